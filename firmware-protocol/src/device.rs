//! The device machine: decides everything the device does, and does nothing itself.
//!
//! A board (or a mock) feeds it bytes, the time in ticks of 0.5 us and what its motor and ranger
//! report, and carries out what it asks for:
//!
//! ```text
//! loop {
//!     handle_* with whatever happened, and the time;
//!     while let Some(action) = poll_action()  { carry it out }
//!     write poll_transmit() to the line, as far as it takes bytes;
//!     sleep until something happens or poll_timeout(), then handle_timeout;
//! }
//! ```
//!
//! The clock has 32 bits and wraps. A timeout that comes early or twice does no harm. Nothing
//! here allocates, panics or waits.

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
use actions::Pending;
use ring::Ring;
use timers::Timers;
use transmit::Outbox;

/// The device's half of the protocol. See the [module](self) for how to drive it.
#[derive(Debug, Clone)]
pub struct Device {
    board: Board,
    now: u32,
    decoder: FrameDecoder,
    counters: LinkCounters,
    last: Option<Accepted>,
    settings: Option<Settings>,
    /// Where the motor stands, or stood before the present move. Steps.
    step: i32,
    homed: bool,
    /// The motor was turned, or held for Home, since its coils were let go.
    holds_coils: bool,
    fault: Option<FaultKind>,
    phase: Phase,
    /// Number of the request that `phase` serves.
    phase_seq: u16,
    run: Run,
    ring: Ring,
    timers: Timers,
    pending: Pending,
    outbox: Outbox,
}

/// The last numbered request, and what was answered.
#[derive(Debug, Clone, Copy)]
struct Accepted {
    seq: u16,
    crc: u32,
    /// `None` while it runs, and for questions, which are simply answered anew.
    answer: Option<Answer>,
}

/// A reply, as small as possible: it is encoded when it is sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Answer {
    Identity,
    Ack,
    Nak(NakReason),
    Started,
    Homed {
        drift_steps: i32,
    },
    /// The one reading in the ring.
    Ping,
    Alive {
        ticks: u32,
    },
    Status {
        ticks: u32,
    },
    /// Unasked: the reading of a beam.
    Beam(u16),
    /// Unasked.
    Fault(FaultKind),
    /// Unasked.
    SweepDone,
}

/// What the device is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    Idle,
    Homing,
    /// A MoveTo.
    Moving {
        target: i32,
    },
    /// A Stop, until the motor stands.
    Stopping,
    /// A Ping or a Sweep.
    Beam(Beam),
}

/// Where the present beam is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Beam {
    /// Turning to its position.
    Moving { target: i32 },
    /// For the motor to rest, for the interval to pass, or for room in the ring.
    Waiting,
    /// Fired.
    Listening,
}

/// The latest Sweep or Ping. A Ping is a sweep with number 0 and one beam that does not move.
#[derive(Debug, Clone, Copy)]
struct Run {
    plan: Sweep,
    /// Number of the request it came with.
    seq: u16,
    beams: u16,
    fired: u16,
    state: SweepState,
}

impl Device {
    /// A device that has just booted. It announces itself with an Identity.
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
            run: Run::none(),
            ring: Ring::new(),
            timers: Timers::default(),
            pending: Pending::default(),
            outbox: Outbox::new(),
        }
    }

    /// A byte came from the host.
    pub fn handle_byte(&mut self, now: u32, byte: u8) {
        self.now = now;
        if self.pending.has(Pending::RESET) {
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

    /// Bytes came from the host.
    pub fn handle_bytes(&mut self, now: u32, bytes: &[u8]) {
        for &byte in bytes {
            self.handle_byte(now, byte);
        }
    }

    /// The UART reported an error (framing, overrun): what is being received is dropped.
    pub fn handle_line_error(&mut self, now: u32) {
        self.now = now;
        self.decoder.damage();
    }

    /// The motor stands at `step`, after [`Action::Move`] or [`Action::StopMotion`].
    pub fn handle_moved(&mut self, now: u32, step: i32) {
        self.now = now;
        self.motor_stands(step);
    }

    /// Homing ended. The value is where the index was found against where it was expected, in
    /// steps: 0 the first time and on a board without an index sensor.
    pub fn handle_homed(&mut self, now: u32, outcome: Result<i32, HomeError>) {
        self.now = now;
        self.homing_ended(outcome);
    }

    /// The listening window of [`Action::Fire`] is over, or the module could not be fired.
    pub fn handle_echoes(&mut self, now: u32, report: &EchoReport) {
        self.now = now;
        self.beam_heard(report);
    }

    /// The emergency stop was pressed.
    pub fn handle_emergency_stop(&mut self, now: u32) {
        self.now = now;
        self.halt(FaultKind::EmergencyStop);
    }

    /// The board found that the motor does not follow.
    pub fn handle_motion_fault(&mut self, now: u32) {
        self.now = now;
        self.halt(FaultKind::MotionFault);
    }

    /// Time has passed. Call at [`Device::poll_timeout`], or at any other time.
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

    /// The next timer, and when it ends on the device clock (ticks, wrapping).
    #[must_use]
    pub fn poll_timeout(&self) -> Option<(DeviceTimer, u32)> {
        self.timers.earliest(self.now)
    }

    /// When the running sweep's lease ends, ticks; `None` without one. For a simulation that must
    /// not let time jump past the host's patience.
    #[must_use]
    pub const fn lease_ends(&self) -> Option<u32> {
        self.timers.lease
    }

    /// What is to be done now. Call until `None`.
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

    /// The next byte for the host, for a board that sends them one by one.
    pub fn poll_byte(&mut self) -> Option<u8> {
        self.next_byte()
    }

    /// What was dropped since boot.
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
