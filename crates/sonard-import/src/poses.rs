//! Poses of planned scans, from operators, files and programs.

use std::{collections::BTreeMap, fmt};

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use sonard_model::{geometry::Pose, scene::Scene};

/// Conditions recorded with a scan: name and value.
pub type Conditions = Map<String, Value>;

/// Pose of a collection, with optional name and conditions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NamedPose {
    /// Name of the pose.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Position and heading.
    #[serde(flatten)]
    pub pose: Pose,
    /// Recorded conditions, such as the state of a door.
    #[serde(default, skip_serializing_if = "Conditions::is_empty")]
    pub conditions: Conditions,
}

/// Reason why a pose is missing or invalid.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PoseFault {
    /// Line number in the file, from 1, if the pose is from a file.
    pub line: Option<u64>,
    /// Description of the fault.
    pub message: String,
    /// Suggested correction for the user.
    pub help: String,
}

impl fmt::Display for PoseFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl PoseFault {
    fn new(message: impl fmt::Display, help: impl fmt::Display) -> Self {
        Self { line: None, message: message.to_string(), help: help.to_string() }
    }

    fn at(self, line: u64) -> Self {
        Self { line: Some(line), ..self }
    }
}

impl NamedPose {
    /// Parses a pose from one line: a JSON object, `X,Y,DEG`, or the name of a pose of the scene.
    /// The pose must be free for the ranger.
    ///
    /// # Errors
    /// Returns the fault and its correction if the text is not a pose or the pose is not free.
    pub fn parse(text: &str, scene: &Scene) -> Result<Self, PoseFault> {
        Self::read(text, scene, None)?.checked(scene)
    }

    /// Parses a pose without checking that it is free; `heading_deg` is the default of a JSON
    /// object without heading.
    fn read(text: &str, scene: &Scene, heading_deg: Option<f64>) -> Result<Self, PoseFault> {
        let text = text.trim();
        if text.starts_with('{') {
            let object = serde_json::from_str(text).map_err(|error| {
                PoseFault::new(format!("{text}: not a JSON object: {error}"), JSON_HELP)
            })?;
            return Self::from_object(object, heading_deg);
        }
        let pose = scene.pose(text).map_err(|error| PoseFault::new(&error, error.help()))?;
        let name = scene.poses.contains_key(text).then(|| text.to_owned());
        Ok(Self { name, pose, conditions: Conditions::new() })
    }

    /// Converts an object with `x_m`, `y_m`, `heading_deg` and optional `name`; other keys become
    /// conditions.
    fn from_object(
        mut object: Map<String, Value>,
        heading_deg: Option<f64>,
    ) -> Result<Self, PoseFault> {
        let mut number = |key: &str, default: Option<f64>| match object.remove(key) {
            Some(value) => {
                value.as_f64().ok_or_else(|| PoseFault::new(format!("{key} is {value}"), JSON_HELP))
            }
            None => default.ok_or_else(|| PoseFault::new(format!("{key} is missing"), JSON_HELP)),
        };
        let (x_m, y_m) = (number("x_m", None)?, number("y_m", None)?);
        let heading_deg = number("heading_deg", heading_deg)?;
        let name = match object.remove("name") {
            None | Some(Value::Null) => None,
            Some(Value::String(name)) => Some(name).filter(|name| !name.is_empty()),
            Some(other) => Some(other.to_string()),
        };
        let pose = Pose { x_m, y_m, heading_deg };
        Ok(Self { name, pose, conditions: object.into_iter().collect() })
    }

    fn checked(self, scene: &Scene) -> Result<Self, PoseFault> {
        scene.check_pose(&self.pose).map_err(|error| PoseFault::new(&error, error.help()))?;
        Ok(self)
    }

    /// Returns `true` if pose and name are equal; conditions may differ.
    #[must_use]
    pub fn is_same_place(&self, other: &Self) -> bool {
        self.pose == other.pose && self.name == other.name
    }

    /// Name of the pose, or its coordinates as `X,Y,DEG`.
    #[must_use]
    pub fn label(&self) -> String {
        let Pose { x_m, y_m, heading_deg } = self.pose;
        self.name.clone().unwrap_or_else(|| format!("{x_m},{y_m},{heading_deg}"))
    }
}

/// Finds the number of each listed pose in a collection; `None` for a new one. A pose listed twice
/// has two numbers.
#[must_use]
pub fn find_numbers(listed: &[NamedPose], known: &BTreeMap<u32, NamedPose>) -> Vec<Option<u32>> {
    let mut free: Vec<(u32, &NamedPose)> =
        known.iter().map(|(number, pose)| (*number, pose)).collect();
    let mut number = |pose: &NamedPose| {
        let at = free.iter().position(|(_, known)| known.is_same_place(pose))?;
        Some(free.remove(at).0)
    };
    listed.iter().map(&mut number).collect()
}

const JSON_HELP: &str = "a pose is {\"x_m\": 1.2, \"y_m\": 0.8, \"heading_deg\": 90}, optionally \
                         with \"name\", in metres and degrees; or X,Y,DEG; or a pose of the scene";
const CSV_HELP: &str = "the first line names the columns: x_m,y_m,heading_deg, optionally name; \
                        further columns are recorded as conditions";

/// Line of a pose file.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseLine {
    /// Line number, from 1.
    pub line: u64,
    /// Parsed pose, not checked against the scene, or the fault of the line.
    pub pose: Result<NamedPose, PoseFault>,
}

/// Parses a pose file: JSON lines if its first character is `{`, otherwise CSV with a header. Each
/// pose must be free for the ranger.
///
/// # Errors
/// Returns the fault of the first invalid line.
pub fn parse_pose_file(text: &str, scene: &Scene) -> Result<Vec<NamedPose>, PoseFault> {
    let lines = parse_pose_lines(text, scene, None)?.into_iter();
    lines
        .map(|PoseLine { line, pose }| {
            pose.and_then(|pose| pose.checked(scene)).map_err(|fault| fault.at(line))
        })
        .collect()
}

/// Parses a pose file line by line; an invalid line does not affect others. `heading_deg` is the
/// default of JSON objects without heading.
///
/// # Errors
/// Returns an error if the file is empty or a required column is missing.
pub fn parse_pose_lines(
    text: &str,
    scene: &Scene,
    heading_deg: Option<f64>,
) -> Result<Vec<PoseLine>, PoseFault> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let lines = if text.trim_start().starts_with('{') {
        json_lines(text, scene, heading_deg)
    } else {
        comma_separated(text)?
    };
    if lines.is_empty() {
        return Err(PoseFault::new("no pose in the file", CSV_HELP));
    }
    Ok(lines)
}

fn json_lines(text: &str, scene: &Scene, heading_deg: Option<f64>) -> Vec<PoseLine> {
    (1..)
        .zip(text.lines())
        .filter(|(_, text)| !text.trim().is_empty())
        .map(|(line, text)| PoseLine { line, pose: NamedPose::read(text, scene, heading_deg) })
        .collect()
}

fn comma_separated(text: &str) -> Result<Vec<PoseLine>, PoseFault> {
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(text.as_bytes());
    let fault = |error: &csv::Error| {
        let line = error.position().map(csv::Position::line);
        PoseFault { line, ..PoseFault::new(error, CSV_HELP) }
    };
    let columns = reader.headers().map_err(|error| fault(&error))?.clone();
    for needed in ["x_m", "y_m", "heading_deg"] {
        if !columns.iter().any(|column| column == needed) {
            return Err(PoseFault::new(format!("column {needed} is missing"), CSV_HELP).at(1));
        }
    }
    let lines = reader.records().map(|record| {
        let record = match record {
            Ok(record) => record,
            Err(error) => {
                let fault = fault(&error);
                return PoseLine { line: fault.line.unwrap_or(1), pose: Err(fault) };
            }
        };
        let line = record.position().map_or(0, csv::Position::line);
        let cells = columns.iter().zip(record.iter()).filter(|(_, cell)| !cell.is_empty());
        let object = cells.map(|(column, cell)| (column.to_owned(), value(column, cell))).collect();
        PoseLine { line, pose: NamedPose::from_object(object, None) }
    });
    Ok(lines.collect())
}

/// Converts a cell to a number or a boolean where possible; a name is always text.
fn value(column: &str, cell: &str) -> Value {
    let parsed = serde_json::from_str(cell).ok();
    let scalar = parsed.filter(|value: &Value| value.is_number() || value.is_boolean());
    scalar.filter(|_| column != "name").unwrap_or_else(|| cell.into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use sonard_model::scene::shipped;

    use proptest::prelude::*;

    fn room() -> Scene {
        Scene::from_json(shipped::text("simple-room").expect("shipped")).expect("valid")
    }

    #[test]
    fn all_formats() {
        let room = room();
        let named = NamedPose::parse("fig9", &room).expect("a pose");
        assert_eq!((named.label().as_str(), named.pose.x_m), ("fig9", 0.774));
        let json = r#"{"x_m": 0.5, "y_m": 0.3, "heading_deg": 90, "name": "a", "door": "open"}"#;
        let pose = NamedPose::parse(json, &room).expect("a pose");
        assert_eq!((pose.label().as_str(), &pose.conditions["door"]), ("a", &"open".into()));
        assert_eq!(NamedPose::parse("0.5,0.3,90", &room).expect("a pose").label(), "0.5,0.3,90");
        let text = "name, x_m, y_m, heading_deg, carpet\nb,0.5,0.3,0,true\n7,0.6,0.2,45,\n";
        let poses = parse_pose_file(text, &room).expect("poses");
        assert_eq!(poses[0].conditions["carpet"], true);
        assert_eq!(poses[1].name.as_deref(), Some("7"));
        assert!(poses[1].conditions.is_empty());
        let lines = format!("{json}\n\n{json}\n");
        assert_eq!(parse_pose_file(&lines, &room).expect("poses").len(), 2);
    }

    proptest! {
        /// Random text: parsed, or rejected with a line number of the text.
        #[test]
        fn random_text(
            pieces in prop::collection::vec(
                prop_oneof![
                    8 => prop::sample::select(vec![
                        "x_m", "y_m", "heading_deg", "name", ",", ",", "\n", "0.5", "0.3", "1e999",
                        "\"", "{\"x_m\":0.5,\"y_m\":0.3,\"heading_deg\":0}", "{", "}", "true", "\r\n",
                    ]).prop_map(str::to_owned),
                    1 => "\\PC{0,6}",
                ],
                0..30,
            ),
            header in any::<bool>(),
        ) {
            let text = if header { "x_m,y_m,heading_deg\n".to_owned() } else { String::new() };
            let text = text + &pieces.concat();
            match parse_pose_file(&text, &room()) {
                Ok(poses) => prop_assert!(!poses.is_empty()),
                Err(fault) => {
                    let lines = text.split('\n').count() as u64;
                    let line = fault.line.unwrap_or(1);
                    prop_assert!((1..=lines + 1).contains(&line), "{fault} at {line} of {lines}");
                }
            }
        }
    }

    #[test]
    fn assigns_numbers() {
        let room = room();
        let pose = |text| NamedPose::parse(text, &room).expect("a pose");
        let known = [(1, pose("fig9")), (2, pose("fig7")), (4, pose("fig9"))].into();
        let listed = [pose("fig9"), pose("fig9"), pose("0.5,0.3,0"), pose("fig7"), pose("fig9")];
        assert_eq!(find_numbers(&listed, &known), [Some(1), Some(4), None, Some(2), None]);
    }

    #[test]
    fn reports_the_line_of_a_fault() {
        let room = room();
        for (text, line, message) in [
            ("x_m,y_m\n0.5,0.3\n", Some(1), "column heading_deg is missing"),
            ("x_m,y_m,heading_deg\n0.5,0.3,0\n0.5,zero,0\n", Some(3), "y_m is \"zero\""),
            ("x_m,y_m,heading_deg\n0.5,0.3\n", Some(2), "fields"),
            ("x_m,y_m,heading_deg\n5,0.3,0\n", Some(2), ""),
            ("x_m,y_m,heading_deg\n", None, "no pose"),
            ("", Some(1), "column x_m is missing"),
            (
                "{\"x_m\":0.5,\"y_m\":0.3,\"heading_deg\":0}\n{\"x_m\":1}\n",
                Some(2),
                "y_m is missing",
            ),
            ("{\"x_m\":0.5,\n", Some(1), "not a JSON object"),
        ] {
            let fault = parse_pose_file(text, &room).expect_err(text);
            assert_eq!(fault.line, line, "{text:?}: {fault}");
            assert!(fault.message.contains(message), "{text:?}: {fault}");
            assert!(!fault.help.is_empty());
        }
        assert!(NamedPose::parse("fig99", &room).expect_err("none").help.contains("fig9"));
    }
}
