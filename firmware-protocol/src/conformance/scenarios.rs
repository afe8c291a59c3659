//! Test scenarios, each on a bench of its own. They panic if the board violates the protocol.
#![expect(clippy::missing_panics_doc, reason = "panicking is what a test is for")]

extern crate std;

use std::vec::Vec;

use super::{
    Bench, BenchError, DeviceUnderTest,
    steps::{answer, assert_echoes, frame, identify, ping, readings, ready, replies, status},
};
use crate::host::{Command, HostError, HostEvent, Outcome};
use crate::messages::{
    Blanking, Capabilities, FaultKind, NakReason, ReadingStatus, Reply, Request, ResetCause,
    Settings, Sweep,
};

/// Settings with a window of 24 ms and a settling time of 2 ms.
pub const SETTINGS: Settings = Settings {
    window_ticks: 48_000,
    min_interval_ticks: 0,
    settle_ticks: 4_000,
    max_echoes: 1,
    blanking: Blanking::Internal,
    speed: 800,
    acceleration: 40_000,
    hold_s: 0,
};
const SWEEP: Sweep =
    Sweep { sweep: 1, first_step: 0, stride: 1, stops: 40, pings_per_stop: 1, lease_ms: 500 };
/// Time allowed for booting, s.
pub(super) const BOOT_S: f64 = 0.1;

/// The board sends its Identity after power-on, and again for each Identify.
pub fn announces_and_identifies(mut bench: Bench<impl DeviceUnderTest>) {
    bench.device.run(100_000).expect("boots");
    let announced = replies(&bench.device.receive());
    let [(_, Reply::Identity(identity))] = announced[..] else {
        panic!("announced {announced:?} instead of itself, once");
    };
    assert_ne!(identity.boot, 0);
    assert_eq!(identity.tick_hz, crate::messages::limits::TICK_HZ);
    assert!(identity.steps_per_revolution > 0);
    let sent_us = bench.device.now_us();
    bench.device.send(&frame(0, 0, &Request::Identify));
    bench.device.run(20_000).expect("runs");
    assert!(bench.device.now_us() - sent_us < 40_000);
    let answer = replies(&bench.device.receive());
    assert_eq!(answer.len(), 1, "{answer:?}");
    assert_eq!(answer[0].1, Reply::Identity(identity));
}

/// Configure is required before Ping and Home, and Home before MoveTo and Sweep.
pub fn enforces_command_order(mut bench: Bench<impl DeviceUnderTest>) {
    let boot = identify(&mut bench).boot;
    let query = |bench: &mut Bench<_>, seq, request| answer(bench, boot, seq, &request);
    let refused = |reason| Reply::Nak { reason };
    assert_eq!(query(&mut bench, 1, Request::Ping), refused(NakReason::NotConfigured));
    assert_eq!(query(&mut bench, 2, Request::Home), refused(NakReason::NotConfigured));
    assert_eq!(query(&mut bench, 3, Request::Configure(SETTINGS)), Reply::Ack);
    assert_eq!(query(&mut bench, 4, Request::MoveTo { step: 3 }), refused(NakReason::NotHomed));
    assert_eq!(query(&mut bench, 5, Request::Sweep(SWEEP)), refused(NakReason::NotHomed));
    assert_eq!(answer(&mut bench, boot.wrapping_add(1), 6, &Request::Ping), {
        refused(NakReason::WrongBoot)
    });
    assert_eq!(bench.device.take_firings(), 0);
    assert_eq!(bench.device.motor_steps(), 0);
}

/// Each limit is rejected with its own reason.
pub fn rejects_invalid_settings(mut bench: Bench<impl DeviceUnderTest>) {
    let boot = identify(&mut bench).boot;
    let wrong = [
        (Settings { window_ticks: 10, ..SETTINGS }, NakReason::WindowOutOfRange),
        (Settings { min_interval_ticks: u32::MAX, ..SETTINGS }, NakReason::IntervalOutOfRange),
        (Settings { settle_ticks: u32::MAX, ..SETTINGS }, NakReason::SettleOutOfRange),
        (Settings { max_echoes: 0, ..SETTINGS }, NakReason::EchoesOutOfRange),
        (
            Settings { blanking: Blanking::Short { ticks: 1 }, ..SETTINGS },
            NakReason::BlankingOutOfRange,
        ),
        (Settings { speed: 0, ..SETTINGS }, NakReason::SpeedOutOfRange),
        (Settings { acceleration: 0, ..SETTINGS }, NakReason::AccelerationOutOfRange),
        (Settings { hold_s: u16::MAX, ..SETTINGS }, NakReason::HoldOutOfRange),
    ];
    for (seq, (settings, reason)) in (1..).zip(wrong) {
        let reply = answer(&mut bench, boot, seq, &Request::Configure(settings));
        assert_eq!(reply, Reply::Nak { reason }, "{settings:?}");
    }
    let reply = answer(&mut bench, boot, 20, &Request::Ping);
    assert_eq!(
        reply,
        Reply::Nak { reason: NakReason::NotConfigured },
        "none of the settings was accepted"
    );
}

/// Times of flight over the whole range of the module.
pub fn times_echo_from_init(mut bench: Bench<impl DeviceUnderTest>) {
    ready(&mut bench, SETTINGS);
    bench.device.take_firings();
    for tenth in 26..200_u32 {
        let after_us = f64::from(tenth) * 101.3;
        bench.device.set_echoes(&[after_us]);
        let reading = ping(&mut bench);
        assert_eq!(reading.status, ReadingStatus::Echo, "{after_us} us");
        assert_echoes(&bench, &reading, &[after_us]);
    }
    assert_eq!(bench.device.take_firings(), 174, "one firing for each ping");
}

/// Up to eight echoes are reported in order; other boards reject more than one.
pub fn reports_multiple_echoes(mut bench: Bench<impl DeviceUnderTest>) {
    let capabilities = ready(&mut bench, SETTINGS).capabilities;
    let multiple = Command::Configure(Settings { max_echoes: 4, ..SETTINGS });
    if !capabilities.has(Capabilities::MULTIPLE_ECHOES) {
        let refused = bench.perform(multiple, 2.0).expect_err("is refused");
        let reason = NakReason::EchoesOutOfRange;
        assert!(
            matches!(refused, BenchError::Host(HostError::Rejected(actual)) if actual == reason)
        );
        return;
    }
    bench.perform(multiple, 2.0).expect("is set");
    let echoes = [4_000.0, 6_500.5, 9_000.0, 15_000.5, 20_000.0];
    bench.device.set_echoes(&echoes);
    let reading = ping(&mut bench);
    assert_echoes(&bench, &reading, &echoes[..4]);
}

/// An echo after the window, or none at all, is reported as no echo.
pub fn ignores_echo_after_window(mut bench: Bench<impl DeviceUnderTest>) {
    ready(&mut bench, SETTINGS);
    for echoes in [&[25_000.0][..], &[]] {
        bench.device.set_echoes(echoes);
        let reading = ping(&mut bench);
        assert_eq!((reading.status, reading.echoes.len()), (ReadingStatus::NoEcho, 0));
    }
}

/// Moves in both directions, short and long.
pub fn moves_exact_steps(mut bench: Bench<impl DeviceUnderTest>) {
    ready(&mut bench, SETTINGS);
    let home = bench.device.motor_steps();
    for step in [1, 0, -1, 2, 400, 399, -250, 17, 1_000, 0] {
        let events = bench.perform(Command::MoveTo { step }, 20.0).expect("moves");
        assert!(events.contains(&HostEvent::Done(Outcome::Moved { step })), "{events:?}");
        assert_eq!(bench.device.motor_steps() - home, i64::from(step));
        assert_eq!(status(&mut bench).step, step);
        assert!(bench.device.holds_coils());
    }
}

/// A sweep with two pings at each stop.
pub fn sweep_fires_each_beam_once(mut bench: Bench<impl DeviceUnderTest>) {
    ready(&mut bench, SETTINGS);
    bench.device.set_echoes(&[5_000.0]);
    bench.device.take_firings();
    let home = bench.device.motor_steps();
    let plan = Sweep { first_step: 10, stride: -3, stops: 12, pings_per_stop: 2, ..SWEEP };
    let events = bench.perform(Command::Sweep(plan), 20.0).expect("sweeps");
    let mut readings = readings(&events);
    readings.sort_by_key(|reading| reading.index);
    assert_eq!(readings.len(), 24);
    for (index, reading) in (0..).zip(&readings) {
        assert_eq!(reading.index, index);
        assert_eq!(reading.step, 10 - 3 * i32::from(index / 2));
        assert_echoes(&bench, reading, &[5_000.0]);
    }
    assert_eq!(bench.device.take_firings(), 24);
    assert_eq!(bench.device.motor_steps() - home, 10 - 33);
    let span = readings[23].fired_ticks.wrapping_sub(readings[0].fired_ticks);
    // 23 windows, 11 moves of three steps and 11 settling times; nothing else may take long.
    assert!((1_150_000..2_600_000).contains(&span), "{span} ticks");
}

/// The reply to a Ping is lost, and the host repeats the request with the same bytes.
pub fn repeated_request_runs_once(mut bench: Bench<impl DeviceUnderTest>) {
    let boot = identify(&mut bench).boot;
    assert_eq!(answer(&mut bench, boot, 1, &Request::Configure(SETTINGS)), Reply::Ack);
    bench.device.take_firings();
    let request = frame(boot, 2, &Request::Ping);
    bench.device.send(&request);
    bench.device.run(60_000).expect("pings");
    let first = replies(&bench.device.receive());
    bench.device.send(&request);
    bench.device.run(60_000).expect("runs");
    let again = replies(&bench.device.receive());
    let reading = |replies: &[(u16, Reply)]| {
        replies.iter().find_map(|(_, reply)| match reply {
            Reply::Reading(reading) => Some(*reading),
            _ => None,
        })
    };
    assert!(reading(&first).is_some(), "{first:?}");
    assert_eq!(reading(&first), reading(&again));
    assert_eq!(bench.device.take_firings(), 1);
}

/// A sequence number belongs to the first request that used it.
pub fn rejects_reused_sequence(mut bench: Bench<impl DeviceUnderTest>) {
    let boot = identify(&mut bench).boot;
    assert_eq!(answer(&mut bench, boot, 1, &Request::Configure(SETTINGS)), Reply::Ack);
    let reply = answer(&mut bench, boot, 1, &Request::Ping);
    assert_eq!(reply, Reply::Nak { reason: NakReason::SequenceReused });
    assert_eq!(bench.device.take_firings(), 0);
}

/// Truncated frames, altered frames, and too many bytes without a delimiter.
pub fn recovers_after_noise(mut bench: Bench<impl DeviceUnderTest>) {
    let boot = identify(&mut bench).boot;
    let right = frame(boot, 1, &Request::Configure(SETTINGS));
    let mut changed = right.clone();
    changed[5] ^= 0x10;
    let noises = [&right[..7], &changed[..], &[0xaa; 200], &[0; 40], &[1, 0, 2, 0, 0xff, 0]];
    for (seq, noise) in (10..).zip(noises) {
        bench.device.send(noise);
        bench.device.run(40_000).expect("runs");
        // Terminates the incomplete frame.
        bench.device.send(&[0]);
        bench.device.run(5_000).expect("runs");
        bench.device.receive();
        let reply = answer(&mut bench, boot, seq, &Request::Status);
        assert!(matches!(reply, Reply::StatusReport(_)), "{reply:?}");
        let Reply::StatusReport(status) = reply else { continue };
        assert!(!status.configured, "noise must not be read as a request");
    }
    // The host machine continues the numbering.
    identify(&mut bench);
    let status = status(&mut bench);
    let damaged = status.dropped_checksum + status.dropped_stuffing;
    let flooded = status.dropped_too_long + status.dropped_line;
    assert!(damaged >= 3 && flooded >= 1, "{status:?}");
}

/// The host receives nothing for a while, and the device holds when its ring is full.
pub fn resends_lost_readings(mut bench: Bench<impl DeviceUnderTest>) {
    ready(&mut bench, SETTINGS);
    bench.device.set_echoes(&[5_000.0]);
    bench.device.take_firings();
    bench.start(Command::Sweep(Sweep { lease_ms: 5_000, ..SWEEP })).expect("begins");
    bench.run(0.1).expect("sweeps");
    for _ in 0..4_000 {
        bench.device.run(500).expect("runs");
        drop(bench.device.receive());
    }
    bench.run(5.0).expect("sweeps");
    let events = bench.take_events().expect("comes to its end");
    let mut indices: Vec<u16> = readings(&events).iter().map(|reading| reading.index).collect();
    indices.sort_unstable();
    assert_eq!(indices, (0..SWEEP.stops).collect::<Vec<_>>());
    let repaired = |event: &&HostEvent| matches!(event, HostEvent::Reading { repaired: true, .. });
    assert!(events.iter().filter(repaired).count() > 5, "no reading was resent");
    assert_eq!(bench.device.take_firings(), usize::from(SWEEP.stops));
}

/// After the lease there is neither firing nor current.
pub fn lease_stops_firing(mut bench: Bench<impl DeviceUnderTest>) {
    ready(&mut bench, SETTINGS);
    bench.start(Command::Sweep(Sweep { stops: 2_000, ..SWEEP })).expect("begins");
    bench.run(0.3).expect("sweeps");
    bench.alive = false;
    bench.run(0.4).expect("runs");
    assert!(bench.device.take_firings() > 5, "fires until the lease expires");
    bench.run(0.11).expect("runs");
    bench.device.take_firings();
    bench.run(1.0).expect("runs");
    assert_eq!(bench.device.take_firings(), 0);
    assert!(!bench.device.holds_coils());
    bench.alive = true;
    bench.run(1.0).expect("runs");
    assert!(bench.events().contains(&HostEvent::Failed(HostError::LeaseExpired)));
    let status = status(&mut bench);
    assert_eq!((status.fault, status.homed), (Some(FaultKind::LeaseExpired), false));
}

/// Stop during a move and during a sweep: the motor comes to rest at a known position.
pub fn stop_keeps_position(mut bench: Bench<impl DeviceUnderTest>) {
    ready(&mut bench, SETTINGS);
    let home = bench.device.motor_steps();
    bench.start(Command::MoveTo { step: 3_000 }).expect("begins");
    bench.run(0.5).expect("moves");
    bench.start(Command::Stop).expect("begins");
    bench.run(1.0).expect("stops");
    let stopped_at = bench.device.motor_steps() - home;
    assert!((100..1_000).contains(&stopped_at), "{stopped_at} steps");
    let report = status(&mut bench);
    assert_eq!((i64::from(report.step), report.homed), (stopped_at, true));
    bench.start(Command::Sweep(SWEEP)).expect("begins");
    bench.run(1.0).expect("sweeps");
    bench.start(Command::Stop).expect("begins");
    bench.run(0.5).expect("stops");
    bench.device.take_firings();
    bench.run(0.5).expect("runs");
    assert_eq!(bench.device.take_firings(), 0);
    assert_eq!(i64::from(status(&mut bench).step), bench.device.motor_steps() - home);
}

/// After the hold time an idle motor carries no current.
pub fn releases_idle_coils(mut bench: Bench<impl DeviceUnderTest>) {
    ready(&mut bench, Settings { hold_s: 1, ..SETTINGS });
    bench.run(0.8).expect("runs");
    assert!(bench.device.holds_coils());
    bench.run(0.4).expect("runs");
    assert!(!bench.device.holds_coils());
    assert_eq!(status(&mut bench).fault, Some(FaultKind::HoldExpired));
}

/// Reset is acknowledged, then clears the whole state.
pub fn reset_clears_state(mut bench: Bench<impl DeviceUnderTest>) {
    let before = ready(&mut bench, SETTINGS);
    bench.perform(Command::Reset, 5.0).expect("restarts");
    let after = identify(&mut bench);
    assert_ne!(after.boot, before.boot);
    assert_eq!(after.reset_cause, ResetCause::Requested);
    let status = status(&mut bench);
    assert!(!status.configured && !status.homed);
    assert!(!bench.device.holds_coils());
    ready(&mut bench, SETTINGS);
    bench.device.set_echoes(&[5_000.0]);
    let reading = ping(&mut bench);
    assert_echoes(&bench, &reading, &[5_000.0]);
}
