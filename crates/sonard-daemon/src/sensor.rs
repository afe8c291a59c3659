//! A sensor that a program wants.

use super::refusal::{Refusal, RefusalKind};
use sonard_api::{SensorOrder, Setup};
use sonard_device::ranger::{Listening, Motion};
use sonard_model::acoustics::Sensor;

/// The sensor of an order beside what the configuration decides.
///
/// # Errors
/// When it is none, or the configuration says otherwise.
pub fn ordered_sensor(
    order: &SensorOrder,
    setup: &Setup,
    of_array: bool,
    sound_speed_m_s: f64,
) -> Result<Sensor, Refusal> {
    let sensor = order.applied_to(&setup.sensor).map_err(|error| Refusal {
        kind: RefusalKind::Wrong,
        message: error.to_string(),
        help: "GET /v1/sensors tells the presets with their figures".into(),
    })?;
    if let (Some(configured), Some(_)) = (setup.model.options.threshold, order.threshold) {
        return Err(conflict(
            format!("model.threshold of the configuration is {configured}: it goes before"),
            "take it out of the configuration, or leave threshold out of the order",
        ));
    }
    // What the model plays listens until the next one of its rangers fires.
    if !of_array {
        let max_range_m = setup.model.options.max_range_m.unwrap_or(sensor.max_range_m);
        let listening = Listening { max_range_m, sound_speed_m_s, blanking_us: sensor.blanking_us };
        let heard = Motion::from(&setup.motion).check_window(&listening);
        heard.map_err(|deaf| conflict(deaf.to_string(), &deaf.help()))?;
    }
    Ok(sensor)
}

fn conflict(message: String, help: &str) -> Refusal {
    Refusal { kind: RefusalKind::Conflict, message, help: help.into() }
}
