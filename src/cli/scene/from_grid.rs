//! `sonard scene from-grid`.

use std::path::PathBuf;

use super::{
    super::{Outcome, map_file, numbers::not_negative},
    made::MadeArgs,
};

/// Options of `sonard scene from-grid`.
#[derive(Debug, clap::Args)]
pub(in crate::cli) struct FromGridArgs {
    /// Map as map_server has it: its description (YAML), or the folder of map.yaml; beside it the image, PGM or PNG
    #[arg(value_name = "MAP")]
    map: PathBuf,
    /// How far a wall may be off the sides of the cells that it stands for, metres [default: 0 along rows and columns of
    /// cells, one and a half cells for slanting walls]
    #[arg(long, value_name = "M", value_parser = not_negative)]
    tolerance_m: Option<f64>,
    /// Leave out what is less around, metres [default: four cells]
    #[arg(long, value_name = "M", value_parser = not_negative)]
    least_m: Option<f64>,
    #[command(flatten)]
    made: MadeArgs,
}

pub(super) const ABOUT: &str = "\
Make a scene of a map: the walls that cells show, traced as lines.

Walls are where occupied cells meet free ones (or two cells behind such); where nothing is occupied there is no wall, so \
what a robot did not see is open. The file's thresholds, negate and mode (trinary, scale, raw) decide which cells these are, \
as map_server has them; origin places and turns the map. In a map that `sonard map` wrote, cells above 0.65 are occupied \
and those below 0.49 free. Walls along rows and columns stay where the cells are; stairs are straightened to slanting walls. A \
wall that both sides were seen of has two faces. All is of one material: give walls their own in the file that comes out.";

pub(super) const EXAMPLES: &str = "\
Examples:
  sonard scene from-grid map -o room.json             # the folder that `sonard map` wrote
  sonard scene from-grid ~/maps/office.yaml --least-m 0.5 | sonard scene check /dev/stdin";

pub(super) fn run(args: &FromGridArgs) -> Outcome {
    let (found, yaml) = map_file::read_walls(&args.map, args.tolerance_m, args.least_m)?;
    let help = format!(
        "give a map with occupied cells beside free ones (by this file above {} and below {}), or a smaller --least-m",
        yaml.occupied_thresh, yaml.free_thresh
    );
    args.made.write(&args.map, &found, &[], &help)
}
