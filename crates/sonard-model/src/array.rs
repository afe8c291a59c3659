//! Arrays: several rangers at fixed bearings on a robot, fired in turn. The arrangement beside the
//! stepper, on which one ranger turns.
//!
//! [`RangerArray`] is what is known about one, [`Course`] the course of its robot.
//! [`ArrayModel`](crate::model::ArrayModel) predicts what its rangers read, with crosstalk: rangers that fire
//! at once, or before the sound of the turn before has died away, receive one another.

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
pub use course::{Course, CourseError};
pub use error::{ArrayError, ArrayPoseError};
pub use firing::{OtherFiring, Turn};

use crate::{
    geometry::{DVec2, Pose, wrap_360},
    plan::ScanPlan,
    scene::Scene,
};

/// The data files that come with the program, by name.
const PRESETS: [(&str, &str); 3] = [
    ("pioneer-8", include_str!("../../../arrays/pioneer-8.json")),
    ("pioneer-7", include_str!("../../../arrays/pioneer-7.json")),
    ("ring-12", include_str!("../../../arrays/ring-12.json")),
];

/// Most rangers of an array, and most firings of a round.
const MOST: usize = 256;

/// Rangers at fixed bearings on one robot.
///
/// Places are in a frame that moves and turns with the robot's pose: x ahead, y to the left.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RangerArray {
    /// The preset's name.
    pub name: String,
    /// What it is, in a sentence.
    pub description: String,
    /// What kind of ranger all of them are: a sensor preset, or a file with a sensor's data.
    pub sensor: String,
    /// From one firing to the next, milliseconds. A ranger listens for as long.
    pub interval_ms: f64,
    /// The rangers.
    pub rangers: Vec<MountedRanger>,
    /// Ids in the order in which they are fired, some perhaps more than once or not at all, a list of ids for
    /// rangers that fire at once; without it, all in the order above, one after the other.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub firing_order: Vec<Turn>,
    /// The body of the robot, which sound does not pass. Without it, the one that the scene has, or
    /// none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<Body>,
    /// For each figure above, by field name, where it comes from.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub sources: BTreeMap<String, String>,
}

/// A ranger on the robot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MountedRanger {
    /// Its name in records.
    pub id: String,
    /// The middle of its face ahead of the robot's place, metres.
    pub x_m: f64,
    /// The same to the left, metres.
    pub y_m: f64,
    /// Where it looks, degrees counter-clockwise from the heading.
    pub bearing_deg: f64,
    /// Height in a scene with heights, metres; without it, the sensor's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub z_m: Option<f64>,
}

impl MountedRanger {
    /// Where it stands in the world and looks to, on a robot at a pose.
    #[must_use]
    pub fn pose_on(&self, robot: &Pose) -> Pose {
        let turn = DVec2::from_angle(robot.direction_rad(0.0));
        let place = robot.position() + turn.rotate(DVec2::new(self.x_m, self.y_m));
        let heading_deg = robot.heading_deg + self.bearing_deg;
        Pose { x_m: place.x, y_m: place.y, heading_deg }
    }

    /// Its bearing as records have it, degrees in [0, 360).
    #[must_use]
    pub fn azimuth_deg(&self) -> f64 {
        wrap_360(self.bearing_deg)
    }
}

impl RangerArray {
    /// The names of the presets.
    pub fn preset_names() -> impl Iterator<Item = &'static str> {
        PRESETS.iter().map(|(name, _)| *name)
    }

    /// The file of an array that comes with the program, as it is shipped.
    #[must_use]
    pub fn preset_text(name: &str) -> Option<&'static str> {
        PRESETS.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
    }

    /// An array that comes with the program.
    ///
    /// # Errors
    /// When there is none of that name.
    pub fn preset(name: &str) -> Result<Self, ArrayError> {
        match Self::preset_text(name) {
            Some(text) => Self::from_json(text),
            None => Err(ArrayError::UnknownPreset {
                name: name.to_owned(),
                known: Self::preset_names().map(str::to_owned).collect(),
            }),
        }
    }

    /// An array from the text of a data file.
    ///
    /// # Errors
    /// When the text is not an array's, a figure is out of range, or ids do not fit.
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

    /// Checks that every figure makes sense and that ids fit.
    ///
    /// # Errors
    /// Names the first that does not.
    pub fn check(&self) -> Result<(), ArrayError> {
        within("interval_ms", self.interval_ms, 1.0, 10_000.0)?;
        let count = self.rangers.len();
        if !(1..=MOST).contains(&count) {
            return Err(ArrayError::Count { field: "rangers", count, most: MOST });
        }
        for (at, ranger) in self.rangers.iter().enumerate() {
            let field = |name| format!("rangers[{at}].{name}");
            if ranger.id.is_empty() {
                return Err(ArrayError::NoId { field: field("id") });
            }
            let before = self.rangers[..at].iter().position(|other| other.id == ranger.id);
            if let Some(first) = before {
                let (field, id) = (field("id"), ranger.id.clone());
                return Err(ArrayError::SameId { field, id, first });
            }
            within(field("x_m"), ranger.x_m, -10.0, 10.0)?;
            within(field("y_m"), ranger.y_m, -10.0, 10.0)?;
            within(field("bearing_deg"), ranger.bearing_deg, -360.0, 360.0)?;
            within(field("z_m"), ranger.z_m.unwrap_or(0.0), -1000.0, 1000.0)?;
        }
        self.body.as_ref().map_or(Ok(()), Body::check)?;
        self.check_order()
    }

    /// The ranger of an id, as an index into `rangers`.
    #[must_use]
    pub fn index_of(&self, id: &str) -> Option<usize> {
        self.rangers.iter().position(|ranger| ranger.id == id)
    }

    /// The ranger of an id.
    #[must_use]
    pub fn ranger(&self, id: &str) -> Option<&MountedRanger> {
        self.index_of(id).map(|at| &self.rangers[at])
    }

    /// A plan that counts so many rounds right: as many beams as there are firings, spread evenly.
    /// Where they look is each reading's own.
    #[must_use]
    pub fn plan(&self, rounds: u32) -> ScanPlan {
        let beams = self.round().count() as f64 * f64::from(rounds.max(1));
        ScanPlan { step_deg: 360.0 / beams, ..ScanPlan::default() }
    }

    /// Where a robot stands in each of so many rounds from a pose on: it turns in place by equal parts of the angle
    /// between two rangers of an even ring, so that directions are spread evenly.
    #[must_use]
    pub fn turned(&self, pose: &Pose, rounds: u32) -> Vec<Pose> {
        let step_deg = self.plan(rounds).step_deg;
        let heading_deg = |round| wrap_360(pose.heading_deg + f64::from(round) * step_deg);
        let turned = (1..rounds).map(|round| Pose { heading_deg: heading_deg(round), ..*pose });
        std::iter::once(*pose).chain(turned).collect()
    }

    /// A scene with this robot's body as its robot.
    #[must_use]
    pub fn in_scene(&self, scene: &Scene) -> Scene {
        let own = self.body.as_ref().map(Body::robot);
        Scene { robot: own.or_else(|| scene.robot.clone()), ..scene.clone() }
    }

    /// Whether a robot that carries the array can stand at a pose of a scene: as for one ranger,
    /// and every ranger has to have its face in the open, outside the body too.
    ///
    /// # Errors
    /// Which ranger can't be there, and why.
    pub fn check_pose(&self, scene: &Scene, robot: &Pose) -> Result<(), ArrayPoseError> {
        self.check_poses(scene, std::slice::from_ref(robot)).map_err(|(_, error)| error)
    }

    /// The same for many poses.
    ///
    /// # Errors
    /// The first pose that fails, by its index, and why.
    pub fn check_poses(
        &self,
        scene: &Scene,
        poses: &[Pose],
    ) -> Result<(), (usize, ArrayPoseError)> {
        let faces = |robot: &Pose| {
            let faces = self.rangers.iter().map(|ranger| ranger.pose_on(robot).position());
            (*robot, faces.collect())
        };
        let checked = self.in_scene(scene).check_many_places(poses.iter().map(faces));
        checked.map_err(|(at, (ranger, error))| {
            let ranger = ranger.map(|ranger| self.rangers[ranger].id.clone());
            (at, ArrayPoseError { ranger, error })
        })
    }
}

/// Written so that NaN is refused too.
fn within(field: impl Into<String>, value: f64, least: f64, most: f64) -> Result<(), ArrayError> {
    if (least..=most).contains(&value) {
        Ok(())
    } else {
        Err(ArrayError::Figure { field: field.into(), value, least, most })
    }
}
