//! Options that several verbs share: sensor, air and engine.

use std::{fs, io};

use super::Failure;
use crate::{
    acoustics::{Air, Sensor, SensorError},
    model::{OptionKeys, Options},
    scene::suggest,
};

/// The sensor that is meant when none is named.
const SENSOR: &str = "senscomp-6500";

/// Which ranger.
#[derive(Debug, Clone, clap::Args)]
#[command(next_help_heading = "Sensor and air")]
pub(super) struct SensorArgs {
    /// Sensor preset (`sonard sensor list`), or a file with a sensor's data [default: senscomp-6500; of an array, its own]
    #[arg(long, value_name = "NAME|FILE")]
    sensor: Option<String>,
    /// End the blanking by hand as early as the sensor allows, as BINH does
    #[arg(long, conflicts_with = "blanking_us")]
    short_blanking: bool,
    /// From firing until the receiver listens, microseconds [default: the sensor's]
    #[arg(long, value_name = "US")]
    blanking_us: Option<f64>,
    /// Height of the transducer in a scene with floor, ceiling or low walls, metres [default: the
    /// sensor's, else half a metre above the floor]
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    sensor_z: Option<f64>,
    /// Elevation of the transducer's axis, degrees [default: the sensor's]
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    tilt_deg: Option<f64>,
    /// How far the transducer's face is ahead of the rotation axis, metres [default: the sensor's]
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    ahead_m: Option<f64>,
    /// The same to the left [default: the sensor's]
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    left_m: Option<f64>,
}

/// The air between ranger and walls.
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
    /// Speed of sound, metres a second; instead of the one that follows from the air
    #[arg(long, value_name = "M/S")]
    sound_speed: Option<f64>,
}

impl SensorArgs {
    /// The same for `sonard-emulator`, with the blanking that came of it.
    pub(super) fn emulator(&self, sensor: &Sensor) -> [String; 2] {
        let name = self.sensor.as_deref().unwrap_or(SENSOR);
        [format!("--sensor={name}"), format!("--blanking-us={}", sensor.blanking_us)]
    }

    /// The sensor named: a file if there is one of that name, else a preset; with its blanking as
    /// asked for.
    pub(super) fn sensor(&self) -> Result<Sensor, Failure> {
        self.sensor_or(SENSOR)
    }

    /// The same with another one to fall back on.
    pub(super) fn sensor_or(&self, otherwise: &str) -> Result<Sensor, Failure> {
        let mut sensor = load_sensor(self.sensor.as_deref().unwrap_or(otherwise))?;
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

/// A sensor by the name of its file or preset.
pub(super) fn load_sensor(name: &str) -> Result<Sensor, Failure> {
    match fs::read_to_string(name) {
        Ok(text) => Sensor::from_json(&text).map_err(|error| refuse_sensor(name, &error)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            Sensor::preset(name).map_err(|error| refuse_sensor(name, &error))
        }
        Err(error) => Err(Failure::input(
            format!("cannot read the sensor {name}: {error}"),
            "give a text file that you may read, or the name of a preset",
        )),
    }
}

fn refuse_sensor(name: &str, error: &SensorError) -> Failure {
    match error {
        SensorError::UnknownPreset { .. } => {
            let known: Vec<String> = Sensor::preset_names().map(str::to_owned).collect();
            Failure::input(
                format!("there is no sensor file `{name}` and no preset of that name"),
                suggest(name, &known, "presets"),
            )
        }
        SensorError::Form { line, column, field, message } => Failure::input(
            format!("{name}:{line}:{column}: {field}: {message}"),
            "start from a preset in the folder sensors/ of the source",
        ),
        SensorError::Figure { .. } => {
            Failure::input(format!("{name}: {error}"), "correct that figure in the file")
        }
    }
}

impl AirArgs {
    /// The same for `sonard-emulator`.
    pub(super) fn emulator(&self) -> [String; 3] {
        [
            format!("--temperature-c={}", self.temperature_c),
            format!("--humidity-percent={}", self.humidity_percent),
            format!("--pressure-kpa={}", self.pressure_kpa),
        ]
    }

    /// The air described.
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

/// The model's options, each of which the engine has to know.
pub(super) fn engine_options(keys: &OptionKeys) -> Result<Options, Failure> {
    keys.options().map_err(|error| {
        let engines: Vec<_> = error.of.iter().map(|engine| engine.name()).collect();
        Failure::input(
            format!(
                "--{}: {} does not know it",
                error.option.replace('_', "-"),
                error.engine.name()
            ),
            format!("leave it out, or use --engine {}", engines.join(" or --engine ")),
        )
    })
}
