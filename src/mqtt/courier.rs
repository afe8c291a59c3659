//! The task that brings records from the log to the broker.

use std::time::Duration;

use bytes::Bytes;
use jiff::Timestamp;
use rumqttc::Publish;
use tokio::{
    task::{JoinError, JoinHandle},
    time::{Instant, MissedTickBehavior, interval, sleep},
};
use tokio_util::sync::CancellationToken;

use super::{
    account::Account,
    commands::{Asked, Clerk},
    connection::{Connection, News, Sent},
    log_side::{Errand, LogSide, Outcome},
    patience::Patience,
    status::StatusNews,
    topics::{Kind, Topics},
    window::Window,
};
use crate::{api::MqttReport, daemon::Handle, scan::EventKind};

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
}

/// What is wrong, the first thing first.
#[derive(Debug, Default)]
pub(super) struct Troubles {
    line: Option<String>,
    log: Option<String>,
    commands: Option<String>,
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
}

impl Courier {
    /// Brings records until it is stopped and, as far as a broker is there, everything is acknowledged.
    pub(super) async fn run(mut self) {
        let mut patience = Patience::new();
        loop {
            let why = self.attend(&mut patience).await;
            self.window.disconnect();
            if self.stop.is_cancelled() {
                break;
            }
            let wait = patience.next(rand::random());
            self.tell_lost(&why);
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
    async fn attend(&mut self, patience: &mut Patience) -> String {
        let mut connection = match Connection::open(&self.account) {
            Ok(connection) => connection,
            Err(why) => return why,
        };
        tokio::select! {
            () = self.stop.cancelled() => return String::new(),
            news = connection.next() => match news {
                News::Connected => {}
                News::Published(_) | News::Acknowledged(_) => {
                    return "it sends before it is asked".into();
                }
                News::Lost(why) => return why,
            }
        }
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
        };
        let why = self.serve(&mut round, patience).await;
        if let Some(errand) = round.errand.take() {
            self.come_back(errand.await, &mut round);
        }
        let why = why.err().unwrap_or_default();
        if self.stop.is_cancelled() {
            round.connection.close().await;
        }
        why
    }

    /// Sends and hears until the end, which is an error if it is not wanted.
    async fn serve(&mut self, round: &mut Round, patience: &mut Patience) -> Result<(), String> {
        self.greet(round)?;
        let mut look = interval(LOOK);
        look.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            self.give_out(&round.connection)?;
            self.send_errand(round);
            if self.is_over(round)? {
                return Ok(());
            }
            tokio::select! {
                news = round.connection.next() => match news {
                    News::Lost(why) => return Err(why),
                    News::Published(publish) if self.commands => self.command(&publish, round),
                    News::Acknowledged(sent) => self.take_in(sent, round, patience),
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

    /// Says that the daemon is there, and asks for commands if they are wanted.
    fn greet(&mut self, round: &mut Round) -> Result<(), String> {
        let online = Kind::Online;
        let message = Sent::Message(online);
        round.connection.send(
            self.topics.of(online),
            online,
            Bytes::from_static(b"true"),
            message,
        )?;
        if self.commands {
            round.connection.subscribe(self.topics.commands())?;
        }
        self.report.connections += 1;
        self.report.connected = true;
        self.report.since = Timestamp::now();
        self.troubles = Troubles::default();
        tracing::info!("mqtt: connected with {}", self.report.broker);
        self.tell();
        Ok(())
    }

    /// Gives out what may be under way.
    fn give_out(&mut self, connection: &Connection) -> Result<(), String> {
        while let Some((number, message)) = self.window.give() {
            let topic = self.topics.of(message.kind);
            connection.send(topic, message.kind, message.payload, Sent::Record(number))?;
        }
        Ok(())
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

    fn take_in(&mut self, sent: Sent, round: &mut Round, patience: &mut Patience) {
        round.heard = Instant::now();
        match sent {
            Sent::Record(number) => {
                patience.restore();
                self.window.acknowledge(number, self.epoch.elapsed());
            }
            Sent::Message(Kind::Status) => round.status.acknowledged(),
            Sent::Message(_) | Sent::Subscription(true) => {}
            Sent::Subscription(false) => {
                let why = "it gives this user no commands";
                tracing::warn!("mqtt: {}: {why}", self.report.broker);
                self.troubles.commands = Some(why.into());
            }
        }
    }

    /// What is done from time to time.
    fn look(&mut self, round: &mut Round, patience: &mut Patience) -> Result<(), String> {
        let now = Instant::now();
        if !round.connection.is_waiting() {
            round.heard = now;
            if now > round.began + SILENCE {
                patience.restore();
            }
        } else if now > round.heard + SILENCE {
            return Err(format!("it acknowledged nothing for {} s", SILENCE.as_secs()));
        }
        if now < round.tell_at {
            return Ok(());
        }
        round.tell_at = now + TELL;
        self.tell();
        if let Some(status) = round.status.due(&self.daemon.status(), self.epoch.elapsed()) {
            let kind = Kind::Status;
            round.connection.send(self.topics.of(kind), kind, status, Sent::Message(kind))?;
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
            let online = Kind::Online;
            let message = Sent::Message(online);
            let payload = Bytes::from_static(b"false");
            round.connection.send(self.topics.of(online), online, payload, message)?;
            round.said_goodbye = true;
        }
        let is_heard = round.said_goodbye && !round.connection.is_waiting();
        Ok(is_heard || Instant::now() > end + GOODBYE)
    }

    fn answer(&self, round: &Round, answer: &serde_json::Value) {
        let kind = Kind::Answer;
        let payload = answer.to_string().into();
        // Where hundreds wait to be taken by the broker, nobody waits for this one.
        if let Err(error) =
            round.connection.send(self.topics.of(kind), kind, payload, Sent::Message(kind))
        {
            tracing::warn!("mqtt: an answer is left out: {error}");
        }
    }

    fn tell_lost(&mut self, why: &str) {
        if self.report.connected || self.troubles.line.as_deref() != Some(why) {
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
        let Troubles { line, log, commands } = &self.troubles;
        self.report.trouble = line.as_ref().or(log.as_ref()).or(commands.as_ref()).cloned();
        self.daemon.report_mqtt(self.report.clone());
    }
}

type Errands = JoinHandle<(LogSide, Outcome)>;

/// What came of the errand under way; never, if there is none. Cancel-safe.
async fn back(errand: &mut Option<Errands>) -> Result<(LogSide, Outcome), JoinError> {
    match errand {
        Some(errand) => errand.await,
        None => std::future::pending().await,
    }
}
