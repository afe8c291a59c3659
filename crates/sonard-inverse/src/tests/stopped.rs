//! Fits that are stopped and go on.

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

use super::{first_pose, found::sweep, world};
use crate::{
    Atlas, AtlasError, ErrorModel, Fit, FitError, Fitted, Found, Heard, Parameter, Prior, Sweep,
    Unwatched, Watch, World, fit_watched, locate_watched,
};

/// Keeps what is found, and stops when there is so much.
struct Keeper {
    found: Mutex<Vec<Found>>,
    most: usize,
}

impl Keeper {
    fn until(most: usize) -> Self {
        Self { found: Mutex::default(), most }
    }

    fn found(self) -> Vec<Found> {
        self.found.into_inner().expect("no panic")
    }
}

impl Watch for Keeper {
    fn found(&self, found: &Found) {
        self.found.lock().expect("no panic").push(found.clone());
    }

    fn stops(&self) -> bool {
        self.found.lock().expect("no panic").len() >= self.most
    }
}

/// Few readings of a corner by the engine that is quickest, so that a fit is short, of which one in four is of somebody who walks about, so that it begins
/// anew from elsewhere.
fn short(parameters: &[(Parameter, f64)]) -> (World, Vec<Sweep>, Fit) {
    let mut here = world("right-angle-corner", "senscomp-6500");
    here.options = Options {
        engine: EngineOptions::Cone(ConeOptions::default()),
        max_range_m: Some(3.0),
        ..Options::default()
    };
    let pose = first_pose(&here.scene);
    let believed = Pose { x_m: pose.x_m + 0.05, ..pose };
    let truth = here.changed(&[(&Parameter::Threshold, 2.0)]).expect("a world");
    let noise = TofNoise::of_range_mm(1.0, truth.air.sound_speed_m_s());
    let mut sweep = sweep(&truth, &pose, &believed, 24, noise, 2);
    let late_us = [700.0, 2900.0, 1300.0].into_iter().cycle();
    for (beam, late_us) in sweep.beams.iter_mut().step_by(4).zip(late_us) {
        beam.heard = Heard::Echo { tof_us: 3000.0 + late_us };
    }
    let of = |(parameter, sigma): &(Parameter, f64)| Prior {
        parameter: parameter.clone(),
        sigma: *sigma,
    };
    (here, vec![sweep], Fit::usual(parameters.iter().map(of).collect(), 0.1))
}

const PLACE: [(Parameter, f64); 3] =
    [(Parameter::X(0), 0.1), (Parameter::Y(0), 0.1), (Parameter::Threshold, 6.0)];

/// All figures of an answer, as the bits that they are.
fn bits(fitted: &Fitted) -> Vec<u64> {
    let of = fitted.estimates.iter().flat_map(|estimate| [estimate.change, estimate.sigma]);
    let errors = &fitted.errors;
    let further = [errors.sigma_m, errors.sigma_db, errors.clutter, fitted.log_posterior];
    let poses = fitted.poses.iter().flat_map(|pose| [pose.x_m, pose.y_m, pose.heading_deg]);
    let covariance = fitted.covariance.iter().copied();
    of.chain(further).chain(poses).chain(covariance).map(f64::to_bits).collect()
}

/// Stops a fit at every so many searches, and goes on from each.
fn stop_and_go_on(parameters: &[(Parameter, f64)], every: usize) {
    let (here, sweeps, what) = short(parameters);
    let keeper = Keeper::until(usize::MAX);
    let whole = fit_watched(&here, &sweeps, &what, &[], &keeper).expect("a fit");
    let all = keeper.found();
    let count = |kind: fn(&Found) -> bool| all.iter().filter(|found| kind(found)).count();
    // It begins anew, looks at places along two directions, and follows the best.
    assert!(count(|found| matches!(found, Found::End { .. })) >= 6, "{all:?}");
    assert!(count(|found| matches!(found, Found::Place { .. } | Found::Nothing)) >= 12, "{all:?}");
    (0..all.len()).into_par_iter().step_by(every).for_each(|cut| {
        let keeper = Keeper::until(cut);
        let stopped = fit_watched(&here, &sweeps, &what, &[], &keeper);
        assert_eq!(stopped.err(), Some(FitError::Stopped), "{cut}");
        let known = keeper.found();
        assert_eq!(known, all[..cut], "{cut}");
        let keeper = Keeper::until(usize::MAX);
        let again = fit_watched(&here, &sweeps, &what, &known, &keeper).expect("a fit");
        assert_eq!(bits(&again), bits(&whole), "{cut}");
        assert_eq!(keeper.found(), all[cut..], "{cut}");
    });
    let nothing_left = Keeper::until(usize::MAX);
    let again = fit_watched(&here, &sweeps, &what, &all, &nothing_left).expect("a fit");
    assert_eq!(bits(&again), bits(&whole));
    assert_eq!(nothing_left.found(), []);
}

#[test]
fn a_fit_that_was_stopped_at_any_search_goes_on_to_the_same_answer() {
    stop_and_go_on(&PLACE, 1);
}

#[test]
fn so_does_one_that_turns_its_sweep() {
    stop_and_go_on(&[&PLACE[..], &[(Parameter::Heading(0), 8.0)]].concat(), 13);
}

#[test]
fn what_another_fit_found_is_refused() {
    let (here, sweeps, what) = short(&PLACE);
    let errors = ErrorModel::rough(0.1, 6.0, 5.0);
    let place = Found::Place { values: vec![0.0; 3], log_posterior: 0.0 };
    let short = Found::Spread { values: vec![0.0; 2], errors, is_last: false };
    for known in [place, short] {
        let fitted = fit_watched(&here, &sweeps, &what, &[known], &Unwatched);
        assert_eq!(fitted.err(), Some(FitError::OtherFit));
    }
}

/// Counts how often it is asked, and stops at the last time.
struct Impatient {
    asked: AtomicUsize,
    most: usize,
}

impl Watch for Impatient {
    fn stops(&self) -> bool {
        self.asked.fetch_add(1, Ordering::Relaxed) >= self.most
    }
}

#[test]
fn a_search_for_poses_ends_when_nobody_waits_for_it() {
    let (here, sweeps, _) = short(&PLACE);
    let atlas = Atlas::new(&here, 0.3).expect("an atlas");
    for most in [0, 3, 20] {
        let watch = || Impatient { asked: AtomicUsize::new(0), most };
        let modes = locate_watched(&here, &atlas, &sweeps[0], &watch());
        assert_eq!(modes.err(), Some(FitError::Stopped), "{most}");
        assert_eq!(Atlas::watched(&here, 0.3, &watch()).err(), Some(AtlasError::Stopped), "{most}");
    }
}
