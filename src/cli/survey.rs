//! `sonard survey`.

mod checkpoint;
mod course;
mod files;
mod next_view;
mod picture;
mod summary;

use std::{path::PathBuf, sync::Arc};

use indicatif::ProgressBar;

use super::{
    Failure, Outcome,
    answer::print_result,
    logs::{for_each_scan, logs_in},
    numbers::within,
    output::{OutPath, Overwrite},
    predictor::conditions,
    progress,
    runtime::{self, Interrupts},
    what_if::{AssumptionFilter, InsteadArgs, WhatIf},
};
use crate::{
    inverse::{ParameterGroup, World},
    scan::{Provenance, Session},
    survey::{
        OdometrySigma, PlanScores, SearchEnd, Survey, SurveyCourse, SurveyError, SurveyObserver,
        SurveyOptions, SurveyProgress, SurveyStage, resume_survey, unknown_room,
    },
};

/// Options of `sonard survey`.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(super) struct Args {
    /// Logs of sweeps, or of an array on a moving robot, in the order of the course, or folders of
    /// logs; - for standard input
    #[arg(required = true, value_name = "LOG")]
    logs: Vec<PathBuf>,
    /// Output folder; scene, poses, walls with their status, report, picture
    #[arg(long, value_name = "DIR")]
    out: OutPath,
    /// Standard deviations of the poses in the log as odometry: of the position and of the heading,
    /// metres and degrees per metre driven; then, if given, both at each stop besides (5 mm and 0.5
    /// degrees)
    #[arg(long, value_name = "M,DEG[,M,DEG]", default_value = "0.05,5", value_parser = parse_odometry)]
    odometry: OdometrySigma,
    /// Positions in the log are waypoints in one frame, however wrong the headings are
    #[arg(long, conflicts_with = "no_odometry")]
    waypoints: bool,
    /// Ignore the poses in the log
    #[arg(long, conflicts_with = "odometry")]
    no_odometry: bool,
    /// Standard deviation of ranges, metres, instead of 4 mm and the step of the ranger
    #[arg(long, value_name = "M", value_parser = within(0.001..=0.1))]
    range_sigma: Option<f64>,
    /// Most walls are square to each other: a line off the common axis costs up to 6 nats
    #[arg(long)]
    square: bool,
    /// Keep conjectured stretches of walls in scene.json
    #[arg(long)]
    closed: bool,
    /// Maximum range, metres, instead of the sensor's; longer ranges count as no echo
    #[arg(long, value_name = "M", default_value_t = 5.0, value_parser = within(0.3..=20.0))]
    max_range: f64,
    /// Reflectance (amplitude) of all surfaces, 0 to 1
    #[arg(long, value_name = "R", default_value_t = 0.97, value_parser = within(0.05..=1.0))]
    reflectance: f64,
    /// Parameters to fit, separated by commas (threshold, rise, mounting, materials, air, delay, gear,
    /// beam, skirts, pulse)
    #[arg(long, value_name = "WHAT", value_delimiter = ',', hide_possible_values = true)]
    fit: Vec<ParameterGroup>,
    /// Maximum distance of the next view from a stop, metres
    #[arg(long, value_name = "M", default_value_t = SurveyOptions::default().view_reach_m,
          value_parser = within(0.0..=20.0))]
    view_reach: f64,
    /// Minimum distance between rounds of an array that are used, metres, unless the robot turns by
    /// 5 degrees
    #[arg(long, value_name = "M", default_value_t = SurveyCourse::ROUND_SPACING_M,
          value_parser = within(0.0..=5.0))]
    round_spacing: f64,
    /// Budget of the search: maximum number of floor plans whose readings are predicted
    #[arg(long, value_name = "N", default_value_t = SurveyOptions::default().max_scenes,
          value_parser = parse_count)]
    max_scenes: usize,
    /// JSON instead of text; one object, as in survey.json
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    instead: InsteadArgs,
    #[command(flatten)]
    overwrite: Overwrite,
}

pub(super) const ABOUT: &str = "\
Reconstruct an unknown room from sweeps taken at a few places, or from an array on a moving robot.

Poses come first: mirror images of walls are lines and mirror images of corners are points, so \
echoes of any order locate the sweeps, with odometry as prior. Walls are then placed on lines \
through these features such that the model explains the readings best: echoes along any path, \
missing echoes, minimum ranges. No scene is needed; one in the log is ignored.

Each stretch of wall is observed (explained echoes of two sweeps or more determine it there), implied \
(plans without it explain less) or conjectured (left out of scene.json without --closed). Floor \
plans that explain the readings nearly as well are listed with their probabilities, and the next \
view is the place from which one more sweep is expected to decide most of it. The frame is the \
pose of the first sweep in the log. Dimensions follow the speed of sound: 0.17 % per degree.

An interrupted survey, or one whose budget is spent, writes the best plan so far. The same command \
continues from unfinished.jsonl, also after the program was killed; --max-scenes may differ.

--fit estimates numbers of the ranger and of the air together with plan and poses, from the values \
assumed and with the priors of `sonard calibrate`, and searches the plan again with them. Some \
remain at their priors: the speed of sound is coupled to all dimensions, and only odometry separates \
both.";

const HELP: &str = "\
Files in DIR: scene.json with the stops as poses; poses.csv; survey.json with covariances, status, \
alternatives and the cause of each reading; report.md; plan.svg and plan.png; with --fit also \
sensor.json and air.json.

Examples:
  sonard simulate --scene two-surface-room --pose 0.6,0.6,0 -o a.jsonl
  sonard simulate --scene two-surface-room --pose 1.1,0.7,40 -o b.jsonl
  sonard simulate --scene two-surface-room --pose 0.8,1.1,90 -o c.jsonl
  sonard survey a.jsonl b.jsonl c.jsonl --odometry 0.05,5 --out room
  sonard locate a.jsonl --scene room/scene.json
  sonard survey a.jsonl b.jsonl c.jsonl --fit threshold,mounting --out fitted
  sonard compare a.jsonl --scene fitted/scene.json --sensor fitted/sensor.json

Exit codes: 0 done, 1 ended early (interrupted, or the budget is spent), 2 wrong usage or input, \
3 write error.";

/// Readings of the logs and what they share.
struct Input {
    course: SurveyCourse,
    world: World,
    provenances: Vec<Provenance>,
}

pub(super) fn run(args: &Args) -> Outcome {
    let what_if = args.instead.load()?;
    let input = read(args, &what_if)?;
    let head = checkpoint::Head::new(args, &input);
    let saved = checkpoint::load(&args.out, args.overwrite, &head)?;
    // The results beside a checkpoint are those of the same survey.
    let overwrite = args.overwrite.or_forced(saved.is_some());
    files::check(args, overwrite)?;
    let scores = saved.unwrap_or_default();
    let search = || find(args, &input, &scores);
    let found = checkpoint::while_saving(&args.out, overwrite, &head, &scores, search)?;
    files::write(args, overwrite, &input, &found)?;
    match found.end {
        SearchEnd::Complete | SearchEnd::UnexplainedArcs => checkpoint::remove(&args.out)?,
        SearchEnd::Budget | SearchEnd::Cancelled => {
            checkpoint::save(&args.out, overwrite, &head, &scores)?;
        }
    }
    print_result(args.json, [&found], |out| summary::print(out, &input, &found))?;
    match found.end {
        SearchEnd::Complete | SearchEnd::UnexplainedArcs => Ok(()),
        SearchEnd::Budget | SearchEnd::Cancelled => Err(Failure::Found(None)),
    }
}

impl Args {
    fn options(&self) -> SurveyOptions {
        SurveyOptions {
            odometry: (!self.no_odometry)
                .then_some(OdometrySigma { are_waypoints: self.waypoints, ..self.odometry }),
            range_sigma_m: self.range_sigma,
            square_deg: self.square.then_some(SurveyOptions::SQUARE_DEG),
            reflectance: self.reflectance,
            fit: self.fit.clone(),
            view_reach_m: self.view_reach,
            max_scenes: self.max_scenes,
            ..SurveyOptions::default()
        }
    }
}

fn parse_odometry(text: &str) -> Result<OdometrySigma, String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|part| part.trim().parse()).collect();
    let standard = OdometrySigma::default();
    let sigma = match numbers.as_deref() {
        Ok(&[m_per_m, deg_per_m]) => Some(OdometrySigma { m_per_m, deg_per_m, ..standard }),
        Ok(&[m_per_m, deg_per_m, m_per_stop, deg_per_stop]) => {
            Some(OdometrySigma { m_per_m, deg_per_m, m_per_stop, deg_per_stop, ..standard })
        }
        _ => None,
    };
    let is_valid = |sigma: &OdometrySigma| {
        [sigma.m_per_m, sigma.m_per_stop].iter().all(|m| (1e-4..=1.0).contains(m))
            && [sigma.deg_per_m, sigma.deg_per_stop].iter().all(|deg| (0.01..=180.0).contains(deg))
    };
    sigma.filter(is_valid).ok_or_else(|| {
        "give metres (0.0001 to 1) and degrees (0.01 to 180) per metre, such as 0.05,5, and, if you \
         like, both per stop, such as 0.05,5,0.01,2"
            .to_owned()
    })
}

fn parse_count(text: &str) -> Result<usize, String> {
    let count = text.parse().ok().filter(|count| (100..=10_000_000).contains(count));
    count.ok_or_else(|| "give a number from 100 to 10000000".to_owned())
}

/// Reads the sweeps and the sensor and air that they share.
fn read(args: &Args, what_if: &WhatIf) -> Result<Input, Failure> {
    let mut assumptions = AssumptionFilter::new(what_if);
    let mut input: Option<(Arc<Session>, Input)> = None;
    for log in &logs_in(&args.logs)? {
        for_each_scan(log, |mut scan| {
            assumptions.apply(&mut scan);
            let found = match SurveyCourse::from_scan(&scan) {
                Ok(found) => found,
                Err(error) => {
                    notice!("warning: {}: {error}; scan skipped", log.display());
                    return Ok(());
                }
            };
            // Every sweep has a session.
            let Some(session) = scan.session.clone() else { return Ok(()) };
            match &mut input {
                None => {
                    let (air, options) = conditions(log, &session)?;
                    let sensor = session.sensor.clone();
                    let world = unknown_room(sensor, air, options, args.max_range);
                    let world = world.map_err(|error| failure_from(&error))?;
                    let provenances = vec![session.provenance];
                    input = Some((session, Input { course: found, world, provenances }));
                }
                Some((first, input)) => {
                    if first.sensor != session.sensor {
                        return Err(Failure::input(
                            format!(
                                "{}: the sensor differs from that of the previous scans",
                                log.display()
                            ),
                            "survey scans of one sensor together, or override it with --sensor",
                        ));
                    }
                    input.course.extend(found).map_err(|error| {
                        let error = format!("{}: {error}", log.display());
                        Failure::input(error, "survey them separately")
                    })?;
                    input.provenances.push(session.provenance);
                }
            }
            Ok(())
        })?;
    }
    let Some((_, mut input)) = input else {
        return Err(Failure::input(
            "there is no sweep to survey",
            "give logs of a ranger on a stepper, or of an array on a moving robot",
        ));
    };
    input.course.thin(args.round_spacing);
    Ok(input)
}

/// Surveys until done or interrupted.
fn find(args: &Args, input: &Input, scores: &PlanScores) -> Result<Survey, Failure> {
    let runtime = runtime::new()?;
    let interrupts = {
        let _within = runtime.enter();
        Interrupts::listen()
    };
    let bar = progress::spinner(&format!("survey of {}:", course::count(&input.course)));
    let observer = Observer { bar: bar.clone(), interrupts };
    let found = resume_survey(&input.world, &input.course, &args.options(), scores, &observer);
    bar.finish_and_clear();
    found.map_err(|error| failure_from(&error))
}

fn failure_from(error: &SurveyError) -> Failure {
    let help = match error {
        SurveyError::TooFewSweeps(_) => "give the sweeps of several places, in one log or several",
        SurveyError::NoArcs(_) => "leave this scan out, or raise --max-range",
        SurveyError::World(_) | SurveyError::Scene(_) | SurveyError::Option { .. } => {
            "check sensor and air of the logs, and the options"
        }
        SurveyError::MixedCourse => "survey them separately",
        SurveyError::TooManyRounds { .. } => "give a shorter course, or a larger --round-spacing",
        SurveyError::Group(error) => return Failure::input(error, error.help()),
        SurveyError::NotFittable { .. } => "poses, walls and posts are estimated in any case",
    };
    Failure::input(error, help)
}

/// Progress and interrupts of a running survey.
struct Observer {
    bar: ProgressBar,
    interrupts: Interrupts,
}

impl SurveyObserver for Observer {
    fn progress(&self, progress: SurveyProgress) {
        let stage = match progress.stage {
            SurveyStage::Course => "poses".to_owned(),
            SurveyStage::Walls { round } => format!("walls, round {round}"),
            SurveyStage::Alternatives => "alternatives".to_owned(),
        };
        let (walls, plans) = (progress.walls, progress.scored_scenes);
        self.bar.set_message(format!("{stage}, {walls} walls, {plans} floor plans tried"));
    }

    fn is_cancelled(&self) -> bool {
        self.interrupts.happened()
    }
}
