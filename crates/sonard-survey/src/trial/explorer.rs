//! Robot that explores a true room by sweeps.

use rand::Rng;
use sonard_inverse::{FitSweep, World, WorldError};
use sonard_model::{
    geometry::{DVec2, Pose},
    scene::Scene,
};
use uuid::Uuid;

use super::{
    readings::{ReadingNoise, simulate_sweeps},
    rooms::{drift, is_free},
};

/// Distance from a wall at which the robot stops, metres.
pub(super) const CONTACT_M: f64 = 0.15;
/// Maximum step of a move towards walls, metres.
const STEP_M: f64 = 0.02;

/// Errors of an exploring robot, and its number of beams.
#[derive(Debug, Clone, Copy)]
pub struct ExplorerSettings {
    /// Number of beams of a sweep.
    pub beams: usize,
    /// Noise of readings.
    pub noise: ReadingNoise,
    /// Errors of odometry, as of [`drift`]: metres per metre and degrees per metre.
    pub odometry_per_m: [f64; 2],
}

/// Robot that drives straight between stops of a true room and sweeps at each.
#[derive(Debug, Clone)]
pub struct Explorer<'a> {
    world: &'a World,
    settings: ExplorerSettings,
    stops: Vec<Pose>,
    readings: Vec<FitSweep>,
    /// Distances between stops along the moves, metres.
    between_m: Vec<Vec<f64>>,
    driven_m: f64,
}

/// Way of an explorer: back along its moves to a stop, and straight from there to a place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Way {
    /// End of the way.
    pub place: DVec2,
    /// Index of the stop.
    via: usize,
}

impl<'a> Explorer<'a> {
    /// Robot without a stop.
    #[must_use]
    pub const fn new(world: &'a World, settings: ExplorerSettings) -> Self {
        Self {
            world,
            settings,
            stops: Vec::new(),
            readings: Vec::new(),
            between_m: Vec::new(),
            driven_m: 0.0,
        }
    }

    /// True world.
    #[must_use]
    pub const fn world(&self) -> &'a World {
        self.world
    }

    /// True poses of the sweeps.
    #[must_use]
    pub fn stops(&self) -> &[Pose] {
        &self.stops
    }

    /// Sweeps with their poses by odometry, the first of which is the true one.
    #[must_use]
    pub fn readings(&self) -> &[FitSweep] {
        &self.readings
    }

    /// Distance driven, metres.
    #[must_use]
    pub const fn driven_m(&self) -> f64 {
        self.driven_m
    }

    /// Sweeps at each pose of a course, straight from the last stop to the first and so on.
    ///
    /// # Errors
    /// As [`simulate_sweeps`].
    pub fn sweep_along(
        &mut self,
        course: &[Pose],
        random: &mut impl Rng,
    ) -> Result<(), WorldError> {
        for pose in course {
            self.sweep(*pose, self.stops.len().saturating_sub(1), random)?;
        }
        Ok(())
    }

    /// Shortest way to a place whose straight move is free and at most `reach_m` long; `None` if
    /// there is none.
    #[must_use]
    pub fn way_to(&self, place: DVec2, reach_m: f64) -> Option<Way> {
        let last = self.stops.len().checked_sub(1)?;
        let length_m =
            |at: usize| self.between_m[last][at] + self.stops[at].position().distance(place);
        let is_reached = |at: &usize| {
            let from = self.stops[*at].position();
            from.distance(place) <= reach_m && is_way_free(&self.world.scene, from, place)
        };
        let reached = (0..=last).filter(is_reached);
        let via = reached.min_by(|a, b| length_m(*a).total_cmp(&length_m(*b)))?;
        Some(Way { place, via })
    }

    /// Way to the next view of a survey: the shortest, or that by the nearest stop if walls of the
    /// true room are in all of them; `None` before the first stop.
    #[must_use]
    pub fn way_to_view(&self, view: DVec2, reach_m: f64) -> Option<Way> {
        let off_m = |at: &usize| self.stops[*at].position().distance(view);
        let nearest = || (0..self.stops.len()).min_by(|a, b| off_m(a).total_cmp(&off_m(b)));
        let by_nearest = || nearest().map(|via| Way { place: view, via });
        self.way_to(view, reach_m).or_else(by_nearest)
    }

    /// Drives along a way, its straight move as far as walls allow, and sweeps.
    ///
    /// # Errors
    /// As [`simulate_sweeps`].
    pub fn drive(&mut self, way: Way, random: &mut impl Rng) -> Result<(), WorldError> {
        let Way { place, via } = way;
        let from = self.stops[via].position();
        let steps = (from.distance(place) / STEP_M).ceil().max(1.0);
        let at = |step: usize| from.lerp(place, step as f64 / steps);
        let is_clear = |step: &usize| self.world.scene.clearance_m(at(*step)) > CONTACT_M;
        let reached = (0..=steps as usize).take_while(is_clear).last().map_or(from, at);
        let heading_deg = (place - from).to_angle().to_degrees();
        self.sweep(Pose { x_m: reached.x, y_m: reached.y, heading_deg }, via, random)
    }

    fn sweep(&mut self, pose: Pose, via: usize, random: &mut impl Rng) -> Result<(), WorldError> {
        let ExplorerSettings { beams, noise, .. } = self.settings;
        let known = self.odometry_at(pose, random);
        let mut fired = simulate_sweeps(self.world, &[pose], beams, noise, random)?;
        for sweep in &mut fired {
            sweep.pose = known;
            sweep.scan = Uuid::from_u128(self.stops.len() as u128 + 1);
        }
        let mut row: Vec<f64> = (0..self.stops.len())
            .map(|at| {
                self.between_m[via][at] + self.stops[via].position().distance(pose.position())
            })
            .collect();
        self.driven_m += row.last().copied().unwrap_or(0.0);
        self.between_m.iter_mut().zip(&row).for_each(|(of, m)| of.push(*m));
        row.push(0.0);
        self.between_m.push(row);
        self.stops.push(pose);
        self.readings.extend(fired);
        Ok(())
    }

    /// Pose by odometry after a move from the last stop, with errors by the straight distance.
    fn odometry_at(&self, pose: Pose, random: &mut impl Rng) -> Pose {
        let (Some(from), Some(last)) = (self.stops.last(), self.readings.last()) else {
            return pose;
        };
        let moved = drift(&[*from, pose], self.settings.odometry_per_m, random)[1];
        let turn = |deg: f64| DVec2::from_angle(deg.to_radians());
        let by = turn(-from.heading_deg).rotate(moved.position() - from.position());
        let by = turn(last.pose.heading_deg).rotate(by);
        Pose {
            x_m: last.pose.x_m + by.x,
            y_m: last.pose.y_m + by.y,
            heading_deg: last.pose.heading_deg + moved.heading_deg - from.heading_deg,
        }
    }
}

fn is_way_free(scene: &Scene, from: DVec2, to: DVec2) -> bool {
    let steps = (from.distance(to) / 0.05).ceil().max(1.0);
    (1..=steps as usize).all(|step| is_free(scene, from.lerp(to, step as f64 / steps)))
}
