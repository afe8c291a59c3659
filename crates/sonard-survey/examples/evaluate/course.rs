//! Courses through random rooms, with their readings.

use std::error::Error;

use rand_pcg::Pcg64;
use sonard_inverse::{ArrayRound, FitSweep, World};
use sonard_model::geometry::Pose;
use sonard_survey::{
    SurveyInput,
    trial::{
        RoomKind, draw_trial, drift, generator, poses_along, simulate_rounds, simulate_sweeps,
        trial_world,
    },
};

use crate::Settings;

/// Course through a random room.
pub(crate) struct Course {
    /// World that the survey assumes.
    pub(crate) assumed: World,
    /// World of the readings.
    pub(crate) world: World,
    /// True poses.
    pub(crate) poses: Vec<Pose>,
    /// Sweeps with their odometry; empty for an array.
    pub(crate) sweeps: Vec<FitSweep>,
    /// Rounds of an array with their odometry.
    pub(crate) rounds: Vec<ArrayRound>,
    /// Generator for everything that follows.
    pub(crate) random: Pcg64,
}

impl Course {
    pub(crate) fn draw(
        kind: RoomKind,
        seed: u64,
        settings: &Settings,
    ) -> Result<Self, Box<dyn Error>> {
        let mut random = generator(kind, seed);
        let (room, course) = draw_trial(kind, settings.stops, &mut random)?;
        let poses = settings.poses.map_or(course.clone(), |count| poses_along(&course, count));
        let assumed = trial_world(room)?;
        let world = settings.truth.applied(&assumed)?;
        let odometry = drift(&poses, settings.odometry, &mut random);
        let (mut sweeps, mut rounds) = (Vec::new(), Vec::new());
        let (beams, noise) = (settings.beams, settings.noise);
        match &settings.array {
            Some(array) => {
                rounds = simulate_rounds(&world, array, &poses, noise, &mut random)?;
            }
            None => sweeps = simulate_sweeps(&world, &poses, beams, noise, &mut random)?,
        }
        for (sweep, pose) in sweeps.iter_mut().zip(&odometry) {
            sweep.pose = *pose;
        }
        for (round, pose) in rounds.iter_mut().zip(&odometry) {
            round.pose = *pose;
        }
        Ok(Self { assumed, world, poses, sweeps, rounds, random })
    }

    pub(crate) fn readings(&self) -> SurveyInput<'_> {
        match self.rounds.is_empty() {
            true => SurveyInput::from(&self.sweeps),
            false => SurveyInput::from(&self.rounds),
        }
    }
}
