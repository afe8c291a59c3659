//! Command `sonard-papers benchmark explore` and its table.

use std::{
    io::{self, Write},
    path::PathBuf,
    sync::Arc,
};

use comfy_table::{CellAlignment, Table};
use indicatif::ProgressBar;
use rand::SeedableRng;
use rand_pcg::Pcg64;
use rayon::prelude::*;
use serde::Serialize;

use sonard_model::{
    acoustics::{Air, Sensor},
    model::{Options, Simulator},
};
use sonard_papers::{
    explore::{Exploration, Sensing},
    pictures::draw_explorations,
    trial::gallery,
};

use super::{
    Failure, Outcome,
    answer::{RULED, print_result},
    explore::{RobotArgs, Summary, explored, write_all},
    output::Overwrite,
    progress,
};

/// Options of `sonard-papers benchmark explore`.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(crate) struct Args {
    /// Number of rooms, each explored three times
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    rooms: u32,
    /// Random seed; rooms and noise
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    robot: RobotArgs,
    /// JSON instead of text; summary object per exploration
    #[arg(long)]
    json: bool,
    /// Output folder for the files of `sonard-papers explore --out`, and a picture of each room's
    /// three maps
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    overwrite: Overwrite,
}

pub(crate) const ABOUT: &str = "\
Explore random rooms with sonar, laser and just-in-time sensing, and compare the maps.

Each room is 6 to 8 m by 5 to 6.5 m with two or three objects, its walls oblique to the axes. The \
three robots start at the same pose; the table lists each room and the means.";

const HELP: &str = "\
Examples:
  sonard-papers benchmark explore                       ten rooms; the same seed gives the same table
  sonard-papers benchmark explore --seed 2 --out rooms  other rooms, with pictures

`sonard-papers explore --help` defines the map errors.";

/// Row of the table.
#[derive(Debug, Serialize)]
struct Row {
    room: u32,
    #[serde(flatten)]
    summary: Summary,
}

pub(crate) fn run(args: &Args) -> Outcome {
    let bar = progress::bar(u64::from(args.rooms), "rooms");
    let rooms: Result<Vec<Vec<Row>>, Failure> =
        (0..args.rooms).into_par_iter().map(|number| room(args, number, &bar)).collect();
    bar.finish_and_clear();
    let rows: Vec<Row> = rooms?.into_iter().flatten().collect();
    print_result(args.json, &rows, |out| print(out, &rows))
}

/// Explores summary room with each kind of sensing.
fn room(args: &Args, number: u32, bar: &ProgressBar) -> Result<Vec<Row>, Failure> {
    let reject = |error: &dyn std::fmt::Display| {
        Failure::input(error.to_string(), "see `sonard-papers benchmark explore --help`")
    };
    let (robot, settings) = args.robot.settings()?;
    let seed = args.seed.wrapping_mul(1_000_003) ^ u64::from(number);
    let scene = gallery(&format!("room {}", number + 1), &mut Pcg64::seed_from_u64(seed));
    let pose = scene.poses["start"];
    let sensor = Sensor::preset("senscomp-6500").map_err(|error| reject(&error))?;
    let options = Options { max_range_m: Some(args.robot.sonar_range), ..Options::default() };
    let simulator = Simulator::new(Arc::new(scene), sensor, Air::default(), options)
        .map_err(|error| reject(&error))?;
    let scene = simulator.scene();
    let stops = ProgressBar::hidden();
    let explore = |sensing| {
        let made = explored((&simulator, pose), sensing, robot, &settings, seed, &stops)?;
        Ok((sensing, made))
    };
    let made: Vec<(Sensing, Exploration)> =
        Sensing::ALL.into_iter().map(explore).collect::<Result<_, Failure>>()?;
    if let Some(folder) = &args.out {
        let folder = folder.join(format!("room-{}", number + 1));
        for (sensing, made) in &made {
            write_all((&folder.join(sensing.name()), args.overwrite), made, *sensing, scene)?;
        }
        let all: Vec<(Sensing, &Exploration)> = made.iter().map(|(s, made)| (*s, made)).collect();
        let picture = draw_explorations(&all, Some(scene));
        let png = picture.to_png(1200).map_err(|error| reject(&error))?;
        args.overwrite.save(&folder.join("maps.png"), &png)?;
    }
    bar.inc(1);
    let row = |(sensing, made): &(Sensing, Exploration)| Row {
        room: number + 1,
        summary: Summary::from_exploration(scene, *sensing, made),
    };
    Ok(made.iter().map(row).collect())
}

fn print(out: &mut impl Write, rows: &[Row]) -> io::Result<()> {
    let mut table = Table::new();
    table.load_style(RULED).set_header([
        "room",
        "sensing",
        "shots",
        "distance",
        "collisions",
        "line error",
        "endpoint error",
        "map error",
        "",
    ]);
    for row in rows {
        table.add_row(line(&row.room.to_string(), row.summary.sensing, &[&row.summary]));
    }
    for sensing in Sensing::ALL {
        let group: Vec<&Summary> = rows
            .iter()
            .map(|row| &row.summary)
            .filter(|summary| summary.sensing == sensing)
            .collect();
        table.add_row(line("all", sensing, &group));
    }
    for column in table.column_iter_mut().skip(2) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    writeln!(out, "{table}")?;
    let mean = |sensing, value: fn(&Summary) -> f64| {
        let group =
            rows.iter().map(|row| &row.summary).filter(|summary| summary.sensing == sensing);
        mean(&group.collect::<Vec<_>>(), value)
    };
    let map = |sensing| mean(sensing, |summary| summary.error.map_error_m);
    let shots = |sensing| mean(sensing, |summary| f64::from(summary.laser_shots));
    // A ratio to zero is undefined.
    let finite = |text: String, ratio: f64| if ratio.is_finite() { text } else { "-".into() };
    let [of_shots, of_laser, of_sonar] = [
        100.0 * shots(Sensing::JustInTime) / shots(Sensing::Laser),
        100.0 * (map(Sensing::JustInTime) / map(Sensing::Laser) - 1.0),
        map(Sensing::Sonar) / map(Sensing::JustInTime),
    ];
    writeln!(
        out,
        "just-in-time versus laser only: {} of the shots, map error {}; versus sonar only: map \
         error / {}",
        finite(format!("{of_shots:.1} %"), of_shots),
        finite(format!("{of_laser:+.0} %"), of_laser),
        finite(format!("{of_sonar:.0}"), of_sonar),
    )
}

fn mean(rows: &[&Summary], value: fn(&Summary) -> f64) -> f64 {
    rows.iter().map(|row| value(row)).sum::<f64>() / rows.len() as f64
}

fn line(room: &str, sensing: Sensing, group: &[&Summary]) -> Vec<String> {
    let millimetres = |error: fn(&Summary) -> f64| format!("{:.1} mm", 1e3 * mean(group, error));
    let incomplete = group.iter().filter(|summary| !summary.finished).count();
    vec![
        room.into(),
        sensing.name().into(),
        format!("{:.0}", mean(group, |summary| f64::from(summary.laser_shots))),
        format!("{:.0} m", mean(group, |summary| summary.travel_m)),
        format!("{:.0}", mean(group, |summary| f64::from(summary.collisions))),
        millimetres(|summary| summary.error.line_error_m),
        millimetres(|summary| summary.error.endpoint_error_m),
        millimetres(|summary| summary.error.map_error_m),
        if incomplete == 0 { String::new() } else { format!("{incomplete} incomplete") },
    ]
}
