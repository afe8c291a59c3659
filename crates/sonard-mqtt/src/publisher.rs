//! The task that brings records from the log to the broker.

use std::time::Duration;

use bytes::Bytes;
use jiff::Timestamp;
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
    account::Account,
    commands::{Asked, Clerk},
    connection::{Connection, Loss, News},
    diagnosis::{Cause, Diagnosis, Finding, STEADY, Sending},
    log_side::{Errand, Errands, LogSide, Outcome, back},
    patience::Patience,
    status::StatusNews,
    topics::{Kind, Topics},
    window::Window,
};

/// How often it is looked whether there is more to do.
const LOOK: Duration = Duration::from_millis(100);
/// How often it is told how it goes.
const TELL: Duration = Duration::from_secs(1);
/// A broker that acknowledges nothing for so long does not do its part.
const SILENCE: Duration = Duration::from_secs(30);
/// How long the end may take.
const FAREWELL: Duration = Duration::from_secs(3);
/// How long the broker may take to hear that it is.
const GOODBYE: Duration = Duration::from_secs(1);
/// How soon after a fault of the disk it is asked again.
const DISK_AGAIN: Duration = Duration::from_secs(1);

/// The request for commands.
const SUBSCRIPTION: Sending = Sending { record: None, kind: None, bytes: 0 };

/// What the task is made of.
pub(super) struct Courier {
    pub(super) account: Account,
    pub(super) topics: Topics,
    pub(super) commands: bool,
    pub(super) status_every: Duration,
    pub(super) daemon: Handle,
    pub(super) window: Window,
    pub(super) log: Option<LogSide>,
    pub(super) stop: CancellationToken,
    pub(super) report: MqttReport,
    pub(super) epoch: Instant,
    pub(super) troubles: Troubles,
    pub(super) diagnosis: Diagnosis,
}

/// What is wrong, the first thing first.
#[derive(Debug, Default)]
pub(super) struct Troubles {
    line: Option<String>,
    log: Option<String>,
    commands: Option<String>,
    /// The cause of repeated losses; it may be wrong while a connection lasts.
    cause: Option<String>,
}

/// What changes while a connection lasts.
struct Round {
    connection: Connection,
    clerk: Clerk,
    status: StatusNews,
    errand: Option<Errands>,
    /// Whether all of the log was read when so many records were written to it.
    read_at: Option<u64>,
    disk_again: Option<Instant>,
    tell_at: Instant,
    /// When the broker acknowledged something last, or had nothing to acknowledge.
    heard: Instant,
    /// When it ends, once it is to end; whether it was said that it does.
    end: Option<Instant>,
    said_goodbye: bool,
    began: Instant,
    /// Whether commands are still to be asked for.
    subscribes: bool,
}

impl Courier {
    /// Brings records until it is stopped and, as far as a broker is there, everything is acknowledged.
    pub(super) async fn run(mut self) {
        let mut patience = Patience::new();
        loop {
            let loss = self.attend(&mut patience).await;
            self.window.disconnect();
            if self.stop.is_cancelled() {
                break;
            }
            let wait = patience.next(rand::random());
            self.tell_lost(&loss.why);
            tokio::select! {
                () = self.stop.cancelled() => break,
                () = sleep(wait) => {}
            }
        }
        if let (Some(log), Some(place)) = (self.log.take(), self.window.last()) {
            let errand = Errand { remember: Some(place.clone()), ..Errand::default() };
            // What is not remembered is sent again.
            drop(log.run(errand).await);
        }
    }

    /// Uses a connection from its beginning to its end; says why it ended.
    async fn attend(&mut self, patience: &mut Patience) -> Loss {
        let connection = match self.connect().await {
            Ok(connection) => connection,
            Err(loss) => {
                self.diagnosis.not_accepted();
                self.troubles.cause = None;
                return loss;
            }
        };
        let now = Instant::now();
        let mut round = Round {
            connection,
            clerk: Clerk::new(self.daemon.clone()),
            status: StatusNews::new(self.status_every),
            errand: None,
            read_at: None,
            disk_again: None,
            tell_at: now,
            heard: now,
            end: None,
            said_goodbye: false,
            began: now,
            subscribes: self.commands,
        };
        let served = self.serve(&mut round, patience).await;
        if let Some(errand) = round.errand.take() {
            self.come_back(errand.await, &mut round);
        }
        let loss = served.err().unwrap_or_else(|| Loss::from(String::new()));
        if self.stop.is_cancelled() {
            round.connection.close().await;
        } else {
            let finding = self.diagnosis.ended(loss.by_broker, round.began.elapsed());
            self.act_on(finding, patience);
        }
        loss
    }

    /// A connection that the broker has accepted.
    async fn connect(&self) -> Result<Connection, Loss> {
        let mut connection = Connection::open(&self.account)?;
        tokio::select! {
            () = self.stop.cancelled() => Err(Loss::from(String::new())),
            news = connection.next() => match news {
                News::Connected => Ok(connection),
                News::Lost(loss) => Err(loss),
                News::Published(_) | News::Acknowledged(_) | News::Subscribed(_) => {
                    Err(Loss::from("it sends before it is asked".to_owned()))
                }
            }
        }
    }

    /// Leaves out what the broker does not take, and reports the cause of a loss that repeats.
    fn act_on(&mut self, finding: Finding, patience: &mut Patience) {
        match finding {
            Finding::Open => {}
            Finding::Cause(cause) => self.tell_cause(self.words(cause, None)),
            Finding::Refused(sending, cause) => {
                self.leave_out(sending, cause);
                patience.restore();
            }
        }
    }

    fn leave_out(&mut self, sending: Sending, cause: Cause) {
        let told = self.words(cause, sending.kind);
        if let Some(number) = sending.record {
            let place = self.window.leave_out(number, self.epoch.elapsed());
            // Of a whole kind, one event is enough.
            let is_known =
                matches!(cause, Cause::Kind(_)) && self.troubles.cause == Some(told.clone());
            if let (Some(place), Some(kind), false) = (place, sending.kind, is_known) {
                let (topic, bytes) = (self.topics.of(kind), sending.bytes);
                let detail = format!(
                    "mqtt: a record for {topic} is left out, {bytes} bytes before byte {} of {}: {told}",
                    place.bytes, place.file
                );
                self.daemon.event(EventKind::Gap, detail);
            }
        }
        self.tell_cause(told);
    }

    fn words(&self, cause: Cause, kind: Option<Kind>) -> String {
        cause.words(kind, &self.topics, &self.account.client_id())
    }

    fn tell_cause(&mut self, cause: String) {
        if self.troubles.cause.as_ref() != Some(&cause) {
            tracing::warn!("mqtt: {}: {cause}", self.report.broker);
            self.troubles.cause = Some(cause);
        }
    }

    /// Sends and hears until the end, which is an error if it is not wanted.
    async fn serve(&mut self, round: &mut Round, patience: &mut Patience) -> Result<(), Loss> {
        self.greet(round)?;
        let mut look = interval(LOOK);
        look.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            self.subscribe(round)?;
            self.give_out(&round.connection)?;
            self.send_errand(round);
            if self.is_over(round)? {
                return Ok(());
            }
            tokio::select! {
                news = round.connection.next() => match news {
                    News::Lost(loss) => return Err(loss),
                    News::Published(publish) if self.commands => self.command(&publish, round),
                    News::Acknowledged(sending) => self.take_in(sending, round),
                    News::Subscribed(is_granted) => self.take_subscription(is_granted, round),
                    // A broker that sends what was not asked for is not answered.
                    News::Published(_) | News::Connected => {}
                },
                (answer, taken) = round.clerk.next() => {
                    *(if taken { &mut self.report.commands } else { &mut self.report.refused }) += 1;
                    self.answer(round, &answer);
                }
                done = back(&mut round.errand) => {
                    round.errand = None;
                    self.come_back(done, round);
                }
                () = self.stop.cancelled(), if round.end.is_none() => {
                    round.end = Some(Instant::now() + FAREWELL);
                    // The last records were written meanwhile.
                    round.read_at = None;
                }
                _ = look.tick() => self.look(round, patience)?,
            }
        }
    }

    /// Says that the daemon is there.
    fn greet(&mut self, round: &mut Round) -> Result<(), String> {
        self.send(&round.connection, Kind::Online, Bytes::from_static(b"true"))?;
        self.report.connections += 1;
        self.report.connected = true;
        self.report.since = Timestamp::now();
        self.troubles = Troubles { cause: self.troubles.cause.take(), ..Troubles::default() };
        if self.troubles.cause.is_none() {
            tracing::info!("mqtt: connected with {}", self.report.broker);
        }
        self.tell();
        Ok(())
    }

    /// Asks for commands if they are wanted.
    fn subscribe(&mut self, round: &mut Round) -> Result<(), String> {
        if !round.subscribes || !self.may_send(&round.connection) {
            return Ok(());
        }
        round.subscribes = false;
        if self.diagnosis.refuses(None, 0).is_none() {
            round.connection.subscribe(self.topics.commands())?;
            self.diagnosis.sent(SUBSCRIPTION);
        }
        Ok(())
    }

    /// Gives out what may be under way.
    fn give_out(&mut self, connection: &Connection) -> Result<(), String> {
        while self.may_send(connection) {
            let Some((number, message)) = self.window.give() else { break };
            let (kind, bytes) = (Some(message.kind), message.payload.len());
            let sending = Sending { record: Some(number), kind, bytes };
            if let Some(cause) = self.diagnosis.refuses(kind, bytes) {
                self.leave_out(sending, cause);
                continue;
            }
            connection.send(self.topics.of(message.kind), sending, message.payload)?;
            self.diagnosis.sent(sending);
        }
        Ok(())
    }

    /// Whether another message may be under way.
    fn may_send(&self, connection: &Connection) -> bool {
        self.diagnosis.allows_many() || !connection.is_waiting()
    }

    /// Sends a message that is no record, unless the broker does not take it; whether it is under way.
    fn send(
        &mut self,
        connection: &Connection,
        kind: Kind,
        payload: Bytes,
    ) -> Result<bool, String> {
        let sending = Sending { record: None, kind: Some(kind), bytes: payload.len() };
        if let Some(cause) = self.diagnosis.refuses(sending.kind, sending.bytes) {
            self.leave_out(sending, cause);
            return Ok(false);
        }
        connection.send(self.topics.of(kind), sending, payload)?;
        self.diagnosis.sent(sending);
        Ok(true)
    }

    /// Reads on, and remembers the place, when it is time.
    fn send_errand(&mut self, round: &mut Round) {
        if round.errand.is_some() || round.disk_again.is_some_and(|at| at > Instant::now()) {
            return;
        }
        let written = self.daemon.records_written();
        let room = Some(self.window.room()).filter(|room| *room > 0);
        let errand = Errand {
            read: room.filter(|_| round.read_at != Some(written)),
            remember: self.window.due(self.epoch.elapsed()).cloned(),
            behind: None,
        };
        self.send_off(errand, round, written);
    }

    fn send_off(&mut self, errand: Errand, round: &mut Round, written: u64) {
        let Errand { read, remember, behind } = &errand;
        if read.is_none() && remember.is_none() && behind.is_none() {
            return;
        }
        if let Some(log) = self.log.take() {
            if read.is_some() {
                // What is written from now on is read the next time.
                round.read_at = Some(written);
            }
            round.errand = Some(log.run(errand));
        }
    }

    /// Takes in what came of an errand.
    fn come_back(&mut self, done: Result<(LogSide, Outcome), JoinError>, round: &mut Round) {
        let Ok((log, outcome)) = done else {
            // It was printed why.
            self.troubles.log = Some("reading the log failed: a fault of this program".into());
            return;
        };
        self.log = Some(log);
        let mut fault = None;
        if let Some((place, written)) = outcome.remembered {
            match written {
                Ok(()) => self.window.remembered(&place, self.epoch.elapsed()),
                Err(error) => fault = Some(error),
            }
        }
        match outcome.piece {
            Some(Ok(piece)) => {
                if !piece.is_end {
                    round.read_at = None;
                }
                if let Some(gap) = piece.gap {
                    self.daemon.event(EventKind::Gap, format!("mqtt: {gap}"));
                }
                piece.lines.into_iter().for_each(|line| self.window.put(line));
            }
            Some(Err(error)) => {
                round.read_at = None;
                fault = Some(error);
            }
            None => {}
        }
        if let Some(bytes) = outcome.behind_bytes {
            self.report.behind_bytes = bytes;
        }
        round.disk_again = fault.as_ref().map(|_| Instant::now() + DISK_AGAIN);
        self.troubles.log = fault.map(|error| format!("the log: {error}"));
    }

    fn command(&mut self, publish: &Publish, round: &mut Round) {
        let topic = String::from_utf8_lossy(&publish.topic);
        let asked = Asked {
            name: self.topics.command(&topic).unwrap_or_default(),
            body: &publish.payload,
            is_retained: publish.retain,
            is_repeated: publish.dup,
        };
        if let Err(answer) = round.clerk.take(&asked) {
            self.report.refused += 1;
            self.answer(round, &answer);
        }
    }

    fn take_in(&mut self, sending: Sending, round: &mut Round) {
        round.heard = Instant::now();
        self.diagnosis.acknowledged(sending);
        match sending {
            Sending { record: Some(number), .. } => {
                self.window.acknowledge(number, self.epoch.elapsed());
            }
            Sending { kind: Some(Kind::Status), .. } => round.status.acknowledged(),
            _ => {}
        }
    }

    fn take_subscription(&mut self, is_granted: bool, round: &mut Round) {
        round.heard = Instant::now();
        self.diagnosis.acknowledged(SUBSCRIPTION);
        if !is_granted {
            let why = "it gives this user no commands";
            tracing::warn!("mqtt: {}: {why}", self.report.broker);
            self.troubles.commands = Some(why.into());
        }
    }

    /// What is done from time to time.
    fn look(&mut self, round: &mut Round, patience: &mut Patience) -> Result<(), String> {
        let now = Instant::now();
        // Not at once: a connection that is ended again and again works in between.
        if now > round.began + SILENCE {
            patience.restore();
        }
        if now > round.began + STEADY && !self.diagnosis.leaves_out() {
            self.troubles.cause = None;
        }
        if !round.connection.is_waiting() {
            round.heard = now;
        } else if now > round.heard + SILENCE {
            return Err(format!("it acknowledged nothing for {} s", SILENCE.as_secs()));
        }
        if now < round.tell_at {
            return Ok(());
        }
        round.tell_at = now + TELL;
        self.tell();
        if self.may_send(&round.connection)
            && let Some(status) = round.status.due(&self.daemon.status(), self.epoch.elapsed())
            && !self.send(&round.connection, Kind::Status, status)?
        {
            round.status.acknowledged();
        }
        if round.errand.is_none() {
            let behind = Some(self.window.place().clone());
            self.send_off(Errand { behind, ..Errand::default() }, round, 0);
        }
        Ok(())
    }

    /// Whether it is over: everything is acknowledged and the goodbye said, or it took too long.
    fn is_over(&mut self, round: &mut Round) -> Result<bool, String> {
        let Some(end) = round.end else { return Ok(false) };
        let is_done = round.errand.is_none()
            && round.read_at == Some(self.daemon.records_written())
            && self.window.waiting() == 0;
        if !round.said_goodbye && (is_done || Instant::now() > end) {
            self.send(&round.connection, Kind::Online, Bytes::from_static(b"false"))?;
            round.said_goodbye = true;
        }
        let is_heard = round.said_goodbye && !round.connection.is_waiting();
        Ok(is_heard || Instant::now() > end + GOODBYE)
    }

    fn answer(&mut self, round: &Round, answer: &serde_json::Value) {
        // Where hundreds wait to be taken by the broker, nobody waits for this one.
        if let Err(error) = self.send(&round.connection, Kind::Answer, answer.to_string().into()) {
            tracing::warn!("mqtt: an answer is left out: {error}");
        }
    }

    fn tell_lost(&mut self, why: &str) {
        // A cause that is known explains all that follow.
        let is_news = self.report.connected || self.troubles.line.as_deref() != Some(why);
        if is_news && self.troubles.cause.is_none() {
            tracing::warn!("mqtt: {}: {why}", self.report.broker);
        }
        if std::mem::replace(&mut self.report.connected, false) {
            self.report.since = Timestamp::now();
        }
        self.troubles.line = Some(why.to_owned());
        self.tell();
    }

    fn tell(&mut self) {
        self.report.acknowledged = self.window.acknowledged();
        self.report.passed_over = self.window.passed_over();
        self.report.waiting = self.window.waiting() as u64;
        self.report.left_out = self.window.left_out();
        let Troubles { line, log, commands, cause } = &self.troubles;
        let told = [cause, line, log, commands].into_iter().flatten().next();
        self.report.trouble = told.cloned();
        self.daemon.report_mqtt(self.report.clone());
    }
}
