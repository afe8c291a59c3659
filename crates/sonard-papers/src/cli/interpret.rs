//! `sonard-papers benchmark interpret`.

use std::io::{self, Write};

use comfy_table::{CellAlignment, Table};
use serde::Serialize;

use sonard_interpret::interpret::Settings;
use sonard_papers::{
    calibration::{Judged, Reliability, judge_room},
    pictures::draw_reliability,
};

use super::{
    Outcome,
    answer::{RULED, answer},
    input::load_sensor,
    output::PictureArgs,
    progress,
};

/// Options of `sonard-papers benchmark interpret`.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(crate) struct Args {
    /// How many made-up rooms, each read from one or two places
    #[arg(long, value_name = "N", default_value_t = 1000, value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    trials: u64,
    /// Random seed; rooms, places and noise
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Sensor preset (`sonard sensor list`), or a file with a sensor's data; with its whole receiver
    #[arg(long, value_name = "NAME|FILE", default_value = "senscomp-6500")]
    sensor: String,
    /// JSON instead of text; one object
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    picture: PictureArgs,
}

pub(crate) const ABOUT: &str = "\
Measure how often the probabilities of `sonard interpret` come true.

The model reads made-up rooms with boxes and partitions, each from a random place and, where the \
interpretation proposes a next one, from that too. It knows by which path each sound came, and so what \
each arc is of. For each arc there are four claims, of plane, corner, edge and something else; claims of \
0.9 should come true nine times in ten.";

const HELP: &str = "\
Examples:
  sonard-papers benchmark interpret -o reliability.png     1,000 rooms; the same seed gives the same table
  sonard-papers benchmark interpret --trials 100 --seed 2 --json

The expected calibration error is the mean distance of claim and share over all claims in ten bins; the \
Brier score is the mean squared distance of a claim from what is.";

/// What is printed.
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
    claims: usize,
    claimed: f64,
    came_true: f64,
}

pub(crate) fn run(args: &Args) -> Outcome {
    let sensor = load_sensor(&args.sensor)?;
    args.picture.check()?;
    let settings = Settings::default();
    let bar = progress::bar(args.trials, "rooms");
    let mut judged: Vec<Judged> = Vec::new();
    for number in 0..args.trials {
        judged.extend(judge_room(args.seed, number, &sensor, &settings));
        bar.inc(1);
    }
    bar.finish_and_clear();
    let reliability = Reliability::of(&judged);
    let found = Answer::of(args, judged.len(), &reliability);
    answer(args.json, [&found], |out| found.print(out))?;
    let lines = [found.in_words(), format!("{} with its whole receiver", sensor.name)];
    let picture = draw_reliability("Probabilities of planes, corners, edges", &lines, &reliability);
    args.picture.write(&picture)
}

impl Answer {
    fn of(args: &Args, arcs: usize, reliability: &Reliability) -> Self {
        let bins = reliability.bins.iter().map(|bin| Row {
            claims: bin.count,
            claimed: bin.claimed,
            came_true: bin.came_true,
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

    fn in_words(&self) -> String {
        format!(
            "{} rooms, seed {}, {} arcs: expected calibration error {:.3}, Brier score {:.3}",
            self.rooms, self.seed, self.arcs, self.expected_calibration_error, self.brier
        )
    }

    fn print(&self, out: &mut impl Write) -> io::Result<()> {
        let mut table = Table::new();
        table.load_style(RULED).set_header(["claims of", "claimed", "came true", "claims"]);
        for (tenth, row) in self.bins.iter().enumerate() {
            let share =
                |share: f64| if row.claims > 0 { format!("{share:.3}") } else { "-".into() };
            table.add_row([
                format!("{:.1} to {:.1}", tenth as f64 / 10.0, (tenth + 1) as f64 / 10.0),
                share(row.claimed),
                share(row.came_true),
                row.claims.to_string(),
            ]);
        }
        for column in table.column_iter_mut().skip(1) {
            column.set_cell_alignment(CellAlignment::Right);
        }
        writeln!(out, "{table}")?;
        writeln!(out, "{}", self.in_words())
    }
}
