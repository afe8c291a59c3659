//! What rough walls scatter.
//!
//! A wall of amplitude reflectance `R` and roughness `s` mirrors `(1 - s) R^2` of the energy that
//! meets it and scatters `s R^2` after Lambert's law: into a solid angle `dW` at `b` from the normal
//! goes the share `cos b / pi dW`, which over the half space is all of it. So energy is conserved,
//! and with `s` towards 0 a mirror is left.
//!
//! A patch that fills the solid angle `W` around the ranger, at `b` from its normal, takes the share
//! `W / (4 pi)` of a source and sends back to a receiver at `r` an intensity of `cos b / (pi r^2)`
//! of that. Over what a head-on mirror at the same range gives, `1 / (4 pi (2 r)^2)` of the source,
//! this is
//!
//! ```text
//! 4 / pi  s R^2  cos b  W.
//! ```
//!
//! In the plan a wall is a row of patches of an angle `da` each, as high as the beam: `W` is `da`
//! times the integral of the two-way pattern's square over the rise
//! ([`Settings::scatter_height_rad`](super::Settings::scatter_height_rad)). Patches are small
//! beside beam and pulse. Each is heard by itself, with a phase of its own; that the phases spread
//! evenly, as those of a rough surface do, lets the powers of neighbours add.
//!
//! Followed are the ways that go back as they came, mirrors on the way included. What is scattered
//! more than once is left out.

use std::f64::consts::{PI, TAU};

use super::{Echo, Face, Paths, Settings, Via, beam::Beam, trace::Tree};
use crate::geometry::DVec2;

/// Largest patch, radians: less than any sensor's beam.
const PATCH_RAD: f64 = 0.03;

/// Longest difference of range over a patch, metres: a third of a burst of 16 cycles.
const PATCH_M: f64 = 0.02;

/// Turns of phase from patch to patch: the golden section, whose multiples spread most evenly.
const PHASE_TURNS: f64 = 0.618_033_988_749_895;

/// The part of a rough wall that a beam lights.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lit {
    pub(super) beam: Beam,
    pub(super) wall: u32,
    /// Along the wall, between two places.
    pub(super) span_m: [f64; 2],
}

/// A place that sound is scattered back from.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spot {
    pub(super) wall: u32,
    pub(super) leg: super::ways::Leg,
    pub(super) place: DVec2,
}

/// All scattered echoes of a tree; their places go to [`Tree::spots`].
pub(super) fn echoes(paths: &Paths, tree: &mut Tree) -> Vec<Echo> {
    let lit = std::mem::take(&mut tree.lit);
    let mut echoes = Vec::new();
    for part in &lit {
        add(paths, part, tree, &mut echoes);
    }
    echoes
}

fn add(paths: &Paths, lit: &Lit, tree: &mut Tree, echoes: &mut Vec<Echo>) {
    let Lit { beam, wall, span_m: [low_m, high_m] } = *lit;
    let (face, settings) = (&paths.faces[wall as usize], &paths.settings);
    let along = face.mirror.normal.perp();
    let height_m = face.mirror.height_m(beam.image).abs();
    let foot_m = along.dot(beam.image);
    // By angle from the normal, so that patches look alike from the ranger.
    let angle = |place_m: f64| (place_m - foot_m).atan2(height_m);
    let (from_rad, to_rad) = (angle(low_m), angle(high_m));
    let mut at_rad = from_rad;
    while at_rad < to_rad {
        let range_m = height_m / at_rad.cos();
        let slope_m = (range_m * at_rad.tan().abs()).max(range_m * PATCH_RAD);
        let step_rad = PATCH_RAD.min(PATCH_M / slope_m).max(1e-4);
        let next_rad = (at_rad + step_rad).min(to_rad);
        let middle_rad = 0.5 * (at_rad + next_rad);
        let place_m = foot_m + height_m * middle_rad.tan();
        let place = face.mirror.offset_m * face.mirror.normal + place_m * along;
        let run = place - beam.image;
        let length_m = 2.0 * run.length();
        let share = share(face, middle_rad.cos(), next_rad - at_rad, settings);
        let amplitude = beam.gain * beam.gain * share.sqrt() * settings.air_gain(length_m);
        at_rad = next_rad;
        if amplitude < settings.floor || length_m > settings.max_path_m {
            continue;
        }
        let departure = beam.departure(run.normalize_or_zero());
        let number = tree.spots.len() as u32;
        tree.spots.push(Spot { wall, leg: (&beam.ray_to(place)).into(), place });
        echoes.push(Echo {
            length_m,
            amplitude,
            phase_rad: TAU * (PHASE_TURNS * f64::from(number)).fract() - PI,
            departure,
            arrival: departure,
            rise_rad: [0.0; 2],
            image: 0,
            via: Via::Scatter { spot: number },
        });
    }
}

/// Power from a patch over that of a head-on mirror.
fn share(face: &Face, cosine: f64, angle_rad: f64, settings: &Settings) -> f64 {
    4.0 / PI * face.scatter * cosine * angle_rad * settings.scatter_height_rad
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{geometry::Mirror, scene::Material};

    /// Mirrored and scattered energy together, the latter summed over the half space.
    #[test]
    fn a_rough_surface_keeps_its_energy() {
        for (reflectance, roughness) in [(1.0, 0.3), (0.9, 1.0), (0.7, 0.0)] {
            let material = Material { reflectance, roughness };
            let mirrored = super::super::mirror_gain(&material).powi(2);
            let steps = 100_000;
            let lobe: f64 = (0..steps)
                .map(|i| (f64::from(i) + 0.5) / f64::from(steps) * PI / 2.0)
                .map(|b| b.cos() / PI * TAU * b.sin() * PI / 2.0 / f64::from(steps))
                .sum();
            let scattered = super::super::scattered(&material) * lobe;
            assert!((mirrored + scattered - reflectance * reflectance).abs() < 1e-9);
        }
    }

    /// The share of a patch, from the intensities of which it is the ratio.
    #[test]
    fn a_patch_follows_from_lamberts_law() {
        let mirror = Mirror::through(DVec2::ZERO, DVec2::X);
        let face = Face { mirror, rotor: DVec2::X, gain: 0.8, loss_m: 0.0, scatter: 0.36 };
        let settings = Settings { scatter_height_rad: 0.2, ..super::super::tests::LOSSLESS };
        let (range_m, cosine, angle_rad): (f64, f64, f64) = (1.7, 0.6, 0.01);
        let area = range_m * angle_rad / cosine * range_m * 0.2;
        let meets = area * cosine / (4.0 * PI * range_m * range_m);
        let returns = 0.36 * meets * cosine / PI / (range_m * range_m);
        let mirror = 1.0 / (4.0 * PI * (2.0 * range_m).powi(2));
        let found = share(&face, cosine, angle_rad, &settings);
        assert!((found / (returns / mirror) - 1.0).abs() < 1e-12);
    }
}
