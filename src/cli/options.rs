//! Options shared by several verbs: sensor, air and engine.

#[cfg(feature = "daemon")]
mod emulator;

use std::{fs, io};

use super::Failure;
use crate::{
    acoustics::{Air, Sensor, SensorError},
    model::{OptionKeys, Options},
    scene::suggest,
};

/// Sensor used if none is given.
const SENSOR: &str = "senscomp-6500";

/// Options of the sensor and its mounting.
#[derive(Debug, Clone, clap::Args)]
#[command(next_help_heading = "Sensor and air")]
pub(super) struct SensorArgs {
    /// Sensor preset (`sonard sensor list`), or a file with a sensor's data [default:
    /// senscomp-6500; for an array, its own]
    #[arg(long, value_name = "NAME|FILE")]
    sensor: Option<String>,
    /// End the blanking as early as the sensor allows, with BINH
    #[arg(long, conflicts_with = "blanking_us")]
    short_blanking: bool,
    /// Blanking time after transmission, microseconds [default: the sensor's]
    #[arg(long, value_name = "US")]
    blanking_us: Option<f64>,
    /// Height of the transducer in a scene with floor, ceiling or low walls, metres [default: the
    /// sensor's, else 0.5 m above the floor]
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    sensor_z: Option<f64>,
    /// Elevation of the transducer's axis, degrees [default: the sensor's]
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    tilt_deg: Option<f64>,
    /// Transducer offset forward of the rotation axis, metres [default: the sensor's]
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    ahead_m: Option<f64>,
    /// Transducer offset to the left of the rotation axis, metres [default: the sensor's]
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    left_m: Option<f64>,
}

/// Options of the air.
#[derive(Debug, Clone, Copy, clap::Args)]
#[command(next_help_heading = "Sensor and air")]
pub(super) struct AirArgs {
    /// Air temperature, degrees Celsius
    #[arg(long, value_name = "C", default_value_t = 20.0, allow_negative_numbers = true)]
    temperature_c: f64,
    /// Relative humidity, percent
    #[arg(long, value_name = "PERCENT", default_value_t = 50.0)]
    humidity_percent: f64,
    /// Static pressure, kilopascals
    #[arg(long, value_name = "KPA", default_value_t = 101.325)]
    pressure_kpa: f64,
    /// Speed of sound, metres per second; instead of that computed from the air
    #[arg(long, value_name = "M/S")]
    sound_speed: Option<f64>,
}

impl SensorArgs {
    /// Loads the sensor, from a file or else a preset, and applies the overrides.
    pub(super) fn sensor(&self) -> Result<Sensor, Failure> {
        self.sensor_or(SENSOR)
    }

    /// Loads the sensor with another default.
    pub(super) fn sensor_or(&self, default: &str) -> Result<Sensor, Failure> {
        let mut sensor = load_sensor(self.sensor.as_deref().unwrap_or(default))?;
        if self.short_blanking {
            sensor.blanking_us = sensor.short_blanking_us.ok_or_else(|| {
                Failure::input(
                    format!("--short-blanking: {} has no short_blanking_us", sensor.name),
                    "give --blanking-us instead",
                )
            })?;
        }
        if let Some(blanking_us) = self.blanking_us {
            sensor.blanking_us = blanking_us;
            sensor.check().map_err(|error| {
                Failure::input(format!("--blanking-us: {error}"), "give microseconds, 0 or more")
            })?;
        }
        let mounting = &mut sensor.mounting;
        mounting.z_m = self.sensor_z.or(mounting.z_m);
        mounting.tilt_deg = self.tilt_deg.unwrap_or(mounting.tilt_deg);
        mounting.ahead_m = self.ahead_m.unwrap_or(mounting.ahead_m);
        mounting.left_m = self.left_m.unwrap_or(mounting.left_m);
        sensor.check().map_err(|error| {
            Failure::input(
                error,
                "give --sensor-z, --ahead-m and --left-m in metres and --tilt-deg from -90 to 90",
            )
        })?;
        Ok(sensor)
    }
}

/// Loads a sensor from a file, or else the preset of that name.
pub(super) fn load_sensor(name: &str) -> Result<Sensor, Failure> {
    match fs::read_to_string(name) {
        Ok(text) => Sensor::from_json(&text).map_err(|error| sensor_failure(name, &error)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            Sensor::preset(name).map_err(|error| sensor_failure(name, &error))
        }
        Err(error) => Err(Failure::input(
            format!("cannot read the sensor {name}: {error}"),
            "give a readable text file, or the name of a preset",
        )),
    }
}

fn sensor_failure(name: &str, error: &SensorError) -> Failure {
    match error {
        SensorError::UnknownPreset { .. } => {
            let names: Vec<String> = Sensor::preset_names().map(str::to_owned).collect();
            Failure::input(
                format!("no sensor file `{name}` and no preset of that name"),
                suggest(name, &names, "presets"),
            )
        }
        SensorError::Malformed { line, column, field, message } => Failure::input(
            format!("{name}:{line}:{column}: {field}: {message}"),
            "start from a preset in the folder sensors/ of the source",
        ),
        SensorError::OutOfRange { .. } => {
            Failure::input(format!("{name}: {error}"), "correct that value in the file")
        }
    }
}

impl AirArgs {
    /// Returns the air with the given properties.
    pub(super) fn air(&self) -> Result<Air, Failure> {
        Air::new(self.temperature_c, self.humidity_percent, self.pressure_kpa)
            .and_then(|air| self.sound_speed.map_or(Ok(air), |speed| air.with_sound_speed(speed)))
            .map_err(|error| {
                let option = match error.field {
                    "sound_speed_m_s" => "sound-speed".to_owned(),
                    field => field.replace('_', "-"),
                };
                Failure::input(
                    format!("--{option} is {}", error.value),
                    format!("give a number from {} to {}", error.min, error.max),
                )
            })
    }
}

/// Converts the model's options; options of another engine are errors.
pub(super) fn engine_options(keys: &OptionKeys) -> Result<Options, Failure> {
    keys.options().map_err(|error| {
        let engines: Vec<_> = error.engines.iter().map(|engine| engine.name()).collect();
        Failure::input(
            format!(
                "--{}: not an option of the engine {}",
                error.option.replace('_', "-"),
                error.engine.name()
            ),
            format!("leave it out, or use --engine {}", engines.join(" or --engine ")),
        )
    })
}
