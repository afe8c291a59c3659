//! `sonard-papers benchmark interpret`.

use std::io::{self, Write};

use comfy_table::{CellAlignment, Table};
use serde::Serialize;

use sonard_interpret::interpret::InterpretSettings;
use sonard_papers::{
    calibration::{ClassifiedArc, Reliability, classify_room},
    pictures::draw_reliability,
};

use super::{
    Outcome,
    answer::{RULED, print_result},
    input::load_sensor,
    output::PictureArgs,
    progress,
};

/// Options of `sonard-papers benchmark interpret`.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(crate) struct Args {
    /// Number of random rooms, each scanned from one or two positions
    #[arg(long, value_name = "N", default_value_t = 1000, value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    trials: u64,
    /// Random seed; rooms, places and noise
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Sensor preset (`sonard sensor list`), or a file with a sensor's data; with its complete
    /// receiver
    #[arg(long, value_name = "NAME|FILE", default_value = "senscomp-6500")]
    sensor: String,
    /// JSON instead of text; one object
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    picture: PictureArgs,
}

pub(crate) const ABOUT: &str = "\
Measure the calibration of the probabilities of `sonard interpret`.

The model simulates scans of random rooms with boxes and partitions, each from a random position and, where the \
interpretation proposes a next one, from there too. The predicted path of each echo gives the true cause of \
each arc. Each arc has four predicted probabilities: of plane, corner, edge and other. Classes predicted with \
0.9 should occur nine times in ten.";

const HELP: &str = "\
Examples:
  sonard-papers benchmark interpret -o reliability.png     1,000 rooms; the same seed gives the same table
  sonard-papers benchmark interpret --trials 100 --seed 2 --json

The expected calibration error is the mean absolute difference of mean predicted probability and observed \
frequency in ten bins, weighted by their counts; the Brier score is the mean squared difference of predicted \
probability and outcome.";

/// Printed statistics of the reliability diagram.
#[derive(Debug, Serialize)]
struct Answer {
    rooms: u64,
    seed: u64,
    arcs: usize,
    expected_calibration_error: f64,
    brier: f64,
    bins: Vec<Row>,
}

#[derive(Debug, Serialize)]
struct Row {
    count: usize,
    mean_predicted: f64,
    observed: f64,
}

pub(crate) fn run(args: &Args) -> Outcome {
    let sensor = load_sensor(&args.sensor)?;
    args.picture.check()?;
    let settings = InterpretSettings::default();
    let bar = progress::bar(args.trials, "rooms");
    let mut arcs: Vec<ClassifiedArc> = Vec::new();
    for number in 0..args.trials {
        arcs.extend(classify_room(args.seed, number, &sensor, &settings));
        bar.inc(1);
    }
    bar.finish_and_clear();
    let reliability = Reliability::from_arcs(&arcs);
    let found = Answer::new(args, arcs.len(), &reliability);
    print_result(args.json, [&found], |out| found.print(out))?;
    let lines = [found.summary(), format!("{} with its complete receiver", sensor.name)];
    let picture = draw_reliability("Probabilities of planes, corners, edges", &lines, &reliability);
    args.picture.write(&picture)
}

impl Answer {
    fn new(args: &Args, arcs: usize, reliability: &Reliability) -> Self {
        let bins = reliability.bins.iter().map(|bin| Row {
            count: bin.count,
            mean_predicted: bin.mean_predicted,
            observed: bin.observed,
        });
        Self {
            rooms: args.trials,
            seed: args.seed,
            arcs,
            expected_calibration_error: reliability.expected_error,
            brier: reliability.brier,
            bins: bins.collect(),
        }
    }

    fn summary(&self) -> String {
        format!(
            "{} rooms, seed {}, {} arcs: expected calibration error {:.3}, Brier score {:.3}",
            self.rooms, self.seed, self.arcs, self.expected_calibration_error, self.brier
        )
    }

    fn print(&self, out: &mut impl Write) -> io::Result<()> {
        let mut table = Table::new();
        table.load_style(RULED).set_header(["bin", "mean predicted", "observed", "count"]);
        for (bin, row) in self.bins.iter().enumerate() {
            let share = |share: f64| if row.count > 0 { format!("{share:.3}") } else { "-".into() };
            table.add_row([
                format!("{:.1} to {:.1}", bin as f64 / 10.0, (bin + 1) as f64 / 10.0),
                share(row.mean_predicted),
                share(row.observed),
                row.count.to_string(),
            ]);
        }
        for column in table.column_iter_mut().skip(1) {
            column.set_cell_alignment(CellAlignment::Right);
        }
        writeln!(out, "{table}")?;
        writeln!(out, "{}", self.summary())
    }
}
