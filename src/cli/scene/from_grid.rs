//! `sonard scene from-grid`.

use std::path::PathBuf;

use super::{
    super::{Outcome, map_file, numbers::not_negative},
    made::MadeArgs,
};

/// Options of `sonard scene from-grid`.
#[derive(Debug, clap::Args)]
pub(in crate::cli) struct FromGridArgs {
    /// Map of map_server: its description (YAML), or the folder of map.yaml, with the image, PGM or
    /// PNG
    #[arg(value_name = "MAP")]
    map: PathBuf,
    /// Maximum deviation of a wall from the edges of its cells, metres [default: 0 along rows and
    /// columns of cells, one and a half cells for slanting walls]
    #[arg(long, value_name = "M", value_parser = not_negative)]
    tolerance_m: Option<f64>,
    /// Drop outlines shorter than this, metres [default: four cells]
    #[arg(long, value_name = "M", value_parser = not_negative)]
    min_length_m: Option<f64>,
    #[command(flatten)]
    made: MadeArgs,
}

pub(super) const ABOUT: &str = "\
Make a scene from a map: walls are traced from its cells.

Walls are boundaries between occupied and free cells (or two cells behind such); without an \
occupied cell there is no wall, so unobserved areas are open. The file's thresholds, negate and \
mode (trinary, scale, raw) classify the cells as in map_server; origin places and rotates the map. \
In a map written by `sonard map`, cells above 0.65 are occupied and those below 0.49 free. Walls \
along rows and columns follow the cells; stairs are straightened to slanting walls. A wall \
observed from both sides has two faces. All walls have the same material, which can be changed in \
the resulting file.";

pub(super) const EXAMPLES: &str = "\
Examples:
  sonard scene from-grid map -o room.json             # a folder written by `sonard map`
  sonard scene from-grid ~/maps/office.yaml --min-length-m 0.5 | sonard scene check /dev/stdin";

pub(super) fn run(args: &FromGridArgs) -> Outcome {
    let (found, yaml) = map_file::read_walls(&args.map, args.tolerance_m, args.min_length_m)?;
    let help = format!(
        "give a map with occupied cells next to free ones (in this file above {} and below {}), or a smaller --min-length-m",
        yaml.occupied_thresh, yaml.free_thresh
    );
    args.made.write(&args.map, &found, &[], &help)
}
