//! Replay of a log by the mock.

use std::path::Path;

use crate::{
    acoustics::Sensor,
    cli::{Failure, logs::for_each_scan, mock_world::MockWorldArgs},
    mock::{MockBoard, Replay, ReplayError},
    scan::{ScanView, text::format_count},
};

/// Difference of an azimuth from its motor step that is reported, degrees.
const REPORTED_DEG: f64 = 0.01;

/// Creates the board that replays a log, and prints the scan that reads all of it.
pub(super) fn board(log: &Path, world: &MockWorldArgs) -> Result<MockBoard, Failure> {
    let mut scans = Vec::new();
    for_each_scan(log, |scan| {
        scans.push(scan);
        Ok(())
    })?;
    let replay = Replay::from_scans(&scans).map_err(|error| failure_from(log, &error))?;
    let (steps, deviation_deg) = (replay.steps_per_revolution(), replay.max_deviation_deg());
    print_line!(
        "{}: {}, on a motor with {steps} steps per revolution",
        log.display(),
        format_count(replay.scans(), "scan")
    );
    if deviation_deg > REPORTED_DEG {
        print_line!(
            "warning: azimuths of the log are up to {deviation_deg:.3} degrees off the motor's steps"
        );
    }
    if let Some(command) = scans.first().and_then(|scan| scan_command(scan, steps)) {
        print_line!("read it with: {command}");
    }
    Ok(world.replaying_board(replay))
}

/// Command that takes the log's first scan again, up to the port and the output.
fn scan_command(scan: &ScanView, steps: u16) -> Option<String> {
    let (session, start) = (scan.session.as_deref()?, scan.start.as_ref()?);
    let scene = match &session.scene {
        Some(scene) => scene.name.as_str(),
        None => "SCENE",
    };
    let motor_step_deg = 360.0 / f64::from(steps);
    let is_on_steps = |angle_deg: f64| {
        let place = angle_deg / motor_step_deg;
        (place - place.round()).abs() < 1e-6
    };
    let plan = &start.plan;
    let plan =
        match plan.check().is_ok() && is_on_steps(plan.from_deg) && is_on_steps(plan.step_deg) {
            true => *plan,
            false => crate::scan::ScanPlan { step_deg: motor_step_deg, ..Default::default() },
        };
    let mut command = format!(
        "sonard scan --port PORT --scene {scene} --pose {},{},{}",
        start.pose.x_m, start.pose.y_m, start.pose.heading_deg
    );
    let defaults = crate::scan::ScanPlan::default();
    for (option, value, default) in [
        ("from-deg", plan.from_deg, defaults.from_deg),
        ("to-deg", plan.to_deg, defaults.to_deg),
        ("step-deg", plan.step_deg, defaults.step_deg),
    ] {
        if (value - default).abs() > 1e-12 {
            command += &format!(" --{option} {value}");
        }
    }
    if plan.pings_per_stop > 1 {
        command += &format!(" --pings-per-stop {}", plan.pings_per_stop);
    }
    let sensor = &session.sensor;
    if Sensor::preset(&sensor.name).is_ok_and(|preset| preset.name != "senscomp-6500") {
        command += &format!(" --sensor {}", sensor.name);
    }
    let air = start.air.as_ref().map_or(session.air.sound_speed_m_s, |air| air.sound_speed_m_s);
    Some(format!("{command} --sound-speed {air} --out DIR"))
}

fn failure_from(log: &Path, error: &ReplayError) -> Failure {
    let help = match error {
        ReplayError::Empty => "give a log with at least one scan",
        ReplayError::OfArray(_) => {
            "give a log of a ranger on a stepper; `sonard run --simulate` has arrays"
        }
        ReplayError::Moving(_) => "give a log of scans that are each taken at one pose",
        ReplayError::NoSession(_) => "`sonard log verify` lists what is missing in the log",
        ReplayError::TooLong => "split the log at its sessions or scans",
    };
    Failure::input(format!("{}: {error}", log.display()), help)
}
