//! Names of reflectors and diffractors: ids of the scene, and fixed names for objects without an
//! id.

use super::{Diffractor, Edge, Mechanism, Reflector};
use crate::scene::Scene;

/// Name of the transducer's own face on a path.
pub const FACE_NAME: &str = "transducer";
/// Names of a room's floor and ceiling.
const FLOOR: &str = "floor";
const CEILING: &str = "ceiling";

impl Reflector {
    /// Name in a scene: the id of a wall or cylinder, `floor` or `ceiling`.
    ///
    /// # Panics
    /// If the reflector is of another scene.
    #[must_use]
    pub fn name(self, scene: &Scene) -> String {
        match self {
            Self::Wall(index) => scene.walls[index as usize].id.to_string(),
            Self::Cylinder(index) => scene.cylinders[index as usize].id.to_string(),
            Self::Floor => FLOOR.to_owned(),
            Self::Ceiling => CEILING.to_owned(),
        }
    }
}

impl Mechanism {
    /// Name of the object in a scene: that of the [`Reflector`], of the [`Diffractor`], or
    /// [`FACE_NAME`].
    ///
    /// # Panics
    /// If the mechanism is of another scene.
    #[must_use]
    pub fn name(self, scene: &Scene) -> String {
        match self {
            Self::Reflection(reflector) => reflector.name(scene),
            Self::Diffraction(diffractor) => diffractor.name(scene),
            Self::Scattering { wall } => Reflector::Wall(wall).name(scene),
            Self::Transducer => FACE_NAME.to_owned(),
        }
    }
}

impl Diffractor {
    /// Name in a scene: `WALL.a` and `WALL.b` are the upright edges at the ends of a wall,
    /// `WALL.top` and `WALL.bottom` the level ones; a thin cylinder has its id.
    ///
    /// # Panics
    /// If the diffractor is of another scene.
    #[must_use]
    pub fn name(self, scene: &Scene) -> String {
        let (wall, end) = match self {
            Self::Upright(Edge { wall, at_b: false }) => (wall, "a"),
            Self::Upright(Edge { wall, at_b: true }) => (wall, "b"),
            Self::Level { wall, is_upper: true } => (wall, "top"),
            Self::Level { wall, is_upper: false } => (wall, "bottom"),
            Self::Post { cylinder } => return Reflector::Cylinder(cylinder).name(scene),
        };
        format!("{}.{end}", scene.walls[wall as usize].id)
    }
}
