//! Carries out on pins what the device machine decides.

mod under_way;

use firmware_protocol::{
    device::{Action, Board, Device, EchoReport, IndexSearch, within_half_a_turn},
    messages::{Blanking, Capabilities, Echoes, FirmwareVersion, ReadingStatus, ResetCause},
};
use sonard_model::motion::Trapezoid;

use super::pins::{Output, Pins};

use under_way::{Listening, Turn};

/// How long BLNK is held, ticks: at least 0.44 ms, so that the echo just heard has passed.
const BLNK_TICKS: u64 = 1_000;
/// How often the board looks for a first echo that others may follow, ticks.
pub const LOOK_TICKS: u64 = 200;

/// Settings of the board.
#[derive(Debug, Clone, Copy)]
pub struct PiSettings {
    /// Boot nonce of the first start; another one than before.
    pub boot: u16,
    /// Serial number.
    pub serial: [u8; 10],
    /// Steps a revolution.
    pub steps_per_revolution: u16,
}

/// The device machine on pins. Feed it bytes, call [`Self::advance`] whenever
/// [`Self::next_wake`] has come, and send what [`Self::poll_transmit`] gives.
#[derive(Debug)]
pub struct PiBoard<P> {
    pub(super) pins: P,
    settings: PiSettings,
    device: Device,
    boot: u16,
    /// What the step counter says.
    position: i32,
    /// Whether a homing has been done, so that the next can tell the drift.
    known: bool,
    pressed: bool,
    turn: Option<Turn>,
    search: Option<Search>,
    listening: Option<Listening>,
}

#[derive(Debug)]
struct Search {
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
            known: false,
            pressed: false,
            turn: None,
            search: None,
            listening: None,
        }
    }

    /// The pins.
    pub const fn pins(&mut self) -> &mut P {
        &mut self.pins
    }

    /// Bytes from the host.
    pub fn handle_bytes(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            let now = self.ticks();
            self.device.handle_byte(now, byte);
            self.act();
        }
    }

    /// Appends what the device has to say.
    pub fn poll_transmit(&mut self, out: &mut Vec<u8>) {
        out.extend(std::iter::from_fn(|| self.device.poll_byte()));
        // A restart waits until its acknowledgement is out.
        self.act();
    }

    /// When to call [`Self::advance`] next, ticks of the pins' clock.
    pub fn next_wake(&mut self) -> Option<u64> {
        let now = self.pins.now();
        let timer = self.device.poll_timeout().map(|(_, at)| {
            let ahead = at.wrapping_sub(now as u32).cast_signed().max(0);
            now + u64::from(ahead.unsigned_abs())
        });
        let turn = self.turn.as_ref().map(Turn::due);
        let listening = self.listening.as_ref().map(|listening| listening.due(now));
        [timer, turn, listening].into_iter().flatten().min()
    }

    /// Does everything that is due.
    pub fn advance(&mut self) {
        // The lease first: a beam that ends after it must not be followed by another.
        let now = self.ticks();
        self.device.handle_timeout(now);
        self.watch_emergency();
        self.act();
        self.listen();
        self.act();
        self.turn();
        self.act();
    }

    /// The machine's clock has 32 bits.
    fn ticks(&mut self) -> u32 {
        self.pins.now() as u32
    }

    fn watch_emergency(&mut self) {
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
                    self.begin_turn(target, speed, acceleration, None);
                }
                Action::StopMotion => self.brake(),
                Action::ReleaseCoils => self.release(),
                Action::Fire { window_ticks, max_echoes, blanking } => {
                    self.fire(window_ticks, max_echoes, blanking);
                }
                Action::AbortFire => self.end_listening(),
                Action::Reset => self.restart(),
            }
        }
    }

    fn home(&mut self, speed: u16, acceleration: u32) {
        self.pins.set(Output::Enable, false);
        if let Some(at_index) = self.pins.at_index() {
            let index = IndexSearch::begin(at_index, self.settings.steps_per_revolution);
            self.search = Some(Search { index, speed, acceleration });
            self.search_on();
        } else {
            // Held where it is: that is zero now.
            self.position = 0;
            let now = self.ticks();
            self.device.handle_homed(now, Ok(0));
        }
    }

    /// The next turn of the search for the index.
    fn search_on(&mut self) {
        if let Some(Search { index, speed, acceleration }) = &self.search {
            let (target, watch) = index.turn(self.position);
            self.begin_turn(target, *speed, *acceleration, watch);
        }
    }

    fn begin_turn(&mut self, target: i32, speed: u16, acceleration: u32, watch: Option<bool>) {
        self.pins.set(Output::Enable, false);
        let steps = target.wrapping_sub(self.position);
        self.pins.set(Output::Dir, steps >= 0);
        let motion = Trapezoid::new(steps, speed, acceleration);
        let since = self.pins.now();
        self.turn = Some(Turn { motion, since, pulses: 0, watch, seen: None });
    }

    fn brake(&mut self) {
        self.search = None;
        let now = self.pins.now();
        match &mut self.turn {
            Some(turn) => turn.brake(now),
            None => self.device.handle_moved(now as u32, self.position),
        }
    }

    /// The coils lose their current.
    fn release(&mut self) {
        self.pins.set(Output::Enable, true);
        self.turn = None;
        self.search = None;
        self.known = false;
    }

    /// The pulses that are due, and the end of the move.
    fn turn(&mut self) {
        let Some(turn) = &mut self.turn else { return };
        let now = self.pins.now();
        if turn.watch.is_some() && self.pins.at_index() == turn.watch {
            turn.seen = Some(self.position);
            turn.watch = None;
            turn.brake(now);
        }
        let due = turn.due();
        if due > now {
            return;
        }
        if turn.is_under_way() {
            // What is late makes the rest late: pulses never crowd.
            turn.since += now - due;
            turn.pulses += 1;
            self.pins.pulse();
            self.position = self.position.wrapping_add(turn.motion.steps().signum());
            return;
        }
        let seen = turn.seen;
        self.turn = None;
        self.arrived(seen);
    }

    fn arrived(&mut self, seen: Option<i32>) {
        let now = self.ticks();
        let Some(search) = &mut self.search else {
            return self.device.handle_moved(now, self.position);
        };
        let Some(outcome) = search.index.arrived(seen) else { return self.search_on() };
        self.search = None;
        let known = std::mem::replace(&mut self.known, outcome.is_ok());
        let revolution = self.settings.steps_per_revolution;
        let drift = outcome.map(|index| {
            self.position = self.position.wrapping_sub(index);
            if known { within_half_a_turn(index, revolution) } else { 0 }
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
        self.pins.forget_echoes();
        let fired = self.pins.raise_init();
        let binh_at = match blanking {
            Blanking::Internal => None,
            Blanking::Short { ticks } => Some(fired + u64::from(ticks)),
        };
        self.listening = Some(Listening {
            fired,
            until: fired + u64::from(window_ticks),
            binh_at,
            blnk_until: None,
            max_echoes,
            echoes: Echoes::new(),
        });
    }

    /// What the module does meanwhile, and the end of the window.
    fn listen(&mut self) {
        let Some(listening) = &mut self.listening else { return };
        let now = self.pins.now();
        while let Some(at) = self.pins.next_echo() {
            if listening.hears(at) {
                // Lowers ECHO and keeps the module deaf until the same echo has passed.
                self.pins.set(Output::Blnk, true);
                listening.blnk_until = Some(self.pins.now() + BLNK_TICKS);
            }
        }
        if now >= listening.until {
            let status = ReadingStatus::Echo;
            let (fired_ticks, echoes) = (listening.fired as u32, listening.echoes);
            self.end_listening();
            let report = EchoReport { fired_ticks, status, echoes };
            return self.device.handle_echoes(now as u32, &report);
        }
        if listening.binh_at.take_if(|at| *at <= now).is_some() {
            self.pins.set(Output::Binh, true);
        }
        if listening.blnk_until.take_if(|at| *at <= now).is_some() {
            self.pins.set(Output::Blnk, false);
        }
    }

    fn end_listening(&mut self) {
        for output in [Output::Init, Output::Binh, Output::Blnk] {
            self.pins.set(output, false);
        }
        self.listening = None;
    }

    fn restart(&mut self) {
        make_safe(&mut self.pins);
        self.release();
        self.listening = None;
        self.position = 0;
        self.boot = self.boot.checked_add(1).unwrap_or(1);
        let cause = ResetCause::Requested;
        self.device = Device::new(identity(&mut self.pins, &self.settings, self.boot, cause));
    }
}

/// Turns the motor or fires.
const fn is_dangerous(action: &Action) -> bool {
    matches!(action, Action::Home { .. } | Action::Move { .. } | Action::Fire { .. })
}

/// Nothing fires and nothing turns.
fn make_safe(pins: &mut impl Pins) {
    pins.set(Output::Enable, true);
    for output in [Output::Init, Output::Binh, Output::Blnk, Output::Step, Output::Dir] {
        pins.set(output, false);
    }
}

fn identity(
    pins: &mut impl Pins,
    settings: &PiSettings,
    boot: u16,
    reset_cause: ResetCause,
) -> Board {
    let fitted = |there: bool, capability| if there { capability } else { Capabilities::default() };
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
