//! The only place where the host machine meets a line and a clock.

use std::{ops::ControlFlow, time::Duration};

use firmware_protocol::{
    host::{
        BoardChange, Command, Host, HostConfig, HostError, HostEvent, LinkStats, Outcome,
        StartError,
    },
    messages::{Identity, NakReason, SweepState},
};
use thiserror::Error;
use tokio::{
    io::{AsyncRead, AsyncReadExt as _, AsyncWrite, AsyncWriteExt as _},
    sync::watch,
    time::{Instant, sleep_until},
};

/// Restarts of a device that is being met, after which it is given up.
const RESTARTS: u32 = 3;

/// A host machine on a line. It owns both; whoever wants something of the device asks it.
#[derive(Debug)]
pub struct Driver<L> {
    line: L,
    host: Host,
    epoch: Instant,
    hung_up: bool,
    outgoing: Vec<u8>,
    stats: watch::Sender<LinkStats>,
}

/// The result of a successful command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ended {
    /// An Identify.
    Identified(Identity),
    /// A sweep: so many readings were delivered.
    Swept {
        /// Readings delivered.
        delivered: u16,
        /// Complete or stopped.
        end: SweepState,
    },
    /// Any other command.
    Done(Outcome),
}

/// The reason why a command failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum DriveError {
    /// It was not begun.
    #[error("{0}")]
    NotStarted(StartError),
    /// It failed.
    #[error("{0}")]
    Host(HostError),
    /// Whoever takes the events wanted no more of them; the command is still under way.
    #[error("given up by the receiver of its readings")]
    Abandoned,
    /// The device that answers is not the one that the session describes.
    #[error("another device answers than the one that was met: {0}")]
    OtherBoard(BoardChange),
}

impl DriveError {
    /// What a person can do about it.
    #[must_use]
    pub const fn help(&self) -> &'static str {
        match self {
            Self::NotStarted(_) | Self::Abandoned => "this is a fault of the program: report it",
            Self::Host(error) => host_help(error),
            Self::OtherBoard(_) => {
                "what it measures must not go under the other one's name: scan again, or put the \
                 other one back"
            }
        }
    }
}

const fn host_help(error: &HostError) -> &'static str {
    match error {
        HostError::NoAnswer { .. } => {
            "check that no other program reads the port (`sudo fuser -v PORT`), that the port is the \
             ranger's, that the board has power, and the cable; a board that never ran the firmware \
             does not answer either"
        }
        HostError::NotADevice { .. } => {
            "check that the port is the ranger's; a modem, a GPS or another firmware speaks \
             something else"
        }
        HostError::WrongVersion { .. } => {
            "flash the firmware of this version of sonard, or install the sonard of the firmware's"
        }
        HostError::WrongIdentity(_) => {
            "flash the firmware of this version of sonard; on a board of your own see what \
             PROTOCOL.md says that a host must refuse"
        }
        HostError::Refused(reason) => refused_help(*reason),
        HostError::Rebooted => {
            "the board restarts again and again: look at its supply (the module draws 2 A while \
             firing; it needs 1000 uF beside it)"
        }
        HostError::Hangup => "the cable was pulled or the board lost power: plug it in, scan again",
        HostError::LeaseExpired => {
            "this computer was away too long: stop what loads it, scan again"
        }
        HostError::EmergencyStop => "release the emergency stop, then scan again",
        HostError::MotionFault => "free the motor, check its supply and current, then scan again",
        HostError::Stopped => "another program stopped it: make sure that only one uses the port",
        HostError::Overrun { .. } => {
            "check that the motor turns, its supply and its index sensor; reset the board"
        }
        HostError::Stalled { .. }
        | HostError::SweepLost
        | HostError::WrongReading { .. }
        | HostError::SenselessReading(_)
        | HostError::SenselessReply(_) => {
            "reset the board and scan again; if it happens again, report it with the log"
        }
    }
}

const fn refused_help(reason: NakReason) -> &'static str {
    match reason {
        NakReason::Busy => {
            "another program gives the ranger work at the same time: make sure that only one uses \
             the port"
        }
        NakReason::WrongBoot
        | NakReason::SequenceReused
        | NakReason::UnknownRequest
        | NakReason::NotConfigured
        | NakReason::NotHomed => {
            "reset the board and scan again; if it happens again, report it with the log"
        }
        NakReason::IndexNotFound => {
            "if the motor did not turn, check its supply and current; if it did, check the index \
             sensor; `sonard doctor --port PORT` examines both"
        }
        NakReason::Stopped => host_help(&HostError::Stopped),
        NakReason::EmergencyStop => host_help(&HostError::EmergencyStop),
        NakReason::MotionFault => host_help(&HostError::MotionFault),
        NakReason::PositionOutOfRange
        | NakReason::WindowOutOfRange
        | NakReason::IntervalOutOfRange
        | NakReason::SettleOutOfRange
        | NakReason::EchoesOutOfRange
        | NakReason::BlankingOutOfRange
        | NakReason::SpeedOutOfRange
        | NakReason::AccelerationOutOfRange
        | NakReason::HoldOutOfRange
        | NakReason::SweepOutOfRange
        | NakReason::LeaseOutOfRange => "change the setting that the device names",
    }
}

impl<L: AsyncRead + AsyncWrite + Unpin> Driver<L> {
    /// A driver on an open line.
    pub fn new(line: L, config: HostConfig) -> Self {
        Self {
            line,
            host: Host::new(config),
            epoch: Instant::now(),
            hung_up: false,
            outgoing: Vec::new(),
            stats: watch::Sender::new(LinkStats::default()),
        }
    }

    /// Gives the line back.
    pub fn into_line(self) -> L {
        self.line
    }

    /// The machine, for its statistics.
    pub const fn host(&self) -> &Host {
        &self.host
    }

    /// Its statistics for somebody else, also while a command is under way.
    #[must_use]
    pub fn watch_stats(&self) -> watch::Receiver<LinkStats> {
        self.stats.subscribe()
    }

    /// Microseconds since the driver was made: the time line of the machine's events.
    pub fn now_us(&self) -> u64 {
        u64::try_from(self.epoch.elapsed().as_micros()).unwrap_or(u64::MAX)
    }

    /// Begins a command; [`Self::finish`] carries it out.
    ///
    /// # Errors
    /// When another one is under way or something must come first; a hangup or a restart of the
    /// device since the command before is told as what it is.
    pub fn start(&mut self, command: Command) -> Result<(), DriveError> {
        if self.hung_up {
            return Err(DriveError::Host(HostError::Hangup));
        }
        let now_us = self.now_us();
        self.host.start(now_us, command).map_err(|error| match error {
            StartError::Restarted => DriveError::Host(HostError::Rebooted),
            error => DriveError::NotStarted(error),
        })
    }

    /// Carries out one command and hands every event on the way to `on_event`, which may break
    /// off.
    ///
    /// # Errors
    /// As [`Self::start`] and [`Self::finish`].
    pub async fn perform(
        &mut self,
        command: Command,
        on_event: impl FnMut(HostEvent) -> ControlFlow<()>,
    ) -> Result<Ended, DriveError> {
        self.start(command)?;
        self.finish(on_event).await
    }

    /// Asks the device who it is, and stops whatever it still does: a sweep that an earlier program
    /// left behind goes on for as long as anybody talks to the device, and all else is refused
    /// meanwhile. Events go to `on_event`.
    ///
    /// # Errors
    /// When nothing or something else answers, or the device only restarts.
    pub async fn take_over(
        &mut self,
        mut on_event: impl FnMut(HostEvent) -> ControlFlow<()>,
    ) -> Result<Identity, DriveError> {
        let mut restarts = 0;
        loop {
            let ended = self.perform(Command::Identify, &mut on_event).await?;
            let Ended::Identified(identity) = ended else { continue };
            match self.stop(&mut on_event).await {
                Ok(()) => return Ok(identity),
                // It restarted in between: what it says of itself is no longer true.
                Err(DriveError::Host(HostError::Rebooted)) if restarts < RESTARTS => restarts += 1,
                Err(error) => return Err(error),
            }
        }
    }

    /// Brings the device to a stand, whatever is under way.
    ///
    /// # Errors
    /// As [`Self::start`] and [`Self::finish`].
    pub async fn stop(
        &mut self,
        mut on_event: impl FnMut(HostEvent) -> ControlFlow<()>,
    ) -> Result<(), DriveError> {
        self.start(Command::Stop)?;
        loop {
            // The end of what was stopped may come first.
            match self.finish(&mut on_event).await {
                Ok(Ended::Done(Outcome::Stopped)) => return Ok(()),
                Ok(_) | Err(DriveError::Host(HostError::Stopped) | DriveError::Abandoned) => {}
                Err(error) => return Err(error),
            }
        }
    }

    /// Waits for the end of the command under way, handing every other event to `on_event`.
    ///
    /// Cancel-safe: what was received stays in the machine, and a later call goes on with it.
    ///
    /// # Errors
    /// The machine's own, which name the cause.
    pub async fn finish(
        &mut self,
        mut on_event: impl FnMut(HostEvent) -> ControlFlow<()>,
    ) -> Result<Ended, DriveError> {
        loop {
            match self.next_event().await {
                HostEvent::Identified(identity) => return Ok(Ended::Identified(identity)),
                HostEvent::SweepDone { delivered, end, .. } => {
                    return Ok(Ended::Swept { delivered, end });
                }
                HostEvent::Done(outcome) => return Ok(Ended::Done(outcome)),
                HostEvent::Failed(error) => return Err(DriveError::Host(error)),
                event => {
                    if on_event(event).is_break() {
                        return Err(DriveError::Abandoned);
                    }
                }
            }
        }
    }

    /// Waits on a line without work until the device says something by itself; `None` when the
    /// line was closed.
    ///
    /// Cancel-safe, as [`Self::finish`].
    pub async fn idle(&mut self) -> Option<HostEvent> {
        while !self.hung_up {
            if let Some(event) = self.host.poll_event() {
                return Some(event);
            }
            self.wait().await;
        }
        None
    }

    /// The machine's next event.
    async fn next_event(&mut self) -> HostEvent {
        loop {
            if let Some(event) = self.host.poll_event() {
                return event;
            }
            while let Some(frame) = self.host.poll_transmit() {
                self.outgoing.extend_from_slice(&frame);
            }
            self.wait().await;
        }
    }

    /// Waits for bytes, room for bytes, or the machine's next deadline, and tells the machine.
    async fn wait(&mut self) {
        let deadline = self.host.poll_timeout();
        let deadline = deadline.map(|(_, at_us)| self.epoch + Duration::from_micros(at_us));
        let timer = async {
            match deadline {
                Some(at) => sleep_until(at).await,
                None => std::future::pending().await,
            }
        };
        let mut buffer = [0; 1024];
        // After a hangup the line would answer at once, for ever: it is not asked again.
        let (listening, speaking) = (!self.hung_up, !self.hung_up && !self.outgoing.is_empty());
        let (mut reader, mut writer) = tokio::io::split(&mut self.line);
        let happened = tokio::select! {
            read = reader.read(&mut buffer), if listening => Happened::Read(read.unwrap_or(0)),
            written = writer.write(&self.outgoing), if speaking => {
                Happened::Written(written.unwrap_or(0))
            }
            () = timer => Happened::Timeout,
        };
        let now_us = self.now_us();
        match happened {
            Happened::Read(0) | Happened::Written(0) => {
                self.hung_up = true;
                self.outgoing.clear();
                self.host.handle_hangup(now_us);
            }
            Happened::Read(count) => {
                self.host.handle_bytes(now_us, buffer.get(..count).unwrap_or_default());
            }
            Happened::Written(count) => drop(self.outgoing.drain(..count)),
            Happened::Timeout => self.host.handle_timeout(now_us),
        }
        self.stats.send_replace(*self.host.stats());
    }
}

enum Happened {
    /// So many bytes came; 0 at the end of the line.
    Read(usize),
    /// So many bytes went; 0 at the end of the line.
    Written(usize),
    Timeout,
}
