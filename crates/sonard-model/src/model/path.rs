//! Propagation paths: interactions of the sound between transmitter and receiver.

use std::sync::Arc;

use crate::{geometry::DVec2, reading::PathKind};

/// A propagation path: its interactions in the order in which the sound reaches them.
///
/// The path is straight from the transmitter to the first point, from each point to the next, and
/// to the receiver.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Path {
    /// Interactions from the transmitter to the receiver. Firings from a point in several
    /// directions share those of their common paths.
    pub interactions: Arc<[Interaction]>,
}

/// A point where the sound changes its direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interaction {
    /// Mechanism of the change.
    pub mechanism: Mechanism,
    /// Point in the plan (world, metres).
    pub point: DVec2,
    /// Height, metres; `None` in a scene without floor and ceiling, and from engines without
    /// heights.
    pub z_m: Option<f64>,
}

/// A change of the direction of propagation, and the part of the scene that causes it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Mechanism {
    /// Mirror reflection (by engine [`Cone`](super::Cone), which has no mirrors: the nearest hit).
    Reflection(Reflector),
    /// Diffraction at an edge.
    Diffraction(Diffractor),
    /// Diffuse scattering by the roughness of a wall.
    Scattering {
        /// Index of the wall in `scene.walls`.
        wall: u32,
    },
    /// Return from the face of the transducer, which sends an echo out once more.
    Transducer,
}

/// A surface of the scene that reflects.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Reflector {
    /// A wall: `scene.walls[i]`.
    Wall(u32),
    /// A cylinder: `scene.cylinders[i]`.
    Cylinder(u32),
    /// The floor of a scene with heights.
    Floor,
    /// The ceiling of a scene with heights.
    Ceiling,
}

/// An edge of a scene, or an object that diffracts like an edge.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Diffractor {
    /// An upright edge: where walls end or join.
    Upright(Edge),
    /// A level edge of a wall that ends below the ceiling or above the floor.
    Level {
        /// Index of the wall in `scene.walls`.
        wall: u32,
        /// `true` for the wall's upper edge, `false` for its lower edge.
        is_upper: bool,
    },
    /// A thin cylinder, which scatters as a whole.
    Post {
        /// Index of the cylinder in `scene.cylinders`.
        cylinder: u32,
    },
}

/// An end of a wall.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Edge {
    /// Index of the wall in `scene.walls`.
    pub wall: u32,
    /// `true` for end `b`, `false` for end `a`.
    pub at_b: bool,
}

impl Path {
    /// Kind of the path in one word: scattering if any wall scatters it, otherwise diffraction if
    /// any edge diffracts it.
    #[must_use]
    pub fn kind(&self) -> PathKind {
        kind(self.mechanisms())
    }

    /// Number of mirror reflections, at walls, cylinders, floor and ceiling. Diffraction and
    /// scattering do not count, and neither does the transducer's face: a few wavelengths wide, it
    /// is no mirror.
    #[must_use]
    pub fn order(&self) -> usize {
        self.reflectors().count()
    }

    /// Mechanisms of the path, in order.
    pub fn mechanisms(&self) -> impl DoubleEndedIterator<Item = Mechanism> {
        self.interactions.iter().map(|interaction| interaction.mechanism)
    }

    /// Mirror reflections of the path, in order.
    pub fn reflectors(&self) -> impl DoubleEndedIterator<Item = Reflector> {
        self.mechanisms().filter_map(|mechanism| match mechanism {
            Mechanism::Reflection(reflector) => Some(reflector),
            _ => None,
        })
    }

    /// Edges that diffract the path, in order.
    pub fn diffractors(&self) -> impl DoubleEndedIterator<Item = Diffractor> {
        self.mechanisms().filter_map(|mechanism| match mechanism {
            Mechanism::Diffraction(diffractor) => Some(diffractor),
            _ => None,
        })
    }

    /// Returns the path as a line in the plan, between a transmitter and a receiver at these
    /// places.
    #[must_use]
    pub fn polyline(&self, [transmitter, receiver]: [DVec2; 2]) -> Vec<DVec2> {
        let points = self.interactions.iter().map(|interaction| interaction.point);
        std::iter::once(transmitter).chain(points).chain([receiver]).collect()
    }

    /// Returns the path from the receiver to the transmitter.
    #[must_use]
    pub fn reversed(&self) -> Self {
        Self { interactions: self.interactions.iter().rev().copied().collect() }
    }
}

/// [`Path::kind`] of a path with these mechanisms.
pub(super) fn kind(mechanisms: impl Iterator<Item = Mechanism>) -> PathKind {
    mechanisms.fold(PathKind::Specular, |kind, mechanism| match mechanism {
        Mechanism::Scattering { .. } => PathKind::Scattered,
        Mechanism::Diffraction(_) if kind == PathKind::Specular => PathKind::Diffracted,
        _ => kind,
    })
}

impl Mechanism {
    /// Wall or cylinder at whose surface or edge the mechanism acts, floor or ceiling; `None` for
    /// the transducer.
    #[must_use]
    pub const fn surface(self) -> Option<Reflector> {
        match self {
            Self::Reflection(reflector) => Some(reflector),
            Self::Diffraction(
                Diffractor::Upright(Edge { wall, .. }) | Diffractor::Level { wall, .. },
            )
            | Self::Scattering { wall } => Some(Reflector::Wall(wall)),
            Self::Diffraction(Diffractor::Post { cylinder }) => Some(Reflector::Cylinder(cylinder)),
            Self::Transducer => None,
        }
    }
}
