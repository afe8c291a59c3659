//! The host machine: the one owner of waiting and retrying.
//!
//! It is told what to do ([`Host::start`]), fed with bytes and the time in us of any clock that
//! does not jump, and says what to send and what came of it:
//!
//! ```text
//! loop {
//!     start / handle_* with whatever happened, and the time;
//!     while let Some(frame) = poll_transmit() { write it, at once }
//!     while let Some(event) = poll_event()    { act on it }
//!     wait for bytes until poll_timeout(), then handle_timeout;
//! }
//! ```
//!
//! A timeout that comes early or twice does no harm. Before [`HostEvent::Failed`] a device that
//! still answers and may be at work is stopped; after it the host does nothing more by itself: one
//! that does not answer is ended by the sweep's lease.

mod board;
mod config;
mod deadline;
mod event;
mod exchange;
mod firings;
mod receive;
mod sense;
mod stats;
mod sweep;
mod track;

pub use board::{BoardChange, Serial};
pub use config::{
    ACKNOWLEDGEMENTS_A_RING, ATTEMPTS, Command, HostConfig, INITIAL_MARGIN_US, KEEP_ALIVES_A_LEASE,
    MAX_MARGIN_US, MIN_MARGIN_US, OVERRUNS, READINGS_AHEAD, SEQ_GAP_MAX, STOP_ATTEMPTS, StartError,
};
pub use event::{HostError, HostEvent, Outcome};
pub use sense::{IdentityFault, ReadingFault, ReplyFault};
pub use stats::LinkStats;

use heapless::Deque;

use crate::frame::{Frame, FrameDecoder, Received};
use crate::messages::{Identity, Reply, Request, Settings};
use deadline::Margin;
use exchange::{Exchange, Numbers};
use firings::DeviceTime;
use track::Track;

/// Events kept until they are polled. Readings that find no place count as lost on the line, and
/// are sent again.
const EVENTS: usize = 64;
/// Places that readings leave free for events that come once.
const EVENTS_RESERVED: usize = 16;

/// Everything the host may wait for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HostTimer {
    /// The reply to a request; then it is sent again.
    Reply,
    /// The end of something long that the device has begun; then it is asked again.
    Completion,
    /// The next sign of life during a sweep, well within its lease.
    KeepAlive,
    /// The next reading of a sweep; then the device is asked where it is.
    Progress,
}

/// The host's half of the protocol. See the [module](self) for how to drive it.
#[derive(Debug, Clone)]
pub struct Host {
    config: HostConfig,
    decoder: FrameDecoder,
    stats: LinkStats,
    events: Deque<HostEvent, EVENTS>,
    margin: Margin,
    numbers: Numbers,
    identity: Option<Identity>,
    /// Survives a hangup, so that a restart meanwhile is noticed.
    boot: Option<u16>,
    /// The boot before: its frames are late copies.
    previous_boot: Option<u16>,
    /// Who was met last. Survives hangup and restart, so that another board is noticed.
    met: Option<Identity>,
    /// What the device was last set to.
    settings: Option<Settings>,
    /// Where the ranger points, as far as known.
    step: Option<i32>,
    job: Option<Command>,
    exchange: Option<Exchange>,
    outgoing: Option<Frame>,
    track: Option<Track>,
    /// Bytes and right frames received when the job began.
    received_before: (u64, u64),
    /// When the last right frame came.
    heard_us: Option<u64>,
    /// Why the command fails as soon as the device has been stopped.
    giving_up: Option<HostError>,
    device_time: DeviceTime,
}

impl Host {
    /// A host that knows no device yet.
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
            met: None,
            settings: None,
            step: None,
            job: None,
            exchange: None,
            outgoing: None,
            track: None,
            received_before: (0, 0),
            heard_us: None,
            giving_up: None,
            device_time: DeviceTime::default(),
            config,
        }
    }

    /// Begins a command. Its end is an event.
    ///
    /// # Errors
    ///
    /// [`StartError`] if it cannot begin now; nothing was changed then.
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
            // After a hangup or a restart it was met, and has to be met again.
            let met = self.met.is_some();
            return Err(if met { StartError::Restarted } else { StartError::NotIdentified });
        }
        let needs_settings =
            !matches!(command, Command::Configure(_) | Command::Status | Command::Reset);
        if needs_settings && self.settings.is_none() {
            return Err(StartError::NotConfigured);
        }
        Ok(())
    }

    /// Bytes came from the device.
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
                self.heard_us = Some(now_us);
                let (header, wire_len) = (raw.header, raw.wire_len);
                match Reply::decode(raw.body) {
                    Ok(Reply::Identity(identity)) => {
                        self.handle_identity(now_us, header, &identity, wire_len);
                    }
                    Ok(reply) => self.handle_reply(now_us, header, &reply, wire_len),
                    Err(_) => {
                        let stranger = crate::messages::ProtocolId::peek(raw.body);
                        self.handle_undecodable(stranger);
                    }
                }
            }
        }
    }

    /// Time has passed. Call at [`Host::poll_timeout`], or at any other time.
    pub fn handle_timeout(&mut self, now_us: u64) {
        if self.exchange.as_ref().is_some_and(|exchange| exchange.deadline_us <= now_us) {
            self.retry(now_us);
        }
        self.continue_sweep(now_us);
    }

    /// The line was closed: what is under way fails, and the device must be identified anew.
    pub fn handle_hangup(&mut self, _now_us: u64) {
        self.decoder = FrameDecoder::new();
        self.identity = None;
        self.giving_up = None;
        if self.job.is_some() {
            self.fail(HostError::Hangup);
        }
    }

    /// The next timer, and when it ends (us).
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

    /// The next frame to write to the line. It counts as sent at the time of the call before.
    pub fn poll_transmit(&mut self) -> Option<Frame> {
        let frame = self.outgoing.take()?;
        self.stats.frames_sent += 1;
        self.stats.bytes_sent += frame.len() as u64;
        Some(frame)
    }

    /// The next thing to know.
    pub fn poll_event(&mut self) -> Option<HostEvent> {
        self.events.pop_front()
    }

    /// Whether a command is under way.
    #[must_use]
    pub const fn is_busy(&self) -> bool {
        self.job.is_some()
    }

    /// The device, once identified and until hangup or restart.
    #[must_use]
    pub const fn identity(&self) -> Option<&Identity> {
        self.identity.as_ref()
    }

    /// Numbers about the link.
    #[must_use]
    pub const fn stats(&self) -> &LinkStats {
        &self.stats
    }

    /// Reports something that must not be lost; places are reserved for it.
    fn report(&mut self, event: HostEvent) {
        // Cannot fail while the caller polls events at all: there is one command at a time.
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
        // Whatever became of the Stop, the command fails for its own cause.
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
