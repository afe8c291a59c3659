//! Predicted outcomes of a sweep, as far as possible those of a plan that differs little.

use sonard_model::{
    geometry::{DVec2, Pose},
    model::{EchoSet, ObservationPoint, Prediction, Simulator},
    reading::PingStatus,
};

use super::{Judge, outcome_of};
use crate::readings::{Beam, Outcome};

/// Step of directions in which readings are predicted for all headings, degrees: at most half of
/// the step of a coarse ranger's beams.
pub(crate) const DIRECTION_STEP_DEG: f64 = 1.5;

/// Predicted outcome in a direction.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ray {
    pub(crate) outcome: Outcome,
    /// Radius around the place of the pose outside of which nothing affects the outcome, metres.
    radius_m: f64,
    /// Log-likelihood of the reading in this direction, nats; 0 where headings are free.
    pub(crate) nats: f64,
}

/// Predicted outcomes of a sweep: of its beams, or, where its heading is free, in all directions in
/// steps of [`DIRECTION_STEP_DEG`].
#[derive(Debug)]
pub(crate) struct SweepRays {
    pub(crate) rays: Vec<Ray>,
    /// Echoes on which they depend; `None` where the transducers are at other places.
    echoes: Option<EchoSet>,
}

impl SweepRays {
    /// Same outcomes with the likelihoods of a judge.
    pub(crate) fn rescored(&self, judge: &Judge, sweep: usize) -> Self {
        let mut rays = self.rays.clone();
        if !judge.is_turned(sweep) {
            let beams = &judge.readings()[sweep].beams;
            for (ray, beam) in rays.iter_mut().zip(beams) {
                ray.nats = judge.beam_nats(beam, ray.outcome);
            }
        }
        Self { rays, echoes: self.echoes.clone() }
    }
}

/// Outcomes of a sweep in a plan that is equal within a distance of its pose.
#[derive(Debug, Clone, Copy)]
pub(crate) struct KnownRays<'r> {
    pub(crate) of: &'r SweepRays,
    /// Distance, metres.
    pub(crate) distance_m: f64,
}

impl KnownRays<'_> {
    /// Returns `true` if a ray depends on places at the distance or farther.
    fn may_affect(&self, ray: &Ray) -> bool {
        ray.radius_m > self.distance_m
    }

    /// Indices of the rays that may be affected.
    pub(crate) fn affected(&self) -> Vec<usize> {
        (0..self.of.rays.len()).filter(|at| self.may_affect(&self.of.rays[*at])).collect()
    }
}

/// Predicts a sweep in a scene.
pub(crate) struct SweepPredictor<'j, 'a> {
    judge: &'j Judge<'a>,
    simulator: &'j Simulator,
    sweep: usize,
    pose: &'j Pose,
    point: ObservationPoint<'j>,
}

impl<'j, 'a> SweepPredictor<'j, 'a> {
    pub(crate) fn new(
        judge: &'j Judge<'a>,
        simulator: &'j Simulator,
        sweep: usize,
        pose: &'j Pose,
    ) -> Self {
        let point = simulator.at(pose.position());
        Self { judge, simulator, sweep, pose, point }
    }

    fn beams(&self) -> &'a [Beam] {
        &self.judge.readings()[self.sweep].beams
    }

    /// Number of rays.
    fn count(&self) -> usize {
        match self.judge.is_turned(self.sweep) {
            true => (360.0 / DIRECTION_STEP_DEG) as usize,
            false => self.beams().len(),
        }
    }

    fn direction_rad(&self, at: usize) -> f64 {
        match self.judge.is_turned(self.sweep) {
            true => (DIRECTION_STEP_DEG * at as f64).to_radians(),
            false => self.pose.direction_rad(self.beams()[at].azimuth_deg),
        }
    }

    /// Predicts all rays; `None` if the scene has more paths than the model follows.
    pub(crate) fn rays(&self) -> Option<Vec<Ray>> {
        (0..self.count()).map(|at| self.ray(at)).collect()
    }

    /// Rays with the echoes on which they depend; `None` if the scene has more paths than the model
    /// follows.
    pub(crate) fn with_echoes(&self, rays: Vec<Ray>) -> Option<SweepRays> {
        let radius_m = rays.iter().map(|ray| ray.radius_m).fold(0.0, f64::max);
        let is_at_pose = |beam: &Beam| beam.face == DVec2::ZERO;
        let is_single = self.judge.workspace.is_simplified || self.beams().iter().all(is_at_pose);
        let echoes = if is_single { self.point.echo_set(radius_m).ok()? } else { None };
        Some(SweepRays { rays, echoes })
    }

    /// Indices of the rays that differ from known ones; `None` if the scene has more paths than the
    /// model follows.
    pub(crate) fn affected(&self, known: &KnownRays) -> Option<Vec<usize>> {
        let mut affected = known.affected();
        let radii_m = affected.iter().map(|at| known.of.rays[*at].radius_m);
        let radius_m = radii_m.fold(0.0, f64::max);
        if let Some(echoes) = &known.of.echoes
            && let Some(own) = self.point.echo_set(radius_m).ok()?
        {
            let change = echoes.change_to(&own);
            affected
                .retain(|at| change.affects(self.direction_rad(*at), known.of.rays[*at].radius_m));
        }
        Some(affected)
    }

    /// Known rays, with those predicted that differ; `None` if the scene has more paths than the model
    /// follows.
    pub(crate) fn changed(&self, known: &KnownRays, affected: &[usize]) -> Option<Vec<Ray>> {
        let mut rays = known.of.rays.clone();
        for &at in affected {
            rays[at] = self.ray(at)?;
        }
        Some(rays)
    }

    /// Predicts one ray; `None` if the scene has more paths than the model follows.
    pub(crate) fn ray(&self, at: usize) -> Option<Ray> {
        if self.judge.is_turned(self.sweep) {
            let firing = self.point.ping_with_radius(self.direction_rad(at), DVec2::ZERO);
            let (prediction, radius_m) = firing.ok()?;
            return Some(Ray { outcome: outcome_of(&prediction), radius_m, nats: 0.0 });
        }
        let beam = &self.beams()[at];
        let (prediction, radius_m) = self.predict(beam)?;
        let outcome = outcome_of(&prediction);
        Some(Ray { outcome, radius_m, nats: self.judge.beam_nats(beam, outcome) })
    }

    /// Predicts the readings of all beams; `None` if the scene has more paths than the model follows.
    pub(crate) fn predictions(&self) -> Option<Vec<Prediction>> {
        self.beams().iter().map(|beam| self.predict(beam).map(|of| of.0)).collect()
    }

    /// Predicts the reading of a beam, and returns the radius around the place of the pose outside of
    /// which nothing affects it, metres.
    fn predict(&self, beam: &Beam) -> Option<(Prediction, f64)> {
        let direction_rad = self.pose.direction_rad(beam.azimuth_deg);
        let face = self.pose.rotate_to_world(beam.face);
        if face == DVec2::ZERO {
            return self.point.ping_with_radius(direction_rad, face).ok();
        }
        let (mut prediction, radius_m) = if self.judge.workspace.is_simplified {
            self.point.ping_with_radius(direction_rad, face).ok()?
        } else {
            let beside = self.simulator.at(self.pose.position() + face);
            let (prediction, radius_m) =
                beside.ping_with_radius(direction_rad, DVec2::ZERO).ok()?;
            (prediction, radius_m + face.length())
        };
        let max_range_m = self.judge.readings()[self.sweep].max_range_m;
        if prediction.range_m.is_some_and(|range_m| range_m > max_range_m) {
            (prediction.status, prediction.range_m) = (PingStatus::NoEcho, None);
        }
        Some((prediction, radius_m))
    }
}
