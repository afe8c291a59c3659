//! Limits of scene, array and device for what programs order or preview.

use firmware_protocol::messages::Identity;
use sonard_api::AirOrder;
use sonard_device::ranger::check_blanking;
use sonard_model::{
    acoustics::{Air, Sensor},
    array::RangerArray,
    geometry::Pose,
    scene::Scene,
};
use sonard_records::{PlanError, ScanPlan};

use super::refusal::{Refusal, RefusalKind};

/// Checks azimuths of a scan, by a device if one is connected.
///
/// # Errors
/// If they are none, the motor can't reach them, or an array is simulated, whose rangers are fixed.
pub fn check_plan(
    plan: &ScanPlan,
    of_array: bool,
    device: Option<&Identity>,
) -> Result<(), Refusal> {
    if of_array {
        return Err(Refusal {
            kind: RefusalKind::Conflict,
            message: "an array has no plan: its rangers are fixed".into(),
            help: "another array is simulate.array in the configuration".into(),
        });
    }
    let refuse = |error: PlanError| Refusal {
        kind: match error {
            PlanError::OffMotorGrid { .. } => RefusalKind::Conflict,
            _ => RefusalKind::Wrong,
        },
        message: error.to_string(),
        help: "a full turn is from_deg 0, to_deg 360, step_deg 0.9, pings_per_stop 1".into(),
    };
    plan.check().map_err(refuse)?;
    if let Some(device) = device {
        plan.motor_steps(device.steps_per_revolution.into()).map_err(refuse)?;
    }
    Ok(())
}

/// Checks a pose of the ranger, or of the robot with an array; without a scene any will do.
///
/// # Errors
/// If a figure is not finite, or the scene is in the way.
pub fn check_pose(
    pose: &Pose,
    scene: Option<&Scene>,
    array: Option<&RangerArray>,
) -> Result<(), Refusal> {
    let finite = [pose.x_m, pose.y_m, pose.heading_deg].iter().all(|figure| figure.is_finite());
    if !finite {
        return Err(Refusal {
            kind: RefusalKind::Wrong,
            message: "a figure of the pose is not finite".into(),
            help: "metres and degrees".into(),
        });
    }
    let Some(scene) = scene else { return Ok(()) };
    match array {
        Some(array) => {
            array.check_pose(scene, pose).map_err(|error| conflict(&error, error.help()))
        }
        None => scene.check_pose(pose).map_err(|error| conflict(&error, error.help())),
    }
}

/// The air of an order; humidity (percent) and pressure (kilopascals) stay if it leaves them out.
///
/// # Errors
/// If a figure is out of range.
pub fn ordered_air(
    order: &AirOrder,
    humidity_percent: f64,
    pressure_kpa: f64,
) -> Result<Air, Refusal> {
    let air = Air::new(
        order.temperature_c,
        order.humidity_percent.unwrap_or(humidity_percent),
        order.pressure_kpa.unwrap_or(pressure_kpa),
    );
    air.map_err(|error| Refusal {
        kind: RefusalKind::Wrong,
        message: error.to_string(),
        help: "temperatures are degrees Celsius, pressures kilopascals".into(),
    })
}

/// Checks that a device can keep the blanking of a sensor that is to take another's place.
///
/// # Errors
/// If it can't.
pub fn check_device(sensor: &Sensor, before: &Sensor, device: &Identity) -> Result<(), Refusal> {
    if sensor.blanking_us == before.blanking_us {
        return Ok(());
    }
    let kept = check_blanking(sensor.blanking_us, device);
    kept.map_err(|error| conflict(&error, "leave blanking_us as it is, or give more".into()))
}

fn conflict(error: &impl std::fmt::Display, help: String) -> Refusal {
    Refusal { kind: RefusalKind::Conflict, message: error.to_string(), help }
}
