//! Names of what a path meets: ids of the scene, and words for what has no id.

use super::{Bend, Edge, Reflector};
use crate::scene::Scene;

/// What the transducer's own face is called on a path.
pub const FACE_NAME: &str = "transducer";
/// The same of a room's floor and ceiling.
const FLOOR: &str = "floor";
const CEILING: &str = "ceiling";

impl Reflector {
    /// Its name in a scene: the id of a wall or cylinder, `floor` or `ceiling`.
    ///
    /// # Panics
    /// If it is of another scene.
    #[must_use]
    pub fn name(self, scene: &Scene) -> String {
        match self {
            Self::Wall(index) => scene.walls[index as usize].id.to_string(),
            Self::Cylinder(index) => scene.cylinders[index as usize].id.to_string(),
            Self::Floor => FLOOR.to_owned(),
            Self::Ceiling => CEILING.to_owned(),
        }
    }

    /// The reflector of that name; `None` if the scene has none.
    #[must_use]
    pub fn named(scene: &Scene, name: &str) -> Option<Self> {
        let wall = scene.walls.iter().position(|wall| &*wall.id == name);
        let cylinder = || scene.cylinders.iter().position(|cylinder| &*cylinder.id == name);
        wall.map(|index| Self::Wall(index as u32))
            .or_else(|| cylinder().map(|index| Self::Cylinder(index as u32)))
            .or_else(|| (name == FLOOR).then_some(Self::Floor))
            .or_else(|| (name == CEILING).then_some(Self::Ceiling))
    }
}

impl Bend {
    /// Its name in a scene: `WALL.a` and `WALL.b` are the upright edges at the ends of a wall, `WALL.top`
    /// and `WALL.bottom` the level ones.
    ///
    /// # Panics
    /// If it is of another scene.
    #[must_use]
    pub fn name(self, scene: &Scene) -> String {
        let (wall, end) = match self {
            Self::Upright(Edge { wall, at_b: false }) => (wall, "a"),
            Self::Upright(Edge { wall, at_b: true }) => (wall, "b"),
            Self::Level { wall, is_upper: true } => (wall, "top"),
            Self::Level { wall, is_upper: false } => (wall, "bottom"),
        };
        format!("{}.{end}", scene.walls[wall as usize].id)
    }

    /// The edge of that name; `None` if the scene has none.
    #[must_use]
    pub fn named(scene: &Scene, name: &str) -> Option<Self> {
        let (wall, end) = name.rsplit_once('.')?;
        let wall = scene.walls.iter().position(|known| &*known.id == wall)? as u32;
        match end {
            "a" => Some(Self::Upright(Edge { wall, at_b: false })),
            "b" => Some(Self::Upright(Edge { wall, at_b: true })),
            "top" => Some(Self::Level { wall, is_upper: true }),
            "bottom" => Some(Self::Level { wall, is_upper: false }),
            _ => None,
        }
    }
}
