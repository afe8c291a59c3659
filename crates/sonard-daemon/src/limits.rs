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

use super::order_error::{OrderError, OrderErrorKind};

/// Checks the azimuths of a scan, also against the motor if a device is connected.
///
/// # Errors
/// If the plan is invalid, the motor can't reach its azimuths, or an array is simulated, whose
/// rangers are fixed.
pub fn check_plan(
    plan: &ScanPlan,
    of_array: bool,
    device: Option<&Identity>,
) -> Result<(), OrderError> {
    if of_array {
        let message = "an array has no plan: its rangers are fixed";
        let help = "to change them, set simulate.array in the configuration";
        return Err(OrderError::new(OrderErrorKind::Conflict, message, help).at("plan"));
    }
    let reject = |error: PlanError| {
        let (kind, field) = match error {
            PlanError::OffMotorGrid { step_deg, .. } if step_deg == plan.step_deg => {
                (OrderErrorKind::Conflict, "step_deg")
            }
            PlanError::OffMotorGrid { .. } => (OrderErrorKind::Conflict, "from_deg"),
            PlanError::NotFinite { field, .. } => (OrderErrorKind::Invalid, field),
            PlanError::StepNotPositive(_) | PlanError::TooManyBeams(_) => {
                (OrderErrorKind::Invalid, "step_deg")
            }
            PlanError::BadRange { .. } => (OrderErrorKind::Invalid, "to_deg"),
            PlanError::BadPings(_) => (OrderErrorKind::Invalid, "pings_per_stop"),
        };
        let help = "a full revolution is from_deg 0, to_deg 360, step_deg 0.9, pings_per_stop 1";
        OrderError::new(kind, error.to_string(), help).at(format!("plan.{field}"))
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
) -> Result<(), OrderError> {
    let is_finite = [pose.x_m, pose.y_m, pose.heading_deg].iter().all(|value| value.is_finite());
    if !is_finite {
        let message = "the pose has a value that is not finite";
        let help = "give x_m and y_m in metres, heading_deg in degrees";
        return Err(OrderError::new(OrderErrorKind::Invalid, message, help).at("pose"));
    }
    let Some(scene) = scene else { return Ok(()) };
    match array {
        Some(array) => {
            array.check_pose(scene, pose).map_err(|error| conflict(&error, error.help(), "pose"))
        }
        None => scene.check_pose(pose).map_err(|error| conflict(&error, error.help(), "pose")),
    }
}

/// Air of an order. The given humidity and pressure apply where the order omits them.
///
/// # Errors
/// If a value is out of range.
pub fn air_from_order(
    order: &AirOrder,
    humidity_percent: f64,
    pressure_kpa: f64,
) -> Result<Air, OrderError> {
    let air = Air::new(
        order.temperature_c,
        order.humidity_percent.unwrap_or(humidity_percent),
        order.pressure_kpa.unwrap_or(pressure_kpa),
    );
    air.map_err(|error| {
        let help = "temperatures are degrees Celsius, pressures kilopascals";
        OrderError::new(OrderErrorKind::Invalid, error.to_string(), help)
            .at(format!("air.{}", error.field))
    })
}

/// Checks that a device supports the blanking of a sensor that replaces the one in `before`.
///
/// # Errors
/// If the blanking is shorter than the device supports.
pub fn check_device(sensor: &Sensor, before: &Sensor, device: &Identity) -> Result<(), OrderError> {
    if sensor.blanking_us == before.blanking_us {
        return Ok(());
    }
    check_blanking(sensor.blanking_us, device).map_err(|error| {
        let help = "keep blanking_us unchanged, or increase it".into();
        conflict(&error, help, "sensor.blanking_us")
    })
}

fn conflict(error: &impl std::fmt::Display, help: String, field: &str) -> OrderError {
    OrderError::new(OrderErrorKind::Conflict, error.to_string(), help).at(field)
}
