//! Checks of ordered and previewed settings against scene, array and device.

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

use super::order_error::{Refusal, RefusalKind};

/// Checks the azimuths of a scan, also against the motor if a device is connected.
///
/// # Errors
/// If the plan is invalid, the motor can't reach its azimuths, or an array is simulated, whose
/// rangers are fixed.
pub fn check_plan(
    plan: &ScanPlan,
    of_array: bool,
    device: Option<&Identity>,
) -> Result<(), Refusal> {
    if of_array {
        return Err(Refusal {
            kind: RefusalKind::Conflict,
            message: "an array has no plan: its rangers are fixed".into(),
            help: "to change them, set simulate.array in the configuration".into(),
        });
    }
    let reject = |error: PlanError| Refusal {
        kind: match error {
            PlanError::OffMotorGrid { .. } => RefusalKind::Conflict,
            _ => RefusalKind::Wrong,
        },
        message: error.to_string(),
        help: "a full revolution is from_deg 0, to_deg 360, step_deg 0.9, pings_per_stop 1".into(),
    };
    plan.check().map_err(reject)?;
    if let Some(device) = device {
        plan.motor_steps(device.steps_per_revolution.into()).map_err(reject)?;
    }
    Ok(())
}

/// Checks a pose of the ranger, or of the robot with an array. Without a scene any finite pose is
/// valid.
///
/// # Errors
/// If a value is not finite, or the pose is inside an obstacle or outside the scene.
pub fn check_pose(
    pose: &Pose,
    scene: Option<&Scene>,
    array: Option<&RangerArray>,
) -> Result<(), Refusal> {
    let is_finite = [pose.x_m, pose.y_m, pose.heading_deg].iter().all(|value| value.is_finite());
    if !is_finite {
        return Err(Refusal {
            kind: RefusalKind::Wrong,
            message: "the pose has a value that is not finite".into(),
            help: "give x_m and y_m in metres, heading_deg in degrees".into(),
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

/// Air of an order. The given humidity and pressure apply where the order omits them.
///
/// # Errors
/// If a value is out of range.
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

/// Checks that a device supports the blanking of a sensor that replaces the one in `before`.
///
/// # Errors
/// If the blanking is shorter than the device supports.
pub fn check_device(sensor: &Sensor, before: &Sensor, device: &Identity) -> Result<(), Refusal> {
    if sensor.blanking_us == before.blanking_us {
        return Ok(());
    }
    check_blanking(sensor.blanking_us, device)
        .map_err(|error| conflict(&error, "keep blanking_us unchanged, or increase it".into()))
}

fn conflict(error: &impl std::fmt::Display, help: String) -> Refusal {
    Refusal { kind: RefusalKind::Conflict, message: error.to_string(), help }
}
