//! `sonard calibrate`.

mod prior;
mod report;

use std::{
    io::{self, Write},
    sync::Arc,
};

use comfy_table::{CellAlignment, Table};

use super::{
    Failure, Outcome,
    answer::answer,
    compare::RULED,
    numbers::within,
    output::{OutPath, Overwrite},
    progress,
    what_if::WhatIfArgs,
    worlds::SweepArgs,
};
use crate::inverse::{
    Fit, Fitted, Group, GroupError, Prior, Progress, Sweep, Told, World, fit_watched, priors,
};
use prior::PriorSigma;
use report::write_folder;

/// Options of `sonard calibrate`.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(super) struct Args {
    #[command(flatten)]
    sweeps: SweepArgs,
    /// What to fit, separated by commas
    #[arg(long, value_name = "WHAT", value_delimiter = ',', default_value = "pose,air,threshold")]
    fit: Vec<Group>,
    /// Standard deviation of what is believed beforehand about a parameter, in its unit; several are possible
    #[arg(long, value_name = "NAME=SIGMA")]
    prior: Vec<PriorSigma>,
    /// How far off predicted ranges may be at first, metres
    #[arg(long, value_name = "M", default_value_t = 0.1, value_parser = within(0.005..=1.0))]
    widest_m: f64,
    /// Folder for what is written; the fitted sensor, scene, air and poses, the estimates and a report
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
Fit sensor, air, scene and poses to what was measured.

Starts from what the logs and files say, with the stated doubt about each parameter, and finds the values with which \
the model explains the readings best: the ranges of echoes by any path that the receiver may have reported, silences, \
and where arcs begin and end. Each value comes with its standard deviation, and with a word whether the readings say \
more about it than was believed before: what they can't tell stays where it was. The share of readings that nothing \
explains is part of the answer.";

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
  walls       each wall along its normal (0.05 m)

Examples:
  sonard simulate --scene simple-room --pose 0.80,0.05,92 --temperature-c 15 -o room.jsonl
  sonard calibrate room.jsonl --pose 0.774,0.085,90
  sonard calibrate *.jsonl --scene arena.json --fit pose,delay,threshold,beam --prior x_m=0.05 --out fitted

Of --json: name, scan (of a pose), value, change, sigma, low, high (95 %), prior, prior_sigma, identified, at_limit; values that \
are logarithms or shares are told as what they make of the file's figure.
Exit codes: 0 done, 2 wrong usage or input, 3 the disk gave up.";

pub(super) fn run(args: &Args) -> Outcome {
    let what_if = args.what_if.load()?;
    if let Some(out) = &args.out {
        report::check(out, args.overwrite)?;
    }
    let (mut sweeps, mut world): (Vec<Sweep>, Option<Arc<World>>) = (Vec::new(), None);
    args.sweeps.for_each(&what_if, |log, sweep, of| {
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
    let Some(world) = world else {
        return Err(Failure::input(
            "there is no sweep to fit to",
            "give logs of a ranger on a stepper",
        ));
    };
    let what = Fit::usual(wanted(args, &world, sweeps.len())?, args.widest_m);
    let bar = progress::spinner("scans fitted to");
    bar.set_position(sweeps.len() as u64);
    let watch = |progress: Progress| bar.set_message(progress.to_string());
    let fitted = fit_watched(&world, &sweeps, &what, &watch).map_err(|error| {
        Failure::input(error, "see that poses are in the scene, and fit fewer parameters")
    })?;
    bar.finish_and_clear();
    let lines = fitted.told(&world, &sweeps, &what);
    if let Some(out) = &args.out {
        write_folder(out, args.overwrite, &world, &sweeps, &fitted, &lines)?;
    }
    answer(args.json, &lines, |out| print(out, &lines, &fitted))
}

/// What is to be fitted, with its priors.
fn wanted(args: &Args, world: &World, sweeps: usize) -> Result<Vec<Prior>, Failure> {
    let given: Vec<(String, f64)> = args.prior.iter().map(|PriorSigma(one)| one.clone()).collect();
    priors(&args.fit, &given, world, sweeps).map_err(|error| {
        let option = match error {
            GroupError::NoHeight | GroupError::NoSkirts { .. } => "--fit ",
            GroupError::NotFitted { .. } | GroupError::Sigma { .. } => "--prior: ",
        };
        Failure::input(format!("{option}{error}"), error.help())
    })
}

fn print(out: &mut impl Write, lines: &[Told], fitted: &Fitted) -> io::Result<()> {
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
    report::fit_words(lines, fitted).iter().try_for_each(|line| writeln!(out, "{line}"))
}
