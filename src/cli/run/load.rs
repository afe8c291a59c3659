//! Loads settings from options, environment and file, at start and at each reload.

use std::{
    collections::BTreeMap,
    env,
    ffi::OsString,
    fs, io,
    path::{Path, PathBuf},
    sync::Arc,
};

use super::{
    Args,
    files::{Files, digests},
};
use crate::{
    array::RobotCourse,
    cli::{Failure, array::load_array, options::load_sensor, scene_file, socket},
    config::{ConfigError, ConfigLayers, Keys, Mode, PlaceKeys, robot_name_from_host},
    daemon::{ArraySimulation, OptionalOutputs, Settings, SettingsConflict},
    host_gpio,
    scene::{PoseError, Scene, parse_pose},
};

/// Configuration file without `--config`.
const CONFIG_FILE: &str = "/etc/sonard/sonard.toml";

/// Reader of the configuration, for the start and reloads.
pub(super) struct Loader {
    args: Args,
    port: Option<String>,
}

impl Loader {
    pub(super) const fn new(args: Args) -> Self {
        Self { args, port: None }
    }

    /// Overrides the port by that of the mock.
    pub(super) fn fix_port(&mut self, port: String) {
        self.port = Some(port);
    }

    /// Reads and checks the configuration with every file that it names, for start, reload and
    /// `--check`.
    pub(super) fn load(&mut self) -> Result<(Settings, Files), Failure> {
        let layers = self.layers()?;
        let mut keys = layers.clone().into_keys().map_err(|error| failure_from(&error))?;
        self.fill_in(&layers, &mut keys);
        let mut settings = match self.args.simulate {
            true => simulated(keys, layers.origin("model", "sensor").is_some())?,
            false => settings(keys)?,
        };
        settings.check().map_err(|mismatch| {
            let SettingsConflict { section, key, .. } = mismatch;
            let origin = layers
                .origin(section, key)
                .map_or_else(|| format!("{section}.{key}"), ToString::to_string);
            Failure::input(format!("{origin}: {}", mismatch.message), &mismatch.help)
        })?;
        let files = Files::read(&settings.keys)?;
        settings.files = digests(&settings.keys, &files.fleet);
        if !self.args.simulate {
            host_gpio::check(&settings.keys.gpio)
                .map_err(|error| Failure::input(&error, error.help()))?;
        }
        if settings.keys.device.port.is_none() && !self.args.mock && !self.args.simulate {
            return Err(Failure::input(
                "no device: device.port is not set",
                "set device.port in the file, give --port, or use --mock or --simulate to try \
                 without one",
            ));
        }
        if self.args.mock && settings.scene.is_none() {
            return Err(Failure::input(
                "a mock needs a scene",
                "give --scene, for instance --scene simple-room --pose fig9",
            ));
        }
        Ok((settings, files))
    }

    /// Reads the configuration for a daemon that runs; a failure is one line.
    pub(super) fn reload(&mut self) -> Result<Box<Settings>, String> {
        let loaded = self.load().map(|(settings, _files)| Box::new(settings));
        loaded.map_err(|failure| one_line(&failure))
    }

    fn layers(&self) -> Result<ConfigLayers, Failure> {
        let args = &self.args;
        let mut layers = file_and_environment(args.config.as_deref())?;
        let path = |path: &Option<PathBuf>| path.clone().map(PathBuf::into_os_string);
        let text = |text: &Option<String>| text.clone().map(OsString::from);
        let shortcuts = [
            ("--port", "device.port", text(&args.port)),
            ("--scene", "place.scene", path(&args.scene)),
            ("--pose", "place.pose", text(&args.pose)),
            ("--log", "log.folder", path(&args.log)),
            ("--socket", "server.socket", path(&args.socket)),
            ("--array", "simulate.array", text(&args.array)),
        ];
        for setting in &self.args.set {
            layers = layers.with_option("--set", setting).map_err(|error| failure_from(&error))?;
        }
        for (option, key, value) in shortcuts {
            if let Some(value) = value {
                let value = value.to_str().ok_or_else(|| {
                    let value = value.display();
                    Failure::input(
                        format!("{option}: {value} is not UTF-8, as a configuration must be"),
                        "rename it, or name it by a symbolic link",
                    )
                })?;
                layers = layers
                    .with_option(option, &format!("{key}={value}"))
                    .map_err(|error| failure_from(&error))?;
            }
        }
        Ok(layers)
    }

    /// Fills in values from system and systemd and the places of a user without rights to the
    /// system's, which replace defaults, and the mock's port, which overrides all.
    fn fill_in(&self, layers: &ConfigLayers, keys: &mut Keys) {
        // systemd separates several folders by colons; the first is used.
        let first = |variable| {
            let folders = env::var(variable).ok()?;
            folders.split(':').next().map(str::to_owned).filter(|folder| !folder.is_empty())
        };
        let text = |path: PathBuf| path.into_os_string().into_string().ok();
        if layers.origin("log", "folder").is_none()
            && let Some(folder) = first("STATE_DIRECTORY")
                .or_else(|| socket::instead_of(&keys.log.folder, socket::user_logs).and_then(text))
        {
            keys.log.folder = folder;
        }
        if layers.origin("server", "socket").is_none() {
            let own = || {
                let own = || Some(socket::user_socket());
                socket::instead_of(&keys.server.socket, own).and_then(text)
            };
            let systemd = first("RUNTIME_DIRECTORY").map(|folder| format!("{folder}/sonard.sock"));
            if let Some(socket) = systemd.or_else(own) {
                keys.server.socket = socket;
            }
        }
        let host = rustix::system::uname();
        if layers.origin("fleet", "robot").is_none()
            && let Some(name) = host.nodename().to_str().ok().and_then(robot_name_from_host)
        {
            keys.fleet.robot = name;
        }
        // A simulated array runs continuously by default, as on the robot.
        if self.args.simulate && layers.origin("scanning", "mode").is_none() {
            keys.scanning.mode = Mode::Continuous;
        }
        if self.port.is_some() {
            keys.device.port.clone_from(&self.port);
        }
    }
}

/// Optional outputs of this build.
const OUTPUTS: OptionalOutputs =
    OptionalOutputs { mqtt: cfg!(feature = "mqtt"), ros: cfg!(feature = "ros") };

fn settings(keys: Keys) -> Result<Settings, Failure> {
    let refuse_pose = |error: PoseError| Failure::input(&error, error.help());
    let (scene, pose) = match &keys.place.scene {
        Some(name) => {
            let scene = scene_file::load(name)?;
            let pose = scene_file::pose(&scene, &keys.place.pose)
                .map_err(|failure| explain_missing_pose(&scene, &keys.place.pose, failure))?;
            (Some(Arc::new(scene)), pose)
        }
        None => (None, parse_pose(&keys.place.pose).map_err(refuse_pose)?),
    };
    let sensor = load_sensor(&keys.model.sensor)?;
    Ok(Settings {
        keys,
        scene,
        sensor,
        pose,
        simulated: None,
        outputs: OUTPUTS,
        files: BTreeMap::new(),
    })
}

/// Explains that no pose was given where the default one is not free.
fn explain_missing_pose(scene: &Scene, pose: &str, failure: Failure) -> Failure {
    if pose != PlaceKeys::default().pose {
        return failure;
    }
    let names: Vec<String> = scene.poses.keys().map(|name| format!("`{name}`")).collect();
    let names = if names.is_empty() { String::new() } else { format!(", or {}", names.join(", ")) };
    Failure::input(
        format!("the pose in `{}` is missing, and (0, 0) is not free", scene.name),
        format!("give --pose (place.pose): X,Y,DEG (metres, degrees){names}"),
    )
}

/// Settings of a simulated array; the sensor is the array's own unless one is configured.
fn simulated(mut keys: Keys, sensor_chosen: bool) -> Result<Settings, Failure> {
    let requested = &keys.simulate;
    let mut array = load_array(&requested.array)?;
    array.interval_ms = requested.interval_ms.unwrap_or(array.interval_ms);
    let course = requested.course.as_ref().map(|file| load_course(Path::new(file))).transpose()?;
    let course = course.map(|course| course.with_times(requested.speed_m_s));
    if !sensor_chosen {
        keys.model.sensor.clone_from(&array.sensor);
    }
    let Some(name) = &keys.place.scene else {
        return Err(Failure::input(
            "an array needs a scene",
            "give --scene, for instance --scene mcgill-lab --pose fig4",
        ));
    };
    let scene = scene_file::load(name)?;
    let pose = match &course {
        Some(course) => course.poses()[0],
        None => {
            scene.pose(&keys.place.pose).map_err(|error| Failure::input(&error, error.help()))?
        }
    };
    let all = course.as_ref().map_or(std::slice::from_ref(&pose), |course| course.poses());
    for (number, pose) in (1..).zip(all) {
        array.check_pose(&scene, pose).map_err(|error| {
            let file = keys.simulate.course.as_ref();
            let which = file.map(|file| format!("{file}: pose {number}: ")).unwrap_or_default();
            Failure::input(format!("{which}{error}"), error.help())
        })?;
    }
    let sensor = load_sensor(&keys.model.sensor)?;
    let simulated = ArraySimulation { array: Arc::new(array), course: course.map(Arc::new) };
    Ok(Settings {
        keys,
        scene: Some(Arc::new(scene)),
        sensor,
        pose,
        simulated: Some(simulated),
        outputs: OUTPUTS,
        files: BTreeMap::new(),
    })
}

/// Formats the effective values as a configuration file.
pub(super) fn effective_configuration(settings: &Settings) -> String {
    let text = toml::to_string(&settings.keys).unwrap_or_default();
    format!("# Configuration valid. Effective values:\n{text}")
}

/// Reads the configuration file, by default [`CONFIG_FILE`] if it exists, and the environment.
///
/// # Errors
///
/// An unreadable file, or a wrong key or value.
pub(in crate::cli) fn file_and_environment(config: Option<&Path>) -> Result<ConfigLayers, Failure> {
    let mut layers = ConfigLayers::<Keys>::new();
    let file = config.unwrap_or(Path::new(CONFIG_FILE));
    match fs::read_to_string(file) {
        Ok(text) => {
            layers = layers
                .with_file(&file.display().to_string(), &text)
                .map_err(|error| failure_from(&error))?;
        }
        Err(error) if error.kind() == io::ErrorKind::NotFound && config.is_none() => {}
        Err(error) => {
            return Err(Failure::input(
                format!("cannot read the configuration {}: {error}", file.display()),
                "give --config a TOML file; `sonard run --print-config` prints one",
            ));
        }
    }
    // Names and values that are not UTF-8 can't be settings.
    let variables = env::vars_os()
        .filter_map(|(name, value)| Some((name.into_string().ok()?, value.into_string().ok()?)));
    layers.with_environment(variables).map_err(|error| failure_from(&error))
}

/// Loads a course from a file of poses.
fn load_course(path: &Path) -> Result<RobotCourse, Failure> {
    let name = path.display();
    let text = fs::read_to_string(path).map_err(|error| {
        Failure::input(
            format!("cannot read the poses {name}: {error}"),
            "give a text file with one pose per line: {\"x_m\": 1.0, \"y_m\": 2.0, \"heading_deg\": 90.0}",
        )
    })?;
    RobotCourse::from_json_lines(&text).map_err(|error| {
        let message = format!("{name}:{}: {}", error.line, error.message);
        Failure::input(message, "correct that line")
    })
}

/// Formats a failure on one line.
pub(in crate::cli) fn one_line(failure: &Failure) -> String {
    match failure {
        Failure::Found(text) => text.clone().unwrap_or_default(),
        Failure::Input(diagnostic) | Failure::Device(diagnostic) => match diagnostic.help() {
            "" => diagnostic.to_string(),
            help => format!("{diagnostic}; {help}"),
        },
    }
}

fn failure_from(error: &ConfigError) -> Failure {
    Failure::input(error, &error.help)
}
