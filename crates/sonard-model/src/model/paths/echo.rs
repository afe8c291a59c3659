//! Echo paths as the mechanisms list them: length, field and directions, with a reference to what the
//! mechanism keeps of the path itself.

use super::tolerance::{SAME_M, SAME_RAD};
use crate::{geometry::DVec2, reading::PathKind};

/// An echo path before the beam pattern.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Echo {
    pub(crate) length_m: f64,
    pub(crate) amplitude: f64,
    pub(crate) phase_rad: f64,
    /// Unit vector in which it leaves.
    pub(crate) departure: DVec2,
    /// Unit vector towards where it comes from.
    pub(crate) arrival: DVec2,
    /// Elevation of departure and arrival, radians.
    pub(crate) rise_rad: [f64; 2],
    /// Its image by floor and ceiling, counted from 1; 0 for a path in the plan.
    pub(crate) image: u16,
    /// How steeply a path of the plan can climb, by the numbers in the beams from transmitter and from receiver.
    pub(crate) slopes: [u32; 2],
    /// Whether it touches cylinders more than once, or a cylinder and an upright edge: see
    /// [`Settings::contact_floor`](super::settings::Settings::contact_floor).
    pub(crate) is_repeated: bool,
    pub(crate) via: Via,
}

/// The mechanism of an echo, with its number among what that mechanism keeps.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Via {
    /// Mirror reflections at walls alone; the node of the tree of beams at which its ray ends.
    Walls { node: u32 },
    /// Diffraction at one upright edge; `out` and `back` number the rays to it from transmitter and
    /// receiver.
    Edge { point: u32, out: u32, back: u32 },
    /// Diffraction at two upright edges.
    Edges { double: u32 },
    /// Reflection at cylinders; the connection in the middle of the path.
    Cylinder { connection: u32 },
    /// Straight up or down and back.
    Upright,
    /// Scattering by a patch of a rough wall.
    Scatter { patch: u32 },
    /// Diffraction at a level edge.
    LevelEdge { level: u32 },
}

impl Via {
    /// The kind of path.
    pub(crate) const fn kind(&self) -> PathKind {
        match self {
            Self::Edge { .. } | Self::Edges { .. } | Self::LevelEdge { .. } => PathKind::Diffracted,
            Self::Walls { .. } | Self::Cylinder { .. } | Self::Upright => PathKind::Specular,
            Self::Scatter { .. } => PathKind::Scattered,
        }
    }
}

impl Via {
    /// Whether one leads out as the other leads back, on two rays. Of a transmitter in line with an edge and the wall
    /// behind it both leave and arrive alike.
    fn is_reverse(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Edge { out, back, .. }, Self::Edge { out: other_out, back: other_back, .. }) => {
                out != back && (out, back) == (other_back, other_out)
            }
            _ => false,
        }
    }
}

impl Echo {
    /// Whether two echoes are one that touches a corner and was found on both sides of it.
    pub(crate) fn is_same(&self, other: &Self) -> bool {
        self.departure.distance_squared(other.departure) < SAME_RAD * SAME_RAD
            && self.arrival.distance_squared(other.arrival) < SAME_RAD * SAME_RAD
            && self.image == other.image
            && std::mem::discriminant(&self.via) == std::mem::discriminant(&other.via)
            // By two edges, and by level edges, there may be several paths of one length and the same
            // directions; their mechanisms list each once.
            && !matches!(self.via, Via::Edges { .. } | Via::LevelEdge { .. })
            && !self.via.is_reverse(&other.via)
    }
}

/// Echoes by length, each once.
pub(crate) fn sorted(echoes: &[Echo]) -> Vec<Echo> {
    // Lengths are positive, so their bits sort like the numbers; indices make it stable.
    let mut order: Vec<(u64, u32)> =
        echoes.iter().zip(0..).map(|(echo, index)| (echo.length_m.to_bits(), index)).collect();
    order.sort_unstable();
    let mut sorted: Vec<Echo> = order.iter().map(|&(_, index)| echoes[index as usize]).collect();
    drop_repeats(&mut sorted, |echo| echo.length_m, Echo::is_same);
    sorted
}

/// Keeps the first of items that are the same and within [`SAME_M`] in length. Sorted by length.
pub(crate) fn drop_repeats<T: Copy>(
    items: &mut Vec<T>,
    length_m: impl Fn(&T) -> f64,
    same: impl Fn(&T, &T) -> bool,
) {
    let mut kept = 0;
    for i in 0..items.len() {
        let item = items[i];
        let near = items[..kept]
            .iter()
            .rev()
            .take_while(|other| length_m(&item) - length_m(other) < SAME_M)
            .any(|other| same(&item, other));
        if !near {
            items[kept] = item;
            kept += 1;
        }
    }
    items.truncate(kept);
}
