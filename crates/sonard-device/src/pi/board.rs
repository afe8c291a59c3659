//! Execution of the device state machine's actions on pins.

mod activity;

use firmware_protocol::{
    device::{Action, Board, Device, EchoReport, IndexSearch, within_half_a_turn},
    messages::{Blanking, Capabilities, Echoes, FirmwareVersion, ReadingStatus, ResetCause},
};
use sonard_model::motion::Trapezoid;

use super::pins::{BoardOutput, Pins};

use activity::{Firing, Move};

/// Duration of BLNK, ticks: at least 0.44 ms, so that the detected echo has passed.
const BLNK_TICKS: u64 = 1_000;
/// Poll interval of ECHO while further echoes are expected, ticks.
pub const ECHO_POLL_TICKS: u64 = 200;

/// Identity and motor of a Raspberry Pi board.
#[derive(Debug, Clone, Copy)]
pub struct PiSettings {
    /// Boot nonce of the first start; must differ from the previous run.
    pub boot: u16,
    /// Serial number reported to the host.
    pub serial: [u8; 10],
    /// Motor steps per revolution.
    pub steps_per_revolution: u16,
}

/// Device state machine on pins. The caller feeds received bytes, calls [`Self::advance`] at
/// [`Self::next_wake`], and sends the bytes from [`Self::poll_transmit`].
#[derive(Debug)]
pub struct PiBoard<P> {
    pub(super) pins: P,
    settings: PiSettings,
    device: Device,
    boot: u16,
    /// Value of the step counter.
    position: i32,
    /// `true` after a homing, so that the next one can measure the drift.
    is_homed: bool,
    pressed: bool,
    motion: Option<Move>,
    search: Option<HomeSearch>,
    firing: Option<Firing>,
}

#[derive(Debug)]
struct HomeSearch {
    index: IndexSearch,
    speed: u16,
    acceleration: u32,
}

impl<P: Pins> PiBoard<P> {
    /// Makes the pins safe and starts the machine.
    pub fn new(mut pins: P, settings: PiSettings) -> Self {
        make_safe(&mut pins);
        let board = identity(&mut pins, &settings, settings.boot, ResetCause::PowerOn);
        Self {
            device: Device::new(board),
            boot: board.boot,
            pins,
            settings,
            position: 0,
            is_homed: false,
            pressed: false,
            motion: None,
            search: None,
            firing: None,
        }
    }

    /// Mutable access to the pins, for their clock.
    pub const fn pins(&mut self) -> &mut P {
        &mut self.pins
    }

    /// Processes bytes from the host.
    pub fn handle_bytes(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            let now = self.ticks();
            self.device.handle_byte(now, byte);
            self.act();
        }
    }

    /// Appends the bytes for the host.
    pub fn poll_transmit(&mut self, out: &mut Vec<u8>) {
        out.extend(std::iter::from_fn(|| self.device.poll_byte()));
        // A restart waits until its acknowledgement is sent.
        self.act();
    }

    /// Time of the next call of [`Self::advance`], ticks of the pins' clock.
    pub fn next_wake(&mut self) -> Option<u64> {
        let now = self.pins.now();
        let timer = self.device.poll_timeout().map(|(_, at)| {
            let ahead = at.wrapping_sub(now as u32).cast_signed().max(0);
            now + u64::from(ahead.unsigned_abs())
        });
        let motion = self.motion.as_ref().map(Move::due);
        let firing = self.firing.as_ref().map(|firing| firing.due(now));
        [timer, motion, firing].into_iter().flatten().min()
    }

    /// Performs everything that is due.
    pub fn advance(&mut self) {
        // The lease comes first: a beam that ends after it must not be followed by another.
        let now = self.ticks();
        self.device.handle_timeout(now);
        self.check_emergency();
        self.act();
        self.advance_firing();
        self.act();
        self.advance_move();
        self.act();
    }

    /// Time in the machine's 32-bit ticks.
    fn ticks(&mut self) -> u32 {
        self.pins.now() as u32
    }

    fn check_emergency(&mut self) {
        let pressed = self.pins.emergency().unwrap_or(false);
        if pressed && !self.pressed {
            make_safe(&mut self.pins);
            let now = self.ticks();
            self.device.handle_emergency_stop(now);
        }
        self.pressed = pressed;
    }

    fn act(&mut self) {
        while let Some(action) = self.device.poll_action() {
            if self.pressed && is_dangerous(&action) {
                let now = self.ticks();
                self.device.handle_emergency_stop(now);
                continue;
            }
            match action {
                Action::Home { speed, acceleration } => self.home(speed, acceleration),
                Action::Move { target, speed, acceleration } => {
                    self.begin_move(target, speed, acceleration, None);
                }
                Action::StopMotion => self.brake(),
                Action::ReleaseCoils => self.release_coils(),
                Action::Fire { window_ticks, max_echoes, blanking } => {
                    self.fire(window_ticks, max_echoes, blanking);
                }
                Action::AbortFire => self.end_firing(),
                Action::Reset => self.restart(),
            }
        }
    }

    fn home(&mut self, speed: u16, acceleration: u32) {
        self.pins.set(BoardOutput::Enable, false);
        if let Some(at_index) = self.pins.at_index() {
            let index = IndexSearch::begin(at_index, self.settings.steps_per_revolution);
            self.search = Some(HomeSearch { index, speed, acceleration });
            self.continue_search();
        } else {
            // Without an index sensor the present position becomes zero.
            self.position = 0;
            let now = self.ticks();
            self.device.handle_homed(now, Ok(0));
        }
    }

    /// Begins the next move of the search for the index.
    fn continue_search(&mut self) {
        if let Some(HomeSearch { index, speed, acceleration }) = &self.search {
            let (target, stop_at) = index.turn(self.position);
            self.begin_move(target, *speed, *acceleration, stop_at);
        }
    }

    fn begin_move(&mut self, target: i32, speed: u16, acceleration: u32, stop_at: Option<bool>) {
        self.pins.set(BoardOutput::Enable, false);
        let steps = target.wrapping_sub(self.position);
        self.pins.set(BoardOutput::Dir, steps >= 0);
        let profile = Trapezoid::new(steps, speed, acceleration);
        let since = self.pins.now();
        self.motion = Some(Move { profile, since, pulses: 0, stop_at, edge: None });
    }

    fn brake(&mut self) {
        self.search = None;
        let now = self.pins.now();
        match &mut self.motion {
            Some(motion) => motion.brake(now),
            None => self.device.handle_moved(now as u32, self.position),
        }
    }

    /// Switches the coil current off.
    fn release_coils(&mut self) {
        self.pins.set(BoardOutput::Enable, true);
        self.motion = None;
        self.search = None;
        self.is_homed = false;
    }

    /// Emits the pulse that is due, or ends the move.
    fn advance_move(&mut self) {
        let Some(motion) = &mut self.motion else { return };
        let now = self.pins.now();
        if motion.stop_at.is_some() && self.pins.at_index() == motion.stop_at {
            motion.edge = Some(self.position);
            motion.stop_at = None;
            motion.brake(now);
        }
        let due = motion.due();
        if due > now {
            return;
        }
        if motion.has_pulses_left() {
            // A late pulse delays all later ones: pulses never crowd.
            motion.since += now - due;
            motion.pulses += 1;
            self.pins.pulse();
            self.position = self.position.wrapping_add(motion.profile.steps().signum());
            return;
        }
        let edge = motion.edge;
        self.motion = None;
        self.end_move(edge);
    }

    fn end_move(&mut self, edge: Option<i32>) {
        let now = self.ticks();
        let Some(search) = &mut self.search else {
            return self.device.handle_moved(now, self.position);
        };
        let Some(outcome) = search.index.arrived(edge) else { return self.continue_search() };
        self.search = None;
        let was_homed = std::mem::replace(&mut self.is_homed, outcome.is_ok());
        let revolution = self.settings.steps_per_revolution;
        let drift = outcome.map(|index| {
            self.position = self.position.wrapping_sub(index);
            if was_homed { within_half_a_turn(index, revolution) } else { 0 }
        });
        self.device.handle_homed(now, drift);
    }

    fn fire(&mut self, window_ticks: u32, max_echoes: u8, blanking: Blanking) {
        if self.pins.echo() {
            let fired_ticks = self.ticks();
            let status = ReadingStatus::ModuleFault;
            let report = EchoReport { fired_ticks, status, echoes: Echoes::new() };
            return self.device.handle_echoes(fired_ticks, &report);
        }
        self.pins.discard_echoes();
        let fired = self.pins.raise_init();
        let binh_at = match blanking {
            Blanking::Internal => None,
            Blanking::Short { ticks } => Some(fired + u64::from(ticks)),
        };
        self.firing = Some(Firing {
            fired,
            until: fired + u64::from(window_ticks),
            binh_at,
            blnk_until: None,
            max_echoes,
            echoes: Echoes::new(),
        });
    }

    /// Records echoes, drives the blanking inputs, and ends the window.
    fn advance_firing(&mut self) {
        let Some(firing) = &mut self.firing else { return };
        let now = self.pins.now();
        while let Some(at) = self.pins.next_echo() {
            if firing.record_echo(at) {
                // Lowers ECHO and blanks the module until the detected echo has passed.
                self.pins.set(BoardOutput::Blnk, true);
                firing.blnk_until = Some(self.pins.now() + BLNK_TICKS);
            }
        }
        if now >= firing.until {
            let status = ReadingStatus::Echo;
            let (fired_ticks, echoes) = (firing.fired as u32, firing.echoes);
            self.end_firing();
            let report = EchoReport { fired_ticks, status, echoes };
            return self.device.handle_echoes(now as u32, &report);
        }
        if firing.binh_at.take_if(|at| *at <= now).is_some() {
            self.pins.set(BoardOutput::Binh, true);
        }
        if firing.blnk_until.take_if(|at| *at <= now).is_some() {
            self.pins.set(BoardOutput::Blnk, false);
        }
    }

    fn end_firing(&mut self) {
        for output in [BoardOutput::Init, BoardOutput::Binh, BoardOutput::Blnk] {
            self.pins.set(output, false);
        }
        self.firing = None;
    }

    fn restart(&mut self) {
        make_safe(&mut self.pins);
        self.release_coils();
        self.firing = None;
        self.position = 0;
        self.boot = self.boot.checked_add(1).unwrap_or(1);
        let cause = ResetCause::Requested;
        self.device = Device::new(identity(&mut self.pins, &self.settings, self.boot, cause));
    }
}

/// Returns `true` for an action that turns the motor or fires.
const fn is_dangerous(action: &Action) -> bool {
    matches!(action, Action::Home { .. } | Action::Move { .. } | Action::Fire { .. })
}

/// Sets outputs to safe levels: no coil current, no firing.
fn make_safe(pins: &mut impl Pins) {
    pins.set(BoardOutput::Enable, true);
    for output in [
        BoardOutput::Init,
        BoardOutput::Binh,
        BoardOutput::Blnk,
        BoardOutput::Step,
        BoardOutput::Dir,
    ] {
        pins.set(output, false);
    }
}

fn identity(
    pins: &mut impl Pins,
    settings: &PiSettings,
    boot: u16,
    reset_cause: ResetCause,
) -> Board {
    let fitted =
        |is_fitted: bool, capability| if is_fitted { capability } else { Capabilities::default() };
    Board {
        boot,
        firmware: FirmwareVersion { major: 0, minor: 1, patch: 0 },
        serial: settings.serial,
        steps_per_revolution: settings.steps_per_revolution,
        capabilities: Capabilities::SHORT_BLANKING
            .with(Capabilities::MULTIPLE_ECHOES)
            .with(Capabilities::COIL_RELEASE)
            .with(fitted(pins.at_index().is_some(), Capabilities::INDEX_SENSOR))
            .with(fitted(pins.emergency().is_some(), Capabilities::EMERGENCY_STOP)),
        reset_cause,
    }
}
