//! Options of `sonard-emulator`, from those of a verb.

use super::{AirArgs, SENSOR, SensorArgs};
use crate::acoustics::Sensor;

impl SensorArgs {
    /// Returns the options of `sonard-emulator` for this sensor and its blanking.
    pub(in crate::cli) fn emulator(&self, sensor: &Sensor) -> [String; 2] {
        let name = self.sensor.as_deref().unwrap_or(SENSOR);
        [format!("--sensor={name}"), format!("--blanking-us={}", sensor.blanking_us)]
    }
}

impl AirArgs {
    /// Returns the options of `sonard-emulator` for this air.
    pub(in crate::cli) fn emulator(&self) -> [String; 3] {
        [
            format!("--temperature-c={}", self.temperature_c),
            format!("--humidity-percent={}", self.humidity_percent),
            format!("--pressure-kpa={}", self.pressure_kpa),
        ]
    }
}
