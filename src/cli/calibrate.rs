//! `sonard calibrate`.

mod checkpoint;
mod diagnosis;
mod picture;
mod report;

use std::{
    io::{self, Write},
    sync::Arc,
};

use indicatif::ProgressBar;

use super::{
    Failure, Outcome,
    answer::print_result,
    numbers::within,
    output::{OutPath, Overwrite},
    prior::{self, PriorSigma},
    progress,
    runtime::{self, Interrupts},
    table::{align_right, fit, ruled},
    what_if::{WhatIf, WhatIfArgs},
    worlds::SweepArgs,
};
use crate::{
    inverse::{
        FitError, FitObserver, FitOptions, FitProgress, FitResult, FitSweep, ParameterGroup,
        ParameterReport, Search, SearchResult, World, fit_observed,
    },
    scan::{Provenance, text::format_count},
};
use checkpoint::{Checkpoint, Head};
use diagnosis::describe_misfits;
use report::write_folder;

/// Options of `sonard calibrate`.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(super) struct Args {
    #[command(flatten)]
    sweeps: SweepArgs,
    /// Parameters to fit, separated by commas
    #[arg(long, value_name = "WHAT", value_delimiter = ',', default_value = "pose,air,threshold")]
    fit: Vec<ParameterGroup>,
    /// Prior standard deviation of a parameter, in its unit (repeatable)
    #[arg(long, value_name = "NAME=SIGMA")]
    prior: Vec<PriorSigma>,
    /// Largest initial error of the predicted ranges, metres
    #[arg(long, value_name = "M", default_value_t = 0.1, value_parser = within(0.005..=1.0))]
    max_initial_error_m: f64,
    /// Search effort, and allowance for furniture
    #[arg(long, value_name = "HOW", default_value = "thorough", value_enum)]
    search: Search,
    /// Output folder; fitted sensor, scene, air and poses, estimates, correlations, report, picture
    /// of the residuals before and after
    #[arg(long, value_name = "DIR")]
    out: Option<OutPath>,
    #[command(flatten)]
    overwrite: Overwrite,
    #[command(flatten)]
    what_if: WhatIfArgs,
    /// JSON instead of text; one object per parameter
    #[arg(long)]
    json: bool,
}

pub(super) const ABOUT: &str = "\
Fit sensor, air, scene and poses to measurements.

The fit starts from the values in logs and files, with a prior uncertainty for each parameter. It \
finds the values with which the model explains the readings best: ranges of echoes along any path \
that the receiver may have reported, missing echoes, and the ends of arcs. Each value has a \
standard deviation, and a remark if the readings do not determine it better than the prior does; \
such values keep their initial value. The share of unexplained readings is part of the result.

A few unexplained readings do no harm. Where furniture that is not in the scene reflects or hides \
a good part of the beams, --search furnished keeps it from biasing the estimates. It is not the \
default, because model errors of a wall or at the edge of the beam may be taken for furniture, \
too.

With --out, intermediate results are kept in DIR/unfinished.jsonl until the final ones are \
written. An interrupted calibration resumes when the same command is given again, with the same \
result. The file of a different calibration is rejected.";

const HELP: &str = "\
Parameters (--fit), each with its default prior:
  pose        x_m and y_m (0.1 m) and heading_deg (8 degrees) of each scan
  heading     heading_zero_deg, azimuth zero of the stepper, for all scans (8)
  gear        gear ratio error of the stepper (0.02)
  mounting    ahead_m and left_m, transducer offset from the rotation axis (0.03 m)
  height      height_m of the transducer, in a scene with floor or ceiling (0.1 m)
  air         sound_speed, as a share (0.015: 8 degrees Celsius)
  delay       delay_m, added to every range (0.03 m)
  threshold   threshold_db of the receiver (6 dB)
  rise        threshold_rise_db_per_m, increase of the threshold with range (5 dB/m)
  beam        aperture: size of the radiating face, as a logarithm (0.3)
  skirts      skirts_db, side-lobe floor of the beam, if the sensor's file has one (6 dB)
  materials   reflectance of each material, as a logarithm (0.1)
  roughness   roughness of each material (0.1)
  walls       each wall along its normal (0.05 m)
  turns       turn_deg of each wall about its middle; corners follow (2 degrees)
  ends        each free end of a wall along the wall, outwards (0.05 m)
  posts       x_m, y_m (0.05 m) and radius_m (0.02 m) of each cylinder

Examples:
  sonard simulate --scene simple-room --pose 0.80,0.05,92 --temperature-c 15 -o room.jsonl
  sonard calibrate room.jsonl --pose 0.774,0.085,90
  sonard calibrate *.jsonl --scene arena.json --fit pose,delay,threshold,beam --prior x_m=0.05 --out fitted

Fields of --json: name, scan (of a pose), value, change, sigma, low, high (95 %), prior, \
prior_sigma, identified, at_limit. Logarithms and shares are reported in the file's units.
Exit codes: 0 done, 1 interrupted, 2 wrong usage or input, 3 write error.";

pub(super) fn run(args: &Args) -> Outcome {
    let what_if = args.what_if.load(args.sweeps.scene()?.as_deref())?;
    if let Some(out) = &args.out
        && !checkpoint::check(out, args.overwrite)?
    {
        report::check(out, args.overwrite)?;
    }
    let Input { sweeps, world, sources } = read(args, &what_if)?;
    let priors = prior::parameters(&args.fit, &args.prior, &world, sweeps.len())?;
    let fit = FitOptions {
        search: args.search,
        ..FitOptions::with_priors(priors, args.max_initial_error_m)
    };
    let head = Head::new(&world, &sweeps, &fit);
    let open = |out: &OutPath| Checkpoint::open(out, args.overwrite, &head);
    let checkpoint = args.out.as_ref().map(open).transpose()?;
    let fitted = find(&world, &sweeps, &fit, checkpoint.as_ref())?;
    let lines = fitted.report(&world, &sweeps, &fit);
    let diagnoses = describe_misfits(&world, &sweeps, &fitted);
    if args.json {
        diagnoses.iter().for_each(|diagnosis| notice!("{diagnosis}"));
    }
    let summary = report::summarize(&lines, &fitted, diagnoses);
    if let (Some(out), Some(checkpoint)) = (&args.out, checkpoint) {
        let overwrite = args.overwrite.or_forced(checkpoint.begin_results());
        write_folder(out, overwrite, &world, &sweeps, &fitted, &lines, &summary)?;
        picture::write(out, overwrite, &world, &sweeps, &fitted, &sources)?;
        checkpoint.remove()?;
    }
    print_result(args.json, &lines, |out| print(out, &lines, &summary))
}

/// Sweeps with the sensor, air and scene that they share.
struct Input {
    sweeps: Vec<FitSweep>,
    world: Arc<World>,
    sources: Vec<Provenance>,
}

/// Reads the sweeps and the sensor, air and scene that they share.
fn read(args: &Args, what_if: &WhatIf) -> Result<Input, Failure> {
    let (mut sweeps, mut world): (Vec<FitSweep>, Option<Arc<World>>) = (Vec::new(), None);
    let mut sources = Vec::new();
    args.sweeps.for_each(what_if, |log, sweep, of, provenance| {
        sources.push(provenance);
        let saved = world.get_or_insert_with(|| Arc::clone(of));
        if saved.sensor != of.sensor || saved.scene.sha256 != of.scene.sha256 {
            return Err(Failure::input(
                format!("{}: the sensor or scene differs from that of the previous scans", log.display()),
                "calibrate scans of one sensor and scene together, or override them with --sensor or --scene",
            ));
        }
        sweeps.push(sweep);
        Ok(())
    })?;
    let world = world.ok_or_else(|| {
        Failure::input("there is no sweep to fit to", "give logs of a ranger on a stepper")
    })?;
    Ok(Input { sweeps, world, sources })
}

/// Fits the parameters, resuming from a checkpoint, until done or interrupted.
fn find(
    world: &World,
    sweeps: &[FitSweep],
    fit: &FitOptions,
    checkpoint: Option<&Checkpoint>,
) -> Result<FitResult, Failure> {
    let runtime = runtime::new()?;
    let interrupts = {
        let _within = runtime.enter();
        Interrupts::listen()
    };
    let saved = checkpoint.map_or(&[][..], Checkpoint::saved);
    if let Some(checkpoint) = checkpoint.filter(|_| !saved.is_empty()) {
        let (path, searches) = (checkpoint.path().display(), saved.len());
        notice!("{path}: resuming after {searches} searches");
    }
    let bar = progress::spinner(&format!("fitting {}:", format_count(sweeps.len(), "scan")));
    let watcher = Watcher { bar: bar.clone(), interrupts, checkpoint };
    let fitted = fit_observed(world, sweeps, fit, saved, &watcher);
    bar.finish_and_clear();
    fitted.map_err(|error| failure_from(&error, checkpoint))
}

/// Progress bar, checkpoint and interrupts of a running fit.
struct Watcher<'a> {
    bar: ProgressBar,
    interrupts: Interrupts,
    checkpoint: Option<&'a Checkpoint>,
}

impl FitObserver for Watcher<'_> {
    fn progress(&self, progress: FitProgress) {
        self.bar.set_message(progress.to_string());
    }

    fn found(&self, found: &SearchResult) {
        if let Some(checkpoint) = self.checkpoint {
            self.bar.suspend(|| checkpoint.save(found));
        }
    }

    fn is_cancelled(&self) -> bool {
        self.interrupts.happened()
    }
}

fn failure_from(error: &FitError, checkpoint: Option<&Checkpoint>) -> Failure {
    let kept = checkpoint.map(|checkpoint| checkpoint.path().display());
    match (error, kept) {
        (FitError::Stopped, Some(path)) => Failure::Found(Some(format!(
            "{error}: results so far are in {path}; run the same command to resume"
        ))),
        (FitError::Stopped, None) => Failure::Found(Some(error.to_string())),
        (FitError::OtherFit, Some(path)) => {
            Failure::input(format!("{path}: {error}"), checkpoint::HELP)
        }
        _ => {
            // A repeated run would fail in the same way.
            if let Some(checkpoint) = checkpoint {
                drop(checkpoint.remove());
            }
            Failure::input(
                error,
                "check that the poses are inside the scene, or fit fewer parameters",
            )
        }
    }
}

/// Prints the parameters as a table, followed by the summary.
fn print(out: &mut impl Write, lines: &[ParameterReport], summary: &[String]) -> io::Result<()> {
    let mut table = ruled(["parameter", "initial", "estimate", "\u{b1}", "95 %", ""]);
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
    align_right(&mut table, 1..5);
    writeln!(out, "{}", fit(table))?;
    summary.iter().try_for_each(|line| writeln!(out, "{line}"))
}
