//! Lead of pulses that a post returns: from its surface, while the path runs to its axis.
//!
//! With unit vectors `u`, `v` from the axis to both legs the lead is `r |u + v|` in the plan, times
//! the cosine of the rise.

use sonard_model::{
    geometry::DVec2,
    model::{Diffractor, Interaction, Mechanism, Path, Reflector},
    scene::Scene,
};

use super::{SceneMotion, height::Rise};
use crate::bearing::Bearing;

/// A post that diffracts, on a path.
pub(super) struct PostContact {
    at: usize,
    cylinder: u32,
}

/// Leg of a path at a post: direction from the axis, and its rotation per unit of a parameter.
struct PostLeg {
    direction: DVec2,
    turned_rad: f64,
}

impl PostContact {
    /// Finds the post of a path.
    pub(super) fn find(path: &Path) -> Option<Self> {
        path.interactions.iter().enumerate().find_map(|(at, met)| match met.mechanism {
            Mechanism::Diffraction(Diffractor::Post { cylinder }) => Some(Self { at, cylinder }),
            _ => None,
        })
    }

    /// Derivative of the lead, metres per unit, for a path whose length changes by `longer_m`.
    pub(super) fn lead_derivative(
        &self,
        path: &Path,
        ends: [DVec2; 2],
        scene: &Scene,
        motion: &SceneMotion,
        (rise, longer_m): (&Rise, f64),
    ) -> f64 {
        let Some(cylinder) = scene.cylinders.get(self.cylinder as usize) else { return 0.0 };
        let (_, growth) = motion.of_cylinder(self.cylinder).unwrap_or_default();
        let interactions = &path.interactions;
        let out: Vec<Interaction> = interactions.iter().take(self.at).rev().copied().collect();
        let back: Vec<Interaction> = interactions.iter().skip(self.at + 1).copied().collect();
        let legs =
            [(out, 0), (back, 1)].map(|(met, end)| self.leg(met, ends[end], end, scene, motion));
        let [Some(u), Some(v)] = legs else { return 0.0 };
        let sum = u.direction + v.direction;
        let turned = u.turned_rad * u.direction.perp() + v.turned_rad * v.direction.perp();
        let width = sum.length();
        let widens = sum.normalize_or_zero().dot(turned);
        let [cosine, sine] = rise.cosine_and_sine();
        let plan_longer_m = (longer_m - sine * rise.climb) / cosine.max(f64::MIN_POSITIVE);
        let steepens = (plan_longer_m - cosine * longer_m) / rise.length_m();
        cosine * (growth * width + cylinder.radius_m * widens)
            + steepens * cylinder.radius_m * width
    }

    /// Leg from the axis by these interactions to an end of the path.
    fn leg(
        &self,
        met: Vec<Interaction>,
        end: DVec2,
        number: usize,
        scene: &Scene,
        motion: &SceneMotion,
    ) -> Option<PostLeg> {
        let center = scene.cylinders.get(self.cylinder as usize)?.center;
        let (velocity, _) = motion.of_cylinder(self.cylinder).unwrap_or_default();
        let moves = [velocity, motion.transducer[number]];
        let is_in_plan = |met: &&Interaction| {
            !matches!(met.mechanism, Mechanism::Reflection(Reflector::Floor | Reflector::Ceiling))
        };
        let Some(first) = met.iter().find(is_in_plan).map(|met| met.point) else {
            let run = end - center;
            let direction = run.normalize_or_zero();
            let turned_rad = direction.perp().dot(moves[1] - moves[0]) / run.length();
            return Some(PostLeg { direction, turned_rad });
        };
        let path = Path { interactions: met.into() };
        let motion = SceneMotion { transducer: moves, ..motion.clone() };
        let bearing = Bearing::new(&path, [center, end], scene)?;
        let [turned_rad, _] = bearing.derivatives(scene, &motion);
        Some(PostLeg { direction: (first - center).normalize_or_zero(), turned_rad })
    }
}
