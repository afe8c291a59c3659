//! Times of flight, accurate to the tick of 0.5 us.

use crate::common::{SETTINGS, readings, ready, scripted};
use firmware_protocol::host::Command;
use firmware_protocol::messages::{Blanking, ReadingStatus, Settings};
use sonard_emulator::{CYCLES_PER_TICK, HZ};

const MS: u64 = HZ / 1000;
/// Settings for echoes from 1 ms on: the internal blanking takes 2.38 ms.
const SHORT: Settings = Settings {
    window_ticks: 124_000,
    blanking: Blanking::Short { ticks: 1_000 },
    settle_ticks: 0,
    ..SETTINGS
};

#[test]
fn accurate_at_all_phases() {
    let mut bench = ready(scripted(&[]), SHORT);
    bench.device.take_init_rises();
    // Odd, so that the delays cover all eight phases of a tick.
    let stride = 301;
    let (mut pings, mut phases, mut worst) = (0, [0_u32; 8], 0.0_f64);
    let mut after = MS;
    while after <= 60 * MS {
        bench.device.set_environment(Box::new(scripted(&[after])));
        let events = bench.perform(Command::Ping, 2.0).expect("pings");
        let reading = readings(&events)[0];
        assert_eq!(reading.echoes.len(), 1, "{after} cycles: {reading:?}");
        let error = f64::from(reading.echoes[0]) - after as f64 / CYCLES_PER_TICK as f64;
        assert!(error.abs() <= 1.0, "{after} cycles: {error} ticks off");
        worst = worst.max(error.abs());
        let rises = bench.device.take_init_rises();
        assert_eq!(rises.len(), 1, "{after} cycles: one firing for a ping, {rises:?}");
        phases[(after % 8) as usize] += 1;
        pings += 1;
        after += stride;
    }
    println!("{pings} pings, at most {worst:.3} ticks off");
    assert!(pings >= 3_000);
    assert!(phases.iter().all(|&count| count > 300), "{phases:?}");
}

#[test]
fn firing_time_matches_init() {
    let mut bench = ready(scripted(&[5 * MS]), SETTINGS);
    bench.device.take_init_rises();
    let mut offsets = Vec::new();
    for _ in 0..50 {
        let events = bench.perform(Command::Ping, 2.0).expect("pings");
        let rise = bench.device.take_init_rises()[0];
        let ticks = (rise / CYCLES_PER_TICK) as u32;
        offsets.push(readings(&events)[0].fired_ticks.wrapping_sub(ticks) as i32);
        // Another value of the 16-bit counter each time, including wraps.
        bench.run(0.000_7 * f64::from(offsets.len() as u32)).expect("waits");
    }
    assert!(offsets.iter().all(|&offset| offset == offsets[0]), "{offsets:?}");
}

#[test]
fn fires_once_at_any_count() {
    // Near a wrap of the 16-bit counter a compare unit might match twice.
    let quick = Settings { window_ticks: 2_000, ..SHORT };
    let mut bench = ready(scripted(&[MS / 2 + 100]), quick);
    bench.device.take_init_rises();
    let mut near_wrap = 0;
    for _ in 0..2_000 {
        bench.perform(Command::Ping, 2.0).expect("pings");
        let rises = bench.device.take_init_rises();
        assert_eq!(rises.len(), 1);
        let place = rises[0] / CYCLES_PER_TICK % 65_536;
        near_wrap += u32::from(!(600..64_936).contains(&place));
    }
    assert!(near_wrap > 0, "no firing near the wrap");
}

#[test]
fn multiple_echoes_accurate() {
    let many = Settings { max_echoes: 8, ..SHORT };
    let mut bench = ready(scripted(&[]), many);
    let mut worst = 0.0_f64;
    for round in 0..200_u64 {
        // Further apart than the BLNK pulse, at varying phases.
        let echoes: Vec<u64> = (0..8)
            .map(|k| 2 * MS + round * 1_003 + k * (MS + 37 * round) + (round * k) % 8)
            .collect();
        bench.device.set_environment(Box::new(scripted(&echoes)));
        let events = bench.perform(Command::Ping, 2.0).expect("pings");
        let reading = readings(&events)[0];
        assert_eq!(reading.echoes.len(), 8, "{echoes:?}: {reading:?}");
        for (ticks, cycles) in reading.echoes.iter().zip(&echoes) {
            let error = f64::from(*ticks) - *cycles as f64 / CYCLES_PER_TICK as f64;
            worst = worst.max(error.abs());
            assert!(error.abs() <= 2.0, "{echoes:?}: {reading:?}");
        }
    }
    println!("several echoes: at most {worst:.3} ticks off");
}

#[test]
fn limits_echoes_and_window() {
    let two = Settings { max_echoes: 2, ..SETTINGS };
    let mut bench = ready(scripted(&[4 * MS, 6 * MS, 8 * MS]), two);
    let events = bench.perform(Command::Ping, 2.0).expect("pings");
    assert_eq!(readings(&events)[0].echoes[..], [8_000, 12_000]);
    // The window is 24 ms.
    bench.device.set_environment(Box::new(scripted(&[25 * MS])));
    let events = bench.perform(Command::Ping, 2.0).expect("pings");
    assert_eq!(readings(&events)[0].status, ReadingStatus::NoEcho);
}

#[test]
fn short_blanking() {
    let near = scripted(&[MS + MS / 2]);
    let mut bench = ready(near.clone(), SETTINGS);
    let events = bench.perform(Command::Ping, 2.0).expect("pings");
    assert_eq!(readings(&events)[0].status, ReadingStatus::NoEcho);
    let mut bench = ready(near, SHORT);
    let events = bench.perform(Command::Ping, 2.0).expect("pings");
    assert_eq!(readings(&events)[0].echoes[..], [3_000]);
}

#[test]
fn stuck_echo_is_module_fault() {
    let mut bench = ready(scripted(&[5 * MS]), SETTINGS);
    bench.device.take_init_rises();
    bench.device.stick_echo(true);
    let events = bench.perform(Command::Ping, 2.0).expect("reports a module fault");
    assert_eq!(readings(&events)[0].status, ReadingStatus::ModuleFault);
    assert!(bench.device.take_init_rises().is_empty());
    bench.device.stick_echo(false);
    let events = bench.perform(Command::Ping, 2.0).expect("pings");
    assert_eq!(readings(&events)[0].echoes[..], [10_000]);
}
