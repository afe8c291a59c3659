//! Command `sonard-papers benchmark score` and its output.

use std::{
    io::{self, Write},
    path::{Path, PathBuf},
};

use sonard_interpret::interpret::grid::{Grid, GridShape, MapScore, PathSettings, ideal, score};
use sonard_model::geometry::{DVec2, Pose};

use super::{
    Failure, Outcome,
    answer::print_result,
    input::{load_scene, read_map},
    output::{Overwrite, write_map},
};

/// Options of `sonard-papers benchmark score`.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(crate) struct Args {
    /// Map: its .yaml file, or the folder with map.yaml
    #[arg(value_name = "MAP")]
    map: PathBuf,
    /// Ideal map of the same region, scene file, or name of a shipped scene
    #[arg(value_name = "IDEAL")]
    ideal: String,
    /// Spacing of the lattice of path endpoints, metres
    #[arg(long, value_name = "M", default_value_t = PathSettings::default().spacing_m)]
    spacing: f64,
    /// Also write the ideal map draw_ideal from the scene into this folder
    #[arg(long, value_name = "DIR")]
    save_ideal: Option<PathBuf>,
    /// JSON instead of text; one object
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    overwrite: Overwrite,
}

pub(crate) const ABOUT: &str = "\
Compare a map with the ideal one.

Four benchmarks, in percent. Correlation of the two maps' cells: more is better. Map score: the \
squared difference of the cells, summed, over the number of cells: less is better. The same sum \
over cells that are occupied in either map only. False-positive paths: share of the shortest paths through \
the map's free space between points of a lattice that hit an obstacle of the ideal map.

An ideal map is draw_ideal from a scene on the map's cells: walls are occupied, space reachable \
from the scene's poses is free, the rest is unknown.";

const HELP: &str = "\
Examples:
  sonard-papers benchmark score map simple-room
  sonard-papers benchmark score map/map.yaml ideal/map.yaml --json
Exit codes: 0 done, 2 wrong usage or input, 3 write error.";

pub(crate) fn run(args: &Args) -> Outcome {
    if !(args.spacing.is_finite() && args.spacing > 0.0) {
        return Err(Failure::input(
            format!("--spacing is {}", args.spacing),
            "give a length in metres, greater than 0",
        ));
    }
    let map = read_map(&args.map)?;
    let ideal = if is_map(Path::new(&args.ideal)) {
        read_map(Path::new(&args.ideal))?
    } else {
        draw_ideal(&args.ideal, *map.shape())?
    };
    if let Some(folder) = &args.save_ideal {
        write_map(folder, &ideal, args.overwrite)?;
    }
    let settings = PathSettings { spacing_m: args.spacing, ..PathSettings::default() };
    let found = score(&map, &ideal, &settings).map_err(|error| {
        Failure::input(error, "give maps of one region and resolution (sonard map --region)")
    })?;
    print_result(args.json, [&found], |out| print(out, &found))
}

/// Whether a path names a map, not a scene.
fn is_map(path: &Path) -> bool {
    let yaml = path.extension().is_some_and(|extension| extension == "yaml" || extension == "yml");
    yaml || path.join("map.yaml").is_file()
}

fn draw_ideal(name: &str, shape: GridShape) -> Result<Grid, Failure> {
    let scene = load_scene(Path::new(name))?;
    let places: Vec<DVec2> = scene.poses.values().map(Pose::position).collect();
    if places.is_empty() {
        return Err(Failure::input(
            format!("the scene {name} has no pose, so its free space is undefined"),
            "add a pose inside the room to the scene file",
        ));
    }
    Ok(ideal(&scene, shape, &places))
}

fn print(out: &mut impl Write, score: &MapScore) -> io::Result<()> {
    let percent = |value: Option<f64>| value.map_or("none".into(), |value| format!("{value:.2} %"));
    writeln!(out, "correlation            {}", percent(score.correlation_percent))?;
    writeln!(out, "map score              {}", percent(Some(score.map_score_percent)))?;
    writeln!(out, "map score, occupied    {}", percent(Some(score.map_score_occupied_percent)))?;
    writeln!(
        out,
        "false-positive paths   {} of {}",
        percent(score.false_positive_paths_percent),
        score.paths
    )
}
