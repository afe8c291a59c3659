//! Checkpointing and cancellation.

use std::sync::{
    Mutex,
    atomic::{AtomicUsize, Ordering},
};

use rayon::prelude::*;
use sonard_model::{
    acoustics::TofNoise,
    geometry::Pose,
    model::{ConeOptions, EngineOptions, Options},
};

use super::{first_pose, recovery::sweep, world};
use crate::{
    CoarseGrid, CoarseGridError, ErrorModel, FiringOutcome, FitError, FitObserver, FitOptions,
    FitResult, FitSweep, NoObserver, Parameter, Prior, SearchResult, World, fit_observed,
    locate_observed,
};

/// Observer that records results, and cancels after a number of them.
struct Recorder {
    found: Mutex<Vec<SearchResult>>,
    max: usize,
}

impl Recorder {
    fn until(max: usize) -> Self {
        Self { found: Mutex::default(), max }
    }

    fn found(self) -> Vec<SearchResult> {
        self.found.into_inner().expect("no panic")
    }
}

impl FitObserver for Recorder {
    fn found(&self, found: &SearchResult) {
        self.found.lock().expect("no panic").push(found.clone());
    }

    fn is_cancelled(&self) -> bool {
        self.found.lock().expect("no panic").len() >= self.max
    }
}

/// Short fit: few readings of a corner by the fastest engine, one in four of a person who walks
/// about, so that it restarts elsewhere.
pub(crate) fn short(parameters: &[(Parameter, f64)]) -> (World, Vec<FitSweep>, FitOptions) {
    let mut here = world("right-angle-corner", "senscomp-6500");
    here.options = Options {
        engine: EngineOptions::Cone(ConeOptions::default()),
        max_range_m: Some(3.0),
        ..Options::default()
    };
    let pose = first_pose(&here.scene);
    let initial = Pose { x_m: pose.x_m + 0.05, ..pose };
    let truth = here.changed(&[(&Parameter::Threshold, 2.0)]).expect("a world");
    let noise = TofNoise::from_range_sigma_mm(1.0, truth.air.sound_speed_m_s());
    let mut sweep = sweep(&truth, &pose, &initial, 24, noise, 2);
    let late_us = [700.0, 2900.0, 1300.0].into_iter().cycle();
    for (beam, late_us) in sweep.beams.iter_mut().step_by(4).zip(late_us) {
        beam.outcome = FiringOutcome::Echo { tof_us: 3000.0 + late_us };
    }
    let of = |(parameter, sigma): &(Parameter, f64)| Prior {
        parameter: parameter.clone(),
        sigma: *sigma,
    };
    (here, vec![sweep], FitOptions::with_priors(parameters.iter().map(of).collect(), 0.1))
}

pub(crate) const PLACE: [(Parameter, f64); 3] =
    [(Parameter::X(0), 0.1), (Parameter::Y(0), 0.1), (Parameter::Threshold, 6.0)];

/// All values of a result as bits.
fn bits(fitted: &FitResult) -> Vec<u64> {
    let of = fitted.estimates.iter().flat_map(|estimate| [estimate.change, estimate.sigma]);
    let errors = &fitted.errors;
    let further = [errors.sigma_m, errors.sigma_db, errors.outlier_share, fitted.log_posterior];
    let poses = fitted.poses.iter().flat_map(|pose| [pose.x_m, pose.y_m, pose.heading_deg]);
    let covariance = fitted.covariance.iter().copied();
    of.chain(further).chain(poses).chain(covariance).map(f64::to_bits).collect()
}

/// Cancels a fit after every `every`-th search, and resumes from each checkpoint.
fn cancel_and_resume(parameters: &[(Parameter, f64)], every: usize) {
    let (here, sweeps, what) = short(parameters);
    let keeper = Recorder::until(usize::MAX);
    let whole = fit_observed(&here, &sweeps, &what, &[], &keeper).expect("a fit");
    let all = keeper.found();
    let count = |kind: fn(&SearchResult) -> bool| all.iter().filter(|found| kind(found)).count();
    // Restarts, searches along two directions, and follows the best.
    assert!(count(|found| matches!(found, SearchResult::End { .. })) >= 6, "{all:?}");
    assert!(
        count(|found| matches!(found, SearchResult::Place { .. } | SearchResult::Nothing)) >= 12,
        "{all:?}"
    );
    (0..all.len()).into_par_iter().step_by(every).for_each(|cut| {
        let keeper = Recorder::until(cut);
        let stopped = fit_observed(&here, &sweeps, &what, &[], &keeper);
        assert_eq!(stopped.err(), Some(FitError::Stopped), "{cut}");
        let known = keeper.found();
        assert_eq!(known, all[..cut], "{cut}");
        let keeper = Recorder::until(usize::MAX);
        let again = fit_observed(&here, &sweeps, &what, &known, &keeper).expect("a fit");
        assert_eq!(bits(&again), bits(&whole), "{cut}");
        assert_eq!(keeper.found(), all[cut..], "{cut}");
    });
    let nothing_left = Recorder::until(usize::MAX);
    let again = fit_observed(&here, &sweeps, &what, &all, &nothing_left).expect("a fit");
    assert_eq!(bits(&again), bits(&whole));
    assert_eq!(nothing_left.found(), []);
}

#[test]
fn resumed_fit_is_bit_identical() {
    cancel_and_resume(&PLACE, 1);
}

#[test]
fn resumed_fit_with_heading_is_bit_identical() {
    cancel_and_resume(&[&PLACE[..], &[(Parameter::Heading(0), 8.0)]].concat(), 13);
}

#[test]
fn foreign_checkpoint_is_rejected() {
    let (here, sweeps, what) = short(&PLACE);
    let errors = ErrorModel::rough(0.1, 6.0, 5.0);
    let place = SearchResult::Place { values: vec![0.0; 3], log_posterior: 0.0 };
    let short = SearchResult::Spread { values: vec![0.0; 2], errors, is_last: false };
    for known in [place, short] {
        let fitted = fit_observed(&here, &sweeps, &what, &[known], &NoObserver);
        assert_eq!(fitted.err(), Some(FitError::OtherFit));
    }
}

/// Observer that counts polls, and cancels after a number of them.
struct Canceller {
    polls: AtomicUsize,
    max: usize,
}

impl FitObserver for Canceller {
    fn is_cancelled(&self) -> bool {
        self.polls.fetch_add(1, Ordering::Relaxed) >= self.max
    }
}

#[test]
fn search_for_poses_is_cancelled() {
    let (here, sweeps, _) = short(&PLACE);
    let atlas = CoarseGrid::new(&here, 0.3).expect("an atlas");
    for max in [0, 3, 20] {
        let watch = || Canceller { polls: AtomicUsize::new(0), max };
        let modes = locate_observed(&here, &atlas, &sweeps[0], &watch());
        assert_eq!(modes.err(), Some(FitError::Stopped), "{max}");
        assert_eq!(
            CoarseGrid::observed(&here, 0.3, &watch()).err(),
            Some(CoarseGridError::Stopped),
            "{max}"
        );
    }
}
