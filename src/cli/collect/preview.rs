//! How long a collection takes, before it begins.

use std::time::Duration;

use firmware_protocol::messages::{
    Capabilities, FirmwareVersion, Identity, PROTOCOL, ResetCause, limits::TICK_HZ,
};
use indicatif::HumanDuration;
use serde_json::json;

use super::{Args, load::Loaded, load::Poses};
use crate::{
    cli::Failure,
    link::BAUD,
    ranger::{Budget, Listening},
};

/// A reading's record with its prediction, and what a scan has besides, bytes: means of scans on the
/// mock in the shipped scenes.
const PING_BYTES: f64 = 540.0;
const SCAN_BYTES: f64 = 5_000.0;

/// The time of one scan with the plan's settings, by a device with every capability.
pub(super) fn budget(loaded: &Loaded) -> Result<Budget, Failure> {
    let steps_per_revolution = loaded.steps_per_revolution;
    let motor = loaded.plan.motor_steps(steps_per_revolution.into()).map_err(|error| {
        Failure::input(error, "give plan.from_deg and plan.step_deg on the motor's steps")
    })?;
    let air = loaded.air(loaded.keys.air.temperature_c)?;
    let listening = Listening {
        max_range_m: loaded.keys.sensor.max_range_m.unwrap_or(loaded.sensor.max_range_m),
        sound_speed_m_s: air.sound_speed_m_s(),
        blanking_us: loaded.sensor.blanking_us,
    };
    let settings = loaded.motion().settings(&listening, &assumed(steps_per_revolution));
    Ok(Budget::of(&loaded.plan, &settings, motor, BAUD))
}

/// Disk that so many scans take, bytes.
pub(super) fn disk_bytes(loaded: &Loaded, scans: u32) -> f64 {
    f64::from(scans) * (SCAN_BYTES + PING_BYTES * f64::from(loaded.plan.beams()))
}

/// The estimate as text, or as one JSON object.
pub(super) fn of(loaded: &Loaded, args: &Args) -> Result<String, Failure> {
    let scan = budget(loaded)?;
    let collection = &loaded.keys.collection;
    let poses = loaded.pose_count();
    let scans = poses.map(|poses| poses.saturating_mul(collection.repeats));
    let pauses_s = scans.map(|scans| f64::from(scans.saturating_sub(1)) * collection.pause_s);
    let people = loaded.keys.poses.confirm
        || !loaded.keys.ask.at_pose.is_empty()
        || matches!(loaded.poses, Poses::Prompt);
    if args.json {
        let split = |budget: &Budget| {
            json!({
                "acoustics_s": budget.acoustics_s,
                "motor_s": budget.motor_s,
                "link_s": budget.link_s,
            })
        };
        let all = scans.map(|scans| {
            let budget = scan.times(scans.into());
            let mut all = split(&budget);
            all["pauses_s"] = pauses_s.into();
            all["total_s"] = (budget.total_s() + pauses_s.unwrap_or(0.0)).into();
            all["disk_bytes"] = disk_bytes(loaded, scans).round().into();
            all
        });
        let mut one = split(&scan);
        one["total_s"] = scan.total_s().into();
        one["beams"] = loaded.plan.beams().into();
        let said = json!({
            "poses": poses, "repeats": collection.repeats, "scans": scans,
            "scan": one, "total": all, "waits_for_people": people,
        });
        return Ok(format!("{said}\n"));
    }
    let line = |name: &str, budget: &Budget| {
        format!(
            "{name:<12}{:>12} = {} acoustics + {} motor + {} link",
            seconds(budget.total_s()),
            seconds(budget.acoustics_s),
            seconds(budget.motor_s),
            seconds(budget.link_s),
        )
    };
    let mut lines = vec![line("one scan", &scan)];
    match scans {
        Some(scans) => {
            lines.push(line(&format!("{scans} scans"), &scan.times(scans.into())));
            let total_s = scan.times(scans.into()).total_s() + pauses_s.unwrap_or(0.0);
            if collection.pause_s > 0.0 {
                lines.push(format!("{:<12}{:>12}", "pauses", seconds(pauses_s.unwrap_or(0.0))));
            }
            lines.push(format!(
                "{:<12}{:>12} ({}), and some {:.1} MB of disk",
                "in all",
                seconds(total_s),
                human(total_s),
                disk_bytes(loaded, scans) / 1e6
            ));
        }
        None => lines.push("how many poses there will be is not known: set poses.count".into()),
    }
    if people {
        lines.push("not counted: how long people take to answer and to carry the ranger".into());
    }
    lines.push("not counted: retakes, and the time of the model at each new pose".into());
    Ok(lines.join("\n") + "\n")
}

pub(super) fn human(seconds: f64) -> HumanDuration {
    HumanDuration(Duration::from_secs_f64(seconds.clamp(0.0, 1e9)))
}

fn seconds(seconds: f64) -> String {
    if seconds < 100.0 { format!("{seconds:.2} s") } else { format!("{seconds:.0} s") }
}

/// A device that can do everything a plan may ask for.
fn assumed(steps_per_revolution: u16) -> Identity {
    Identity {
        protocol: PROTOCOL,
        firmware: FirmwareVersion { major: 0, minor: 0, patch: 0 },
        serial: [0; 10],
        boot: 1,
        last_seq: None,
        tick_hz: TICK_HZ,
        steps_per_revolution,
        capabilities: Capabilities::INDEX_SENSOR
            .with(Capabilities::SHORT_BLANKING)
            .with(Capabilities::MULTIPLE_ECHOES),
        ring_bytes: 0,
        reset_cause: ResetCause::PowerOn,
    }
}
