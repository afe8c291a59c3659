//! Environment of the chip: a motor with limits, and supply dips.

use crate::common::{SETTINGS, readings, ready, scripted};
use firmware_protocol::host::{Command, HostError, HostEvent, Outcome};
use firmware_protocol::messages::{ResetCause, Settings, Sweep};
use sonard_emulator::{Bench, BenchError, HZ, MotorLimits};

const MS: u64 = HZ / 1000;

/// Drift in steps measured by homing after nearly three revolutions with the given profile.
fn drift_after_move(speed: u16, acceleration: u32) -> i32 {
    let mut bench = ready(scripted(&[]), Settings { speed, acceleration, ..SETTINGS });
    bench.device.set_motor(Some(MotorLimits::typical()));
    bench.perform(Command::MoveTo { step: 1_150 }, 20.0).expect("reports the target");
    // Slowly, so that the search itself misses no steps.
    bench.perform(Command::Configure(SETTINGS), 2.0).expect("is set");
    let events = bench.perform(Command::Home, 20.0).expect("homes");
    let drift = events.iter().find_map(|event| match event {
        HostEvent::Done(Outcome::Homed { drift_steps }) => Some(*drift_steps),
        _ => None,
    });
    drift.expect("a drift")
}

#[test]
fn drift_beyond_torque() {
    for (speed, acceleration) in [(800, 40_000), (2_000, 40_000), (4_000, 20_000)] {
        assert_eq!(drift_after_move(speed, acceleration), 0, "{speed} {acceleration}");
    }
    for (speed, acceleration) in [(6_000, 150_000), (10_000, 200_000)] {
        let drift = drift_after_move(speed, acceleration);
        assert_ne!(drift, 0, "{speed} {acceleration}");
        assert_eq!(drift % 4, 0, "{speed} {acceleration}: {drift}");
    }
}

#[test]
fn runs_are_deterministic() {
    assert_eq!(drift_after_move(10_000, 200_000), drift_after_move(10_000, 200_000));
}

fn cause(bench: &mut Bench) -> ResetCause {
    bench.perform(Command::Identify, 5.0).expect("answers");
    bench.host.identity().expect("known").reset_cause
}

#[test]
fn dip_restarts_with_cause() {
    for milliseconds in [1, 20, 700] {
        let mut bench = ready(scripted(&[5 * MS]), SETTINGS);
        let old = bench.host.identity().expect("known").boot;
        let plan = Sweep {
            sweep: 1,
            first_step: 0,
            stride: 1,
            stops: 400,
            pings_per_stop: 1,
            lease_ms: 2_000,
        };
        bench.start(Command::Sweep(plan)).expect("begins");
        bench.run(1.0).expect("sweeps");
        assert!(readings(bench.events()).len() > 10);
        let before_us = bench.device.now_us();
        bench.device.dip(milliseconds);
        assert_eq!(bench.device.now_us() - before_us, milliseconds * 1_000);
        assert!(!bench.device.is_firing() && !bench.device.holds_coils());
        bench.run(4.0).expect("runs");
        assert_eq!(bench.take_events(), Err(BenchError::Host(HostError::Rebooted)));
        assert_eq!(cause(&mut bench), ResetCause::BrownOut);
        assert_ne!(bench.host.identity().expect("known").boot, old);
        for command in [Command::Configure(SETTINGS), Command::Home, Command::Ping] {
            bench.perform(command, 20.0).expect("continues");
        }
    }
}
