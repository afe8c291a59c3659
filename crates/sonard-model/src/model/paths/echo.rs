//! Echo paths as listed by the mechanisms: length, field and directions, with a reference to the
//! mechanism's own record of the path.

use super::tolerance::{SAME_M, SAME_RAD};
use crate::{acoustics::edge::LitImages, geometry::DVec2, reading::PathKind};

/// An echo path before the beam pattern.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PathEcho {
    pub(crate) length_m: f64,
    pub(crate) amplitude: f64,
    pub(crate) phase_rad: f64,
    /// Unit vector of departure.
    pub(crate) departure: DVec2,
    /// Unit vector towards the origin of the arriving sound.
    pub(crate) arrival: DVec2,
    /// Elevation of departure and arrival, radians.
    pub(crate) rise_rad: [f64; 2],
    /// Image by floor and ceiling, counted from 1; 0 for a path in the plan.
    pub(crate) image: u16,
    /// Possible slopes of a path of the plan, by the numbers in the beams from transmitter and from
    /// receiver.
    pub(crate) slopes: [u32; 2],
    /// `true` if the path touches cylinders more than once, or a cylinder and an upright edge: see
    /// [`PathSettings::contact_floor`](super::settings::PathSettings::contact_floor).
    pub(crate) is_repeated: bool,
    pub(crate) via: Via,
}

/// Mechanism of an echo, with its number in that mechanism's record.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Via {
    /// Mirror reflections at walls alone; the node of the tree of beams at which the ray ends.
    Walls { node: u32 },
    /// Diffraction at one upright edge; `out` and `back` number the rays to it from transmitter and
    /// receiver, and `lit` are the edge's mirror images that other echoes contain.
    Edge { point: u32, out: u32, back: u32, lit: LitImages },
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
    /// Returns the kind of path.
    pub(crate) const fn kind(&self) -> PathKind {
        match self {
            Self::Edge { .. } | Self::Edges { .. } | Self::LevelEdge { .. } => PathKind::Diffracted,
            Self::Walls { .. } | Self::Cylinder { .. } | Self::Upright => PathKind::Specular,
            Self::Scatter { .. } => PathKind::Scattered,
        }
    }
}

impl Via {
    /// Returns `true` if one leads out as the other leads back, on two rays. For a transmitter in
    /// line with an edge and the wall behind it, both leave and arrive alike.
    fn is_reverse(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Edge { out, back, .. }, Self::Edge { out: other_out, back: other_back, .. }) => {
                out != back && (out, back) == (other_back, other_out)
            }
            _ => false,
        }
    }
}

impl PathEcho {
    /// Returns `true` for the two copies of an echo that touches a corner and was found on both
    /// sides of it.
    pub(crate) fn is_same(&self, other: &Self) -> bool {
        self.departure.distance_squared(other.departure) < SAME_RAD * SAME_RAD
            && self.arrival.distance_squared(other.arrival) < SAME_RAD * SAME_RAD
            && self.image == other.image
            && std::mem::discriminant(&self.via) == std::mem::discriminant(&other.via)
            // By two edges, and by level edges, there may be several paths of one length and equal
            // directions; their mechanisms list each once.
            && !matches!(self.via, Via::Edges { .. } | Via::LevelEdge { .. })
            && !self.via.is_reverse(&other.via)
    }
}

/// Sorts echoes by length and drops repeats.
pub(crate) fn sorted(echoes: &[PathEcho]) -> Vec<PathEcho> {
    // Lengths are positive, so their bits sort like the numbers; indices make it stable.
    let mut order: Vec<(u64, u32)> =
        echoes.iter().zip(0..).map(|(echo, index)| (echo.length_m.to_bits(), index)).collect();
    order.sort_unstable();
    let mut sorted: Vec<PathEcho> =
        order.iter().map(|&(_, index)| echoes[index as usize]).collect();
    drop_repeats(&mut sorted, |echo| echo.length_m, PathEcho::is_same);
    sorted
}

/// Keeps the first of items that are the same and within [`SAME_M`] in length. The items must be
/// sorted by length.
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
