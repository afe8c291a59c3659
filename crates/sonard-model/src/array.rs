//! Arrays: several rangers at fixed bearings on a robot, fired in sequence, in contrast to one
//! ranger on a stepper.
//!
//! [`RangerArray`] holds an array's parameters, [`RobotCourse`] the trajectory of its robot.
//! [`ArrayModel`](crate::model::ArrayModel) predicts the readings of the rangers, with crosstalk:
//! rangers receive each other's sound if they fire simultaneously, or before the sound of the
//! previous slot has decayed.

mod body;
mod course;
mod error;
mod firing;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use body::{Body, BodyShape};
pub use course::{CourseError, RobotCourse};
pub use error::{ArrayError, ArrayPoseError};
pub use firing::{FiringSlot, InterferingFiring};

use crate::{
    geometry::{DVec2, Pose, wrap_360},
    scan_plan::ScanPlan,
    scene::Scene,
};

/// Data files shipped with the program, by name.
const PRESETS: [(&str, &str); 3] = [
    ("pioneer-8", include_str!("../../../arrays/pioneer-8.json")),
    ("pioneer-7", include_str!("../../../arrays/pioneer-7.json")),
    ("ring-12", include_str!("../../../arrays/ring-12.json")),
];

/// Maximum number of rangers of an array, and of firings of a round.
const MAX_ENTRIES: usize = 256;

/// Rangers at fixed bearings on one robot.
///
/// Positions are in the robot's frame: x forward, y to the left.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RangerArray {
    /// Name of the preset.
    pub name: String,
    /// One-sentence description of the array.
    pub description: String,
    /// Sensor of all rangers: a preset, or a file with a sensor's data.
    pub sensor: String,
    /// Interval between consecutive firings, milliseconds; also the detection window of a ranger.
    pub interval_ms: f64,
    /// Rangers in their default firing order.
    pub rangers: Vec<MountedRanger>,
    /// Firing order by id. Ids may be repeated or left out; a list of ids is fired simultaneously.
    /// Default: all rangers in the order above, one after the other.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub firing_order: Vec<FiringSlot>,
    /// Body of the robot, which blocks sound. Default: the robot of the scene, if it has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<Body>,
    /// Source of each figure above, by field name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub sources: BTreeMap<String, String>,
}

/// Ranger mounted on the robot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MountedRanger {
    /// Identifier of the ranger in records.
    pub id: String,
    /// Forward offset of the face's centre from the robot's position, metres.
    pub x_m: f64,
    /// Left offset of the face's centre from the robot's position, metres.
    pub y_m: f64,
    /// Beam direction, degrees counter-clockwise from the heading.
    pub bearing_deg: f64,
    /// Height in a scene with heights, metres; default: the sensor's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub z_m: Option<f64>,
}

impl MountedRanger {
    /// World pose of the ranger on a robot at a pose.
    #[must_use]
    pub fn world_pose(&self, robot: &Pose) -> Pose {
        let place = robot.position() + robot.rotate_to_world(DVec2::new(self.x_m, self.y_m));
        let heading_deg = robot.heading_deg + self.bearing_deg;
        Pose { x_m: place.x, y_m: place.y, heading_deg }
    }

    /// Bearing as an azimuth in records, degrees in [0, 360).
    #[must_use]
    pub fn azimuth_deg(&self) -> f64 {
        wrap_360(self.bearing_deg)
    }
}

impl RangerArray {
    /// Names of the presets, in order.
    pub fn preset_names() -> impl Iterator<Item = &'static str> {
        PRESETS.iter().map(|(name, _)| *name)
    }

    /// Data file of a shipped array, verbatim.
    #[must_use]
    pub fn preset_text(name: &str) -> Option<&'static str> {
        PRESETS.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
    }

    /// Loads a shipped array.
    ///
    /// # Errors
    /// If there is no preset of that name.
    pub fn preset(name: &str) -> Result<Self, ArrayError> {
        match Self::preset_text(name) {
            Some(text) => Self::from_json(text),
            None => Err(ArrayError::UnknownPreset {
                name: name.to_owned(),
                known: Self::preset_names().map(str::to_owned).collect(),
            }),
        }
    }

    /// Parses an array from the text of a data file.
    ///
    /// # Errors
    /// If the text is not an array's, a value is out of range, or ids are inconsistent.
    pub fn from_json(text: &str) -> Result<Self, ArrayError> {
        let mut json = serde_json::Deserializer::from_str(text);
        let array: Self = serde_path_to_error::deserialize(&mut json).map_err(|error| {
            let field = error.path().to_string();
            ArrayError::form(field, error.inner())
        })?;
        json.end().map_err(|error| ArrayError::form("end of file".to_owned(), &error))?;
        array.check()?;
        Ok(array)
    }

    /// Checks that every value is in range and that ids are consistent.
    ///
    /// # Errors
    /// Returns the first value that is not.
    pub fn check(&self) -> Result<(), ArrayError> {
        within("interval_ms", self.interval_ms, 1.0, 10_000.0)?;
        let count = self.rangers.len();
        if !(1..=MAX_ENTRIES).contains(&count) {
            return Err(ArrayError::Count { field: "rangers", count, max: MAX_ENTRIES });
        }
        for (at, ranger) in self.rangers.iter().enumerate() {
            let field = |name| format!("rangers[{at}].{name}");
            if ranger.id.is_empty() {
                return Err(ArrayError::MissingId { field: field("id") });
            }
            let before = self.rangers[..at].iter().position(|other| other.id == ranger.id);
            if let Some(first) = before {
                let (field, id) = (field("id"), ranger.id.clone());
                return Err(ArrayError::DuplicateId { field, id, first });
            }
            within(field("x_m"), ranger.x_m, -10.0, 10.0)?;
            within(field("y_m"), ranger.y_m, -10.0, 10.0)?;
            within(field("bearing_deg"), ranger.bearing_deg, -360.0, 360.0)?;
            within(field("z_m"), ranger.z_m.unwrap_or(0.0), -1000.0, 1000.0)?;
        }
        self.body.as_ref().map_or(Ok(()), Body::check)?;
        self.check_order()
    }

    /// Index into `rangers` of the ranger with an id.
    #[must_use]
    pub fn index_of(&self, id: &str) -> Option<usize> {
        self.rangers.iter().position(|ranger| ranger.id == id)
    }

    /// Ranger with an id.
    #[must_use]
    pub fn ranger(&self, id: &str) -> Option<&MountedRanger> {
        self.index_of(id).map(|at| &self.rangers[at])
    }

    /// Scan plan with the beam count of `rounds` rounds, evenly spaced. The directions are those of
    /// the individual readings.
    #[must_use]
    pub fn plan(&self, rounds: u32) -> ScanPlan {
        let beams = self.round().count() as f64 * f64::from(rounds.max(1));
        ScanPlan { step_deg: 360.0 / beams, ..ScanPlan::default() }
    }

    /// Robot poses of `rounds` rounds from a pose on. The robot rotates in place by equal parts of
    /// the angle between two rangers of an even ring, so that the directions are evenly spaced.
    #[must_use]
    pub fn rotated_poses(&self, pose: &Pose, rounds: u32) -> Vec<Pose> {
        let step_deg = self.plan(rounds).step_deg;
        let heading_deg = |round| wrap_360(pose.heading_deg + f64::from(round) * step_deg);
        let turned = (1..rounds).map(|round| Pose { heading_deg: heading_deg(round), ..*pose });
        std::iter::once(*pose).chain(turned).collect()
    }

    /// Scene with the body of this array's robot as its robot.
    #[must_use]
    pub fn scene_with_body(&self, scene: &Scene) -> Scene {
        let own = self.body.as_ref().map(Body::robot);
        Scene { robot: own.or_else(|| scene.robot.clone()), ..scene.clone() }
    }

    /// Checks that a robot with the array fits at a pose of a scene: the conditions for a single
    /// ranger, and the face of every ranger in free space and outside the body.
    ///
    /// # Errors
    /// Names the ranger that does not fit, and the obstruction.
    pub fn check_pose(&self, scene: &Scene, robot: &Pose) -> Result<(), ArrayPoseError> {
        self.check_poses(scene, std::slice::from_ref(robot)).map_err(|(_, error)| error)
    }

    /// Checks many poses as [`check_pose`](Self::check_pose) does.
    ///
    /// # Errors
    /// Returns the index of the first pose that fails, and its error.
    pub fn check_poses(
        &self,
        scene: &Scene,
        poses: &[Pose],
    ) -> Result<(), (usize, ArrayPoseError)> {
        let faces = |robot: &Pose| {
            let faces = self.rangers.iter().map(|ranger| ranger.world_pose(robot).position());
            (*robot, faces.collect())
        };
        let checked =
            self.scene_with_body(scene).check_many_face_positions(poses.iter().map(faces));
        checked.map_err(|(at, (ranger, error))| {
            let ranger = ranger.map(|ranger| self.rangers[ranger].id.clone());
            (at, ArrayPoseError { ranger, error })
        })
    }
}

/// Range check that rejects NaN as well.
fn within(field: impl Into<String>, value: f64, min: f64, max: f64) -> Result<(), ArrayError> {
    if (min..=max).contains(&value) {
        Ok(())
    } else {
        Err(ArrayError::OutOfRange { field: field.into(), value, min, max })
    }
}
