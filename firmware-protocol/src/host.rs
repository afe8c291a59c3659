//! Host state machine: the only owner of waiting and retrying.
//!
//! The caller starts commands with [`Host::start`] and passes received bytes and the time in us of
//! any monotonic clock. The machine returns frames to send and events:
//!
//! ```text
//! loop {
//!     start / handle_* for each event, with the time;
//!     while let Some(frame) = poll_transmit() { write it, at once }
//!     while let Some(event) = poll_event()    { act on it }
//!     wait for bytes until poll_timeout(), then handle_timeout;
//! }
//! ```
//!
//! A timeout that comes early or twice is harmless. If a command fails while the device still
//! replies and may be active, the host first sends Stop and then reports [`HostEvent::Failed`].
//! After that event the host sends nothing by itself. A device that does not reply is stopped by
//! the lease of its sweep.

mod board;
mod config;
mod deadline;
mod event;
mod exchange;
mod firings;
mod receive;
mod stats;
mod sweep;
mod track;
mod validate;

pub use board::{BoardChange, Serial};
pub use config::{
    ACKNOWLEDGEMENTS_PER_RING, ATTEMPTS, Command, HostConfig, INITIAL_MARGIN_US,
    KEEP_ALIVES_PER_LEASE, MAX_MARGIN_US, MIN_MARGIN_US, OVERRUNS, READINGS_AHEAD, SEQ_GAP_MAX,
    STOP_ATTEMPTS, StartError,
};
pub use event::{HostError, HostEvent, Outcome};
pub use stats::LinkStats;
pub use validate::{IdentityFault, ReadingFault, ReplyFault};

use heapless::Deque;

use crate::frame::{Frame, FrameDecoder, Received};
use crate::messages::{Identity, Reply, Request, Settings};
use deadline::Margin;
use exchange::{Numbers, OpenRequest};
use firings::DeviceTime;
use track::Track;

/// Capacity of the event queue. Readings that do not fit count as lost on the line and are
/// requested again.
const EVENTS: usize = 64;
/// Places reserved for events that are reported only once.
const EVENTS_RESERVED: usize = 16;

/// Timers of the host.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HostTimer {
    /// Waiting for the reply to a request; the request is then repeated.
    Reply,
    /// Waiting for the final reply after Started; the request is then repeated.
    Completion,
    /// Next KeepAlive of a sweep, well within its lease.
    KeepAlive,
    /// Waiting for the next reading of a sweep; KeepAlive then queries the progress.
    Progress,
}

/// Host side of the protocol. See the [module](self) for how to drive it.
#[derive(Debug, Clone)]
pub struct Host {
    config: HostConfig,
    decoder: FrameDecoder,
    stats: LinkStats,
    events: Deque<HostEvent, EVENTS>,
    margin: Margin,
    numbers: Numbers,
    identity: Option<Identity>,
    /// Boot nonce of the device. Kept after a hangup to detect a restart in the meantime.
    boot: Option<u16>,
    /// Preceding boot nonce, whose frames are late copies.
    previous_boot: Option<u16>,
    /// Last identified device. Kept after hangup and restart to detect a different board.
    last_identity: Option<Identity>,
    /// Current settings of the device.
    settings: Option<Settings>,
    /// Position of the motor, if known.
    step: Option<i32>,
    job: Option<Command>,
    exchange: Option<OpenRequest>,
    outgoing: Option<Frame>,
    track: Option<Track>,
    /// Bytes and valid frames received before the start of the command.
    received_before: (u64, u64),
    /// Time of the last valid frame.
    last_frame_us: Option<u64>,
    /// Error to report once the device has been stopped.
    giving_up: Option<HostError>,
    device_time: DeviceTime,
}

impl Host {
    /// Creates a host without an identified device.
    #[must_use]
    pub fn new(config: HostConfig) -> Self {
        Self {
            decoder: FrameDecoder::new(),
            stats: LinkStats::default(),
            events: Deque::new(),
            margin: Margin::new(&config),
            numbers: Numbers::new(config.seed),
            identity: None,
            boot: None,
            previous_boot: None,
            last_identity: None,
            settings: None,
            step: None,
            job: None,
            exchange: None,
            outgoing: None,
            track: None,
            received_before: (0, 0),
            last_frame_us: None,
            giving_up: None,
            device_time: DeviceTime::default(),
            config,
        }
    }

    /// Starts a command. Its end is reported as an event.
    ///
    /// # Errors
    ///
    /// [`StartError`] if the command cannot start now; the state is then unchanged.
    pub fn start(&mut self, now_us: u64, command: Command) -> Result<(), StartError> {
        self.check_start(&command)?;
        if let Command::Sweep(plan) = command {
            return self.start_sweep(now_us, plan);
        }
        self.job = Some(command);
        self.giving_up = None;
        self.received_before = (self.stats.bytes_received, self.stats.frames_received);
        self.send(
            now_us,
            match command {
                Command::Identify => Request::Identify,
                Command::Configure(settings) => Request::Configure(settings),
                Command::Home => Request::Home,
                Command::MoveTo { step } => Request::MoveTo { step },
                Command::Ping => Request::Ping,
                Command::Status => Request::Status,
                Command::Reset => Request::Reset,
                Command::Stop | Command::Sweep(_) => Request::Stop,
            },
        );
        Ok(())
    }

    fn check_start(&self, command: &Command) -> Result<(), StartError> {
        if matches!(command, Command::Stop) {
            return Ok(());
        }
        if self.job.is_some() {
            return Err(StartError::Busy);
        }
        if matches!(command, Command::Identify) {
            return Ok(());
        }
        if self.identity.is_none() {
            // Identified before, then invalidated by a hangup or a restart.
            let was_identified = self.last_identity.is_some();
            return Err(if was_identified {
                StartError::Restarted
            } else {
                StartError::NotIdentified
            });
        }
        let needs_settings =
            !matches!(command, Command::Configure(_) | Command::Status | Command::Reset);
        if needs_settings && self.settings.is_none() {
            return Err(StartError::NotConfigured);
        }
        Ok(())
    }

    /// Processes bytes received from the device.
    pub fn handle_bytes(&mut self, now_us: u64, bytes: &[u8]) {
        self.stats.bytes_received += bytes.len() as u64;
        for &byte in bytes {
            self.handle_byte(now_us, byte);
        }
        self.continue_sweep(now_us);
    }

    fn handle_byte(&mut self, now_us: u64, byte: u8) {
        match self.decoder.push(byte) {
            Received::Nothing => {}
            Received::Empty => {
                self.stats.dropped.empty = self.stats.dropped.empty.saturating_add(1);
            }
            Received::Dropped(reason) => self.stats.dropped.count(reason),
            Received::Frame(raw) => {
                self.stats.frames_received += 1;
                self.last_frame_us = Some(now_us);
                let (header, wire_len) = (raw.header, raw.wire_len);
                match Reply::decode(raw.body) {
                    Ok(Reply::Identity(identity)) => {
                        self.handle_identity(now_us, header, &identity, wire_len);
                    }
                    Ok(reply) => self.handle_reply(now_us, header, &reply, wire_len),
                    Err(_) => {
                        let device_version = crate::messages::ProtocolId::peek(raw.body);
                        self.handle_undecodable(device_version);
                    }
                }
            }
        }
    }

    /// Advances the time. Call at [`Host::poll_timeout`]; further calls are harmless.
    pub fn handle_timeout(&mut self, now_us: u64) {
        if self.exchange.as_ref().is_some_and(|exchange| exchange.deadline_us <= now_us) {
            self.retry(now_us);
        }
        self.continue_sweep(now_us);
    }

    /// Reports that the line was closed: the command in progress fails, and the device must be
    /// identified again.
    pub fn handle_hangup(&mut self, _now_us: u64) {
        self.decoder = FrameDecoder::new();
        self.identity = None;
        self.giving_up = None;
        if self.job.is_some() {
            self.fail(HostError::Hangup);
        }
    }

    /// Returns the next timer and its deadline, us.
    #[must_use]
    pub fn poll_timeout(&self) -> Option<(HostTimer, u64)> {
        if let Some(exchange) = &self.exchange {
            let timer = if exchange.started { HostTimer::Completion } else { HostTimer::Reply };
            return Some((timer, exchange.deadline_us));
        }
        let track = self.track.as_ref()?;
        Some(if track.progress_at_us < track.keep_alive_at_us {
            (HostTimer::Progress, track.progress_at_us)
        } else {
            (HostTimer::KeepAlive, track.keep_alive_at_us)
        })
    }

    /// Returns the next frame to write to the line. It counts as sent at the time of the preceding
    /// call.
    pub fn poll_transmit(&mut self) -> Option<Frame> {
        let frame = self.outgoing.take()?;
        self.stats.frames_sent += 1;
        self.stats.bytes_sent += frame.len() as u64;
        Some(frame)
    }

    /// Returns the next event.
    pub fn poll_event(&mut self) -> Option<HostEvent> {
        self.events.pop_front()
    }

    /// Returns `true` while a command is in progress.
    #[must_use]
    pub const fn is_busy(&self) -> bool {
        self.job.is_some()
    }

    /// Identity of the device; `None` before Identify and after a hangup or restart.
    #[must_use]
    pub const fn identity(&self) -> Option<&Identity> {
        self.identity.as_ref()
    }

    /// Statistics of the link.
    #[must_use]
    pub const fn stats(&self) -> &LinkStats {
        &self.stats
    }

    /// Queues an event that must not be lost; places are reserved for these.
    fn report(&mut self, event: HostEvent) {
        // Cannot fail while the caller polls events: a single command is in progress at a time.
        let _ = self.events.push_back(event);
    }

    fn has_room_for_reading(&self) -> bool {
        self.events.len() < EVENTS - EVENTS_RESERVED
    }

    fn finish(&mut self, outcome: Outcome) {
        self.end_job();
        self.report(HostEvent::Done(outcome));
    }

    fn fail(&mut self, error: HostError) {
        // Regardless of the outcome of the Stop, the command fails for its original cause.
        let error = self.giving_up.take().unwrap_or(error);
        self.end_job();
        self.report(HostEvent::Failed(error));
    }

    fn end_job(&mut self) {
        self.job = None;
        self.exchange = None;
        self.outgoing = None;
        self.track = None;
    }
}
