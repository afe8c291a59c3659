//! `sonard locate`.

use std::{
    io::{self, Write},
    sync::Arc,
};

use serde::Serialize;
use uuid::Uuid;

use super::{
    Failure, Outcome,
    answer::print_result,
    numbers::within,
    prior::{self, PriorSigma},
    progress,
    table::{align_right, fit, ruled},
    what_if::InsteadArgs,
    worlds::SweepArgs,
};
use crate::inverse::{
    CoarseGrid, Misfit, NuisanceEstimate, Odometry, ParameterGroup, PoseMode, Tracker, World,
    diagnose, locate,
};

/// Options of `sonard locate`.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(super) struct Args {
    #[command(flatten)]
    sweeps: SweepArgs,
    /// Spacing of the initial grid of positions, metres [default: 0.05 in small scenes to 0.1]
    #[arg(long, value_name = "M", value_parser = within(0.01..=2.0))]
    spacing_m: Option<f64>,
    /// Parameters to fit, separated by commas
    #[arg(long, value_name = "WHAT", value_delimiter = ',')]
    fit: Vec<ParameterGroup>,
    /// Prior standard deviation of a parameter, in its unit (repeatable)
    #[arg(long, value_name = "NAME=SIGMA", requires = "fit")]
    prior: Vec<PriorSigma>,
    /// JSON instead of text; one object per pose, most probable first
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    instead: InsteadArgs,
    #[command(flatten)]
    course: CourseArgs,
}

/// Options for consecutive scans of a moving robot.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Course")]
struct CourseArgs {
    /// The scans are consecutive, and the poses in the log are odometry in any frame
    #[arg(long)]
    course: bool,
    /// Standard deviation of the odometry's position, metres per metre driven
    #[arg(long, value_name = "M", requires = "course", default_value_t = 0.05,
          value_parser = within(0.0..=1.0))]
    drift_m_per_m: f64,
    /// Standard deviation of the odometry's heading, degrees per metre driven
    #[arg(long, value_name = "DEG", requires = "course", default_value_t = 5.0,
          value_parser = within(0.0..=180.0))]
    drift_deg_per_m: f64,
    /// Probability that the robot was displaced between two scans (kidnapped)
    #[arg(long, value_name = "P", requires = "course", default_value_t = 0.02,
          value_parser = within(0.0..=1.0))]
    kidnap_probability: f64,
}

impl CourseArgs {
    /// Returns the odometry model if the scans are consecutive.
    fn odometry(&self) -> Option<Odometry> {
        let &Self { course, drift_m_per_m, drift_deg_per_m, kidnap_probability } = self;
        course.then_some(Odometry { drift_m_per_m, drift_deg_per_m, kidnap_probability })
    }
}

pub(super) const ABOUT: &str = "\
Find the poses of sweeps without an initial guess.

The readings of a scan alone determine the position of the ranger in the scene. Every pose that \
explains them is listed with its probability, because symmetric rooms have several. The model \
first predicts readings on a grid of positions all over the scene; the best matches are then \
refined until all readings (echoes along any path, missing echoes, ends of arcs) are as likely as \
possible. The pose in the log is ignored, or used as odometry only.

With --course previous scans count too: odometry leads from each pose of the previous scan to an \
expected pose of the current one, and poses that agree gain probability. This distinguishes \
similar rooms once the robot has passed where they differ, and finds a kidnapped robot. Each scan \
is located as soon as it is read: a log may be piped while it is recorded.

Sensitivity differs by some decibels between units of a cheap ranger. With --fit threshold (or any \
other parameters of `sonard calibrate`) these are fitted to each scan along with its pose, and \
listed with it.

A scan that no pose explains still gets its best pose, with the share of readings that it explains \
and what the readings show of the cause: clockwise azimuths, another unit, sensor or place.";

const HELP: &str = "\
Examples:
  sonard simulate --scene mcgill-lab --pose fig4 -o scan.jsonl
  sonard locate scan.jsonl
  sonard locate sweep.jsonl --scene my-room.json --sensor hc-sr04 --json
  sonard locate trajectory.jsonl --scene my-room.json --course --drift-m-per-m 0.1
  sonard locate sweep.jsonl --scene my-room.json --sensor lego-nxt --fit threshold   # another unit

Fields of --json: log, scan, x_m, y_m, heading_deg, probability, sigma_x_m, sigma_y_m, \
sigma_heading_deg, explained (share of the readings), nuisance (name, value and sigma of the \
parameters of --fit), diagnoses (likely errors).

Exit codes: 0 done, 2 wrong usage or input.";

#[derive(Serialize)]
struct LocatedPose<'a> {
    log: String,
    scan: Uuid,
    #[serde(flatten)]
    mode: &'a PoseMode,
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    diagnoses: &'a [Misfit],
}

pub(super) fn run(args: &Args) -> Outcome {
    let what_if = args.instead.load()?;
    let mut current: Option<(Arc<World>, CoarseGrid)> = None;
    let mut course = args.course.odometry().map(Tracker::new);
    let mut found = false;
    args.sweeps.for_each(&what_if, |log, sweep, world, _| {
        if current.as_ref().is_none_or(|(of, _)| !Arc::ptr_eq(of, world)) {
            current = Some((Arc::clone(world), atlas(world, args)?));
        }
        let Some((_, atlas)) = &current else { return Ok(()) };
        let modes = match &mut course {
            Some(course) => course.next(world, atlas, &sweep),
            None => locate(world, atlas, &sweep),
        };
        let modes = modes.map_err(|error| failure_from(&error))?;
        let diagnoses = diagnose(world, atlas, &sweep, &modes);
        found = true;
        let log = log.display().to_string();
        let located =
            |mode| LocatedPose { log: log.clone(), scan: sweep.scan, mode, diagnoses: &diagnoses };
        print_result(args.json, modes.iter().map(located), |out| {
            print(out, &log, sweep.scan, &modes, &diagnoses)
        })
    })?;
    if found {
        return Ok(());
    }
    Err(Failure::input("no scan to locate", "give a log of a ranger on a stepper"))
}

fn atlas(world: &World, args: &Args) -> Result<CoarseGrid, Failure> {
    let nuisance = prior::parameters(&args.fit, &args.prior, world, 1)?;
    let spacing_m = args.spacing_m.unwrap_or_else(|| CoarseGrid::default_spacing_m(&world.scene));
    let bar = progress::spinner("predicting on the grid of positions");
    let atlas = CoarseGrid::new(world, spacing_m).map_err(|error| failure_from(&error))?;
    bar.finish_and_clear();
    Ok(atlas.with_nuisance(nuisance))
}

fn failure_from(error: &dyn std::fmt::Display) -> Failure {
    Failure::input(error, "check the scene with `sonard scene check`, and sensor and air")
}

fn print(
    out: &mut impl Write,
    log: &str,
    scan: Uuid,
    modes: &[PoseMode],
    diagnoses: &[Misfit],
) -> io::Result<()> {
    writeln!(out, "{log}: scan {scan}")?;
    let nuisance = modes.first().map_or(&[][..], |mode| &mode.nuisance);
    let head = ["probability", "x m", "y m", "heading deg", "explained"].map(str::to_owned);
    let mut table = ruled(head.into_iter().chain(nuisance.iter().map(|of| of.name.clone())));
    for mode in modes {
        // Adding zero removes the sign of -0.
        let heading_deg = (100.0 * mode.heading_deg).round() / 100.0 + 0.0;
        let pose = [
            format!("{:.3}", mode.probability),
            format!("{:.3} \u{b1} {:.3}", mode.x_m, mode.sigma_x_m),
            format!("{:.3} \u{b1} {:.3}", mode.y_m, mode.sigma_y_m),
            format!("{heading_deg:.2} \u{b1} {:.2}", mode.sigma_heading_deg),
            format!("{:.0} %", 100.0 * mode.explained),
        ];
        let parameter = |of: &NuisanceEstimate| format!("{:.2} \u{b1} {:.2}", of.value, of.sigma);
        table.add_row(pose.into_iter().chain(mode.nuisance.iter().map(parameter)));
    }
    align_right(&mut table, 0..usize::MAX);
    writeln!(out, "{}", fit(table))?;
    diagnoses
        .iter()
        .try_for_each(|cause| writeln!(out, "warning: {cause}\n  help: {}", cause.advice()))
}
