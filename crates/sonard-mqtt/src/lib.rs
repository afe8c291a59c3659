//! Records to an MQTT broker.
//!
//! They come from the log and not from the hub: what the broker has not acknowledged is in the log, whatever
//! happens to daemon, broker or line. [`window`](Window) knows what is under way and which place of the log is to be
//! remembered, `diagnosis` which messages a broker does not take; both are pure. The courier owns the client.
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![warn(clippy::expect_used, clippy::indexing_slicing, clippy::panic)]

mod account;
mod bookmark;
mod certificate;
mod commands;
mod connection;
mod courier;
mod diagnosis;
mod log_side;
mod patience;
mod status;
mod tail;
mod topics;
mod window;

use std::{io, path::Path, time::Duration};

use jiff::Timestamp;
use sonard_api::{MqttReport, config::MqttKeys};
use sonard_daemon::Handle;
use sonard_records::EventKind;
use sonard_runtime::supervisor::Task;
use tokio::{task::JoinHandle, time::Instant};
use tokio_util::sync::CancellationToken;

pub use account::{Account, AccountError};
pub use topics::{Kind, Topics};
pub use window::{LogPosition, MOST_UNDER_WAY, Message, Read, Window};

use courier::{Courier, Troubles};
use diagnosis::Diagnosis;
use log_side::LogSide;
use tail::Tail;

/// The task that brings records to the broker, to be stopped at the end.
#[derive(Debug)]
pub struct Mqtt {
    stop: CancellationToken,
    task: JoinHandle<Option<()>>,
}

impl Mqtt {
    /// Begins to bring the records of the logs in `folder` to the broker of `account`. Must be called within a
    /// multi-threaded tokio runtime, once the log is open and before the daemon runs.
    ///
    /// # Errors
    /// When the logs can't be read.
    pub fn start(
        account: Account,
        keys: &MqttKeys,
        robot: &str,
        daemon: Handle,
        folder: &Path,
    ) -> io::Result<Self> {
        let (tail, changed) = Tail::open(folder, keys.history)?;
        if let Some(changed) = changed {
            tracing::warn!("mqtt: {changed}");
            daemon.event(EventKind::Gap, format!("mqtt: {changed}"));
        }
        let stop = CancellationToken::new();
        let report = MqttReport {
            broker: account.broker(),
            connected: false,
            since: Timestamp::now(),
            trouble: None,
            connections: 0,
            acknowledged: 0,
            waiting: 0,
            behind_bytes: tail.behind(tail.place())?,
            passed_over: 0,
            left_out: 0,
            commands: 0,
            refused: 0,
        };
        daemon.report_mqtt(report.clone());
        let supervisor = daemon.supervisor().clone();
        let courier = Courier {
            account,
            topics: Topics::new(keys, robot),
            commands: keys.commands,
            status_every: Duration::from_secs(keys.status_s.into()),
            daemon,
            window: Window::new(keys.queue_kb as usize * 1000, tail.place().clone()),
            log: Some(LogSide { tail, folder: folder.into() }),
            stop: stop.clone(),
            report,
            epoch: Instant::now(),
            troubles: Troubles::default(),
            diagnosis: Diagnosis::default(),
        };
        let task = supervisor.spawn(Task::Mqtt, courier.run());
        Ok(Self { stop, task })
    }

    /// Brings what is written to the broker, as far as it takes it within seconds, and says that the daemon leaves.
    pub async fn stop(self) {
        self.stop.cancel();
        // It ends by itself; the supervisor has its panic.
        drop(self.task.await);
    }
}
