//! Publication of log records to an MQTT broker.
//!
//! Records are read from the log instead of the live broadcast: a record that is not acknowledged
//! stays in the log, whatever happens to daemon, broker or connection. [`InFlightQueue`] tracks the
//! messages in flight and the log position to checkpoint, `diagnosis` the messages that the broker
//! rejects; both are pure. The publisher owns the client.
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![warn(clippy::expect_used, clippy::indexing_slicing, clippy::panic)]

mod backoff;
mod certificate;
mod checkpoint;
mod commands;
mod connection;
mod credentials;
mod diagnosis;
mod in_flight;
mod log_worker;
mod publisher;
mod status;
mod tail;
mod topics;

use std::{io, path::Path, time::Duration};

use jiff::Timestamp;
use sonard_api::{MqttReport, config::MqttKeys};
use sonard_daemon::Handle;
use sonard_records::EventKind;
use sonard_runtime::supervisor::Task;
use tokio::{task::JoinHandle, time::Instant};
use tokio_util::sync::CancellationToken;

pub use credentials::{Credentials, CredentialsError};
pub use in_flight::{InFlightQueue, LogLine, LogPosition, MAX_IN_FLIGHT, RecordMessage};
pub use topics::{MessageKind, Topics};

use diagnosis::Diagnosis;
use log_worker::LogWorker;
use publisher::{Faults, Publisher};
use tail::Tail;

/// Handle of the publishing task.
#[derive(Debug)]
pub struct Mqtt {
    stop: CancellationToken,
    task: JoinHandle<Option<()>>,
}

impl Mqtt {
    /// Starts publishing the records of the logs in `folder` to the broker of `account`.
    ///
    /// Must be called within a multi-threaded tokio runtime, once the log is open and before the
    /// daemon runs.
    ///
    /// # Errors
    /// If the logs can't be read.
    pub fn start(
        account: Credentials,
        keys: &MqttKeys,
        robot: &str,
        daemon: Handle,
        folder: &Path,
    ) -> io::Result<Self> {
        let (tail, gap) = Tail::open(folder, keys.history)?;
        if let Some(gap) = gap {
            tracing::warn!("mqtt: {gap}");
            daemon.event(EventKind::Gap, format!("mqtt: {gap}"));
        }
        let stop = CancellationToken::new();
        let report = MqttReport {
            broker: account.broker(),
            connected: false,
            since: Timestamp::now(),
            error: None,
            connections: 0,
            acknowledged: 0,
            waiting: 0,
            lag_bytes: tail.behind(tail.place())?,
            skipped_lines: 0,
            skipped: 0,
            commands: 0,
            rejected: 0,
        };
        daemon.report_mqtt(report.clone());
        let supervisor = daemon.supervisor().clone();
        let publisher = Publisher {
            account,
            topics: Topics::new(keys, robot),
            commands: keys.commands,
            status_interval: Duration::from_secs(keys.status_s.into()),
            daemon,
            in_flight: InFlightQueue::new(keys.queue_kb as usize * 1000, tail.place().clone()),
            log: Some(LogWorker { tail, folder: folder.into() }),
            stop: stop.clone(),
            report,
            epoch: Instant::now(),
            faults: Faults::default(),
            diagnosis: Diagnosis::default(),
        };
        let task = supervisor.spawn(Task::Mqtt, publisher.run());
        Ok(Self { stop, task })
    }

    /// Publishes the remaining records, within a few seconds, and the daemon's `offline` message.
    pub async fn stop(self) {
        self.stop.cancel();
        // The supervisor reports a panic of the task.
        drop(self.task.await);
    }
}
