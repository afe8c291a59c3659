//! The board against the host machine, without a pty and in simulated time.

mod reply_faults;

use firmware_protocol::{
    host::{Command, Host, HostConfig, HostEvent},
    messages::{Blanking, Capabilities, Settings, Sweep, SweepState},
};
use sonard_model::{acoustics::TofNoise, model::Prediction};
use sonard_records::PingStatus;

use super::{BoardSettings, EchoTable, FaultPlan, MockBoard, Note, Pace, WakeKind, World};

const TICKS_PER_US: u64 = 2;

pub(super) fn board(faults: FaultPlan) -> MockBoard {
    let echo_us = |step: u32| 5_000.0 + f64::from(step);
    let predictions: Vec<Prediction> = (0..400)
        .map(|step| Prediction {
            status: PingStatus::Echo,
            range_m: Some(1.0),
            arrival: None,
            amplitude: None,
            margin_db: None,
            echoes_us: [echo_us(step)].into_iter().collect(),
            crosstalk: None,
        })
        .collect();
    let world = World::new(EchoTable::from_predictions(&predictions), TofNoise::NONE, 0.0, 1);
    let settings = BoardSettings {
        boot: 7,
        clock: u32::MAX - 1_000_000,
        steps_per_revolution: 400,
        faults,
        seed: 1,
        pace: Pace::Virtual,
        is_replay: false,
    };
    MockBoard::new(settings, world)
}

const SETTINGS: Settings = Settings {
    window_ticks: 46_512,
    min_interval_ticks: 0,
    settle_ticks: 10_000,
    max_echoes: 1,
    blanking: Blanking::Internal,
    speed: 800,
    acceleration: 40_000,
    hold_s: 0,
};

const SWEEP: Sweep =
    Sweep { sweep: 0, first_step: 0, stride: 1, stops: 400, pings_per_stop: 1, lease_ms: 2_000 };

/// Both machines on one simulated clock.
struct Bench {
    board: MockBoard,
    host: Host,
    start_ticks: u64,
    events: Vec<HostEvent>,
}

impl Bench {
    fn new(faults: FaultPlan) -> Self {
        let board = board(faults);
        let start_ticks = board.now();
        let host = Host::new(HostConfig::new(115_200, 3));
        Self { board, host, start_ticks, events: Vec::new() }
    }

    fn now_us(&self) -> u64 {
        (self.board.now() - self.start_ticks) / TICKS_PER_US
    }

    /// Runs a command to its end. The clock advances to the earlier timer of the two machines.
    fn run(&mut self, command: Command) {
        self.host.start(self.now_us(), command).expect("begins");
        self.exchange();
        while self.host.is_busy() {
            let host = self.host.poll_timeout();
            let host = host.map(|(_, at_us)| self.start_ticks + at_us * TICKS_PER_US);
            let board = self.board.next_wake().map(|wake| wake.at);
            let next = host.into_iter().chain(board).min().expect("a timer");
            self.board.advance(next.max(self.board.now()));
            let now_us = self.now_us();
            self.host.handle_timeout(now_us);
            self.exchange();
        }
    }

    fn exchange(&mut self) {
        let now_us = self.now_us();
        loop {
            let mut sent = Vec::new();
            self.board.poll_transmit(&mut sent);
            self.host.handle_bytes(now_us, &sent);
            let mut is_idle = sent.is_empty();
            while let Some(frame) = self.host.poll_transmit() {
                self.board.handle_bytes(&frame);
                is_idle = false;
            }
            self.events.extend(std::iter::from_fn(|| self.host.poll_event()));
            if is_idle {
                return;
            }
        }
    }
}

#[test]
fn sweep_duration_and_echoes() {
    let mut bench = Bench::new(FaultPlan::default());
    for command in [Command::Identify, Command::Configure(SETTINGS), Command::Home] {
        bench.run(command);
    }
    bench.run(Command::Sweep(SWEEP));
    let identity = bench.host.identity().expect("identified");
    assert!(identity.capabilities.has(Capabilities::SIMULATED.with(Capabilities::VIRTUAL_CLOCK)));
    let readings: Vec<_> = bench
        .events
        .iter()
        .filter_map(|event| match event {
            HostEvent::Reading { reading, .. } => Some(*reading),
            _ => None,
        })
        .collect();
    assert_eq!(readings.len(), 400);
    for reading in &readings {
        let expected = 10_000 + 2 * u32::from(reading.index);
        assert_eq!(reading.echoes[..], [expected], "{reading:?}");
    }
    let span = readings[399].fired_ticks.wrapping_sub(readings[0].fired_ticks);
    // 399 times: the window, a step of 10 ms and 5 ms of settling.
    let needed = 399.0 * (46_512.0 + 20_000.0 + 10_000.0);
    assert!((f64::from(span) / needed - 1.0).abs() < 0.002, "{span} ticks for {needed}");
    assert!(bench.board.take_notes().contains(&Note::Fired(400)));
}

#[test]
fn time_jumps_leave_half_the_lease() {
    let mut bench = Bench::new(FaultPlan::default());
    for command in [Command::Identify, Command::Configure(SETTINGS), Command::Home] {
        bench.run(command);
    }
    bench.host.start(bench.now_us(), Command::Sweep(SWEEP)).expect("begins");
    bench.exchange();
    let began = bench.board.now();
    // The host is not served any more; the board may jump by half of the lease at most.
    while let Some(wake) = bench.board.next_wake().filter(|wake| wake.kind == WakeKind::Work) {
        bench.board.advance(wake.at);
        bench.board.poll_transmit(&mut Vec::new());
    }
    let jumped_s = (bench.board.now() - began) as f64 / 2e6;
    assert!((0.5..=1.0).contains(&jumped_s), "{jumped_s} s of a lease of 2 s");
}

#[test]
fn restart_ends_the_sweep() {
    let mut bench = Bench::new("reset=0.05".parse().expect("a plan"));
    for command in [Command::Identify, Command::Configure(SETTINGS), Command::Home] {
        bench.run(command);
    }
    bench.run(Command::Sweep(SWEEP));
    assert!(bench.events.contains(&HostEvent::Rebooted { old: 7, new: 8 }), "{:?}", bench.events);
    let is_complete =
        |event: &HostEvent| matches!(event, HostEvent::SweepDone { end: SweepState::Complete, .. });
    assert!(!bench.events.iter().any(is_complete));
}

/// Conformance tests of all boards.
mod conformance {
    use std::convert::Infallible;

    use firmware_protocol::{conformance::DeviceUnderTest, conformance_tests};

    use super::*;

    impl DeviceUnderTest for MockBoard {
        type Error = Infallible;

        fn now_us(&self) -> u64 {
            self.now() / TICKS_PER_US
        }

        fn run(&mut self, us: u64) -> Result<(), Infallible> {
            self.advance(self.now() + us * TICKS_PER_US);
            Ok(())
        }

        fn send(&mut self, bytes: &[u8]) {
            self.handle_bytes(bytes);
        }

        fn receive(&mut self) -> Vec<u8> {
            let mut sent = Vec::new();
            self.poll_transmit(&mut sent);
            sent
        }

        fn set_echoes(&mut self, after_us: &[f64]) {
            let everywhere = Prediction {
                status: PingStatus::Echo,
                range_m: None,
                arrival: None,
                amplitude: None,
                margin_db: None,
                echoes_us: after_us.iter().copied().collect(),
                crosstalk: None,
            };
            self.world().set_echo_table(EchoTable::from_predictions(&[everywhere]));
        }

        fn take_firings(&mut self) -> usize {
            self.take_notes().iter().filter(|note| matches!(note, Note::Fired(_))).count()
        }

        fn motor_steps(&self) -> i64 {
            self.steps_from_index().into()
        }

        fn holds_coils(&self) -> bool {
            Self::holds_coils(self)
        }
    }

    conformance_tests!(board(FaultPlan::default()));
}
