//! Motor: steps counted at the pins, times compared with the trapezoid, index, brake.

use crate::common::{SETTINGS, ready, scripted};
use firmware_protocol::host::{Command, HostEvent, Outcome};
use firmware_protocol::messages::Settings;
use rand::{RngExt as _, SeedableRng as _};
use sonard_emulator::{HZ, ScriptedEnvironment};
use sonard_model::motion::Trapezoid;

const QUICK: Settings =
    Settings { speed: 4_000, acceleration: 200_000, settle_ticks: 0, ..SETTINGS };

#[test]
fn random_moves_are_exact() {
    let mut random = rand_pcg::Pcg64::seed_from_u64(4);
    let mut bench = ready(scripted(&[]), QUICK);
    let home = bench.device.steps();
    let mut step = 0_i32;
    let mut moved = 0;
    for number in 0..4_000 {
        let speed = [800, 2_000, 4_000, 10_000][number / 1_000];
        if number % 1_000 == 0 {
            bench.perform(Command::Configure(Settings { speed, ..QUICK }), 2.0).expect("set up");
        }
        bench.device.take_pulses();
        let target = step + random.random_range(-40..=40);
        bench.perform(Command::MoveTo { step: target }, 10.0).expect("moves");
        assert_eq!(bench.device.steps() - home, i64::from(target), "move {number}");
        let pulses = bench.device.take_pulses();
        assert_eq!(pulses.len() as u32, target.abs_diff(step), "move {number}");
        moved += pulses.len();
        step = target;
    }
    println!("4000 moves, {moved} steps");
    let events = bench.perform(Command::Status, 2.0).expect("answers");
    let status = events.iter().find_map(|event| match event {
        HostEvent::Done(Outcome::Status(status)) => Some(*status),
        _ => None,
    });
    assert_eq!(status.expect("a status").step, step);
}

/// Duration from rest to rest: the times before the first and after the last pulse are equal.
fn duration_s(pulses: &[u64], acceleration: u32) -> f64 {
    let rest_s = 1.0 / f64::from(acceleration).sqrt();
    (pulses[pulses.len() - 1] - pulses[0]) as f64 / HZ as f64 + 2.0 * rest_s
}

#[test]
fn pulses_are_trapezoidal() {
    for (speed, acceleration) in [(800, 40_000), (2_000, 10_000), (10_000, 200_000), (100, 500)] {
        let motion = Settings { speed, acceleration, ..QUICK };
        let mut bench = ready(scripted(&[]), motion);
        let mut at = 0;
        for steps in [1, 2, 3, 4, 5, 8, 17, 100, 399, -1, -2, -250] {
            bench.device.take_pulses();
            at += steps;
            bench.perform(Command::MoveTo { step: at }, 60.0).expect("moves");
            let pulses = bench.device.take_pulses();
            let took_s = duration_s(&pulses, acceleration);
            let expected_s = Trapezoid::new(steps, speed, acceleration).duration_s();
            let off = took_s / expected_s - 1.0;
            assert!(
                off.abs() < 0.02,
                "{speed} {acceleration} {steps}: {took_s} s, not {expected_s} s"
            );
            let shortest = pulses.windows(2).map(|pair| pair[1] - pair[0]).min().unwrap_or(HZ);
            let fastest = HZ as f64 / shortest as f64;
            assert!(fastest < 1.02 * f64::from(speed), "{speed} {acceleration} {steps}: {fastest}");
        }
    }
}

#[test]
fn stop_keeps_position() {
    let slow = Settings { speed: 1_000, acceleration: 5_000, ..SETTINGS };
    let mut bench = ready(scripted(&[]), slow);
    for wait_s in [0.001, 0.02, 0.1, 0.5] {
        bench.perform(Command::MoveTo { step: 0 }, 60.0).expect("moves");
        let home = bench.device.steps();
        bench.start(Command::MoveTo { step: 2_000 }).expect("begins");
        bench.run(wait_s).expect("runs");
        bench.start(Command::Stop).expect("begins");
        bench.run(1.0).expect("runs");
        let stopped_at = bench.device.steps() - home;
        let braking = 1_000 * 1_000 / (2 * 5_000) + 2;
        assert!(
            stopped_at <= (wait_s * 1_000.0) as i64 + braking,
            "{wait_s} s: {stopped_at} steps"
        );
        let events = bench.perform(Command::Status, 2.0).expect("answers");
        let reported = events.iter().find_map(|event| match event {
            HostEvent::Done(Outcome::Status(status)) => Some(status.step),
            _ => None,
        });
        assert_eq!(reported.map(i64::from), Some(stopped_at), "{wait_s} s");
    }
}

#[test]
fn homes_from_everywhere() {
    for start in [0, 1, 3, 4, 5, 57, 199, 200, 201, 396, 399, -1, -130] {
        let outside = ScriptedEnvironment { echoes: vec![], step: start };
        let mut bench = ready(outside, QUICK);
        let turned = bench.device.steps();
        assert_eq!((i64::from(start) + turned).rem_euclid(400), 0, "from {start}");
        assert!(turned.abs() <= 400, "from {start}: the cable was wound by {turned} steps");
        // The motor is turned by hand: the counter is at 50, the motor at 47.
        bench.perform(Command::MoveTo { step: 50 }, 10.0).expect("moves");
        bench.device.set_environment(Box::new(ScriptedEnvironment { echoes: vec![], step: 47 }));
        let events = bench.perform(Command::Home, 20.0).expect("homes");
        assert!(
            events.contains(&HostEvent::Done(Outcome::Homed { drift_steps: 3 })),
            "from {start}: {events:?}"
        );
    }
}
