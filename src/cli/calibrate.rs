//! `sonard calibrate`.

mod doubt;
mod report;
mod unfinished;

use std::{
    io::{self, Write},
    sync::Arc,
};

use comfy_table::{CellAlignment, Table};
use indicatif::ProgressBar;

use super::{
    Failure, Outcome,
    answer::answer,
    compare::RULED,
    numbers::within,
    output::{OutPath, Overwrite},
    prior::{self, PriorSigma},
    progress,
    runtime::{self, Interrupts},
    what_if::{WhatIf, WhatIfArgs},
    worlds::SweepArgs,
};
use crate::inverse::{
    Fit, FitError, Fitted, Found, Group, Progress, Search, Sweep, Told, Watch, World, fit_watched,
};
use doubt::doubts_of;
use report::write_folder;
use unfinished::{Head, Unfinished};

/// Options of `sonard calibrate`.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(super) struct Args {
    #[command(flatten)]
    sweeps: SweepArgs,
    /// What to fit, separated by commas
    #[arg(long, value_name = "WHAT", value_delimiter = ',', default_value = "pose,air,threshold")]
    fit: Vec<Group>,
    /// Prior standard deviation of a parameter, in its unit; may be given several times
    #[arg(long, value_name = "NAME=SIGMA")]
    prior: Vec<PriorSigma>,
    /// Largest initial error of predicted ranges, metres
    #[arg(long, value_name = "M", default_value_t = 0.1, value_parser = within(0.005..=1.0))]
    widest_m: f64,
    /// How much to search, and for what
    #[arg(long, value_name = "HOW", default_value = "thorough", value_enum)]
    search: Search,
    /// Output folder; the fitted sensor, scene, air and poses, the estimates, their correlations and a report
    #[arg(long, value_name = "DIR")]
    out: Option<OutPath>,
    #[command(flatten)]
    overwrite: Overwrite,
    #[command(flatten)]
    what_if: WhatIfArgs,
    /// JSON instead of text; one object a parameter
    #[arg(long)]
    json: bool,
}

pub(super) const ABOUT: &str = "\
Fit sensor, air, scene and poses to measurements.

Starting from the values in logs and files, with a prior uncertainty for each parameter, it finds the values \
with which the model explains the readings best: the ranges of echoes by any path that the receiver may have \
reported, missing echoes, and the ends of arcs. Each value comes with its standard deviation, and a remark if \
the readings do not determine it better than the prior: such values stay where they were. The share of \
unexplained readings is part of the result.

A few unexplained readings do no harm. Where furniture that the scene lacks answers or hides a good part of the \
beams, --search furnished keeps it from bending the values. It is no default, because what the model misses of a wall \
or at the edge of the beam may be taken for furniture, too.

With --out, intermediate results are kept in DIR/unfinished.jsonl until the final ones are written: a stopped or \
killed calibration continues when the same command is given again, and comes to the same result. Another \
calibration is refused there.";

const HELP: &str = "\
What to fit (--fit), with the doubt that is assumed:
  pose        x_m and y_m (0.1 m) and heading_deg (8 degrees) of each scan
  heading     heading_zero_deg of the stepper, for all scans (8)
  gear        how much further than said the stepper turns (0.02)
  mounting    ahead_m and left_m, of the face before the axis (0.03 m)
  height      height_m of the transducer, in a scene with floor or ceiling (0.1 m)
  air         sound_speed, as a share (0.015: 8 degrees Celsius)
  delay       delay_m, added to every range (0.03 m)
  threshold   threshold_db of the receiver (6 dB)
  rise        threshold_rise_db_per_m, how the threshold rises with range (5 dB a metre)
  beam        aperture: size of the radiating face, as a logarithm (0.3)
  skirts      skirts_db, what the face hears far off its axis, if the sensor's file has some (6 dB)
  materials   reflectance of each material, as a logarithm (0.1)
  roughness   roughness of each material (0.1)
  walls       each wall along its normal (0.05 m)

Examples:
  sonard simulate --scene simple-room --pose 0.80,0.05,92 --temperature-c 15 -o room.jsonl
  sonard calibrate room.jsonl --pose 0.774,0.085,90
  sonard calibrate *.jsonl --scene arena.json --fit pose,delay,threshold,beam --prior x_m=0.05 --out fitted

Of --json: name, scan (of a pose), value, change, sigma, low, high (95 %), prior, prior_sigma, identified, at_limit; values that \
are logarithms or shares are told as what they make of the file's figure.
Exit codes: 0 done, 1 stopped on request, 2 wrong usage or input, 3 the disk gave up.";

pub(super) fn run(args: &Args) -> Outcome {
    let what_if = args.what_if.load()?;
    if let Some(out) = &args.out
        && !unfinished::check(out, args.overwrite)?
    {
        report::check(out, args.overwrite)?;
    }
    let (sweeps, world) = read(args, &what_if)?;
    let priors = prior::fitted(&args.fit, &args.prior, &world, sweeps.len())?;
    let what = Fit { search: args.search, ..Fit::usual(priors, args.widest_m) };
    let head = Head::of(&world, &sweeps, &what);
    let open = |out: &OutPath| Unfinished::open(out, args.overwrite, &head);
    let unfinished = args.out.as_ref().map(open).transpose()?;
    let fitted = find(&world, &sweeps, &what, unfinished.as_ref())?;
    let lines = fitted.told(&world, &sweeps, &what);
    let doubts = doubts_of(&world, &sweeps, &fitted);
    if args.json {
        doubts.iter().for_each(|doubt| notice!("{doubt}"));
    }
    let words = report::fit_words(&lines, &fitted, doubts);
    if let (Some(out), Some(unfinished)) = (&args.out, unfinished) {
        let overwrite = args.overwrite.or_forced(unfinished.begin_results());
        write_folder(out, overwrite, &world, &sweeps, &fitted, &lines, &words)?;
        unfinished.remove()?;
    }
    answer(args.json, &lines, |out| print(out, &lines, &words))
}

/// The sweeps, and the world that they have in common.
fn read(args: &Args, what_if: &WhatIf) -> Result<(Vec<Sweep>, Arc<World>), Failure> {
    let (mut sweeps, mut world): (Vec<Sweep>, Option<Arc<World>>) = (Vec::new(), None);
    args.sweeps.for_each(what_if, |log, sweep, of| {
        let known = world.get_or_insert_with(|| Arc::clone(of));
        if known.sensor != of.sensor || known.scene.sha256 != of.scene.sha256 {
            return Err(Failure::input(
                format!("{}: another sensor or scene than in the scans before", log.display()),
                "calibrate what belongs together, or name one with --sensor or --scene",
            ));
        }
        sweeps.push(sweep);
        Ok(())
    })?;
    let world = world.ok_or_else(|| {
        Failure::input("there is no sweep to fit to", "give logs of a ranger on a stepper")
    })?;
    Ok((sweeps, world))
}

/// Fits, from what was found before, and until somebody interrupts.
fn find(
    world: &World,
    sweeps: &[Sweep],
    what: &Fit,
    unfinished: Option<&Unfinished>,
) -> Result<Fitted, Failure> {
    let runtime = runtime::new()?;
    let interrupts = {
        let _within = runtime.enter();
        Interrupts::listen()
    };
    let known = unfinished.map_or(&[][..], Unfinished::known);
    if let Some(unfinished) = unfinished.filter(|_| !known.is_empty()) {
        let (path, searches) = (unfinished.path().display(), known.len());
        notice!("{path}: goes on after {searches} searches");
    }
    let bar = progress::spinner("scans fitted to");
    bar.set_position(sweeps.len() as u64);
    let watcher = Watcher { bar: bar.clone(), interrupts, unfinished };
    let fitted = fit_watched(world, sweeps, what, known, &watcher);
    bar.finish_and_clear();
    fitted.map_err(|error| refuse(&error, unfinished))
}

/// Shows how it goes, and keeps it.
struct Watcher<'a> {
    bar: ProgressBar,
    interrupts: Interrupts,
    unfinished: Option<&'a Unfinished>,
}

impl Watch for Watcher<'_> {
    fn progress(&self, progress: Progress) {
        self.bar.set_message(progress.to_string());
    }

    fn found(&self, found: &Found) {
        if let Some(unfinished) = self.unfinished {
            self.bar.suspend(|| unfinished.keep(found));
        }
    }

    fn stops(&self) -> bool {
        self.interrupts.happened()
    }
}

fn refuse(error: &FitError, unfinished: Option<&Unfinished>) -> Failure {
    let kept = unfinished.map(|unfinished| unfinished.path().display());
    match (error, kept) {
        (FitError::Stopped, Some(path)) => Failure::Found(Some(format!(
            "{error}: {path} has what was found; the same command goes on from there"
        ))),
        (FitError::Stopped, None) => Failure::Found(Some(error.to_string())),
        (FitError::OtherFit, Some(path)) => {
            Failure::input(format!("{path}: {error}"), unfinished::HELP)
        }
        _ => {
            // There will be no results, however often it is tried.
            if let Some(unfinished) = unfinished {
                drop(unfinished.remove());
            }
            Failure::input(error, "see that poses are in the scene, and fit fewer parameters")
        }
    }
}

/// The parameters as a table, then what is remarkable in words.
fn print(out: &mut impl Write, lines: &[Told], words: &[String]) -> io::Result<()> {
    let mut table = Table::new();
    table.load_style(RULED);
    table.set_header(["parameter", "was", "is", "\u{b1}", "95 %", ""]);
    for line in lines {
        table.add_row([
            line.title(),
            format!("{:.5}", line.prior),
            format!("{:.5}", line.value),
            format!("{:.5}", line.sigma),
            format!("{:.5} to {:.5}", line.low, line.high),
            line.remark().to_owned(),
        ]);
    }
    for column in table.column_iter_mut().skip(1).take(4) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    writeln!(out, "{table}")?;
    words.iter().try_for_each(|line| writeln!(out, "{line}"))
}
