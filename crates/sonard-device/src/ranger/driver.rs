//! Host state machine on a real line and clock; the only module that waits for either.

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

/// Maximum number of restarts of a device while it is identified.
const MAX_RESTARTS: u32 = 3;

/// Host state machine on a line; owns both.
#[derive(Debug)]
pub struct Driver<L> {
    line: L,
    host: Host,
    epoch: Instant,
    hung_up: bool,
    outgoing: Vec<u8>,
    stats: watch::Sender<LinkStats>,
}

/// Result of a successful command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CommandResult {
    /// Identity of the device, from an Identify.
    Identified(Identity),
    /// End of a sweep.
    Swept {
        /// Number of readings delivered.
        delivered: u16,
        /// Final state of the sweep: complete or stopped.
        end: SweepState,
    },
    /// Outcome of any other command.
    Done(Outcome),
}

/// Failure of a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum DriveError {
    /// The command was not started.
    #[error("{0}")]
    NotStarted(StartError),
    /// The device or the line failed.
    #[error("{0}")]
    Host(HostError),
    /// The event callback broke off; the command is still running.
    #[error("aborted by the receiver of its readings")]
    Abandoned,
    /// The device is not the one that the session describes.
    #[error("another device responds than the one identified before: {0}")]
    OtherBoard(BoardChange),
}

impl DriveError {
    /// Suggests a remedy.
    #[must_use]
    pub const fn help(&self) -> &'static str {
        match self {
            Self::NotStarted(_) | Self::Abandoned => "this is a fault of the program: report it",
            Self::Host(error) => host_help(error),
            Self::OtherBoard(_) => {
                "its readings must not be recorded under the other device's identity: scan again, \
                 or reconnect the other device"
            }
        }
    }
}

const fn host_help(error: &HostError) -> &'static str {
    match error {
        HostError::NoAnswer { .. } => {
            "check that no other program reads the port (`sudo fuser -v PORT`), that the port is the \
             ranger's, that the board has power, and the cable; a board without the firmware does \
             not respond either"
        }
        HostError::NotADevice { .. } => {
            "check that the port is the ranger's; a modem, a GPS or another firmware uses another \
             protocol"
        }
        HostError::WrongVersion { .. } => {
            "flash the firmware of this version of sonard, or install the sonard version of the \
             firmware"
        }
        HostError::InvalidIdentity(_) => {
            "flash the firmware of this version of sonard; for a board of your own see \"What a \
             host must refuse\" in PROTOCOL.md"
        }
        HostError::Rejected(reason) => refused_help(*reason),
        HostError::Rebooted => {
            "the board restarts repeatedly: check its supply (the module draws 2 A while firing \
             and needs 1000 uF close to it)"
        }
        HostError::Hangup => "the cable was pulled or the board lost power: plug it in, scan again",
        HostError::LeaseExpired => {
            "this computer was blocked for too long: reduce its load, then scan again"
        }
        HostError::EmergencyStop => "release the emergency stop, then scan again",
        HostError::MotionFault => "free the motor, check its supply and current, then scan again",
        HostError::Stopped => {
            "another program stopped the device: make sure that only one uses the port"
        }
        HostError::Overrun { .. } => {
            "check that the motor turns, its supply and its index sensor; reset the board"
        }
        HostError::Stalled { .. } => {
            "the line loses most of what the device sends: check cable and baud rate, then scan again"
        }
        HostError::SweepLost
        | HostError::WrongReading { .. }
        | HostError::InvalidReading(_)
        | HostError::InvalidReply(_) => {
            "reset the board and scan again; if it happens again, report it with the log"
        }
    }
}

const fn refused_help(reason: NakReason) -> &'static str {
    match reason {
        NakReason::Busy => {
            "another program uses the ranger at the same time: make sure that only one uses the \
             port"
        }
        NakReason::WrongBoot
        | NakReason::SequenceReused
        | NakReason::UnknownRequest
        | NakReason::NotConfigured
        | NakReason::NotHomed => {
            "reset the board and scan again; if it happens again, report it with the log"
        }
        NakReason::IndexNotFound => {
            "if the motor did not turn, check its supply and current; otherwise check the index \
             sensor; `sonard doctor --port PORT` tests both"
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
        | NakReason::LeaseOutOfRange => "change the setting that the device rejected",
    }
}

impl<L: AsyncRead + AsyncWrite + Unpin> Driver<L> {
    /// Creates a driver on an open line.
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

    /// Returns the line.
    pub fn into_line(self) -> L {
        self.line
    }

    /// Host state machine, for its statistics.
    pub const fn host(&self) -> &Host {
        &self.host
    }

    /// Subscribes to the link statistics, which are updated also while a command runs.
    #[must_use]
    pub fn subscribe_stats(&self) -> watch::Receiver<LinkStats> {
        self.stats.subscribe()
    }

    /// Microseconds since the driver's creation: the time base of the machine's events.
    pub fn now_us(&self) -> u64 {
        u64::try_from(self.epoch.elapsed().as_micros()).unwrap_or(u64::MAX)
    }

    /// Starts a command; [`Self::finish`] carries it out.
    ///
    /// # Errors
    /// If another command is running or a prerequisite is missing. A hangup or a restart of the
    /// device since the previous command is reported as such.
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

    /// Carries out one command and passes every intermediate event to `on_event`, which may break
    /// off.
    ///
    /// # Errors
    /// As [`Self::start`] and [`Self::finish`].
    pub async fn perform(
        &mut self,
        command: Command,
        on_event: impl FnMut(HostEvent) -> ControlFlow<()>,
    ) -> Result<CommandResult, DriveError> {
        self.start(command)?;
        self.finish(on_event).await
    }

    /// Identifies the device and stops its current activity. A sweep left behind by an earlier
    /// program continues as long as a host communicates, and other commands are refused meanwhile.
    /// Events go to `on_event`.
    ///
    /// # Errors
    /// If no ranger responds, or the device restarts repeatedly.
    pub async fn identify_and_stop(
        &mut self,
        mut on_event: impl FnMut(HostEvent) -> ControlFlow<()>,
    ) -> Result<Identity, DriveError> {
        let mut restarts = 0;
        loop {
            let ended = self.perform(Command::Identify, &mut on_event).await?;
            let CommandResult::Identified(identity) = ended else { continue };
            match self.stop(&mut on_event).await {
                Ok(()) => return Ok(identity),
                // The device restarted in between: its identity is out of date.
                Err(DriveError::Host(HostError::Rebooted)) if restarts < MAX_RESTARTS => {
                    restarts += 1;
                }
                Err(error) => return Err(error),
            }
        }
    }

    /// Stops the device, whatever is running.
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
                Ok(CommandResult::Done(Outcome::Stopped)) => return Ok(()),
                Ok(_) | Err(DriveError::Host(HostError::Stopped) | DriveError::Abandoned) => {}
                Err(error) => return Err(error),
            }
        }
    }

    /// Waits for the end of the running command, passing every other event to `on_event`.
    ///
    /// Cancel-safe: received bytes stay in the machine, and a later call continues with them.
    ///
    /// # Errors
    /// Any error of the host state machine.
    pub async fn finish(
        &mut self,
        mut on_event: impl FnMut(HostEvent) -> ControlFlow<()>,
    ) -> Result<CommandResult, DriveError> {
        loop {
            match self.next_event().await {
                HostEvent::Identified(identity) => return Ok(CommandResult::Identified(identity)),
                HostEvent::SweepDone { delivered, end, .. } => {
                    return Ok(CommandResult::Swept { delivered, end });
                }
                HostEvent::Done(outcome) => return Ok(CommandResult::Done(outcome)),
                HostEvent::Failed(error) => return Err(DriveError::Host(error)),
                event => {
                    if on_event(event).is_break() {
                        return Err(DriveError::Abandoned);
                    }
                }
            }
        }
    }

    /// Waits on an idle line for an unsolicited event of the device; `None` after a hangup.
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

    /// Runs the machine until its next event.
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

    /// Waits for input, output space or the machine's next deadline, and notifies the machine.
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
        // After a hangup the line is always ready: polling it again would spin.
        let (can_read, can_write) = (!self.hung_up, !self.hung_up && !self.outgoing.is_empty());
        let (mut reader, mut writer) = tokio::io::split(&mut self.line);
        let event = tokio::select! {
            read = reader.read(&mut buffer), if can_read => LineEvent::Read(read.unwrap_or(0)),
            written = writer.write(&self.outgoing), if can_write => {
                LineEvent::Written(written.unwrap_or(0))
            }
            () = timer => LineEvent::Timeout,
        };
        let now_us = self.now_us();
        match event {
            LineEvent::Read(0) | LineEvent::Written(0) => {
                self.hung_up = true;
                self.outgoing.clear();
                self.host.handle_hangup(now_us);
            }
            LineEvent::Read(count) => {
                self.host.handle_bytes(now_us, buffer.get(..count).unwrap_or_default());
            }
            LineEvent::Written(count) => drop(self.outgoing.drain(..count)),
            LineEvent::Timeout => self.host.handle_timeout(now_us),
        }
        self.stats.send_replace(*self.host.stats());
    }
}

enum LineEvent {
    /// Number of bytes received; 0 after a hangup.
    Read(usize),
    /// Number of bytes sent; 0 after a hangup.
    Written(usize),
    Timeout,
}
