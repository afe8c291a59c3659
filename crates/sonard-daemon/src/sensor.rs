//! Sensor set by an order.

use super::order_error::{Refusal, RefusalKind};
use sonard_api::{SensorOrder, Setup};
use sonard_device::ranger::{Listening, Motion};
use sonard_model::acoustics::{Sensor, SensorError};

/// Sensor of an order, applied to the configured one and checked against the configuration.
///
/// # Errors
/// When the sensor is invalid, or the order conflicts with the configuration.
pub fn ordered_sensor(
    order: &SensorOrder,
    setup: &Setup,
    of_array: bool,
    sound_speed_m_s: f64,
) -> Result<Sensor, Refusal> {
    let sensor = order.applied_to(&setup.sensor).map_err(|error| {
        let field = match &error {
            SensorError::Figure { field, .. } => format!("sensor.{field}"),
            SensorError::UnknownPreset { .. } | SensorError::Form { .. } => "sensor.preset".into(),
        };
        let help = "GET /v1/sensors lists the presets with their values";
        Refusal::new(RefusalKind::Wrong, error.to_string(), help).at(field)
    })?;
    if let (Some(configured), Some(_)) = (setup.model.options.threshold, order.threshold) {
        return Err(conflict(
            format!("model.threshold = {configured} in the configuration overrides the order"),
            "remove model.threshold from the configuration, or threshold from the order",
            "sensor.threshold",
        ));
    }
    // A simulated ranger receives until the next ranger of its array fires.
    if !of_array {
        let max_range_m = setup.model.options.max_range_m.unwrap_or(sensor.max_range_m);
        let listening = Listening { max_range_m, sound_speed_m_s, blanking_us: sensor.blanking_us };
        // Without a preset only the blanking affects the window.
        let field = if order.preset.is_some() { "sensor.preset" } else { "sensor.blanking_us" };
        Motion::from(&setup.motion)
            .check_window(&listening)
            .map_err(|error| conflict(error.to_string(), &error.help(), field))?;
    }
    Ok(sensor)
}

fn conflict(message: String, help: &str, field: &str) -> Refusal {
    Refusal::new(RefusalKind::Conflict, message, help).at(field)
}
