//! Inputs and limits that all stages of a survey share.

use std::{
    collections::HashSet,
    sync::{
        Mutex, MutexGuard, PoisonError,
        atomic::{AtomicUsize, Ordering},
    },
};

use sonard_inverse::{FitSweep, World, WorldError};
use sonard_model::model::Simulator;

use crate::{
    arc::{Arc, find_arcs},
    error::SurveyError,
    input::SurveyInput,
    odometry::Move,
    progress::SurveyObserver,
    range_errors::RangeErrors,
    readings::Readings,
    scores::PlanScores,
    viewpoint::Viewpoint,
};

/// Inputs of a survey with its budget.
pub(crate) struct Workspace<'a> {
    /// Empty world with the transducer on the axis.
    pub(crate) world: World,
    pub(crate) sweeps: &'a [FitSweep],
    /// Sweeps are rounds of an array.
    pub(crate) is_array: bool,
    /// Simulator of that world, whose scene gives material and options, without walls.
    pub(crate) simulator: Simulator,
    /// Beams by the position that they are fired from.
    pub(crate) viewpoints: Vec<Viewpoint<'a>>,
    /// Predictions are those of the search: without echoes that touch posts more than once, or a post
    /// and an edge, and to the first order of the positions of an array's transducers.
    pub(crate) is_simplified: bool,
    pub(crate) readings: Vec<Readings>,
    pub(crate) errors: RangeErrors,
    /// Standard deviation of directions of walls from a square axis, radians.
    pub(crate) square_rad: Option<f64>,
    /// Arcs by sweep.
    pub(crate) arcs: Vec<Vec<Arc>>,
    /// Odometry between consecutive sweeps; empty without odometry.
    pub(crate) moves: Vec<Move>,
    pub(crate) observer: &'a dyn SurveyObserver,
    pub(crate) scores: &'a PlanScores,
    /// Offset of the face to the left of the axis, metres, which only final estimates include.
    pub(crate) left_m: f64,
    /// Digest of the sensor and air assumed, by which scores of plans differ.
    pub(crate) sensor: u64,
    scored: Mutex<HashSet<u64>>,
    limit: AtomicUsize,
}

impl<'a> Workspace<'a> {
    pub(crate) fn new(
        (world, simulator): (World, Simulator),
        (input, sweeps): (SurveyInput<'a>, &'a [FitSweep]),
        (readings, errors): (Vec<Readings>, RangeErrors),
        square_rad: Option<f64>,
        moves: Vec<Move>,
        (observer, scores): (&'a dyn SurveyObserver, &'a PlanScores),
    ) -> Self {
        let numbered = readings.iter().enumerate();
        let arcs = numbered.map(|(sweep, readings)| find_arcs(sweep, readings, errors)).collect();
        let limit = AtomicUsize::new(usize::MAX);
        Self {
            world,
            sweeps,
            is_array: input.is_array(),
            viewpoints: input.viewpoints(sweeps),
            simulator,
            is_simplified: false,
            readings,
            errors,
            square_rad,
            arcs,
            moves,
            observer,
            scores,
            left_m: 0.0,
            sensor: 0,
            scored: Mutex::default(),
            limit,
        }
    }

    /// Workspace with another digest of sensor and air, whose budget counts the scenes of an earlier
    /// search.
    pub(crate) fn following(self, scored: HashSet<u64>, sensor: u64) -> Self {
        Self { scored: Mutex::new(scored), sensor, ..self }
    }

    /// Workspace with the simplified predictions of the search.
    pub(crate) fn simplified(self) -> Result<Self, SurveyError> {
        let simulator = self.simulator.with_single_contacts().map_err(WorldError::from)?;
        Ok(Self { simulator, is_simplified: true, ..self })
    }

    /// Workspace with complete predictions.
    pub(crate) fn complete(self) -> Result<Self, SurveyError> {
        let simulator = self.world.simulator(&self.sweeps[0].pose)?;
        Ok(Self { simulator, is_simplified: false, ..self })
    }

    /// Workspace with the face left of the axis, metres.
    pub(crate) fn with_left_m(self, left_m: f64) -> Self {
        Self { left_m, ..self }
    }

    /// Digests of the scenes scored so far.
    pub(crate) fn into_scored(self) -> HashSet<u64> {
        self.scored.into_inner().unwrap_or_else(PoisonError::into_inner)
    }

    /// Maximum range of the ranger, metres: the region around the poses with walls.
    pub(crate) fn reach_m(&self) -> f64 {
        self.simulator.receiver().max_range_m
    }

    /// Wavelength of the ranger, metres.
    pub(crate) fn wavelength_m(&self) -> f64 {
        self.world.air.sound_speed_m_s() / self.world.sensor.frequency_hz
    }

    /// Standard deviation of the heading of a sweep by odometry, relative to the first, degrees; 0
    /// for the first, `None` without odometry.
    pub(crate) fn heading_sigma_deg(&self, sweep: usize) -> Option<f64> {
        let moves = self.moves.get(..sweep)?;
        Some(moves.iter().map(|step| step.sigma_deg * step.sigma_deg).sum::<f64>().sqrt())
    }

    /// Factor of the standard deviations of estimates. Nearer echoes cut most arcs of a coarse
    /// ranger; the biases of their middles are common to many beams, and in a measured arena turn
    /// walls and headings by up to five times what the normal equations give.
    pub(crate) fn bias_factor(&self) -> f64 {
        const OF_COARSE: f64 = 3.0;
        if self.errors.is_coarse() { OF_COARSE } else { 1.0 }
    }

    /// Share of its arcs unexplained beyond which the pose of a sweep may be wrong; less without
    /// odometry, where nothing else confirms a pose.
    pub(crate) fn max_unexplained_share(&self) -> f64 {
        if self.moves.is_empty() { 0.15 } else { 0.3 }
    }

    /// Counts a scored scene by the digest of its plan. A scene counts once, however often it is
    /// scored: a search that continues with known scores repeats fewer of them.
    pub(crate) fn count_scene(&self, plan: u64) {
        self.lock().insert(plan);
    }

    /// Number of different scenes scored so far.
    pub(crate) fn scored(&self) -> usize {
        self.lock().len()
    }

    fn lock(&self) -> MutexGuard<'_, HashSet<u64>> {
        self.scored.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Limits the number of scored scenes in all. The limit is checked between moves and rounds,
    /// so the result is independent of the number of threads.
    pub(crate) fn limit_scenes(&self, max: usize) {
        self.limit.store(max, Ordering::Relaxed);
    }

    /// Returns `true` once the budget is spent or the observer cancelled.
    pub(crate) fn is_over(&self) -> bool {
        self.is_spent() || self.observer.is_cancelled()
    }

    /// Returns `true` once the budget is spent.
    pub(crate) fn is_spent(&self) -> bool {
        self.scored() >= self.limit.load(Ordering::Relaxed)
    }
}
