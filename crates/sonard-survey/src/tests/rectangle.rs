//! A rectangle as a whole.

use std::sync::atomic::{AtomicBool, Ordering};

use sonard_model::geometry::wrap_180;

use super::*;
use crate::{
    error::SurveyError,
    progress::NoObserver,
    result::{PieceStatus, SearchEnd, Survey},
    survey::{resume_survey, score_plan, survey},
};

fn surveyed(observer: &dyn SurveyObserver, max_scenes: usize) -> Survey {
    let (corners, poses) = (rectangle(), stops());
    let world = world(&corners);
    let sweeps = sweeps(&world, &poses, &drifted(&poses));
    survey(&world, &sweeps, &SurveyOptions { max_scenes, ..options() }, observer)
        .expect("sweeps with arcs")
}

#[test]
fn rectangle_is_found_from_drifting_odometry() {
    let found = surveyed(&NoObserver, 30_000);
    assert_eq!((found.walls.len(), found.end), (4, SearchEnd::Complete), "{found:#?}");
    for corner in rectangle() {
        let ends = found.walls.iter().flat_map(|wall| [wall.from.at_m, wall.to.at_m]);
        let off_m = ends.map(|end| corner.distance(end.into())).fold(f64::INFINITY, f64::min);
        // The frame is the first pose, whose heading the readings of 1.8 degrees give to some
        // hundredths of a degree: a millimetre at 3 m.
        assert!(off_m < 0.002, "{corner}: {off_m}");
    }
    for (of, truth) in found.poses.iter().zip(stops()) {
        assert!(of.pose.position().distance(truth.position()) < 0.001, "{of:?} {truth:?}");
        let off_deg = wrap_180(of.pose.heading_deg - truth.heading_deg);
        assert!(off_deg.abs() < 0.1, "{of:?} {truth:?}");
    }
    let pieces = || found.walls.iter().flat_map(|wall| &wall.pieces);
    assert!(pieces().any(|piece| piece.status == PieceStatus::Observed));
    assert!(pieces().all(|piece| piece.status != PieceStatus::Conjectured), "{found:#?}");
    // The score is that of the true room, except for the last tenths of a millimetre.
    let (corners, poses, world, sweeps) = true_rectangle();
    let truth = score_plan(&world, &sweeps, &options(), (&sides(&corners), &[]), &poses);
    assert!((found.score - truth.expect("a score")).abs() < 3.0, "{}", found.score);
    let scene = found.scene("found", false).build().expect("a valid scene");
    assert_eq!((scene.walls.len(), scene.poses.len()), (4, 4));
}

#[test]
fn result_is_independent_of_the_number_of_threads() {
    let [one, two] = [1, 2].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.expect("threads").install(|| surveyed(&NoObserver, 30_000))
    });
    assert_eq!(one, two);
}

#[test]
fn early_end_is_reported() {
    let found = surveyed(&NoObserver, 100);
    assert_eq!(found.end, SearchEnd::Budget);
    assert_eq!(found.poses.len(), 4);

    /// Cancels at the first poll.
    #[derive(Default)]
    struct Cancelling(AtomicBool);
    impl SurveyObserver for Cancelling {
        fn is_cancelled(&self) -> bool {
            self.0.store(true, Ordering::Relaxed);
            true
        }
    }
    let cancelling = Cancelling::default();
    assert_eq!(surveyed(&cancelling, 30_000).end, SearchEnd::Cancelled);
    assert!(cancelling.0.load(Ordering::Relaxed));
}

#[test]
fn resumed_survey_is_that_of_an_uninterrupted_one() {
    let (corners, poses) = (rectangle(), stops());
    let world = world(&corners);
    let sweeps = sweeps(&world, &poses, &drifted(&poses));
    let resumed = |scores: &PlanScores, max_scenes: usize| {
        let options = SurveyOptions { max_scenes, ..options() };
        resume_survey(&world, &sweeps, &options, scores, &NoObserver).expect("sweeps with arcs")
    };
    let scores = PlanScores::default();
    assert_eq!(resumed(&scores, 100).end, SearchEnd::Budget);
    let saved = scores.entries();
    assert!(saved.len() > 50, "{}", saved.len());
    let whole = surveyed(&NoObserver, 30_000);
    let scores: PlanScores = saved.into_iter().collect();
    assert_eq!(resumed(&scores, 30_000), whole);
    // The result is independent of which scores are known, as of when a search was interrupted.
    let all = scores.entries();
    for every in [1, 2, 3] {
        let known: PlanScores = all.iter().copied().step_by(every).collect();
        assert_eq!(resumed(&known, 30_000), whole, "every {every}th score is known");
    }
}

#[test]
fn unusable_input_is_rejected() {
    let (_, _, world, all) = true_rectangle();
    let with = |sweeps: &[FitSweep], options: &SurveyOptions| {
        survey(&world, sweeps, options, &NoObserver).expect_err("no survey")
    };
    assert_eq!(with(&all[..1], &options()), SurveyError::TooFewSweeps(1));
    let mut without = all.clone();
    for beam in &mut without[2].beams {
        beam.outcome = FiringOutcome::NoEcho;
    }
    assert_eq!(with(&without, &options()), SurveyError::NoArcs(without[2].scan));
    let black = SurveyOptions { reflectance: 0.0, ..options() };
    let error = with(&all, &black).to_string();
    assert!(error.starts_with("reflectance is 0: it must be"), "{error}");
}
