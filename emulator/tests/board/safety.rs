//! Behaviour on faults of the line, the host and the chip.

use crate::common::{SETTINGS, readings, ready, scripted};
use firmware_protocol::host::{Command, HostError, HostEvent, Outcome};
use firmware_protocol::messages::{FaultKind, ResetCause, Settings, Status, Sweep};
use rand::{Rng as _, RngExt as _, SeedableRng as _};
use sonard_emulator::{Bench, BenchError, HZ, Reset};

const MS: u64 = HZ / 1000;
const LEASE_MS: u16 = 500;
const LONG: Sweep = Sweep {
    sweep: 1,
    first_step: 0,
    stride: 1,
    stops: 2_000,
    pings_per_stop: 1,
    lease_ms: LEASE_MS,
};

/// Bench in the middle of a sweep.
fn sweeping() -> Bench {
    let mut bench = ready(scripted(&[5 * MS]), SETTINGS);
    bench.start(Command::Sweep(LONG)).expect("begins");
    bench.run(1.0).expect("sweeps");
    assert!(readings(bench.events()).len() > 10);
    bench
}

/// Asserts that from now on there is neither firing nor coil current.
fn assert_safe(bench: &mut Bench) {
    assert!(!bench.device.is_firing());
    assert!(!bench.device.holds_coils());
    bench.device.take_init_rises();
    bench.device.take_pulses();
    bench.device.run(HZ).expect("runs");
    assert!(bench.device.take_init_rises().is_empty());
    assert!(bench.device.take_pulses().is_empty());
    assert!(!bench.device.holds_coils());
}

fn status(bench: &mut Bench) -> Status {
    let events = bench.perform(Command::Status, 2.0).expect("answers");
    let found = events.iter().find_map(|event| match event {
        HostEvent::Done(Outcome::Status(status)) => Some(*status),
        _ => None,
    });
    found.expect("a status")
}

fn reset_cause(bench: &mut Bench) -> ResetCause {
    let events = bench.perform(Command::Identify, 5.0).expect("answers");
    let found = events.iter().find_map(|event| match event {
        HostEvent::Identified(identity) => Some(identity.reset_cause),
        _ => None,
    });
    found.expect("an identity")
}

#[test]
fn survives_a_minute_of_noise() {
    let mut random = rand_pcg::Pcg64::seed_from_u64(9);
    let mut bench = ready(scripted(&[5 * MS]), SETTINGS);
    // A frame to damage: a request of the host, captured from the line.
    bench.host.start(bench.device.now_us(), Command::Status).expect("begins");
    let frame = bench.host.poll_transmit().expect("a frame").to_vec();
    bench.device.send(&frame);
    bench.run(0.1).expect("answers");
    bench.take_events().expect("answered");
    for second in 0..60 {
        let mut bytes = Vec::new();
        while bytes.len() < 10_000 {
            match (second + random.random_range(0..6)) % 6 {
                // Random bytes, with and without delimiters.
                0 => bytes.extend((0..200).map(|_| random.random::<u8>())),
                1 => bytes.extend((0..300).map(|_| random.random_range(1..=255_u8))),
                2 => bytes.extend([0; 50]),
                // A valid frame, truncated, altered, and repeated unchanged.
                3 => bytes.extend(&frame[..random.random_range(0..frame.len())]),
                4 => {
                    let mut changed = frame.clone();
                    let at = random.random_range(0..changed.len());
                    changed[at] ^= 1 << random.random_range(0..8);
                    bytes.extend(changed);
                }
                _ => bytes.extend(frame.repeat(10)),
            }
        }
        bytes.truncate(10_000);
        bench.device.send(&bytes);
        while bench.device.unsent() > 0 {
            bench.device.run(MS).expect("never crashes");
            bench.device.received();
        }
        assert!(bench.device.take_init_rises().is_empty(), "noise fired it");
        if second % 10 == 9 {
            // A frame of noise may still be incomplete: it is terminated first, so the next frame
            // is valid.
            bench.device.send(&[0]);
            bench.device.run(10 * MS).expect("runs");
            bench.device.received();
            let before = bench.device.now_us();
            bench.perform(Command::Identify, 1.0).expect("answers");
            let took_us = bench.device.now_us() - before;
            assert!(took_us < 20_000, "answered Identify after {took_us} us");
        }
    }
    let events = bench.perform(Command::Ping, 2.0).expect("pings");
    assert_eq!(readings(&events)[0].echoes[..], [10_000]);
}

#[test]
fn sweep_survives_noise() {
    let mut bench = ready(scripted(&[5 * MS]), SETTINGS);
    let mut random = rand_pcg::Pcg64::seed_from_u64(2);
    bench.start(Command::Sweep(Sweep { stops: 100, ..LONG })).expect("begins");
    for _ in 0..200 {
        bench.run(0.1).expect("runs");
        let mut noise = [0; 20];
        random.fill_bytes(&mut noise);
        bench.device.send(&noise);
        if !bench.host.is_busy() {
            break;
        }
    }
    let events = bench.take_events().expect("comes to its end");
    assert_eq!(readings(&events).len(), 100);
}

#[test]
fn lease_stops_firing() {
    let mut bench = sweeping();
    bench.device.take_init_rises();
    let died = bench.device.cycle();
    bench.alive = false;
    bench.run(2.0).expect("runs");
    let last =
        bench.device.take_init_rises().last().copied().expect("fires until the lease expires");
    let lease = u64::from(LEASE_MS) * MS;
    assert!(last > died && last - died <= lease, "{} ms", (last - died) / MS);
    assert_safe(&mut bench);
    bench.alive = true;
    bench.run(1.0).expect("runs");
    assert!(bench.events().contains(&HostEvent::Failed(HostError::LeaseExpired)));
    assert_eq!(status(&mut bench).fault, Some(FaultKind::LeaseExpired));
}

#[test]
fn detects_reset_during_sweep() {
    for (cause, reported) in
        [(Reset::External, ResetCause::External), (Reset::BrownOut, ResetCause::BrownOut)]
    {
        let mut bench = sweeping();
        let old = bench.host.identity().expect("known").boot;
        bench.device.reset(cause);
        assert!(!bench.device.is_firing() && !bench.device.holds_coils());
        bench.run(3.0).expect("runs");
        let new = old + 1;
        assert!(bench.events().contains(&HostEvent::Rebooted { old, new }), "{cause:?}");
        assert_eq!(bench.take_events(), Err(BenchError::Host(HostError::Rebooted)));
        assert_eq!(reset_cause(&mut bench), reported);
        for command in [Command::Configure(SETTINGS), Command::Home, Command::Ping] {
            bench.perform(command, 20.0).expect("continues");
        }
    }
}

#[test]
fn watchdog_restarts_hang() {
    let mut bench = sweeping();
    bench.device.hang();
    bench.alive = false;
    bench.device.run(HZ * 6 / 10).expect("runs");
    assert_safe(&mut bench);
    bench.alive = true;
    bench.run(3.0).expect("runs");
    assert_eq!(bench.take_events(), Err(BenchError::Host(HostError::Rebooted)));
    assert_eq!(reset_cause(&mut bench), ResetCause::Watchdog);
}

#[test]
fn boot_numbers_are_unique() {
    let mut bench = ready(scripted(&[]), SETTINGS);
    let mut boots = vec![bench.host.identity().expect("known").boot];
    for _ in 0..40 {
        bench.perform(Command::Reset, 5.0).expect("restarts");
        assert_eq!(reset_cause(&mut bench), ResetCause::Requested);
        boots.push(bench.host.identity().expect("known").boot);
    }
    assert!(boots.windows(2).all(|pair| pair[1] == pair[0] + 1), "{boots:?}");
}

#[test]
fn emergency_stop() {
    for wait_s in [0.0, 0.003, 0.013, 0.017, 0.023] {
        let mut bench = sweeping();
        bench.run(wait_s).expect("runs");
        bench.device.press_emergency(true);
        bench.device.run(MS).expect("runs");
        assert_safe(&mut bench);
        bench.run(1.0).expect("runs");
        assert!(bench.events().contains(&HostEvent::Failed(HostError::EmergencyStop)));
        let again = bench.perform(Command::Home, 5.0);
        assert!(again.is_err(), "still pressed: {again:?}");
        assert_safe(&mut bench);
        bench.device.press_emergency(false);
        bench.run(0.2).expect("runs");
        bench.perform(Command::Home, 20.0).expect("homes");
        bench.perform(Command::Ping, 2.0).expect("pings");
    }
}

#[test]
fn releases_idle_coils() {
    let mut bench = ready(scripted(&[]), Settings { hold_s: 2, ..SETTINGS });
    bench.run(1.5).expect("runs");
    assert!(bench.device.holds_coils());
    bench.run(1.0).expect("runs");
    assert_safe(&mut bench);
    assert_eq!(status(&mut bench).fault, Some(FaultKind::HoldExpired));
}
