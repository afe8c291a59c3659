//! Scenes, sensors, air and maps given on the command line.

use std::{
    fs,
    io::ErrorKind,
    path::{Path, PathBuf},
};

use sonard_interpret::interpret::grid::{Grid, MapYaml, from_pgm};
use sonard_model::{
    acoustics::{Air, Sensor},
    geometry::Pose,
    scene::{PoseError, Scene, shipped, suggest},
};

use super::{Failure, output::note_input};

/// Options for scene and pose.
#[derive(Debug, Clone, clap::Args)]
pub(crate) struct PlaceArgs {
    /// Scene file, or name of a shipped scene (`sonard scene list`)
    #[arg(long, value_name = "SCENE")]
    scene: PathBuf,
    /// Pose of the robot: X,Y,DEG (metres, degrees) or the name of a pose in the scene
    #[arg(long, value_name = "POSE", allow_hyphen_values = true)]
    pose: String,
}

impl PlaceArgs {
    /// Loads the scene and a pose inside its room.
    pub(crate) fn load(&self) -> Result<(Scene, Pose), Failure> {
        let scene = load_scene(&self.scene)?;
        let reject = |error: PoseError| Failure::input(&error, error.help());
        let pose = scene.pose(&self.pose).map_err(reject)?;
        scene.check_pose(&pose).map_err(reject)?;
        Ok((scene, pose))
    }
}

/// Options for sensor and air.
#[derive(Debug, Clone, clap::Args)]
#[command(next_help_heading = "Sensor and air")]
pub(crate) struct AcousticArgs {
    /// Sensor preset (`sonard sensor list`), or a file with a sensor's data
    #[arg(long, value_name = "NAME|FILE", default_value = "senscomp-6500")]
    sensor: String,
    /// Air temperature, degrees Celsius
    #[arg(long, value_name = "C", default_value_t = 20.0, allow_negative_numbers = true)]
    temperature_c: f64,
    /// Relative humidity, percent
    #[arg(long, value_name = "PERCENT", default_value_t = 50.0)]
    humidity_percent: f64,
    /// Static pressure, kilopascals
    #[arg(long, value_name = "KPA", default_value_t = 101.325)]
    pressure_kpa: f64,
}

impl AcousticArgs {
    pub(crate) fn sensor(&self) -> Result<Sensor, Failure> {
        load_sensor(&self.sensor)
    }

    pub(crate) fn air(&self) -> Result<Air, Failure> {
        Air::new(self.temperature_c, self.humidity_percent, self.pressure_kpa).map_err(|error| {
            Failure::input(
                format!("--{} is {}", error.field.replace('_', "-"), error.value),
                format!("give a number from {} to {}", error.min, error.max),
            )
        })
    }
}

/// Scene of a file, or the shipped scene of that name if there is no such file.
pub(crate) fn load_scene(path_or_name: &Path) -> Result<Scene, Failure> {
    note_input(path_or_name);
    let name = path_or_name.to_string_lossy();
    let text = match fs::read_to_string(path_or_name) {
        Ok(text) => text,
        Err(error) if error.kind() == ErrorKind::NotFound => {
            shipped::text(&name).map(str::to_owned).ok_or_else(|| {
                let known: Vec<String> = shipped::names().map(str::to_owned).collect();
                Failure::input(
                    format!("there is no scene file `{name}` and no shipped scene of that name"),
                    suggest(&name, &known, "shipped scenes"),
                )
            })?
        }
        Err(error) => {
            return Err(Failure::input(
                format!("cannot read the scene {name}: {error}"),
                "give a readable scene file (JSON, UTF-8), or the name of a shipped scene",
            ));
        }
    };
    Scene::from_json(&text).map_err(|error| Failure::input(format!("{name}:{error}"), error.help()))
}

/// Sensor of a file, or the preset of that name if there is no such file.
pub(crate) fn load_sensor(name: &str) -> Result<Sensor, Failure> {
    note_input(Path::new(name));
    let sensor = match fs::read_to_string(name) {
        Ok(text) => Sensor::from_json(&text),
        Err(error) if error.kind() == ErrorKind::NotFound => Sensor::preset(name),
        Err(error) => {
            return Err(Failure::input(
                format!("cannot read the sensor {name}: {error}"),
                "give a readable sensor file (JSON, UTF-8), or the name of a preset",
            ));
        }
    };
    sensor.map_err(|error| {
        let known: Vec<String> = Sensor::preset_names().map(str::to_owned).collect();
        Failure::input(format!("{name}: {error}"), suggest(name, &known, "presets"))
    })
}

/// Reads a map of `sonard map` from its folder or its `.yaml` file.
pub(crate) fn read_map(path: &Path) -> Result<Grid, Failure> {
    let reject = |path: &Path, error: &dyn std::fmt::Display| {
        Failure::input(
            format!("{}: {error}", path.display()),
            "give a map as `sonard map` writes it: map.yaml next to map.pgm",
        )
    };
    let yaml_path = if path.is_dir() { path.join("map.yaml") } else { path.to_path_buf() };
    note_input(&yaml_path);
    let text = fs::read_to_string(&yaml_path).map_err(|error| reject(&yaml_path, &error))?;
    let yaml = MapYaml::from_text(&text).map_err(|error| reject(&yaml_path, &error))?;
    let image_path = yaml_path.with_file_name("").join(&yaml.image);
    note_input(&image_path);
    let image = fs::read(&image_path).map_err(|error| reject(&image_path, &error))?;
    from_pgm(&image, &yaml).map_err(|error| reject(&image_path, &error))
}
