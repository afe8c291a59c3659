//! Records to an MQTT broker, in a program that was built for it.

use std::path::Path;

#[cfg(feature = "mqtt")]
use crate::mqtt::{Account, Mqtt};
use crate::{
    cli::Failure,
    config::Keys,
    daemon::{Handle, Settings},
};

/// The way to the broker, if one is named: before the daemon runs, and while it does.
pub(super) struct Broker {
    #[cfg(feature = "mqtt")]
    account: Option<Account>,
    #[cfg(feature = "mqtt")]
    sending: Option<Mqtt>,
}

#[cfg(feature = "mqtt")]
impl Broker {
    /// Gets hold of what the configuration names.
    pub(super) fn open(keys: &Keys) -> Result<Self, Failure> {
        let account = Account::open(&keys.mqtt, &keys.fleet.robot);
        let account = account.map_err(|error| Failure::input(&error, error.help.clone()))?;
        Ok(Self { account, sending: None })
    }

    /// Begins to send, once the log is open.
    pub(super) fn start(
        &mut self,
        settings: &Settings,
        daemon: &Handle,
        log: &Path,
    ) -> Result<(), Failure> {
        if let Some(account) = self.account.take() {
            let begun = Mqtt::start(
                account,
                &settings.keys.mqtt,
                &settings.keys.fleet.robot,
                daemon.clone(),
                log,
            );
            let refuse = |error| {
                Failure::device(format!("cannot send what is in {}: {error}", log.display()), "")
            };
            self.sending = Some(begun.map_err(refuse)?);
        }
        Ok(())
    }

    /// Sends what is left.
    pub(super) async fn stop(self) {
        if let Some(sending) = self.sending {
            sending.stop().await;
        }
    }
}

/// The configuration names no broker: that was refused.
#[cfg(not(feature = "mqtt"))]
impl Broker {
    #[expect(clippy::unnecessary_wraps, reason = "with the feature it can fail")]
    pub(super) const fn open(_: &Keys) -> Result<Self, Failure> {
        Ok(Self {})
    }

    #[expect(
        clippy::unnecessary_wraps,
        clippy::unused_self,
        reason = "with the feature it can fail"
    )]
    pub(super) const fn start(
        &mut self,
        _: &Settings,
        _: &Handle,
        _: &Path,
    ) -> Result<(), Failure> {
        Ok(())
    }

    pub(super) async fn stop(self) {}
}
