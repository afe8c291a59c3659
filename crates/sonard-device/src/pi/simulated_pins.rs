//! Simulated pins: a module, a motor with an index, and a virtual clock. The conformance tests of
//! all boards run on them.

use std::collections::VecDeque;
use std::convert::Infallible;

use firmware_protocol::conformance::DeviceUnderTest;
use firmware_protocol::conformance_tests;

use super::{BoardOutput, PiBoard, PiSettings, Pins};

const TICKS_PER_US: u64 = 2;
/// Internal blanking of the module, ticks.
const INTERNAL_BLANKING_TICKS: u64 = 4_760;
/// Duration of an echo, ticks: 16 cycles at 49.4 kHz.
const PULSE_TICKS: u64 = 648;

#[derive(Debug, Default)]
struct SimulatedPins {
    now: u64,
    init: bool,
    blnk: bool,
    forward: bool,
    enabled: bool,
    steps: i64,
    /// Ticks after INIT rises.
    echoes: Vec<u64>,
    fired: u64,
    unblanked: u64,
    blnk_fell: u64,
    latched: bool,
    rises: VecDeque<u64>,
    firings: usize,
    index: Option<i64>,
    emergency: Option<bool>,
}

impl SimulatedPins {
    /// Advances time; ECHO latches if an echo arrives while the receiver is open.
    fn advance_to(&mut self, to: u64) {
        for after in &self.echoes {
            let begins = (self.fired + after).max(self.unblanked).max(self.blnk_fell);
            let detected =
                begins < self.fired + after + PULSE_TICKS && begins > self.now && begins <= to;
            if self.init && !self.blnk && !self.latched && detected {
                self.latched = true;
                self.rises.push_back(begins);
            }
        }
        self.now = to;
    }
}

impl Pins for SimulatedPins {
    fn now(&mut self) -> u64 {
        self.now
    }

    fn set(&mut self, output: BoardOutput, high: bool) {
        match output {
            BoardOutput::Init => {
                self.init = high;
                self.latched &= high;
            }
            BoardOutput::Binh if high => self.unblanked = self.unblanked.min(self.now),
            BoardOutput::Binh => {}
            BoardOutput::Blnk => {
                if self.blnk && !high {
                    self.blnk_fell = self.now;
                }
                self.blnk = high;
                self.latched &= !high;
            }
            BoardOutput::Step => {}
            BoardOutput::Dir => self.forward = high,
            BoardOutput::Enable => self.enabled = !high,
        }
    }

    fn raise_init(&mut self) -> u64 {
        assert!(!self.init, "INIT was high already");
        (self.init, self.fired, self.firings) = (true, self.now, self.firings + 1);
        self.unblanked = self.now + INTERNAL_BLANKING_TICKS;
        self.now
    }

    fn pulse(&mut self) {
        assert!(self.enabled, "a pulse without current");
        self.steps += if self.forward { 1 } else { -1 };
    }

    fn echo(&mut self) -> bool {
        self.latched
    }

    fn next_echo(&mut self) -> Option<u64> {
        self.rises.pop_front()
    }

    fn at_index(&mut self) -> Option<bool> {
        self.index.map(|index| (0..4).contains(&(self.steps - index).rem_euclid(400)))
    }

    fn emergency(&mut self) -> Option<bool> {
        self.emergency
    }
}

/// Raspberry Pi board on simulated pins.
struct SimulatedPi(PiBoard<SimulatedPins>);

impl SimulatedPi {
    fn new(pins: SimulatedPins) -> Self {
        let settings = PiSettings { boot: 7, serial: *b"PI-FAKE-01", steps_per_revolution: 400 };
        Self(PiBoard::new(pins, settings))
    }
}

impl DeviceUnderTest for SimulatedPi {
    type Error = Infallible;

    fn now_us(&self) -> u64 {
        self.0.pins.now / TICKS_PER_US
    }

    fn run(&mut self, us: u64) -> Result<(), Infallible> {
        let end = self.0.pins.now + us * TICKS_PER_US;
        loop {
            self.0.advance();
            let now = self.0.pins.now;
            // Each iteration takes the processor some time.
            let wake = self.0.next_wake().unwrap_or(end).clamp(now + 2, end.max(now + 2));
            self.0.pins.advance_to(wake);
            if wake >= end {
                self.0.advance();
                return Ok(());
            }
        }
    }

    fn send(&mut self, bytes: &[u8]) {
        self.0.handle_bytes(bytes);
    }

    fn receive(&mut self) -> Vec<u8> {
        let mut sent = Vec::new();
        self.0.poll_transmit(&mut sent);
        sent
    }

    fn set_echoes(&mut self, after_us: &[f64]) {
        self.0.pins.echoes = after_us.iter().map(|us| (us * 2.0).round() as u64).collect();
    }

    fn take_firings(&mut self) -> usize {
        std::mem::take(&mut self.0.pins.firings)
    }

    fn motor_steps(&self) -> i64 {
        self.0.pins.steps
    }

    fn holds_coils(&self) -> bool {
        self.0.pins.enabled
    }
}

mod without_an_index {
    use super::*;

    conformance_tests!(SimulatedPi::new(SimulatedPins::default()));
}

mod with_an_index {
    use super::*;

    conformance_tests!(SimulatedPi::new(SimulatedPins {
        index: Some(0),
        ..SimulatedPins::default()
    }));

    use firmware_protocol::conformance::Bench;
    use firmware_protocol::host::{Command, HostEvent, Outcome};
    use firmware_protocol::messages::{Blanking, Settings};

    #[test]
    fn home_is_unique() {
        let settings = Settings {
            window_ticks: 48_000,
            min_interval_ticks: 0,
            settle_ticks: 0,
            max_echoes: 1,
            blanking: Blanking::Internal,
            speed: 2_000,
            acceleration: 100_000,
            hold_s: 0,
        };
        for index in [0, 1, 3, 57, 200, 201, 396, -130] {
            let pins = SimulatedPins { index: Some(index), ..SimulatedPins::default() };
            let mut bench = Bench::new(SimulatedPi::new(pins));
            for command in [Command::Identify, Command::Configure(settings), Command::Home] {
                bench.perform(command, 20.0).expect("gets ready");
            }
            let turned = bench.device.motor_steps();
            assert_eq!((turned - index).rem_euclid(400), 0, "index at {index}");
            assert!(turned.abs() <= 400, "index at {index}: wound by {turned} steps");
            // The motor is turned by hand.
            bench.perform(Command::MoveTo { step: 50 }, 10.0).expect("moves");
            bench.device.0.pins.steps -= 3;
            let events = bench.perform(Command::Home, 20.0).expect("homes");
            let drift = HostEvent::Done(Outcome::Homed { drift_steps: 3 });
            assert!(events.contains(&drift), "index at {index}: {events:?}");
        }
    }
}

#[test]
fn emergency_stop_acts_at_once() {
    use firmware_protocol::conformance::Bench;
    use firmware_protocol::host::{Command, HostError, HostEvent};
    use firmware_protocol::messages::NakReason;

    let pins = SimulatedPins { emergency: Some(false), ..SimulatedPins::default() };
    let mut bench = Bench::new(SimulatedPi::new(pins));
    let settings = firmware_protocol::messages::Settings {
        window_ticks: 48_000,
        min_interval_ticks: 0,
        settle_ticks: 0,
        max_echoes: 1,
        blanking: firmware_protocol::messages::Blanking::Internal,
        speed: 800,
        acceleration: 40_000,
        hold_s: 0,
    };
    for command in [Command::Identify, Command::Configure(settings), Command::Home] {
        bench.perform(command, 20.0).expect("gets ready");
    }
    bench.start(Command::MoveTo { step: 1_000 }).expect("begins");
    bench.run(0.3).expect("moves");
    bench.device.0.pins.emergency = Some(true);
    bench.run(0.01).expect("stops");
    assert!(!bench.device.holds_coils());
    bench.run(0.5).expect("runs");
    let ended_it = |event: &HostEvent| {
        matches!(
            event,
            HostEvent::Failed(
                HostError::EmergencyStop | HostError::Rejected(NakReason::EmergencyStop)
            )
        )
    };
    assert!(bench.events().iter().any(ended_it), "{:?}", bench.events());
    let stopped_at = bench.device.motor_steps();
    assert!(bench.perform(Command::Home, 5.0).is_err(), "still pressed");
    bench.device.0.pins.emergency = Some(false);
    bench.run(0.1).expect("runs");
    bench.perform(Command::Home, 5.0).expect("homes");
    assert_eq!(bench.device.motor_steps(), stopped_at, "without an index, home is the position");
}
