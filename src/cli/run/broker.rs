//! Connection to an MQTT broker, if the program was built with it.

use std::path::Path;

#[cfg(feature = "mqtt")]
use crate::mqtt::{Credentials, Mqtt};
use crate::{
    cli::Failure,
    config::Keys,
    daemon::{Handle, Settings},
};

/// Configured broker, before and after its connection is started.
pub(super) struct Broker {
    #[cfg(feature = "mqtt")]
    credentials: Option<Credentials>,
    #[cfg(feature = "mqtt")]
    publisher: Option<Mqtt>,
}

#[cfg(feature = "mqtt")]
impl Broker {
    /// Reads the credentials named in the configuration.
    pub(super) fn open(keys: &Keys) -> Result<Self, Failure> {
        let credentials = Credentials::open(&keys.mqtt, &keys.fleet.robot);
        let credentials =
            credentials.map_err(|error| Failure::input(&error, error.help.clone()))?;
        Ok(Self { credentials, publisher: None })
    }

    /// Starts publishing, after the log is open.
    pub(super) fn start(
        &mut self,
        settings: &Settings,
        daemon: &Handle,
        log: &Path,
    ) -> Result<(), Failure> {
        if let Some(credentials) = self.credentials.take() {
            let begun = Mqtt::start(
                credentials,
                &settings.keys.mqtt,
                &settings.keys.fleet.robot,
                daemon.clone(),
                log,
            );
            let refuse = |error| {
                Failure::device(
                    format!("cannot publish the records in {}: {error}", log.display()),
                    "",
                )
            };
            self.publisher = Some(begun.map_err(refuse)?);
        }
        Ok(())
    }

    /// Publishes what is pending, and disconnects.
    pub(super) async fn stop(self) {
        if let Some(publisher) = self.publisher {
            publisher.stop().await;
        }
    }
}

/// Without the feature, a configuration with a broker has been rejected before.
#[cfg(not(feature = "mqtt"))]
impl Broker {
    #[expect(clippy::unnecessary_wraps, reason = "fallible with the feature")]
    pub(super) const fn open(_: &Keys) -> Result<Self, Failure> {
        Ok(Self {})
    }

    #[expect(clippy::unnecessary_wraps, clippy::unused_self, reason = "fallible with the feature")]
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
