//! Scattering by rough walls.
//!
//! A wall of amplitude reflectance `R` and roughness `s` mirrors `(1 - s) R^2` of the incident
//! energy and scatters `s R^2` by Lambert's law: into a solid angle `dW` at `b` from the normal
//! goes the share `cos b / pi dW`, which over the half space is all of it. Energy is therefore
//! conserved, and with `s` towards 0 a mirror remains.
//!
//! A patch that fills the solid angle `W` around the ranger, at `b` from its normal, receives the
//! share `W / (4 pi)` of a source and returns to a receiver at `r` an intensity of
//! `cos b / (pi r^2)` of that. Relative to a head-on mirror at the same range, `1 / (4 pi (2 r)^2)`
//! of the source, this is
//!
//! ```text
//! 4 / pi  s R^2  cos b  W.
//! ```
//!
//! In the plan a wall is a row of patches of an angle `da` each, as high as the beam: `W` is `da`
//! times the integral of the two-way pattern's square over the rise
//! ([`PathSettings::scatter_height_rad`]). Patches are small compared with beam and pulse.
//! Each has its own echo and phase. Uniformly distributed phases, as those of a rough
//! surface, let the powers of neighbours add.
//!
//! Paths that return along themselves are followed, mirrors on the path included. Multiple
//! scattering is omitted.
//!
//! Patches are numbered from the foot of the perpendicular onwards, and their phases follow from
//! the numbers. They therefore depend only on the positions of surface and ranger: the same however
//! walls are cut into pieces, in any order and from either end, and they turn and move with the
//! scene. A mirrored scene has different phases: otherwise a ranger in front of a wall's middle
//! would always receive the two halves of the wall in phase.

use std::f64::consts::{PI, TAU};

use super::{
    beams::{LitWall, RayBeam, RayLeg},
    echo::{PathEcho, Via},
    floor::{ALL_SLOPES, TracingPlan, WallMirror},
    settings::PathSettings,
    tolerance::TIE_M,
};
use crate::{
    geometry::{DVec2, Mirror},
    model::SearchPart,
};

/// Largest patch, radians: less than any sensor's beam.
const PATCH_RAD: f64 = 0.03;

/// Largest difference of range over a patch, metres: a third of a burst of 16 cycles.
const PATCH_M: f64 = 0.02;

/// Phase increments in turns: from patch to patch the golden section, whose multiples spread most
/// evenly; from one mirror on the path to the next the root of 3.
const PHASE_TURNS: f64 = 0.618_033_988_749_895;
const ORDER_TURNS: f64 = 1.732_050_807_568_877;

/// A patch of a rough wall that scatters sound back.
#[derive(Debug, Clone, Copy)]
pub(super) struct Patch {
    pub(super) wall: u32,
    pub(super) leg: RayLeg,
    /// Middle of the patch.
    pub(super) point: DVec2,
}

/// Returns all scattered echoes of the visible parts of rough walls, and their patches.
pub(super) fn echoes(plan: &TracingPlan, lit: &[LitWall]) -> (Vec<PathEcho>, Vec<Patch>) {
    let mut found = (Vec::new(), Vec::new());
    let mut parts: Vec<LitPart> = lit.iter().filter_map(|span| LitPart::new(plan, span)).collect();
    group(&mut parts, &LitPart::surface, 0, &mut |parts| {
        parts.sort_by(|a, b| a.from_m.total_cmp(&b.from_m));
        for side_by_side in parts.chunk_by(|first, next| (next.from_m - first.to_m).abs() <= TIE_M)
        {
            if plan.effort.is_over() {
                break;
            }
            add(plan, side_by_side, &mut found);
        }
    });
    found
}

/// Part of a rough wall that a beam illuminates, seen from the beam's image.
///
/// Its position is independent of the drawing of the wall: the cut into pieces and the order of the
/// ends.
struct LitPart<'a> {
    beam: &'a RayBeam,
    wall: u32,
    wall_mirror: &'a WallMirror,
    /// Vector from the image to the foot of its perpendicular on the wall's line.
    to_foot: DVec2,
    /// Interval relative to the foot, counter-clockwise around the image, metres.
    from_m: f64,
    to_m: f64,
}

impl<'a> LitPart<'a> {
    /// Returns `None` for an image in line with the wall.
    fn new(plan: &'a TracingPlan, lit: &'a LitWall) -> Option<Self> {
        let LitWall { beam, wall, span_m: [low_m, high_m] } = lit;
        let wall_mirror = &plan.walls[*wall as usize];
        let Mirror { normal, .. } = wall_mirror.mirror;
        let height_m = wall_mirror.mirror.signed_distance_m(beam.image);
        if height_m == 0.0 || !is_viable(&plan.settings, beam, wall_mirror, height_m.abs()) {
            return None;
        }
        let foot_m = normal.perp().dot(beam.image);
        // The direction along its line is counter-clockwise where the normal points away from the
        // image.
        let (from_m, to_m) = if height_m < 0.0 {
            (low_m - foot_m, high_m - foot_m)
        } else {
            (foot_m - high_m, foot_m - low_m)
        };
        let to_foot = -height_m * normal;
        Some(Self { beam, wall: *wall, wall_mirror, to_foot, from_m, to_m })
    }

    /// Key of a surface seen from one image: parts that agree in all values belong to one surface.
    fn surface(&self) -> [f64; 9] {
        let Self { beam: RayBeam { image, gain, .. }, wall_mirror: wall, to_foot, .. } = self;
        let [bottom_m, top_m] = wall.z_m.unwrap_or([f64::MIN, f64::MAX]);
        let WallMirror { gain: own, scatter, .. } = wall;
        [image.x, image.y, to_foot.x, to_foot.y, *gain, *own, *scatter, bottom_m, top_m]
    }
}

/// Returns `true` if any patch of a wall can be detected that an image of the start, at this height
/// in front of the wall, illuminates by a beam. The decisive patch is at the foot, nearest and
/// head-on. All beams of a surface ([`LitPart::surface`]) have the same result.
fn is_viable(
    settings: &PathSettings,
    beam: &RayBeam,
    wall_mirror: &WallMirror,
    height_m: f64,
) -> bool {
    let share = share(wall_mirror, 1.0, PATCH_RAD, settings);
    let bound = beam.gain * beam.gain * share.sqrt() * settings.air_gain(2.0 * height_m);
    // Patches may be larger than that by rounding.
    1.001 * bound >= settings.floor && 2.0 * height_m <= 1.001 * settings.max_path_m
}

/// Calls `each` for groups of items that agree, except for rounding, in all figures from index
/// `from` on.
fn group<T, const N: usize>(
    items: &mut [T],
    figures: &impl Fn(&T) -> [f64; N],
    from: usize,
    each: &mut impl FnMut(&mut [T]),
) {
    if from == N {
        return each(items);
    }
    let figure = |item: &T| figures(item)[from];
    items.sort_by(|a, b| figure(a).total_cmp(&figure(b)));
    let same = |first: &T, next: &T| figure(next) - figure(first) <= TIE_M;
    items.chunk_by_mut(same).for_each(|items| group(items, figures, from + 1, each));
}

/// Adds the patches of adjacent lit parts, clockwise first. The first and the last patch are cut
/// where the illumination ends.
fn add(plan: &TracingPlan, lit: &[LitPart], (echoes, patches): &mut (Vec<PathEcho>, Vec<Patch>)) {
    let (Some(first), Some(last)) = (lit.first(), lit.last()) else { return };
    let (settings, height_m) = (&plan.settings, first.to_foot.length());
    let rows = PatchRow::new(height_m);
    let (from_rad, to_rad) = (first.from_m.atan2(height_m), last.to_m.atan2(height_m));
    let numbers = rows.place(from_rad).floor() as i32..rows.place(to_rad).ceil() as i32;
    for patch in numbers {
        if !plan.effort.step(SearchPart::Images, 1) {
            return;
        }
        let begins_rad = rows.angle_rad(patch.into());
        let (low_rad, high_rad) =
            (begins_rad.max(from_rad), rows.angle_rad((patch + 1).into()).min(to_rad));
        let middle_rad = 0.5 * (low_rad + high_rad);
        let position_m = height_m * middle_rad.tan();
        let own = lit.partition_point(|part| part.from_m <= position_m).saturating_sub(1);
        let LitPart { beam, wall, wall_mirror, .. } = lit[own];
        let run = first.to_foot + position_m / height_m * first.to_foot.perp();
        let point = beam.image + run;
        let length_m = 2.0 * run.length();
        let share = share(wall_mirror, middle_rad.cos(), (high_rad - low_rad).max(0.0), settings);
        let amplitude = beam.gain * beam.gain * share.sqrt() * settings.air_gain(length_m);
        if amplitude < settings.floor || length_m > settings.max_path_m {
            continue;
        }
        let departure = beam.departure(run.normalize_or_zero());
        plan.effort.keep::<(Patch, PathEcho, PathEcho)>(1);
        let number = patches.len() as u32;
        patches.push(Patch { wall, leg: (&beam.ray_to(point)).into(), point });
        // The powers of two beams' parts of a patch add up if they are a quarter turn apart.
        let turns = PHASE_TURNS * f64::from(patch)
            + ORDER_TURNS * f64::from(beam.order)
            + if begins_rad < from_rad { 0.25 } else { 0.0 };
        echoes.push(PathEcho {
            length_m,
            amplitude,
            phase_rad: TAU * turns.rem_euclid(1.0) - PI,
            departure,
            arrival: departure,
            rise_rad: [0.0; 2],
            image: 0,
            slopes: [beam.slopes, ALL_SLOPES],
            is_repeated: false,
            via: Via::Scatter { patch: number },
        });
    }
}

/// Patches of a wall, numbered from the foot of the perpendicular: by angle, so that they have
/// equal size seen from the ranger, and farther out by range. Their positions are independent of
/// the illuminated part of the wall.
struct PatchRow {
    height_m: f64,
    /// Angle at which one spacing changes into the other.
    turn_rad: f64,
}

impl PatchRow {
    fn new(height_m: f64) -> Self {
        // There both patches have equal size: `h sin a / cos^2 a PATCH_RAD = PATCH_M`.
        let q = PATCH_M / (PATCH_RAD * height_m);
        Self { height_m, turn_rad: (2.0 * q / (1.0 + (1.0 + 4.0 * q * q).sqrt())).asin() }
    }

    /// Number of the patch at an angle from the normal, with the fraction within it.
    fn place(&self, angle_rad: f64) -> f64 {
        let inner = angle_rad.abs().min(self.turn_rad);
        let outer_m = self.height_m / angle_rad.cos() - self.height_m / inner.cos();
        (inner / PATCH_RAD + outer_m.max(0.0) / PATCH_M).copysign(angle_rad)
    }

    /// Angle from the normal of a place; inverse of [`Self::place`].
    fn angle_rad(&self, place: f64) -> f64 {
        let turn = self.turn_rad / PATCH_RAD;
        let outer_m = (place.abs() - turn) * PATCH_M;
        let angle_rad = if outer_m <= 0.0 {
            place.abs() * PATCH_RAD
        } else {
            (self.height_m / (self.height_m / self.turn_rad.cos() + outer_m)).acos()
        };
        angle_rad.copysign(place)
    }
}

/// Power from a patch relative to that of a head-on mirror.
fn share(wall_mirror: &WallMirror, cosine: f64, angle_rad: f64, settings: &PathSettings) -> f64 {
    4.0 / PI * wall_mirror.scatter * cosine * angle_rad * settings.scatter_height_rad
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Material;

    #[test]
    fn patches_are_small_and_contiguous() {
        for height_m in [0.03, 0.4, 3.0, 9.0] {
            let row = PatchRow::new(height_m);
            for patch in -40..40 {
                let [low, high] = [patch, patch + 1].map(|end| row.angle_rad(f64::from(end)));
                assert!(low < high && high - low < 1.0001 * PATCH_RAD, "{height_m} {patch}");
                let range_m = |angle_rad: f64| height_m / angle_rad.cos();
                assert!((range_m(high) - range_m(low)).abs() < 1.0001 * PATCH_M);
                assert!((row.place(low) - f64::from(patch)).abs() < 1e-6, "{height_m} {patch}");
            }
        }
    }

    /// Mirrored and scattered energy together, the latter summed over the half space.
    #[test]
    fn energy_is_conserved() {
        for (reflectance, roughness) in [(1.0, 0.3), (0.9, 1.0), (0.7, 0.0)] {
            let material = Material { reflectance, roughness };
            let mirrored = material.mirror_amplitude().powi(2);
            let steps = 100_000;
            let lobe: f64 = (0..steps)
                .map(|i| (f64::from(i) + 0.5) / f64::from(steps) * PI / 2.0)
                .map(|b| b.cos() / PI * TAU * b.sin() * PI / 2.0 / f64::from(steps))
                .sum();
            let scattered = material.scattered_energy() * lobe;
            assert!((mirrored + scattered - reflectance * reflectance).abs() < 1e-9);
        }
    }

    /// Share of a patch, as the ratio of intensities.
    #[test]
    fn patch_follows_lamberts_law() {
        let mirror = Mirror::through(DVec2::ZERO, DVec2::X);
        let wall_mirror = WallMirror {
            mirror,
            rotor: DVec2::X,
            gain: 0.8,
            loss_m: 0.0,
            scatter: 0.36,
            z_m: None,
        };
        let settings =
            PathSettings { scatter_height_rad: 0.2, ..crate::model::paths::tests::LOSSLESS };
        let (range_m, cosine, angle_rad): (f64, f64, f64) = (1.7, 0.6, 0.01);
        let area = range_m * angle_rad / cosine * range_m * 0.2;
        let meets = area * cosine / (4.0 * PI * range_m * range_m);
        let returns = 0.36 * meets * cosine / PI / (range_m * range_m);
        let mirror = 1.0 / (4.0 * PI * (2.0 * range_m).powi(2));
        let found = share(&wall_mirror, cosine, angle_rad, &settings);
        assert!((found / (returns / mirror) - 1.0).abs() < 1e-12);
    }
}
