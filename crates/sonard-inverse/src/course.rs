//! Tracking of a robot from sweep to sweep with odometry.

use std::{f64::consts::TAU, sync::Arc};

use sonard_model::{
    geometry::{DVec2, Pose, wrap_180},
    scene::Scene,
};

use crate::{
    coarse_grid::CoarseGrid,
    fit::FitError,
    locate::{PoseMode, explaining, modes},
    progress::{FitObserver, NoObserver},
    sweep::FitSweep,
    world::World,
};

/// Error model of odometry.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Odometry {
    /// Standard deviation of the position per metre driven, metres.
    pub drift_m_per_m: f64,
    /// Standard deviation of the heading per metre driven, degrees.
    pub drift_deg_per_m: f64,
    /// Kidnap probability between sweeps, 0 to 1.
    pub kidnap_probability: f64,
}

impl Default for Odometry {
    fn default() -> Self {
        Self { drift_m_per_m: 0.05, drift_deg_per_m: 5.0, kidnap_probability: 0.02 }
    }
}

/// Minimum standard deviations of odometry, metres and degrees.
const MIN_DRIFT: (f64, f64) = (0.01, 1.0);
/// Standard deviation of the heading per degree turned.
const DRIFT_OF_TURN: f64 = 0.03;

/// Tracker of a robot from sweep to sweep.
///
/// Filter over the poses that explain each sweep (a hidden Markov model whose states are
/// [`PoseMode`]s). The weight of a pose is its evidence, times its compatibility with a pose of the
/// previous sweep and the odometry in between. After a kidnapping all poses are equally likely a
/// priori. In a different scene than that of the previous sweep the filter is reset.
#[derive(Debug, Clone, PartialEq)]
pub struct Tracker {
    odometry: Odometry,
    last: Option<LastSweep>,
}

/// Previous sweep.
#[derive(Debug, Clone, PartialEq)]
struct LastSweep {
    scene: Arc<Scene>,
    /// Pose by odometry.
    odometry: Pose,
    /// Posterior poses.
    modes: Vec<PoseMode>,
}

/// Pose predicted from a mode of the previous sweep and odometry.
struct PredictedPose {
    probability: f64,
    pose: Pose,
    sigma_m: f64,
    sigma_deg: f64,
}

impl Tracker {
    /// Tracker without prior knowledge.
    #[must_use]
    pub const fn new(odometry: Odometry) -> Self {
        Self { odometry, last: None }
    }

    /// Locates the next sweep, whose `pose` is given by odometry in an arbitrary frame. Returns all
    /// poses that explain the sweep, most probable first, given this sweep and all before.
    ///
    /// # Errors
    /// Invalid world.
    pub fn next(
        &mut self,
        world: &World,
        atlas: &CoarseGrid,
        sweep: &FitSweep,
    ) -> Result<Vec<PoseMode>, FitError> {
        self.next_observed(world, atlas, sweep, &NoObserver)
    }

    /// Locates like [`next`](Self::next), with cancellation by `watch`.
    ///
    /// # Errors
    /// As [`next`](Self::next), and [`FitError::Stopped`].
    pub fn next_observed(
        &mut self,
        world: &World,
        atlas: &CoarseGrid,
        sweep: &FitSweep,
        watch: &dyn FitObserver,
    ) -> Result<Vec<PoseMode>, FitError> {
        let expected = self.expected(&world.scene, &sweep.pose);
        let poses: Vec<Pose> = expected.iter().map(|expected| expected.pose).collect();
        let found = explaining(world, atlas, sweep, &poses, watch)?;
        let volume = atlas.area_m2() * 360.0;
        let modes = modes(&found, world, atlas, |mode| self.log_prior(mode, &expected, volume));
        if !modes.is_empty() {
            let (scene, modes) = (Arc::clone(&world.scene), modes.clone());
            self.last = Some(LastSweep { scene, odometry: sweep.pose, modes });
        }
        Ok(modes)
    }

    /// Modes of the last sweep propagated by odometry.
    fn expected(&self, scene: &Arc<Scene>, now: &Pose) -> Vec<PredictedPose> {
        let is_same = |last: &&LastSweep| Arc::ptr_eq(&last.scene, scene) || last.scene == *scene;
        let Some(LastSweep { odometry: then, modes, .. }) = self.last.as_ref().filter(is_same)
        else {
            return Vec::new();
        };
        let driven = then.point_in_frame(now.position());
        let turned_deg = wrap_180(now.heading_deg - then.heading_deg);
        modes.iter().map(|mode| self.moved(mode, driven, turned_deg)).collect()
    }

    fn moved(&self, mode: &PoseMode, driven: DVec2, turned_deg: f64) -> PredictedPose {
        let distance_m = driven.length();
        let to = mode.pose().rotate_to_world(driven);
        let pose = Pose {
            x_m: mode.x_m + to.x,
            y_m: mode.y_m + to.y,
            heading_deg: wrap_180(mode.heading_deg + turned_deg),
        };
        let aside_m = distance_m * mode.sigma_heading_deg.to_radians();
        let sigma_m =
            norm([mode.sigma_m(), aside_m, self.odometry.drift_m_per_m * distance_m, MIN_DRIFT.0]);
        let sigma_deg = norm([
            mode.sigma_heading_deg,
            self.odometry.drift_deg_per_m * distance_m,
            DRIFT_OF_TURN * turned_deg,
            MIN_DRIFT.1,
        ]);
        PredictedPose { probability: mode.probability, pose, sigma_m, sigma_deg }
    }

    /// Log-ratio of the prior density of a pose to a uniform density over a volume in square metres
    /// times degrees.
    fn log_prior(&self, mode: &PoseMode, expected: &[PredictedPose], volume: f64) -> f64 {
        if expected.is_empty() {
            return 0.0;
        }
        let at = DVec2::new(mode.x_m, mode.y_m);
        let density = |expected: &PredictedPose| {
            let sigma_m = expected.sigma_m.hypot(mode.sigma_m());
            let sigma_deg = expected.sigma_deg.hypot(mode.sigma_heading_deg);
            let off_m = at.distance(expected.pose.position());
            let off_deg = wrap_180(mode.heading_deg - expected.pose.heading_deg);
            let squares = (off_m / sigma_m).powi(2) + (off_deg / sigma_deg).powi(2);
            (-0.5 * squares).exp() / (TAU.powf(1.5) * sigma_m.powi(2) * sigma_deg)
        };
        let likely: f64 = expected.iter().map(|of| of.probability * density(of)).sum();
        let carried = self.odometry.kidnap_probability;
        (carried + (1.0 - carried) * volume * likely).ln()
    }
}

fn norm<const N: usize>(parts: [f64; N]) -> f64 {
    parts.iter().map(|part| part * part).sum::<f64>().sqrt()
}
