//! Where a robot is along its way: what each sweep says, weighed by what odometry says between them.

use std::{f64::consts::TAU, sync::Arc};

use sonard_model::{
    geometry::{DVec2, Pose, wrap_180},
    scene::Scene,
};

use crate::{
    atlas::Atlas,
    fit::FitError,
    locate::{Mode, explaining, modes},
    sweep::Sweep,
    watch::{Unwatched, Watch},
    world::World,
};

/// Error model of odometry.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Odometry {
    /// Standard deviation of the place for each metre driven, metres.
    pub drift_m_per_m: f64,
    /// Standard deviation of the heading for each metre driven, degrees.
    pub drift_deg_per_m: f64,
    /// Probability that the robot was carried elsewhere from one sweep to the next, 0 to 1.
    pub carried: f64,
}

impl Default for Odometry {
    fn default() -> Self {
        Self { drift_m_per_m: 0.05, drift_deg_per_m: 5.0, carried: 0.02 }
    }
}

/// What odometry is off by at least, metres and degrees, and for each degree turned.
const LEAST_DRIFT: (f64, f64) = (0.01, 1.0);
const DRIFT_OF_TURN: f64 = 0.03;

/// Follows a robot from sweep to sweep.
///
/// A filter over the poses that explain each sweep (a hidden Markov model whose states are [`Mode`]s): a pose is as
/// probable as it explains the sweep, times how well it goes with a pose of the sweep before and the way between them. Where
/// the robot may have been carried, all poses are as good as any other before they are asked. In another scene than that of
/// the sweep before nothing is known, as at the beginning.
#[derive(Debug, Clone, PartialEq)]
pub struct Course {
    odometry: Odometry,
    last: Option<Last>,
}

/// The last sweep.
#[derive(Debug, Clone, PartialEq)]
struct Last {
    scene: Arc<Scene>,
    /// Odometry's pose.
    told: Pose,
    /// Where it was taken.
    modes: Vec<Mode>,
}

/// Where a sweep should have been taken, by a pose of the one before and odometry.
struct Expected {
    probability: f64,
    pose: Pose,
    sigma_m: f64,
    sigma_deg: f64,
}

impl Course {
    /// At its beginning, where nothing is known.
    #[must_use]
    pub const fn new(odometry: Odometry) -> Self {
        Self { odometry, last: None }
    }

    /// Finds where the next sweep was taken, whose `pose` is what odometry says, in a frame of its own: all poses that
    /// explain it, most probable first, with this sweep and all before.
    ///
    /// # Errors
    /// When there is nothing to predict with.
    pub fn next(
        &mut self,
        world: &World,
        atlas: &Atlas,
        sweep: &Sweep,
    ) -> Result<Vec<Mode>, FitError> {
        self.next_watched(world, atlas, sweep, &Unwatched)
    }

    /// The same, until `watch` stops it.
    ///
    /// # Errors
    /// As [`next`](Self::next), and [`FitError::Stopped`].
    pub fn next_watched(
        &mut self,
        world: &World,
        atlas: &Atlas,
        sweep: &Sweep,
        watch: &dyn Watch,
    ) -> Result<Vec<Mode>, FitError> {
        let expected = self.expected(&world.scene, &sweep.pose);
        let poses: Vec<Pose> = expected.iter().map(|expected| expected.pose).collect();
        let found = explaining(world, atlas, sweep, &poses, watch)?;
        let volume = atlas.area_m2() * 360.0;
        let modes = modes(&found, world, atlas, |mode| self.log_prior(mode, &expected, volume));
        if !modes.is_empty() {
            let (scene, modes) = (Arc::clone(&world.scene), modes.clone());
            self.last = Some(Last { scene, told: sweep.pose, modes });
        }
        Ok(modes)
    }

    /// Where the modes of the last sweep have come by what odometry says now.
    fn expected(&self, scene: &Arc<Scene>, now: &Pose) -> Vec<Expected> {
        let is_same = |last: &&Last| Arc::ptr_eq(&last.scene, scene) || last.scene == *scene;
        let Some(Last { told: then, modes, .. }) = self.last.as_ref().filter(is_same) else {
            return Vec::new();
        };
        let driven = DVec2::from_angle(-then.heading_deg.to_radians())
            .rotate(now.position() - then.position());
        let turned_deg = wrap_180(now.heading_deg - then.heading_deg);
        modes.iter().map(|mode| self.moved(mode, driven, turned_deg)).collect()
    }

    fn moved(&self, mode: &Mode, driven: DVec2, turned_deg: f64) -> Expected {
        let distance_m = driven.length();
        let to = DVec2::from_angle(mode.heading_deg.to_radians()).rotate(driven);
        let pose = Pose {
            x_m: mode.x_m + to.x,
            y_m: mode.y_m + to.y,
            heading_deg: wrap_180(mode.heading_deg + turned_deg),
        };
        let aside_m = distance_m * mode.sigma_heading_deg.to_radians();
        let sigma_m = norm([
            mode.sigma_m(),
            aside_m,
            self.odometry.drift_m_per_m * distance_m,
            LEAST_DRIFT.0,
        ]);
        let sigma_deg = norm([
            mode.sigma_heading_deg,
            self.odometry.drift_deg_per_m * distance_m,
            DRIFT_OF_TURN * turned_deg,
            LEAST_DRIFT.1,
        ]);
        Expected { probability: mode.probability, pose, sigma_m, sigma_deg }
    }

    /// Logarithm of how much more probable a pose is beforehand than if nothing were known, where poses fill a volume of
    /// so many square metres times degrees.
    fn log_prior(&self, mode: &Mode, expected: &[Expected], volume: f64) -> f64 {
        if expected.is_empty() {
            return 0.0;
        }
        let at = DVec2::new(mode.x_m, mode.y_m);
        let density = |expected: &Expected| {
            let sigma_m = expected.sigma_m.hypot(mode.sigma_m());
            let sigma_deg = expected.sigma_deg.hypot(mode.sigma_heading_deg);
            let off_m = at.distance(expected.pose.position());
            let off_deg = wrap_180(mode.heading_deg - expected.pose.heading_deg);
            let squares = (off_m / sigma_m).powi(2) + (off_deg / sigma_deg).powi(2);
            (-0.5 * squares).exp() / (TAU.powf(1.5) * sigma_m.powi(2) * sigma_deg)
        };
        let likely: f64 = expected.iter().map(|of| of.probability * density(of)).sum();
        let carried = self.odometry.carried;
        (carried + (1.0 - carried) * volume * likely).ln()
    }
}

fn norm<const N: usize>(parts: [f64; N]) -> f64 {
    parts.iter().map(|part| part * part).sum::<f64>().sqrt()
}
