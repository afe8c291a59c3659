//! Survey as a whole.

mod survey_search;

use std::collections::HashSet;

use sonard_inverse::{FitSweep, World};
use sonard_model::{
    acoustics::Mounting,
    geometry::{DVec2, Pose},
};

use crate::{
    arrangement::{LineArrangement, Segment},
    error::SurveyError,
    input::{MAX_ARRAY_ROUNDS, SurveyInput},
    judge::Judge,
    odometry::Move,
    options::SurveyOptions,
    posed::PosedPlan,
    post::PostShape,
    progress::{NoObserver, SurveyObserver, SurveyStage},
    range_errors::RangeErrors,
    readings::Readings,
    report::report,
    result::Survey,
    room::empty_world,
    scores::PlanScores,
    sensor_fit::SensorFitter,
    workspace::Workspace,
};
use survey_search::SurveySearch;

/// Maximum number of searches with another sensor, each after a fit.
const MAX_SENSOR_FITS: usize = 3;
/// Share of the budget for the search; the rest is for alternatives.
const SEARCH_SHARE: f64 = 0.7;

/// Reconstructs the walls of a room and the poses of the sweeps.
///
/// The poses of the sweeps are odometry; the first is the frame. The scene of the world is ignored,
/// and the face of the sensor is assumed on the axis of the stepper or ahead of it. The result is
/// independent of the number of threads.
///
/// The search predicts rounds of an array from the pose of the robot, to the first order of the
/// offsets of the transducers ([`ping_beside`](sonard_model::model::ObservationPoint::ping_beside));
/// the final estimate and the alternatives are by exact predictions from each transducer. The result
/// has no next view.
///
/// # Errors
/// Fewer than two sweeps or rounds, more than 200 rounds, a sweep without arcs, numbers that can't be fitted, or an invalid
/// sensor or option.
pub fn survey<'a>(
    world: &World,
    input: impl Into<SurveyInput<'a>>,
    options: &SurveyOptions,
    observer: &dyn SurveyObserver,
) -> Result<Survey, SurveyError> {
    resume_survey(world, input, options, &PlanScores::default(), observer)
}

/// Reconstructs a room as [`survey`], with the scores of a search that ended early, which are
/// extended.
///
/// # Errors
/// As [`survey`].
pub fn resume_survey<'a>(
    world: &World,
    input: impl Into<SurveyInput<'a>>,
    options: &SurveyOptions,
    scores: &PlanScores,
    observer: &dyn SurveyObserver,
) -> Result<Survey, SurveyError> {
    let input = input.into();
    let sweeps = &input.sweeps();
    let mut fitter = SensorFitter::new(world, options, input.is_array())?;
    let mut scored = HashSet::new();
    let mut last: Option<PosedPlan> = None;
    for round in 1.. {
        let (world, reflectance) = fitter.world()?;
        let options = &SurveyOptions { reflectance, ..options.clone() };
        // Repeated contacts with posts take most of the time near them, and change few readings, as
        // do exact predictions from each transducer of an array: the final estimate and the
        // alternatives include them.
        let workspace = workspace(&world, (input, sweeps), options, (observer, scores))?
            .following(scored, fitter.digest())
            .simplified()?;
        workspace.limit_scenes((SEARCH_SHARE * options.max_scenes as f64) as usize);
        let mut search = SurveySearch::new(&workspace, options);
        match last.take() {
            Some(last) => search.run_after(last),
            None => search.run(),
        }
        let early_end = search.early_end();
        let is_changed = search.fit_sensor(&mut fitter);
        let posed = search.posed;
        if is_changed && early_end.is_none() && round <= MAX_SENSOR_FITS {
            last = Some(posed);
            scored = workspace.into_scored();
            continue;
        }
        let workspace = workspace.complete()?;
        workspace.limit_scenes(options.max_scenes);
        let mut search = SurveySearch::with_plan(&workspace, options, posed);
        search.report_progress(SurveyStage::Alternatives);
        let assessment = search.settle();
        let end = early_end.unwrap_or_else(|| search.last_end());
        let (posed, covariance) = (&search.posed, &search.covariance);
        let options = &SurveyOptions { reflectance: fitter.world()?.1, ..options.clone() };
        let stated = (end, options, fitter.report()?);
        return Ok(report(sweeps, posed, &assessment, covariance, &workspace, stated));
    }
    unreachable!("the last round returns")
}

/// Score of given walls (pairs of ends, metres), posts and poses, nats, as that of a [`Survey`].
///
/// # Errors
/// As [`survey`].
pub fn score_plan<'a>(
    world: &World,
    input: impl Into<SurveyInput<'a>>,
    options: &SurveyOptions,
    (walls, posts): (&[[DVec2; 2]], &[PostShape]),
    poses: &[Pose],
) -> Result<f64, SurveyError> {
    let scores = PlanScores::default();
    let input = input.into();
    let sweeps = &input.sweeps();
    let workspace = workspace(world, (input, sweeps), options, (&NoObserver, &scores))?;
    let sigma_m = workspace.errors.final_sigma_m();
    let judge = Judge::new(&workspace, poses, sigma_m).with_posts(posts);
    let segment = |(line, &[a, b]): (usize, &[DVec2; 2])| Segment { line, a, b };
    Ok(judge.score_segments(&walls.iter().enumerate().map(segment).collect::<Vec<_>>()))
}

/// Score of given walls (pairs of ends, metres) and poses after a refinement as that of a survey,
/// nats.
///
/// # Errors
/// As [`survey`].
pub fn score_refined_plan(
    world: &World,
    sweeps: &[FitSweep],
    options: &SurveyOptions,
    walls: &[[DVec2; 2]],
    poses: &[Pose],
) -> Result<f64, SurveyError> {
    let scores = PlanScores::default();
    let workspace = workspace(world, (sweeps.into(), sweeps), options, (&NoObserver, &scores))?;
    let (plan, walls) = LineArrangement::of_walls(walls, poses, workspace.reach_m());
    let given = PosedPlan { plan, walls, posts: Vec::new(), poses: poses.to_vec() };
    Ok(SurveySearch::with_plan(&workspace, options, given).refine_given())
}

pub(crate) fn workspace<'a>(
    world: &World,
    (input, sweeps): (SurveyInput<'a>, &'a [FitSweep]),
    options: &SurveyOptions,
    watched: (&'a dyn SurveyObserver, &'a PlanScores),
) -> Result<Workspace<'a>, SurveyError> {
    if sweeps.len() < 2 {
        return Err(SurveyError::TooFewSweeps(sweeps.len()));
    }
    if input.is_array() && sweeps.len() > MAX_ARRAY_ROUNDS {
        return Err(SurveyError::TooManyRounds { rounds: sweeps.len(), max: MAX_ARRAY_ROUNDS });
    }
    options.check()?;
    let errors = RangeErrors::new(&world.sensor, options);
    let mut world = world.clone();
    if input.is_array() {
        // The positions of the transducers include it.
        world.sensor.mounting = Mounting { z_m: world.sensor.mounting.z_m, ..Mounting::default() };
    }
    let left_m = world.sensor.mounting.left_m;
    let world = &empty_world(&world, options.reflectance);
    let simulator = world.simulator(&sweeps[0].pose)?;
    let max_range_m = simulator.receiver().max_range_m;
    let of_sweep = |(at, sweep): (usize, &FitSweep)| {
        Readings::new((sweep, input.faces(at).as_deref()), world, max_range_m, options)
    };
    let readings: Vec<Readings> = sweeps.iter().enumerate().map(of_sweep).collect();
    let poses: Vec<Pose> = sweeps.iter().map(|sweep| sweep.pose).collect();
    let between = |sigma| Move::between(&poses, sigma);
    let moves = options.odometry.map_or_else(Vec::new, between);
    let square_rad = options.square_deg.map(f64::to_radians);
    let model = (world.clone(), simulator);
    let read = (readings, errors);
    let workspace = Workspace::new(model, (input, sweeps), read, square_rad, moves, watched)
        .with_left_m(left_m);
    if input.is_array() {
        // A round far from all walls has no echo; odometry connects those beside it.
        return Ok(workspace);
    }
    let without = workspace.arcs.iter().zip(sweeps).find(|(arcs, _)| arcs.is_empty());
    match without {
        Some((_, sweep)) => Err(SurveyError::NoArcs(sweep.scan)),
        None => Ok(workspace),
    }
}
