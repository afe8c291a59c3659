//! Device state machine: makes every decision of the device and performs no I/O.
//!
//! A board (or a mock) passes it received bytes, the time in ticks of 0.5 us and the events of
//! motor and ranger, and carries out the requested actions:
//!
//! ```text
//! loop {
//!     handle_* for each event, with the time;
//!     while let Some(action) = poll_action()  { carry it out }
//!     write poll_transmit() to the line, as far as there is room;
//!     sleep until the next event or poll_timeout(), then handle_timeout;
//! }
//! ```
//!
//! The clock has 32 bits and wraps. A timeout that comes early or twice is harmless. The machine
//! does not allocate, panic or wait.

mod actions;
mod board;
mod requests;
mod ring;
mod run;
mod search;
mod settings;
mod timers;
mod transmit;

pub use board::{Action, Board, EchoReport, HomeError};
pub use search::{IndexSearch, within_half_a_turn};
pub use timers::DeviceTimer;

use crate::frame::{FrameDecoder, LinkCounters, RawFrame, Received, count};
use crate::messages::{FaultKind, NakReason, Request, Settings, Sweep, SweepState, Wire as _};
use actions::PendingActions;
use ring::ReadingRing;
use timers::Timers;
use transmit::Outbox;

/// Device side of the protocol. See the [module](self) for how to drive it.
#[derive(Debug, Clone)]
pub struct Device {
    board: Board,
    now: u32,
    decoder: FrameDecoder,
    counters: LinkCounters,
    last: Option<AcceptedRequest>,
    settings: Option<Settings>,
    /// Position of the motor, or its position before the current move. Steps from home.
    step: i32,
    homed: bool,
    /// The coils may carry current: set by motion or Home, cleared by a release.
    holds_coils: bool,
    fault: Option<FaultKind>,
    phase: Phase,
    /// Number of the request served by `phase`.
    phase_seq: u16,
    run: SweepRun,
    ring: ReadingRing,
    timers: Timers,
    pending: PendingActions,
    outbox: Outbox,
}

/// Last numbered request, and the reply to it.
#[derive(Debug, Clone, Copy)]
struct AcceptedRequest {
    seq: u16,
    crc: u32,
    /// `None` while the request is in progress, and for queries, which are evaluated again when
    /// repeated.
    answer: Option<CompactReply>,
}

/// Reply in compact form; encoded when it is sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum CompactReply {
    Identity,
    Ack,
    Nak(NakReason),
    Started,
    Homed {
        drift_steps: i32,
    },
    /// The only reading in the ring.
    Ping,
    Alive {
        ticks: u32,
    },
    Status {
        ticks: u32,
    },
    /// Event: the reading of a beam.
    Beam(u16),
    /// Event: the device stopped by itself.
    Fault(FaultKind),
    /// Event: the sweep ended.
    SweepDone,
}

/// Current operation of the device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    Idle,
    Homing,
    /// Serving a MoveTo.
    Moving {
        target: i32,
    },
    /// Serving a Stop, until the motor is at rest.
    Stopping,
    /// Serving a Ping or a Sweep.
    Beam(BeamPhase),
}

/// Progress of the current beam.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum BeamPhase {
    /// Moving to the beam's position.
    Moving { target: i32 },
    /// Waiting for settling time, interval or room in the ring.
    Waiting,
    /// Fired; the listening window is open.
    Listening,
}

/// Latest Sweep or Ping. A Ping is a sweep with number 0 and a single beam at the present position.
#[derive(Debug, Clone, Copy)]
struct SweepRun {
    plan: Sweep,
    /// Number of the request that started the run.
    seq: u16,
    beams: u16,
    fired: u16,
    state: SweepState,
}

impl Device {
    /// Creates a device that has just booted. Its first transmission is an Identity.
    #[must_use]
    pub fn new(board: Board) -> Self {
        let board = Board { boot: board.boot.max(1), ..board };
        Self {
            board,
            now: 0,
            decoder: FrameDecoder::new(),
            counters: LinkCounters::default(),
            last: None,
            settings: None,
            step: 0,
            homed: false,
            holds_coils: false,
            fault: None,
            phase: Phase::Idle,
            phase_seq: 0,
            run: SweepRun::none(),
            ring: ReadingRing::new(),
            timers: Timers::default(),
            pending: PendingActions::default(),
            outbox: Outbox::new(),
        }
    }

    /// Processes a byte received from the host.
    pub fn handle_byte(&mut self, now: u32, byte: u8) {
        self.now = now;
        if self.pending.has(PendingActions::RESET) {
            return;
        }
        match self.decoder.push(byte) {
            Received::Nothing => {}
            Received::Empty => count(&mut self.counters.empty),
            Received::Dropped(reason) => self.counters.count(reason),
            Received::Frame(RawFrame { header, body, crc, .. }) => {
                let mut request = Request::BLANK;
                let known = request.read_exactly(body);
                self.handle_frame(header, crc, known.then_some(&request));
            }
        }
    }

    /// Processes bytes received from the host.
    pub fn handle_bytes(&mut self, now: u32, bytes: &[u8]) {
        for &byte in bytes {
            self.handle_byte(now, byte);
        }
    }

    /// Discards the frame being received, after an error reported by the UART (framing, overrun).
    pub fn handle_line_error(&mut self, now: u32) {
        self.now = now;
        self.decoder.discard_frame();
    }

    /// Reports that the motor is at rest at `step`, after [`Action::Move`] or
    /// [`Action::StopMotion`].
    pub fn handle_moved(&mut self, now: u32, step: i32) {
        self.now = now;
        self.motor_stopped(step);
    }

    /// Reports the end of homing. The value is the actual minus the expected position of the index,
    /// in steps: 0 the first time and on a board without an index sensor.
    pub fn handle_homed(&mut self, now: u32, outcome: Result<i32, HomeError>) {
        self.now = now;
        self.homing_ended(outcome);
    }

    /// Reports the end of the listening window of [`Action::Fire`], or that the module could not be
    /// fired.
    pub fn handle_echoes(&mut self, now: u32, report: &EchoReport) {
        self.now = now;
        self.beam_measured(report);
    }

    /// Reports that the emergency stop was pressed.
    pub fn handle_emergency_stop(&mut self, now: u32) {
        self.now = now;
        self.halt(FaultKind::EmergencyStop);
    }

    /// Reports that the motor does not follow its commands.
    pub fn handle_motion_fault(&mut self, now: u32) {
        self.now = now;
        self.halt(FaultKind::MotionFault);
    }

    /// Advances the time. Call at [`Device::poll_timeout`]; further calls are harmless.
    pub fn handle_timeout(&mut self, now: u32) {
        self.now = now;
        timers::expire(&mut self.timers.settle, now);
        timers::expire(&mut self.timers.min_interval, now);
        if timers::expire(&mut self.timers.lease, now) {
            self.halt(FaultKind::LeaseExpired);
        }
        if timers::expire(&mut self.timers.hold, now) && self.phase == Phase::Idle {
            self.halt(FaultKind::HoldExpired);
        }
        self.try_fire();
    }

    /// Returns the timer that expires first, and its deadline on the device clock (ticks,
    /// wrapping).
    #[must_use]
    pub fn poll_timeout(&self) -> Option<(DeviceTimer, u32)> {
        self.timers.earliest(self.now)
    }

    /// Deadline of the running sweep's lease, ticks; `None` without a sweep. A simulation uses it
    /// to limit jumps of its clock to what the host's timeouts allow.
    #[must_use]
    pub const fn lease_deadline(&self) -> Option<u32> {
        self.timers.lease
    }

    /// Returns the next action to carry out. Call until `None`.
    pub fn poll_action(&mut self) -> Option<Action> {
        self.next_action()
    }

    /// Copies the next bytes for the host into `buffer`; 0 if there are none.
    pub fn poll_transmit(&mut self, buffer: &mut [u8]) -> usize {
        let mut written = 0;
        while let Some(slot) = buffer.get_mut(written) {
            let Some(byte) = self.poll_byte() else { break };
            *slot = byte;
            written = written.wrapping_add(1);
        }
        written
    }

    /// Returns the next byte for the host, for a board that sends bytes individually.
    pub fn poll_byte(&mut self) -> Option<u8> {
        self.next_byte()
    }

    /// Counts of frames dropped since boot.
    #[must_use]
    pub const fn counters(&self) -> &LinkCounters {
        &self.counters
    }

    /// Position in steps from home; `None` before homing and after a fault.
    #[must_use]
    pub fn step(&self) -> Option<i32> {
        self.homed.then_some(self.step)
    }
}
