//! The keys of a collection's plan, as they stand in its file.
//!
//! As for the daemon's configuration, this is the one place that says what there is: the doc
//! comment of a field is its text in `sonard collect --example`, its `range` is what is checked.

use std::sync::LazyLock;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_api::config::{
    CollectionAirKeys, DeviceKeys, Form, MotionKeys, PlanKeys, Section, read_sections,
};
use sonard_model::model::OptionKeys;

/// Things noted about a scan: name and value.
pub type Conditions = serde_json::Map<String, serde_json::Value>;

/// Plan of `sonard collect`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct CollectionKeys {
    /// What is collected, how often and in which order.
    pub collection: CollectionSection,
    /// Where the ranger stands: exactly one of list, file, program, stream and prompt.
    pub poses: PosesKeys,
    /// What is to be noted with every scan: any keys, for instance room = "laboratory",
    /// carpet = false, humidity_percent = 41.
    pub conditions: Conditions,
    /// What is asked for at the terminal and noted.
    pub ask: AskKeys,
    /// Which ranger; --port, --daemon, --mock and --emulator go before it.
    pub device: DeviceKeys,
    /// In what the ranger stands.
    pub place: SceneKeys,
    /// What is known about the ranger, and how echoes are predicted.
    pub sensor: SensorKeys,
    /// Which azimuths a scan measures.
    pub plan: PlanKeys,
    /// How the motor turns and the ranger listens.
    pub motion: MotionKeys,
    /// The air, from which the speed of sound follows. A thermometer's file is read before and
    /// after each scan.
    pub air: CollectionAirKeys,
    /// What is looked at after each scan, and what to do about it: note it in the report, retake
    /// the scan, ask at the terminal (without one: stop), or stop.
    pub checks: CheckKeys,
}

/// What is collected.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct CollectionSection {
    /// What the collection is called in its report.
    pub name: String,
    /// Folder of everything that is collected; --out goes before it.
    pub folder: String,
    /// Scans at each pose.
    #[schemars(range(min = 1, max = 10_000))]
    pub repeats: u32,
    /// By pose: all repeats at a pose, then the next pose. Rounds: every pose once, then again.
    /// Random: all scans in an order by seed. A drift of the air or of the ranger spreads over all
    /// poses in the last two.
    pub order: Order,
    /// Seed of the random order.
    #[schemars(range(min = 0, max = 4_294_967_295_u64))]
    pub seed: u64,
    /// Pause between the end of a scan and the beginning of the next, seconds.
    #[schemars(range(min = 0, max = 604_800))]
    pub pause_s: f64,
    /// How often a scan that a check refused is taken again.
    #[schemars(range(min = 0, max = 1000))]
    pub retakes: u32,
    /// What to do when that did not help: go on without that scan, or stop.
    pub after_retakes: AfterRetakes,
    /// How long a ranger that is gone, or that loses one scan after the other, is tried again, ever
    /// more seldom, seconds, before the collection stops. It goes on where it stopped when it is
    /// started again.
    #[schemars(range(min = 0, max = 604_800))]
    pub patience_s: f64,
}

/// In which order scans are taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Order {
    /// All repeats at a pose, then the next pose.
    #[default]
    ByPose,
    /// Every pose once, then again.
    Rounds,
    /// All scans in an order by seed.
    Random,
}

/// What to do about a scan that could not be taken as it should be.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum AfterRetakes {
    /// Go on without it.
    #[default]
    GoOn,
    /// Stop.
    Stop,
}

/// Where the ranger stands.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PosesKeys {
    /// Poses, each X,Y,DEG (metres, degrees) or the name of a pose in the scene.
    pub list: Vec<String>,
    /// File of poses: CSV whose first line names the columns x_m, y_m, heading_deg, perhaps name,
    /// or JSON lines with these keys. Other columns are noted as conditions of the pose.
    #[schemars(example = "poses.csv")]
    pub file: Option<String>,
    /// Command that prints one pose each time it is run, as JSON with x_m, y_m, heading_deg and
    /// perhaps name and others, or as in list; nothing when there are no more. It may move the
    /// ranger. SONARD_POSE says the pose's number, from 1.
    #[schemars(example = "./move-robot --next")]
    pub program: Option<String>,
    /// Command that runs on and prints one such pose a line. SONARD_POSE says which number the
    /// first line has: those before are known already when a collection goes on.
    #[schemars(example = "ssh robot report-poses")]
    pub stream: Option<String>,
    /// Ask for each pose at the terminal; an empty line ends the collection.
    pub prompt: bool,
    /// Poses wanted of program, stream or prompt, at most; 0 for as many as come.
    #[schemars(range(min = 0, max = 100_000))]
    pub count: u32,
    /// Before the first scan at another pose, wait until somebody says at the terminal that the
    /// ranger stands there.
    pub confirm: bool,
}

/// What is asked for at the terminal.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct AskKeys {
    /// Once each time that the collection is started: for instance ["operator"].
    pub at_start: Vec<String>,
    /// At each pose: for instance ["carpet", "door"].
    pub at_pose: Vec<String>,
}

/// In what the ranger stands.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SceneKeys {
    /// Scene file, or the name of a shipped scene.
    pub scene: String,
}

/// What is known about the ranger.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SensorKeys {
    /// Sensor preset, or a file with a sensor's data.
    pub sensor: String,
    /// End the blanking by hand as early as the sensor allows, as BINH does.
    pub short_blanking: bool,
    /// From firing until the receiver listens, microseconds, instead of the sensor's.
    #[schemars(range(min = 0, max = 100_000), example = 1500)]
    pub blanking_us: Option<f64>,
    /// Height of the transducer in a scene with floor, ceiling or low walls, metres.
    #[schemars(range(min = -100, max = 100), example = 0.3)]
    pub height_m: Option<f64>,
    /// Elevation of the transducer's axis, degrees, instead of the sensor's.
    #[schemars(range(min = -90, max = 90), example = 2)]
    pub tilt_deg: Option<f64>,
    /// How echoes are predicted.
    #[serde(flatten)]
    pub options: OptionKeys,
}

/// What to do about a scan that a check finds something wrong with.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum Action {
    /// Keep it, and say so in the report.
    #[default]
    Note,
    /// Set it aside and take it again.
    Retake,
    /// Ask at the terminal; without one, stop.
    Ask,
    /// Set it aside and stop.
    Stop,
}

/// What to do when the air is no longer that of the session.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum AirAction {
    /// Begin a session with the air as it is now, and predict anew.
    #[default]
    NewSession,
    /// Go on with the session's, and say so in the report.
    Note,
    /// Stop.
    Stop,
}

/// What is looked at after each scan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct CheckKeys {
    /// Beams of a scan that may lack a usable reading: lost, the motor's place in doubt, or the
    /// module not fired.
    #[schemars(range(min = 0, max = 65_535))]
    pub max_missing_beams: u32,
    /// What to do about more of them.
    pub on_missing_beams: Action,
    /// How far off the index may be found after a scan, motor steps: missed steps show there.
    #[schemars(range(min = 0, max = 10_000))]
    pub max_home_drift_steps: u32,
    /// What to do about more.
    pub on_home_drift: Action,
    /// How far the thermometer may be from the session's air before a scan, degrees Celsius.
    #[schemars(range(min = 0, max = 50))]
    pub max_temperature_drift_c: f64,
    /// What to do about more.
    pub on_temperature_drift: AirAction,
    /// How far the thermometer may move during a scan, degrees Celsius.
    #[schemars(range(min = 0, max = 50))]
    pub max_temperature_change_c: f64,
    /// What to do about more.
    pub on_temperature_change: Action,
    /// Share of the compared beams that the model may leave unexplained; more means a wrong pose,
    /// a wrong scene, or a room that changed. 1 for any share.
    #[schemars(range(min = 0, max = 1))]
    pub max_unexplained_share: f64,
    /// What to do about more.
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
            patience_s: 600.0,
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

impl Form for CollectionKeys {
    const HEAD: &'static str = "\
# Plan of a collection for `sonard collect`. Every key is here, with its default; a key without one
# stands in a comment with an example. `sonard collect PLAN.toml --check` reads it, `--plan-only`
# says how long it takes.
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
    use sonard_api::config::{Kind, Layers, document};

    fn read(text: &str) -> Result<CollectionKeys, sonard_api::config::ConfigError> {
        Layers::<CollectionKeys>::new().file("plan.toml", text)?.keys()
    }

    #[test]
    fn the_example_is_the_defaults_and_every_key_says_what_it_is() {
        assert_eq!(read(&document::<CollectionKeys>()), Ok(CollectionKeys::default()));
        for section in CollectionKeys::sections() {
            assert!(!section.about.is_empty(), "{}", section.name);
            for key in &section.keys {
                let (of, name) = (&section.name, &key.name);
                assert!(key.about.ends_with('.'), "{of}.{name}: {}", key.about);
                assert!(key.default.is_some() || key.example.is_some(), "{of}.{name}");
                if let Kind::Number { min, max } | Kind::Whole { min, max } = key.kind {
                    assert!(min > f64::MIN && max < f64::MAX, "{of}.{name}");
                }
            }
        }
    }

    #[test]
    fn conditions_take_any_key_and_other_sections_only_their_own() {
        let keys = read(
            "[conditions]\nroom = \"laboratory\"\ncarpet = false\nhumidity_percent = 41\n\
             [collection]\nrepeats = 3\n",
        )
        .expect("it is right");
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
