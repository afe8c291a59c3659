//! Command `sonard-papers benchmark map` and its table.

use std::{
    io::{self, Write},
    path::{Path, PathBuf},
    sync::Arc,
};

use comfy_table::{CellAlignment, Table};
use rand::SeedableRng;
use rand_pcg::Pcg64;
use rayon::prelude::*;
use serde::Serialize;

use sonard_interpret::interpret::{
    Extents,
    grid::{MapScore, Trust},
    mapping::{MAX_RANGE_M, MapSettings},
};
use sonard_model::{
    acoustics::{Air, Sensor},
    array::RangerArray,
    geometry::{DVec2, Pose},
    model::{Options, PathOptions, Simulator},
    scene::{Scene, shipped},
};
use sonard_papers::trial::{
    Arrangement, MappingTrial, SimulatedCourse, TrialSettings, random_room,
};
use sonard_plot::{MapView, badge_for, draw_map};
use sonard_records::Provenance;

use super::{
    Failure, Outcome,
    answer::{RULED, print_result},
    output::{Overwrite, make_folder},
    progress,
};

/// Options of `sonard-papers benchmark map`.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(crate) struct Args {
    /// Number of courses, each mapped without and with Feature Prediction
    #[arg(long, value_name = "N", default_value_t = 128, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    maps: u32,
    /// Random seed; rooms, courses and noise
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Sets of readings in each course
    #[arg(long, value_name = "N", default_value_t = 60, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    places: u32,
    /// Side of a cell, metres
    #[arg(long, value_name = "M", default_value_t = 0.05)]
    resolution: f64,
    /// Treat ranges beyond this as no echo, metres [default: the sensor's, at most 5]
    #[arg(long, value_name = "M")]
    silent_beyond: Option<f64>,
    /// Exponent of the confidence with the distance of the feature; the paper also uses 1
    #[arg(long, value_name = "E", default_value_t = 2.0)]
    exponent: f64,
    /// Extension of walls beyond their observed part, metres
    #[arg(long, value_name = "M", default_value_t = MapSettings::default().extend_m)]
    extend: f64,
    /// Weight complete readings, including their free space before the feature, as in the paper
    #[arg(long)]
    whole_readings: bool,
    /// Discard readings of lower confidence; 0.5 is full confidence
    #[arg(long, value_name = "C", default_value_t = MapSettings::default().min_confidence)]
    min_reading_confidence: f64,
    /// Detect one arrival at a time and time it by its path alone
    #[arg(long)]
    ideal_receiver: bool,
    /// JSON instead of text; one object per course
    #[arg(long)]
    json: bool,
    /// Output folder for pictures of the maps: ideal, without, with
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    overwrite: Overwrite,
}

pub(crate) const ABOUT: &str = "\
Map simulated courses without and with Feature Prediction, and score the maps.

A robot drives at random through shipped scenes and random rooms, measuring with a ring of seven \
sonars (as on the Pioneer 1) or a stepper; the model simulates the readings. The four benchmarks of the \
Feature Prediction paper compare the maps with ideal ones; the table gives the mean of \
each scene.";

const HELP: &str = "\
Examples:
  sonard-papers benchmark map                         128 courses; the same seed gives the same table
  sonard-papers benchmark map --maps 16 --out maps    and pictures of the maps
  sonard-papers benchmark map --extend 0 --whole-readings --min-reading-confidence 0     as in the paper except wall splitting

The benchmarks, in percent: correlation of the two maps (more is better); map score, the mean \
squared difference of cells; the same of cells occupied in either map; and the share of the shortest paths \
through the map's free space between positions half a metre apart that hit an obstacle of \
the ideal map.";

/// Array of the robot in the Feature Prediction paper.
const RING: &str = "pioneer-7";

/// Shipped scenes with their start poses.
const SHIPPED: [(&str, &str); 4] = [
    ("mcgill-lab", "fig4"),
    ("corridor", "beside-wall"),
    ("two-surface-room", "middle"),
    ("simple-room", "fig7"),
];
/// Random rooms with their numbers of boxes and partitions.
const RANDOM_ROOMS: [(&str, usize, usize); 4] =
    [("room", 0, 0), ("room with boxes", 3, 0), ("two rooms", 0, 1), ("three rooms, boxes", 2, 2)];

/// Scores of one course.
#[derive(Debug, Clone, Serialize)]
struct Row {
    scene: &'static str,
    arrangement: &'static str,
    course: usize,
    without: MapScore,
    with: MapScore,
}

pub(crate) fn run(args: &Args) -> Outcome {
    if let Some(folder) = &args.out {
        make_folder(folder)?;
    }
    let rows = trials(args)?;
    print_result(args.json, &rows, |out| print(out, &rows))
}

/// Maps all courses in parallel.
fn trials(args: &Args) -> Result<Vec<Row>, Failure> {
    let bar = progress::bar(u64::from(args.maps), "courses");
    let rows = (0..args.maps as usize)
        .into_par_iter()
        .map(|course| trial(args, course).inspect(|_| bar.inc(1)))
        .collect();
    bar.finish_and_clear();
    rows
}

/// Maps one course; its number and the seed determine scene, arrangement and random numbers.
fn trial(args: &Args, course: usize) -> Result<Row, Failure> {
    let reject = |error: &dyn std::fmt::Display| {
        Failure::input(error.to_string(), "see `sonard-papers benchmark map --help`")
    };
    let mut rng = Pcg64::seed_from_u64(args.seed.wrapping_mul(1_000_003) ^ course as u64);
    let (name, scene, start) = scene(course % 8, &mut rng)?;
    let ring = (course / 8).is_multiple_of(2);
    let arrangement = match ring {
        true => {
            let array = RangerArray::preset(RING).map_err(|error| reject(&error))?;
            Arrangement::Ring(Box::new(array))
        }
        false => Arrangement::Stepper,
    };
    let settings = TrialSettings {
        resolution_m: args.resolution,
        places: args.places as usize,
        stride_m: 0.25,
        clearance_m: if name == "simple-room" { 0.2 } else { 0.3 },
        arrangement,
        range_sigma_m: 0.005,
        exponent: args.exponent,
        extend_m: args.extend,
        trust: Trust {
            min_confidence: args.min_reading_confidence,
            keep_clear: !args.whole_readings,
        },
    };
    let sensor = Sensor::preset("senscomp-6500").map_err(|error| reject(&error))?;
    let air = Air::default();
    let extents = Extents::new(&sensor, &air, false).map_err(|error| reject(&error))?;
    let silent_beyond_m = args.silent_beyond.unwrap_or(sensor.max_range_m.min(MAX_RANGE_M));
    let options = Options {
        max_range_m: Some(silent_beyond_m),
        engine: PathOptions { ideal_receiver: args.ideal_receiver, ..PathOptions::default() }
            .into(),
        ..Options::default()
    };
    let simulator =
        Simulator::new(Arc::new(scene), sensor, air, options).map_err(|error| reject(&error))?;
    let driven = SimulatedCourse::through(&simulator, start, &settings, &mut rng)
        .map_err(|error| reject(&error))?
        .ok_or_else(|| reject(&format!("{name}: the scene has no free space for the robot")))?;
    let trial = driven.map(&extents, silent_beyond_m, &settings).map_err(|error| reject(&error))?;
    let arrangement = if ring { "ring" } else { "stepper" };
    if let Some(folder) = &args.out {
        let stem = format!("{course:03}-{}-{arrangement}", name.replace([' ', ','], "-"));
        save((folder, args.overwrite), &stem, simulator.scene(), &driven, &trial)?;
    }
    let [without, with] = trial.scores;
    Ok(Row { scene: name, arrangement, course, without, with })
}

fn scene(number: usize, rng: &mut Pcg64) -> Result<(&'static str, Scene, DVec2), Failure> {
    if let Some((name, pose)) = SHIPPED.get(number) {
        let text = shipped::text(name).unwrap_or_default();
        let scene = Scene::from_json(text).map_err(|error| Failure::input(&error, error.help()))?;
        let pose = scene.pose(pose).map_err(|error| Failure::input(&error, error.help()))?;
        return Ok((name, scene, pose.position()));
    }
    let (name, boxes, partitions) = RANDOM_ROOMS[number - SHIPPED.len()];
    let scene = random_room(name, boxes, partitions, rng);
    let start = scene.poses.get("start").map_or(DVec2::ZERO, Pose::position);
    Ok((name, scene, start))
}

fn save(
    (folder, overwrite): (&Path, Overwrite),
    stem: &str,
    scene: &Scene,
    course: &SimulatedCourse,
    trial: &MappingTrial,
) -> Outcome {
    let trajectory: Vec<DVec2> = course.sweeps.iter().map(|sweep| sweep.pose.position()).collect();
    let pictures =
        [("ideal map", &course.ideal), ("without", &trial.maps[0]), ("with", &trial.maps[1])];
    for (kind, map) in pictures {
        let path = folder.join(format!("{stem}-{}.png", kind.replace(" map", "")));
        let view = MapView {
            title: format!("{}, {kind}", scene.name),
            lines: Vec::new(),
            badge: badge_for(Some(Provenance::Simulated)),
            grid: map,
            scene: Some(scene),
            trajectory: &trajectory,
        };
        let png = draw_map(&view)
            .map_err(|error| Failure::input(error, "choose a coarser --resolution"))?;
        overwrite.save(&path, &png)?;
    }
    Ok(())
}

fn print(out: &mut impl Write, rows: &[Row]) -> io::Result<()> {
    let mut table = Table::new();
    table.load_style(RULED).set_header([
        "scene",
        "readings",
        "maps",
        "correlation",
        "map score",
        "occupied",
        "false paths",
    ]);
    let mut groups: Vec<(&str, &str)> = Vec::new();
    for row in rows {
        if !groups.contains(&(row.scene, row.arrangement)) {
            groups.push((row.scene, row.arrangement));
        }
    }
    groups.sort_by_key(|(_, arrangement)| *arrangement);
    for (scene, arrangement) in groups {
        let group: Vec<&Row> =
            rows.iter().filter(|r| r.scene == scene && r.arrangement == arrangement).collect();
        table.add_row(line(scene, arrangement, &group));
    }
    for arrangement in ["ring", "stepper"] {
        let group: Vec<&Row> = rows.iter().filter(|r| r.arrangement == arrangement).collect();
        if !group.is_empty() {
            table.add_row(line("all", arrangement, &group));
        }
    }
    table.add_row(line("all", "both", &rows.iter().collect::<Vec<_>>()));
    for column in table.column_iter_mut().skip(2) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    writeln!(
        out,
        "percent, without -> with Feature Prediction (change in percentage points)\n{table}"
    )
}

fn line(scene: &str, arrangement: &str, rows: &[&Row]) -> Vec<String> {
    let cell = |value: fn(&MapScore) -> Option<f64>| {
        let mean =
            |side: fn(&Row) -> &MapScore| mean(rows.iter().filter_map(|row| value(side(row))));
        change(mean(|row| &row.without), mean(|row| &row.with))
    };
    vec![
        scene.into(),
        arrangement.into(),
        rows.len().to_string(),
        cell(|score| score.correlation_percent),
        cell(|score| Some(score.map_score_percent)),
        cell(|score| Some(score.map_score_occupied_percent)),
        cell(|score| score.false_positive_paths_percent),
    ]
}

/// Mean of values; `None` without any, as for a benchmark undefined in all maps of a scene.
fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0_u32), |(sum, count), value| (sum + value, count + 1));
    (count > 0).then(|| sum / f64::from(count))
}

/// Formats two percentages and their difference in percentage points. A ratio is meaningless for a
/// correlation near 0 or below.
fn change(without: Option<f64>, with: Option<f64>) -> String {
    match (without, with) {
        (Some(without), Some(with)) => {
            format!("{without:.2} -> {with:.2} ({:+.1})", with - without)
        }
        _ => {
            let text = |value: Option<f64>| value.map_or("-".into(), |value| format!("{value:.2}"));
            format!("{} -> {}", text(without), text(with))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn change_is_in_percentage_points() {
        assert_eq!(change(Some(27.0), Some(66.04)), "27.00 -> 66.04 (+39.0)");
        assert_eq!(change(Some(10.0), Some(-10.4)), "10.00 -> -10.40 (-20.4)");
        assert_eq!(change(None, mean([1.0, 2.0].into_iter())), "- -> 1.50");
        assert_eq!(change(mean(std::iter::empty()), None), "- -> -");
    }
}
