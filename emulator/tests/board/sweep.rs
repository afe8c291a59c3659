//! Complete sweeps over the emulated line, with the real host machine.

use std::path::Path;
use std::sync::Arc;

use crate::common::{SETTINGS, readings, ready};
use firmware_protocol::host::Command;
use firmware_protocol::messages::{ReadingStatus, Settings, Sweep, limits::TICK_HZ};
use sonard_device::ranger::min_duration_s;
use sonard_mock::{EchoTable, World};
use sonard_model::{
    acoustics::{Air, Sensor, TofNoise},
    model::{Options, Simulator},
    scan_plan::ScanPlan,
    scene::Scene,
};

fn world() -> World {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/simple-room.json");
    let scene = Scene::from_json(&std::fs::read_to_string(path).expect("a scene")).expect("valid");
    let pose = scene.pose("fig9").expect("a pose");
    let sensor = Sensor::preset("senscomp-6500").expect("a sensor");
    let simulator = Simulator::new(
        Arc::new(scene.with_robot_at(&pose)),
        sensor,
        Air::default(),
        Options::default(),
    );
    let soundings =
        EchoTable::from_model(&simulator.expect("a model"), &pose, 400, 0.0).expect("few paths");
    World::new(soundings, TofNoise::NONE, 0.0, 1)
}

const PLAN: Sweep =
    Sweep { sweep: 1, first_step: 0, stride: 1, stops: 400, pings_per_stop: 1, lease_ms: 2_000 };

/// Settings for a range of four metres at 343.4 m/s, and a settling time of 5 ms.
const FOUR_METRES: Settings =
    Settings { window_ticks: 46_600, settle_ticks: 10_000, max_echoes: 3, ..SETTINGS };

#[test]
fn duration_is_near_minimum() {
    let mut bench = ready(world(), FOUR_METRES);
    bench.device.take_init_rises();
    let before = bench.bytes;
    let events = bench.perform(Command::Sweep(PLAN), 60.0).expect("sweeps");
    let mut readings = readings(&events);
    readings.sort_by_key(|reading| reading.index);
    assert_eq!(readings.len(), 400);
    assert_eq!(bench.device.take_init_rises().len(), 400, "one firing per beam");
    let (first, last) = (readings[0], readings[399]);
    let span = last.fired_ticks.wrapping_sub(first.fired_ticks) + FOUR_METRES.window_ticks;
    let duration_s = f64::from(span) / f64::from(TICK_HZ);
    let limit = min_duration_s(&ScanPlan::default(), &FOUR_METRES, 1);
    let (to_device, from_device) = (bench.bytes.0 - before.0, bench.bytes.1 - before.1);
    println!("{duration_s:.4} s, limit {limit:.4} s, ratio {:.4}", duration_s / limit);
    println!("{to_device} bytes to the device, {from_device} from it");
    assert!(duration_s <= 1.02 * limit, "{duration_s} s, limit {limit} s");
    assert!(duration_s >= limit, "{duration_s} s is less than the minimum of {limit} s");
}

#[test]
fn readings_match_world() {
    let mut bench = ready(world(), FOUR_METRES);
    let events = bench.perform(Command::Sweep(PLAN), 60.0).expect("sweeps");
    let mut world = world();
    let mut detected = 0;
    let mut readings = readings(&events);
    readings.sort_by_key(|reading| reading.index);
    for reading in readings {
        assert_eq!(reading.step, i32::from(reading.index));
        let expected = world.fire(FOUR_METRES.window_ticks, TICK_HZ);
        let first = expected.echo_ticks.first();
        assert_eq!(reading.echoes.is_empty(), first.is_none(), "{reading:?} {expected:?}");
        if let Some(first) = first {
            assert!(reading.echoes[0].abs_diff(*first) <= 1, "{reading:?} {expected:?}");
            assert_eq!(reading.status, ReadingStatus::Echo);
            detected += 1;
        }
        world.turn(1);
    }
    assert!(detected > 300, "{detected} beams with an echo");
}
