//! Echoes while they are being sorted out.

use crate::{geometry::DVec2, reading::PathKind};

/// Echoes that agree in length and both directions to within this are one, metres and radians.
pub(super) const SAME_M: f64 = 1e-8;
pub(super) const SAME_RAD: f64 = 1e-9;

/// An echo path with its way as nodes of the tree.
#[derive(Debug, Clone, Copy)]
pub(super) struct Echo {
    pub(super) length_m: f64,
    pub(super) amplitude: f64,
    pub(super) phase_rad: f64,
    /// Unit vector in which it leaves.
    pub(super) departure: DVec2,
    /// Unit vector towards where it comes from.
    pub(super) arrival: DVec2,
    /// How far up it leaves and comes from, radians.
    pub(super) rise_rad: [f64; 2],
    /// Its image over floor and ceiling, counted from 1; 0 for a path in the plan.
    pub(super) image: u16,
    pub(super) via: Via,
}

/// The way of an echo.
#[derive(Debug, Clone, Copy)]
pub(super) enum Via {
    Walls {
        node: u32,
    },
    /// `out` and `back` are rays to the edge; see [`super::trace::Tree::part`].
    Edge {
        point: u32,
        out: u32,
        back: u32,
    },
    /// By two edges, in [`super::Trees::bridged`].
    Edges {
        way: u32,
    },
    /// By the contact in its middle, in [`super::Trees::joints`].
    Cylinder {
        joint: u32,
    },
    /// Straight up or down and back.
    Upright,
    /// Back from a place of a rough wall, by [`super::trace::Tree::spots`].
    Scatter {
        spot: u32,
    },
    /// By the rim of a wall, in [`super::Trees::rims`].
    Rim {
        rim: u32,
    },
}

impl Via {
    /// How the sound gets back.
    pub(super) const fn kind(&self) -> PathKind {
        match self {
            Self::Edge { .. } | Self::Edges { .. } | Self::Rim { .. } => PathKind::Diffracted,
            Self::Walls { .. } | Self::Cylinder { .. } | Self::Upright => PathKind::Specular,
            Self::Scatter { .. } => PathKind::Scattered,
        }
    }
}

impl Echo {
    /// Whether two echoes are one that touches a corner and was found on both sides of it.
    pub(super) fn is_same(&self, other: &Self) -> bool {
        self.departure.distance_squared(other.departure) < SAME_RAD * SAME_RAD
            && self.arrival.distance_squared(other.arrival) < SAME_RAD * SAME_RAD
            && self.image == other.image
            && std::mem::discriminant(&self.via) == std::mem::discriminant(&other.via)
            // Between two edges, and over rims, there may be several ways of one length; none is here
            // twice.
            && !matches!(self.via, Via::Edges { .. } | Via::Rim { .. })
    }
}

/// Echoes by length, each once.
pub(super) fn sorted(echoes: &[Echo]) -> Vec<Echo> {
    // Lengths are positive, so their bits sort like the numbers; places make it stable.
    let mut order: Vec<(u64, u32)> =
        echoes.iter().zip(0..).map(|(echo, place)| (echo.length_m.to_bits(), place)).collect();
    order.sort_unstable();
    let mut sorted: Vec<Echo> = order.iter().map(|&(_, place)| echoes[place as usize]).collect();
    drop_repeats(&mut sorted, |echo| echo.length_m, Echo::is_same);
    sorted
}

/// Keeps the first of items that are the same and within [`SAME_M`] in length. Sorted by length.
pub(super) fn drop_repeats<T: Copy>(
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
