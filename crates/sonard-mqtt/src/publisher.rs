//! Publishing task: sends records from the log to the broker and executes commands.

use std::time::Duration;

use bytes::Bytes;
use jiff::Timestamp;
use rand::{RngExt as _, rand_core::UnwrapErr, rngs::SysRng};
use rumqttc::Publish;
use sonard_api::MqttReport;
use sonard_daemon::Handle;
use sonard_records::EventKind;
use tokio::{
    task::JoinError,
    time::{Instant, MissedTickBehavior, interval, sleep},
};
use tokio_util::sync::CancellationToken;

use super::{
    backoff::Backoff,
    commands::{CommandHandler, ReceivedCommand},
    connection::{BrokerEvent, Connection, Disconnection},
    credentials::Credentials,
    diagnosis::{Cause, Diagnosis, Finding, STABLE_AFTER, SentMessage},
    in_flight::InFlightQueue,
    log_worker::{LogJob, LogJobResult, LogWorker, RunningLogJob, wait_for_job},
    status::StatusSchedule,
    topics::{MessageKind, Topics},
};

/// Poll interval of the publish loop.
const POLL_INTERVAL: Duration = Duration::from_millis(100);
/// Interval of reports to the daemon's status.
const REPORT_INTERVAL: Duration = Duration::from_secs(1);
/// Time without an acknowledgement after which the connection is closed.
const ACK_TIMEOUT: Duration = Duration::from_secs(30);
/// Time allowed at shutdown to publish the remaining records.
const DRAIN_TIMEOUT: Duration = Duration::from_secs(3);
/// Time allowed for the broker to acknowledge the final `offline` message.
const CLOSE_TIMEOUT: Duration = Duration::from_secs(1);
/// Delay before the next disk access after a disk error.
const DISK_RETRY_DELAY: Duration = Duration::from_secs(1);

/// Subscription to commands, as a message in flight.
const SUBSCRIPTION: SentMessage = SentMessage { record: None, kind: None, bytes: 0 };

/// State of the publishing task.
pub(super) struct Publisher {
    pub(super) account: Credentials,
    pub(super) topics: Topics,
    pub(super) commands: bool,
    pub(super) status_interval: Duration,
    pub(super) daemon: Handle,
    pub(super) in_flight: InFlightQueue,
    pub(super) log: Option<LogWorker>,
    pub(super) stop: CancellationToken,
    pub(super) report: MqttReport,
    pub(super) epoch: Instant,
    pub(super) faults: Faults,
    pub(super) diagnosis: Diagnosis,
}

/// Current faults by source; the first one is reported.
#[derive(Debug, Default)]
pub(super) struct Faults {
    line: Option<String>,
    log: Option<String>,
    commands: Option<String>,
    /// Cause of repeated disconnections, kept while connected again.
    cause: Option<String>,
}

/// State of an accepted connection.
struct Connected {
    connection: Connection,
    commands: CommandHandler,
    status: StatusSchedule,
    job: Option<RunningLogJob>,
    /// Number of written records at which the log was last read to its end.
    read_up_to: Option<u64>,
    retry_at: Option<Instant>,
    report_at: Instant,
    /// Time of the last acknowledgement, or at which no message was in flight.
    last_ack: Instant,
    /// End of the drain timeout, at shutdown.
    end: Option<Instant>,
    sent_offline: bool,
    began: Instant,
    /// `true` while the subscription to commands is still to be sent.
    subscribes: bool,
}

impl Publisher {
    /// Publishes records until stopped and, with a broker, until everything is acknowledged.
    pub(super) async fn run(mut self) {
        let mut backoff = Backoff::new();
        loop {
            let lost = self.run_connection(&mut backoff).await;
            self.in_flight.disconnect();
            if self.stop.is_cancelled() {
                break;
            }
            let delay = backoff.next(UnwrapErr(SysRng).random());
            self.report_disconnection(&lost.reason);
            tokio::select! {
                () = self.stop.cancelled() => break,
                () = sleep(delay) => {}
            }
        }
        if let (Some(log), Some(place)) = (self.log.take(), self.in_flight.final_checkpoint()) {
            let job = LogJob { checkpoint: Some(place.clone()), ..LogJob::default() };
            // After a failure to write the checkpoint, the records are sent again.
            drop(log.run(job).await);
        }
    }

    /// Runs a connection from its start to its end. Returns the cause of the end.
    async fn run_connection(&mut self, backoff: &mut Backoff) -> Disconnection {
        let connection = match self.connect().await {
            Ok(connection) => connection,
            Err(loss) => {
                self.diagnosis.not_accepted();
                self.faults.cause = None;
                return loss;
            }
        };
        let now = Instant::now();
        let mut connected = Connected {
            connection,
            commands: CommandHandler::new(self.daemon.clone()),
            status: StatusSchedule::new(self.status_interval),
            job: None,
            read_up_to: None,
            retry_at: None,
            report_at: now,
            last_ack: now,
            end: None,
            sent_offline: false,
            began: now,
            subscribes: self.commands,
        };
        let served = self.serve(&mut connected, backoff).await;
        if let Some(job) = connected.job.take() {
            self.job_finished(job.await, &mut connected);
        }
        let loss = served.err().unwrap_or_else(|| Disconnection::from(String::new()));
        if self.stop.is_cancelled() {
            connected.connection.close().await;
        } else {
            let finding = self.diagnosis.ended(loss.by_broker, connected.began.elapsed());
            self.handle_finding(finding, backoff);
        }
        loss
    }

    /// Connects to the broker and waits until it accepts the connection.
    async fn connect(&self) -> Result<Connection, Disconnection> {
        let mut connection = Connection::open(&self.account)?;
        tokio::select! {
            () = self.stop.cancelled() => Err(Disconnection::from(String::new())),
            event = connection.next() => match event {
                BrokerEvent::Connected => Ok(connection),
                BrokerEvent::Lost(loss) => Err(loss),
                BrokerEvent::Published(_) | BrokerEvent::Acknowledged(_) | BrokerEvent::Subscribed(_) => {
                    Err(Disconnection::from("it sends before accepting the connection".to_owned()))
                }
            }
        }
    }

    /// Drops a message that the broker rejects, and reports the cause of repeated disconnections.
    fn handle_finding(&mut self, finding: Finding, backoff: &mut Backoff) {
        match finding {
            Finding::Open => {}
            Finding::Cause(cause) => self.report_cause(self.describe(cause, None)),
            Finding::Rejected(sending, cause) => {
                self.drop_message(sending, cause);
                if let (None, Some(kind)) = (sending.record, sending.kind) {
                    let topic = self.topics.topic_for(kind);
                    let text = self.describe(cause, sending.kind);
                    let detail = format!("mqtt: a message for {topic} was not published: {text}");
                    self.daemon.event(EventKind::Gap, detail);
                }
                backoff.reset();
            }
        }
    }

    fn drop_message(&mut self, sending: SentMessage, cause: Cause) {
        let text = self.describe(cause, sending.kind);
        if let Some(number) = sending.record {
            let place = self.in_flight.reject(number, self.epoch.elapsed());
            // A rejected kind is logged only once.
            let is_known =
                matches!(cause, Cause::Kind(_)) && self.faults.cause == Some(text.clone());
            if let (Some(place), Some(kind), false) = (place, sending.kind, is_known) {
                let topic = self.topics.topic_for(kind);
                let bytes = sending.bytes.saturating_sub(topic.len());
                let detail = format!(
                    "mqtt: a record for {topic} was dropped, {bytes} bytes before byte {} of {}: {text}",
                    place.bytes, place.file
                );
                self.daemon.event(EventKind::Gap, detail);
            }
        }
        self.report_cause(text);
    }

    fn describe(&self, cause: Cause, kind: Option<MessageKind>) -> String {
        cause.describe(kind, &self.topics, &self.account.client_id())
    }

    fn report_cause(&mut self, cause: String) {
        if self.faults.cause.as_ref() != Some(&cause) {
            tracing::warn!("mqtt: {}: {cause}", self.report.broker);
            self.faults.cause = Some(cause);
        }
    }

    /// Sends and receives until shutdown or disconnection.
    async fn serve(
        &mut self,
        connected: &mut Connected,
        backoff: &mut Backoff,
    ) -> Result<(), Disconnection> {
        self.send_online(connected)?;
        let mut ticks = interval(POLL_INTERVAL);
        ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            self.subscribe(connected)?;
            self.send_pending(&connected.connection)?;
            self.schedule_job(connected);
            if self.is_over(connected)? {
                return Ok(());
            }
            tokio::select! {
                event = connected.connection.next() => match event {
                    BrokerEvent::Lost(loss) => return Err(loss),
                    BrokerEvent::Published(publish) if self.commands => self.handle_command(&publish, connected),
                    BrokerEvent::Acknowledged(sending) => self.acknowledge(sending, connected),
                    BrokerEvent::Subscribed(is_granted) => self.handle_subscription(is_granted, connected),
                    // Messages without a subscription are ignored.
                    BrokerEvent::Published(_) | BrokerEvent::Connected => {}
                },
                (reply, is_accepted) = connected.commands.next() => {
                    *(if is_accepted { &mut self.report.commands } else { &mut self.report.rejected }) += 1;
                    self.send_reply(connected, &reply);
                }
                done = wait_for_job(&mut connected.job) => {
                    connected.job = None;
                    self.job_finished(done, connected);
                }
                () = self.stop.cancelled(), if connected.end.is_none() => {
                    connected.end = Some(Instant::now() + DRAIN_TIMEOUT);
                    // Further records were written meanwhile.
                    connected.read_up_to = None;
                }
                _ = ticks.tick() => self.poll(connected, backoff)?,
            }
        }
    }

    /// Publishes the `online` message and resets the faults.
    fn send_online(&mut self, connected: &mut Connected) -> Result<(), String> {
        self.send(&connected.connection, MessageKind::Online, Bytes::from_static(b"true"))?;
        self.report.connections += 1;
        self.report.connected = true;
        self.report.since = Timestamp::now();
        self.faults = Faults { cause: self.faults.cause.take(), ..Faults::default() };
        if self.faults.cause.is_none() {
            tracing::info!("mqtt: connected to {}", self.report.broker);
        }
        self.report_state();
        Ok(())
    }

    /// Subscribes to commands, if they are enabled.
    fn subscribe(&mut self, connected: &mut Connected) -> Result<(), String> {
        if !connected.subscribes || !self.may_send(&connected.connection) {
            return Ok(());
        }
        connected.subscribes = false;
        if self.diagnosis.rejects(None, 0).is_none() {
            connected.connection.subscribe(self.topics.commands())?;
            self.diagnosis.sent(SUBSCRIPTION);
        }
        Ok(())
    }

    /// Sends records as far as the limits allow.
    fn send_pending(&mut self, connection: &Connection) -> Result<(), String> {
        while self.may_send(connection) {
            let Some((number, message)) = self.in_flight.pop_next() else { break };
            let topic = self.topics.topic_for(message.kind);
            let (kind, bytes) = (Some(message.kind), topic.len() + message.payload.len());
            let sending = SentMessage { record: Some(number), kind, bytes };
            if let Some(cause) = self.diagnosis.rejects(kind, bytes) {
                self.drop_message(sending, cause);
                continue;
            }
            connection.send(topic, sending, message.payload)?;
            self.diagnosis.sent(sending);
        }
        Ok(())
    }

    /// Returns `true` if another message may be in flight.
    fn may_send(&self, connection: &Connection) -> bool {
        self.diagnosis.allows_many() || !connection.is_waiting()
    }

    /// Sends a message that is not a record. Returns `false` if the broker rejects such messages.
    fn send(
        &mut self,
        connection: &Connection,
        kind: MessageKind,
        payload: Bytes,
    ) -> Result<bool, String> {
        let topic = self.topics.topic_for(kind);
        let bytes = topic.len() + payload.len();
        let sending = SentMessage { record: None, kind: Some(kind), bytes };
        if let Some(cause) = self.diagnosis.rejects(sending.kind, sending.bytes) {
            self.drop_message(sending, cause);
            return Ok(false);
        }
        connection.send(topic, sending, payload)?;
        self.diagnosis.sent(sending);
        Ok(true)
    }

    /// Starts reading the log and writing the checkpoint, as far as due.
    fn schedule_job(&mut self, connected: &mut Connected) {
        if connected.job.is_some() || connected.retry_at.is_some_and(|at| at > Instant::now()) {
            return;
        }
        let written = self.daemon.records_written();
        let room = Some(self.in_flight.room()).filter(|room| *room > 0);
        let job = LogJob {
            read: room.filter(|_| connected.read_up_to != Some(written)),
            checkpoint: self.in_flight.due_checkpoint(self.epoch.elapsed()).cloned(),
            behind: None,
        };
        self.start_job(job, connected, written);
    }

    fn start_job(&mut self, job: LogJob, connected: &mut Connected, written: u64) {
        let LogJob { read, checkpoint, behind } = &job;
        if read.is_none() && checkpoint.is_none() && behind.is_none() {
            return;
        }
        if let Some(log) = self.log.take() {
            if read.is_some() {
                // Records written from now on are read by the next job.
                connected.read_up_to = Some(written);
            }
            connected.job = Some(log.run(job));
        }
    }

    /// Processes the result of a job.
    fn job_finished(
        &mut self,
        done: Result<(LogWorker, LogJobResult), JoinError>,
        connected: &mut Connected,
    ) {
        let Ok((log, result)) = done else {
            // The panic was logged.
            self.faults.log = Some("reading the log failed: an internal error".into());
            return;
        };
        self.log = Some(log);
        let mut fault = None;
        if let Some((place, written)) = result.checkpoint {
            match written {
                Ok(()) => self.in_flight.checkpointed(&place, self.epoch.elapsed()),
                Err(error) => fault = Some(error),
            }
        }
        match result.chunk {
            Some(Ok(chunk)) => {
                if !chunk.is_end {
                    connected.read_up_to = None;
                }
                if let Some(gap) = chunk.gap {
                    self.daemon.event(EventKind::Gap, format!("mqtt: {gap}"));
                }
                chunk.lines.into_iter().for_each(|line| self.in_flight.push(line));
            }
            Some(Err(error)) => {
                connected.read_up_to = None;
                fault = Some(error);
            }
            None => {}
        }
        if let Some(bytes) = result.behind_bytes {
            self.report.lag_bytes = bytes;
        }
        connected.retry_at = fault.as_ref().map(|_| Instant::now() + DISK_RETRY_DELAY);
        self.faults.log = fault.map(|error| format!("the log: {error}"));
    }

    fn handle_command(&mut self, publish: &Publish, connected: &mut Connected) {
        let topic = String::from_utf8_lossy(&publish.topic);
        let received = ReceivedCommand {
            name: self.topics.command(&topic).unwrap_or_default(),
            body: &publish.payload,
            is_retained: publish.retain,
            is_repeated: publish.dup,
        };
        if let Err(reply) = connected.commands.queue(&received) {
            self.report.rejected += 1;
            self.send_reply(connected, &reply);
        }
    }

    fn acknowledge(&mut self, sending: SentMessage, connected: &mut Connected) {
        connected.last_ack = Instant::now();
        self.diagnosis.acknowledged(sending);
        match sending {
            SentMessage { record: Some(number), .. } => {
                self.in_flight.acknowledge(number, self.epoch.elapsed());
            }
            SentMessage { kind: Some(MessageKind::Status), .. } => connected.status.acknowledged(),
            _ => {}
        }
    }

    fn handle_subscription(&mut self, is_granted: bool, connected: &mut Connected) {
        connected.last_ack = Instant::now();
        self.diagnosis.acknowledged(SUBSCRIPTION);
        if !is_granted {
            let reason = "it denies this user the subscription to commands";
            tracing::warn!("mqtt: {}: {reason}", self.report.broker);
            self.faults.commands = Some(reason.into());
        }
    }

    /// Performs the periodic checks and reports.
    fn poll(&mut self, connected: &mut Connected, backoff: &mut Backoff) -> Result<(), String> {
        let now = Instant::now();
        // With a delay: a connection that is closed repeatedly works in between.
        if now > connected.began + ACK_TIMEOUT {
            backoff.reset();
        }
        if now > connected.began + STABLE_AFTER && !self.diagnosis.rejects_any() {
            self.faults.cause = None;
        }
        if !connected.connection.is_waiting() {
            connected.last_ack = now;
        } else if now > connected.last_ack + ACK_TIMEOUT {
            return Err(format!("it acknowledged nothing for {} s", ACK_TIMEOUT.as_secs()));
        }
        if now < connected.report_at {
            return Ok(());
        }
        connected.report_at = now + REPORT_INTERVAL;
        self.report_state();
        if self.may_send(&connected.connection)
            && let Some(status) = connected.status.due(&self.daemon.status(), self.epoch.elapsed())
            && !self.send(&connected.connection, MessageKind::Status, status)?
        {
            connected.status.acknowledged();
        }
        if connected.job.is_none() {
            let behind = Some(self.in_flight.position().clone());
            self.start_job(LogJob { behind, ..LogJob::default() }, connected, 0);
        }
        Ok(())
    }

    /// Returns `true` when the shutdown is complete: everything, including the `offline` message,
    /// is acknowledged, or the timeout has expired.
    fn is_over(&mut self, connected: &mut Connected) -> Result<bool, String> {
        let Some(end) = connected.end else { return Ok(false) };
        let is_done = connected.job.is_none()
            && connected.read_up_to == Some(self.daemon.records_written())
            && self.in_flight.waiting() == 0;
        if !connected.sent_offline && (is_done || Instant::now() > end) {
            self.send(&connected.connection, MessageKind::Online, Bytes::from_static(b"false"))?;
            connected.sent_offline = true;
        }
        let is_acknowledged = connected.sent_offline && !connected.connection.is_waiting();
        Ok(is_acknowledged || Instant::now() > end + CLOSE_TIMEOUT)
    }

    fn send_reply(&mut self, connected: &Connected, reply: &serde_json::Value) {
        // With a full queue of the client, the reply is dropped.
        if let Err(error) =
            self.send(&connected.connection, MessageKind::Answer, reply.to_string().into())
        {
            tracing::warn!("mqtt: a reply was dropped: {error}");
        }
    }

    fn report_disconnection(&mut self, reason: &str) {
        // A known cause explains all further disconnections.
        let is_news = self.report.connected || self.faults.line.as_deref() != Some(reason);
        if is_news && self.faults.cause.is_none() {
            tracing::warn!("mqtt: {}: {reason}", self.report.broker);
        }
        if std::mem::replace(&mut self.report.connected, false) {
            self.report.since = Timestamp::now();
        }
        self.faults.line = Some(reason.to_owned());
        self.report_state();
    }

    fn report_state(&mut self) {
        self.report.acknowledged = self.in_flight.acknowledged();
        self.report.skipped_lines = self.in_flight.passed_over();
        self.report.waiting = self.in_flight.waiting() as u64;
        self.report.skipped = self.in_flight.left_out();
        let Faults { line, log, commands, cause } = &self.faults;
        let first = [cause, line, log, commands].into_iter().flatten().next();
        self.report.error = first.cloned();
        self.daemon.report_mqtt(self.report.clone());
    }
}
