//! Keys of a collection's plan file.
//!
//! These structs define the file format, as for the daemon's configuration. The doc comment of a
//! field is its text in `sonard collect --example`, and its `range` is validated.

use std::sync::LazyLock;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_api::config::{
    CollectionAirKeys, ConfigForm, DeviceKeys, MotionKeys, PlanKeys, Section, read_sections,
};
use sonard_import::poses::Conditions;
use sonard_model::model::OptionKeys;

/// Plan of `sonard collect`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct CollectionKeys {
    /// Name, folder, repeats and order of the scans.
    pub collection: CollectionSection,
    /// Poses of the ranger: exactly one of list, file, program, stream and prompt.
    pub poses: PosesKeys,
    /// Conditions recorded with every scan: any keys, for instance room = "laboratory",
    /// carpet = false, humidity_percent = 41.
    pub conditions: Conditions,
    /// Conditions entered at the terminal.
    pub ask: AskKeys,
    /// Ranger to use; overridden by --port, --daemon, --mock and --emulator.
    pub device: DeviceKeys,
    /// Environment of the ranger.
    pub place: SceneKeys,
    /// Sensor data and prediction of echoes.
    pub sensor: SensorKeys,
    /// Azimuths of a scan.
    pub plan: PlanKeys,
    /// Motion of the motor and timing of the measurements.
    pub motion: MotionKeys,
    /// Air, which determines the speed of sound. A thermometer's file is read before and after each
    /// scan.
    pub air: CollectionAirKeys,
    /// Checks after each scan, and their actions: note the finding in the report, retake the scan,
    /// ask at the terminal (without a terminal: stop), or stop.
    pub checks: CheckKeys,
}

/// Section `[collection]`: name, folder, repeats and order.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct CollectionSection {
    /// Name of the collection in its report.
    pub name: String,
    /// Folder of the collection; overridden by --out.
    pub folder: String,
    /// Scans at each pose.
    #[schemars(range(min = 1, max = 10_000))]
    pub repeats: u32,
    /// By pose: all repeats at a pose, then the next pose. Rounds: every pose once per round.
    /// Random: all scans shuffled by seed. The last two distribute a drift of the air or of the
    /// ranger over all poses.
    pub order: Order,
    /// Seed of the random order.
    #[schemars(range(min = 0, max = 4_294_967_295_u64))]
    pub seed: u64,
    /// Pause between the end of a scan and the start of the next, seconds.
    #[schemars(range(min = 0, max = 604_800))]
    pub pause_s: f64,
    /// Maximum number of retakes of a scan that a check rejected.
    #[schemars(range(min = 0, max = 1000))]
    pub retakes: u32,
    /// Action after the last retake: continue without that scan, or stop.
    pub after_retakes: AfterRetakes,
    /// Time before the collection stops if the ranger is gone or loses its scans, seconds. Retries
    /// within that time are increasingly rare. The same command resumes a stopped collection.
    #[schemars(range(min = 0, max = 604_800))]
    pub retry_limit_s: f64,
}

/// Order of the scans.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Order {
    /// All repeats at a pose, then the next pose.
    #[default]
    ByPose,
    /// Every pose once per round.
    Rounds,
    /// All scans shuffled by seed.
    Random,
}

/// Action after the last retake of a rejected scan.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum AfterRetakes {
    /// Continue without the scan.
    #[default]
    Continue,
    /// Stop the collection.
    Stop,
}

/// Section `[poses]`: source of the poses.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PosesKeys {
    /// Poses, each X,Y,DEG (metres, degrees) or the name of a pose in the scene.
    pub list: Vec<String>,
    /// File of poses: CSV whose first line names the columns x_m, y_m, heading_deg and optionally
    /// name, or JSON lines with these keys. Other columns are recorded as conditions of the pose.
    #[schemars(example = "poses.csv")]
    pub file: Option<String>,
    /// Command that prints one pose per run, as JSON with x_m, y_m, heading_deg and optionally name
    /// and conditions, or as in list; no output ends the collection. The command may move the
    /// ranger. SONARD_POSE is the pose's number, from 1.
    #[schemars(example = "./move-robot --next")]
    pub program: Option<String>,
    /// Command that keeps running and prints one such pose per line. SONARD_POSE is the number of
    /// the first line's pose; a resumed collection has the earlier ones already.
    #[schemars(example = "ssh robot report-poses")]
    pub stream: Option<String>,
    /// Prompt for each pose at the terminal; an empty line ends the collection.
    pub prompt: bool,
    /// Maximum number of poses from program, stream or prompt; 0 for no limit.
    #[schemars(range(min = 0, max = 100_000))]
    pub count: u32,
    /// Before the first scan at a new pose, wait until the operator confirms at the terminal that
    /// the ranger is in place.
    pub confirm: bool,
}

/// Section `[ask]`: conditions entered at the terminal.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct AskKeys {
    /// Conditions entered once per start: for instance ["operator"].
    pub at_start: Vec<String>,
    /// Conditions entered at each pose: for instance ["carpet", "door"].
    pub at_pose: Vec<String>,
}

/// Section `[place]`: environment of the ranger.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SceneKeys {
    /// Scene file, or the name of a shipped scene. Empty for an unknown room, whose scans have
    /// nothing to agree with: max_unexplained_share is then not checked.
    pub scene: String,
}

/// Section `[sensor]`: sensor data and prediction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SensorKeys {
    /// Sensor preset, or a file with a sensor's data.
    pub sensor: String,
    /// End the blanking as early as the sensor allows, by its BINH input.
    pub short_blanking: bool,
    /// Blanking after the ping, microseconds, instead of the sensor's.
    #[schemars(range(min = 0, max = 100_000), example = 1500)]
    pub blanking_us: Option<f64>,
    /// Height of the transducer in a scene with floor, ceiling or low walls, metres.
    #[schemars(range(min = -100, max = 100), example = 0.3)]
    pub height_m: Option<f64>,
    /// Elevation of the transducer's axis, degrees, instead of the sensor's.
    #[schemars(range(min = -90, max = 90), example = 2)]
    pub tilt_deg: Option<f64>,
    /// Options of the prediction of echoes.
    #[serde(flatten)]
    pub options: OptionKeys,
}

/// Action for a scan that violates a check.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum Action {
    /// Keep the scan and note the finding in the report.
    #[default]
    Note,
    /// Set the scan aside and repeat it.
    Retake,
    /// Prompt at the terminal; stop without a terminal.
    Ask,
    /// Set the scan aside and stop.
    Stop,
}

/// Action for air that drifted from the session's.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum AirAction {
    /// Start a session with the current air and update the predictions.
    #[default]
    NewSession,
    /// Keep the session's air and note the drift in the report.
    Note,
    /// Stop the collection.
    Stop,
}

/// Section `[checks]`: limits and actions after each scan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct CheckKeys {
    /// Maximum number of beams without a usable reading: lost, uncertain motor position, or no
    /// ping.
    #[schemars(range(min = 0, max = 65_535))]
    pub max_missing_beams: u32,
    /// Action if max_missing_beams is exceeded.
    pub on_missing_beams: Action,
    /// Maximum index error after a scan, motor steps; missed steps cause it.
    #[schemars(range(min = 0, max = 10_000))]
    pub max_home_drift_steps: u32,
    /// Action if max_home_drift_steps is exceeded.
    pub on_home_drift: Action,
    /// Maximum difference between thermometer and session air before a scan, degrees Celsius.
    #[schemars(range(min = 0, max = 50))]
    pub max_temperature_drift_c: f64,
    /// Action if max_temperature_drift_c is exceeded.
    pub on_temperature_drift: AirAction,
    /// Maximum temperature change during a scan, degrees Celsius.
    #[schemars(range(min = 0, max = 50))]
    pub max_temperature_change_c: f64,
    /// Action if max_temperature_change_c is exceeded.
    pub on_temperature_change: Action,
    /// Maximum share of compared beams that disagree with the model; a larger one indicates a wrong
    /// pose, a wrong scene, or a changed room. 1 for no limit.
    #[schemars(range(min = 0, max = 1))]
    pub max_unexplained_share: f64,
    /// Action if max_unexplained_share is exceeded.
    pub on_unexplained: Action,
}

impl Default for CollectionSection {
    fn default() -> Self {
        Self {
            name: "collection".into(),
            folder: "collection".into(),
            repeats: 1,
            order: Order::default(),
            seed: 1,
            pause_s: 0.0,
            retakes: 3,
            after_retakes: AfterRetakes::default(),
            retry_limit_s: 600.0,
        }
    }
}

impl Default for SceneKeys {
    fn default() -> Self {
        Self { scene: "simple-room".into() }
    }
}

impl Default for SensorKeys {
    fn default() -> Self {
        Self {
            sensor: "senscomp-6500".into(),
            short_blanking: false,
            blanking_us: None,
            height_m: None,
            tilt_deg: None,
            options: OptionKeys::default(),
        }
    }
}

impl Default for CheckKeys {
    fn default() -> Self {
        Self {
            max_missing_beams: 0,
            on_missing_beams: Action::Retake,
            max_home_drift_steps: 0,
            on_home_drift: Action::Retake,
            max_temperature_drift_c: 0.5,
            on_temperature_drift: AirAction::default(),
            max_temperature_change_c: 0.5,
            on_temperature_change: Action::Retake,
            max_unexplained_share: 0.5,
            on_unexplained: Action::Note,
        }
    }
}

impl ConfigForm for CollectionKeys {
    const HEAD: &'static str = "\
# Plan of a collection for `sonard collect`, with every key and its default; keys without a default
# are comments with an example. `sonard collect PLAN.toml --check` validates it, `--plan-only`
# estimates the duration.
";
    const DOCUMENTED_BY: &'static str = "sonard collect --example";

    fn sections() -> &'static [Section] {
        static SECTIONS: LazyLock<Vec<Section>> = LazyLock::new(read_sections::<CollectionKeys>);
        &SECTIONS
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sonard_api::config::{ConfigLayers, ValueKind, document};

    fn read(text: &str) -> Result<CollectionKeys, sonard_api::config::ConfigError> {
        ConfigLayers::<CollectionKeys>::new().with_file("plan.toml", text)?.into_keys()
    }

    #[test]
    fn example_documents_all_defaults() {
        assert_eq!(read(&document::<CollectionKeys>()), Ok(CollectionKeys::default()));
        for section in CollectionKeys::sections() {
            assert!(!section.about.is_empty(), "{}", section.name);
            for key in &section.keys {
                let path = format!("{}.{}", section.name, key.name);
                assert!(key.about.ends_with('.'), "{path}: {}", key.about);
                assert!(key.default.is_some() || key.example.is_some(), "{path}");
                if let ValueKind::Number { min, max } | ValueKind::Whole { min, max } = key.kind {
                    assert!(min > f64::MIN && max < f64::MAX, "{path}");
                }
            }
        }
    }

    #[test]
    fn free_keys_in_conditions() {
        let keys = read(
            "[conditions]\nroom = \"laboratory\"\ncarpet = false\nhumidity_percent = 41\n\
             [collection]\nrepeats = 3\n",
        )
        .expect("valid");
        assert_eq!(keys.collection.repeats, 3);
        assert_eq!(keys.conditions["humidity_percent"], 41);
        for (text, place, help) in [
            ("[collection]\nrepeat = 3", "plan.toml:2:1", "did you mean `repeats`?"),
            ("[collection]\nrepeats = 0", "plan.toml:2:11", "1 to 10000"),
            ("[collection]\norder = \"round\"", "plan.toml:2:9", "did you mean `rounds`?"),
            ("[conditions]\nroom = [1]", "plan.toml:2:8", "Text, number"),
            ("[check]", "plan.toml:1:2", "did you mean `checks`?"),
            ("[poses]\nrepeats = 2", "plan.toml:2:1", "`repeats` belongs in [collection]"),
        ] {
            let error = read(text).expect_err(text);
            assert!(error.to_string().starts_with(place), "{text:?}: {error}");
            assert!(error.help.contains(help), "{text:?}: {}", error.help);
        }
    }
}
