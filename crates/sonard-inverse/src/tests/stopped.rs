//! Fits that are stopped and go on.

use std::sync::{
    Mutex,
    atomic::{AtomicUsize, Ordering},
};

use sonard_model::{acoustics::TofNoise, geometry::Pose};

use super::{first_pose, found::sweep, world};
use crate::{
    Atlas, AtlasError, Fit, FitError, Fitted, Found, Group, Parameter, Sweep, Unwatched, Watch,
    World, fit_watched, locate_watched, priors,
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

/// Few readings of a corner, so that a fit is short, and begins anew from elsewhere because most of them are clutter.
fn short() -> (World, Vec<Sweep>, Fit) {
    let mut here = world("right-angle-corner", "senscomp-6500");
    here.options.max_range_m = Some(2.0);
    let pose = first_pose(&here.scene);
    let believed = Pose { x_m: pose.x_m + 0.05, ..pose };
    let changes = [(&Parameter::Threshold, 2.0)];
    let truth = here.changed(&changes).expect("a world");
    let noise = TofNoise::of_range_mm(1.0, truth.air.sound_speed_m_s());
    let mut sweep = sweep(&truth, &pose, &believed, 48, noise, 2);
    // One in four is of somebody who walks about.
    for (beam, late_us) in
        sweep.beams.iter_mut().step_by(4).zip([700.0, 2900.0, 1300.0].iter().cycle())
    {
        beam.heard = crate::Heard::Echo { tof_us: 3000.0 + late_us };
    }
    let groups = [Group::Pose, Group::Threshold];
    let priors = priors(&groups, &[], &here, 1).expect("they are fitted");
    (here, vec![sweep], Fit::usual(priors, 0.1))
}

/// All figures of an answer, as the bits that they are.
fn bits(fitted: &Fitted) -> Vec<u64> {
    let of = fitted.estimates.iter().flat_map(|estimate| [estimate.change, estimate.sigma]);
    let errors = &fitted.errors;
    let further = [errors.sigma_m, errors.sigma_db, errors.clutter, fitted.log_posterior];
    let poses = fitted.poses.iter().flat_map(|pose| [pose.x_m, pose.y_m, pose.heading_deg]);
    let covariance = fitted.covariance.iter().copied();
    of.chain(further).chain(poses).chain(covariance).map(f64::to_bits).collect()
}

#[test]
fn a_fit_that_was_stopped_anywhere_goes_on_to_the_same_answer() {
    let (here, sweeps, what) = short();
    let keeper = Keeper::until(usize::MAX);
    let whole = fit_watched(&here, &sweeps, &what, &[], &keeper).expect("a fit");
    let all = keeper.found();
    let of = |kind: fn(&Found) -> bool| all.iter().filter(|found| kind(found)).count();
    // It begins anew four times, looks at 24 places along two directions, and follows two.
    assert!(of(|found| matches!(found, Found::End { .. })) >= 6, "{all:?}");
    assert!(of(|found| matches!(found, Found::Place { .. } | Found::Nothing)) >= 12, "{all:?}");
    for cut in 0..all.len() {
        let keeper = Keeper::until(cut);
        let stopped = fit_watched(&here, &sweeps, &what, &[], &keeper);
        assert_eq!(stopped.err(), Some(FitError::Stopped), "{cut}");
        assert_eq!(keeper.found(), all[..cut], "{cut}");
    }
    for cut in 0..=all.len() {
        let keeper = Keeper::until(usize::MAX);
        let again = fit_watched(&here, &sweeps, &what, &all[..cut], &keeper).expect("a fit");
        assert_eq!(bits(&again), bits(&whole), "{cut}");
        let nothing = |found: &&Found| **found != Found::Nothing;
        let further: Vec<Found> = keeper.found();
        assert!(further.iter().filter(nothing).eq(all[cut..].iter().filter(nothing)), "{cut}");
    }
}

#[test]
fn what_another_fit_found_is_refused() {
    let (here, sweeps, what) = short();
    let errors = crate::ErrorModel::rough(0.1, 6.0, 5.0);
    let place = Found::Place { values: vec![0.0; 4], log_posterior: 0.0 };
    let short = Found::Spread { values: vec![0.0; 3], errors, is_last: false };
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
    let (here, sweeps, _) = short();
    let atlas = Atlas::new(&here, 0.3).expect("an atlas");
    for most in [0, 3, 20] {
        let watch = || Impatient { asked: AtomicUsize::new(0), most };
        let modes = locate_watched(&here, &atlas, &sweeps[0], &watch());
        assert_eq!(modes.err(), Some(FitError::Stopped), "{most}");
        assert_eq!(Atlas::watched(&here, 0.3, &watch()).err(), Some(AtlasError::Stopped), "{most}");
    }
}
