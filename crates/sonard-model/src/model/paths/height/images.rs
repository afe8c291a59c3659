//! Floor and ceiling as mirrors.
//!
//! Let the ranger be at `a` above the floor in a room of height `H`. Its images are at `2 m H` and
//! `2 m H - 2 a` above it (Allen and Berkley's lattice, in one dimension), and each path of length
//! `L` in the plan also arrives over `sqrt(L^2 + dz^2)`. A wall at `d` and the floor, `h` below,
//! form a corner that returns an echo from `sqrt(d^2 + h^2)`.
//!
//! The plan's amplitudes remain valid: cylinders spread sound in the plan alone. At an edge,
//! Kouyoumjian and Pathak's coefficient grows by `1 / sin b` for a ray that is `b` off the edge's
//! direction, and the field by the square root of that. The small part of it that shifts the
//! transition (its distance parameter decreases by `sin b`) is omitted. At two edges it grows
//! twice.

use crate::{
    geometry::DVec2,
    model::paths::{
        echo::{PathEcho, Via},
        floor::ALL_SLOPES,
        settings::PathSettings,
    },
};

/// Image of the ranger below the floor or above the ceiling.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct VerticalImage {
    /// Height above the ranger, metres.
    pub(crate) rise_m: f64,
    /// Number of reflections at floor and ceiling.
    pub(crate) bounces: u16,
    /// Amplitude factor of these reflections.
    pub(crate) gain: f64,
}

/// Floor or ceiling as a mirror.
#[derive(Debug, Clone, Copy)]
pub(crate) struct HorizontalMirror {
    pub(crate) z_m: f64,
    /// Amplitude of the mirror reflection.
    pub(crate) gain: f64,
}

/// Returns the images within reach whose echo is above the floor of the settings, without the
/// ranger itself.
pub(crate) fn images(
    floor: Option<HorizontalMirror>,
    ceiling: Option<HorizontalMirror>,
    z_m: f64,
    settings: &PathSettings,
) -> Vec<VerticalImage> {
    let reach_m = settings.max_path_m;
    let below = floor.map(|floor| z_m - floor.z_m);
    let above = ceiling.map(|ceiling| ceiling.z_m - z_m);
    let [at_floor, at_ceiling] =
        [floor, ceiling].map(|level| level.map_or(1.0, |level| level.gain));
    let mut images = Vec::new();
    let mut add = |rise_m: f64, bounces: u16| {
        // Alternating, beginning with the surface that is nearer on the path out.
        let (first, second) = (i32::from(bounces.div_ceil(2)), i32::from(bounces / 2));
        let (floors, ceilings) = if rise_m < 0.0 { (first, second) } else { (second, first) };
        let gain = at_floor.powi(floors) * at_ceiling.powi(ceilings);
        if rise_m.abs() <= reach_m && gain >= settings.floor {
            images.push(VerticalImage { rise_m, bounces, gain });
        }
    };
    match (below, above) {
        (None, None) => {}
        (Some(below), None) => add(-2.0 * below, 1),
        (None, Some(above)) => add(2.0 * above, 1),
        (Some(below), Some(above)) => {
            let height = below + above;
            for turn in 0..=(reach_m / (2.0 * height)) as u16 {
                let whole = 2.0 * f64::from(turn) * height;
                add(-whole - 2.0 * below, 2 * turn + 1);
                add(whole + 2.0 * above, 2 * turn + 1);
                if turn > 0 {
                    add(-whole, 2 * turn);
                    add(whole, 2 * turn);
                }
            }
        }
    }
    images
}

impl VerticalImage {
    /// The ranger itself.
    pub(crate) const NONE: Self = Self { rise_m: 0.0, bounces: 0, gain: 1.0 };

    /// Height, metres, gained by a ray from this image to a point at a height above the ranger,
    /// with floor and ceiling as windows: each reflection at one of them reverses it.
    pub(crate) fn climb_m(&self, rise_m: f64) -> f64 {
        let below_m = rise_m - self.rise_m;
        if self.bounces.is_multiple_of(2) { below_m } else { -below_m }
    }

    /// Returns an echo of the plan by way of this image, which is number `index`; `None` if it is
    /// too long or too weak.
    pub(crate) fn echo(
        &self,
        plan: &PathEcho,
        index: u16,
        settings: &PathSettings,
    ) -> Option<PathEcho> {
        // Scattered sound returns along its own path; level edges have their own images by floor
        // and ceiling.
        if matches!(plan.via, Via::Scatter { .. } | Via::LevelEdge { .. }) {
            return None;
        }
        let length_m = plan.length_m.hypot(self.rise_m);
        let cosine = plan.length_m / length_m;
        let bending = match plan.via {
            Via::Edge { .. } => cosine.sqrt().recip(),
            Via::Edges { .. } => cosine.recip(),
            _ => 1.0,
        };
        let amplitude =
            plan.amplitude * self.gain * bending * settings.air_gain(length_m - plan.length_m);
        let leaves_rad = self.rise_m.atan2(plan.length_m);
        // After an even number of reflections the ray runs as it left, and arrives from the
        // opposite side.
        let comes_rad = if self.bounces.is_multiple_of(2) { -leaves_rad } else { leaves_rad };
        let floor = settings.contact_floor(plan.is_repeated, length_m);
        let fits = length_m <= settings.max_path_m && amplitude >= floor;
        fits.then_some(PathEcho {
            length_m,
            amplitude,
            rise_rad: [leaves_rad, comes_rad],
            image: index,
            ..*plan
        })
    }

    /// Returns the path by floor and ceiling alone, to a receiver that is `apart` from the
    /// transmitter.
    pub(crate) fn upright_echo(
        &self,
        index: u16,
        apart: DVec2,
        settings: &PathSettings,
    ) -> Option<PathEcho> {
        let along = apart.try_normalize().unwrap_or(DVec2::X);
        let nowhere = PathEcho {
            length_m: apart.length(),
            amplitude: 1.0,
            phase_rad: 0.0,
            departure: along,
            arrival: if apart == DVec2::ZERO { along } else { -along },
            rise_rad: [0.0; 2],
            image: 0,
            slopes: [ALL_SLOPES; 2],
            is_repeated: false,
            via: Via::Upright,
        };
        self.echo(&nowhere, index, settings)
    }
}
