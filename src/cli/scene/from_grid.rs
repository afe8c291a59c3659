//! `sonard scene from-grid`.

use std::path::PathBuf;

use super::{
    super::{Outcome, map_file, numbers::not_negative},
    made::MadeArgs,
};
use crate::interpret::grid::{TraceSettings, surfaces};

/// Options of `sonard scene from-grid`.
#[derive(Debug, clap::Args)]
pub(in crate::cli) struct FromGridArgs {
    /// Map as map_server has it: its description (YAML), or the folder of map.yaml; beside it the image, PGM or PNG
    #[arg(value_name = "MAP")]
    map: PathBuf,
    /// How far a wall may be off the sides of the cells that it stands for, metres [default: one and a half cells]
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

Walls are where occupied cells (above 0.65) meet free ones (below 0.49, or two cells behind such); where nothing is \
occupied there is no wall, so what a robot did not see is open. The steps of cells are straightened. A wall that both \
sides were seen of has two faces. All is of one material: give walls their own in the file that comes out.";

pub(super) const EXAMPLES: &str = "\
Examples:
  sonard scene from-grid map -o room.json             # the folder that `sonard map` wrote
  sonard scene from-grid ~/maps/office.yaml --least-m 0.5 | sonard scene check /dev/stdin";

pub(super) fn run(args: &FromGridArgs) -> Outcome {
    let grid = map_file::read(&args.map)?;
    let by_default = TraceSettings::of_cells(grid.shape().resolution_m);
    let settings = TraceSettings {
        tolerance_m: args.tolerance_m.unwrap_or(by_default.tolerance_m),
        least_m: args.least_m.unwrap_or(by_default.least_m),
        ..by_default
    };
    let help =
        "give a map with occupied cells (above 0.65) beside free ones, or a smaller --least-m";
    args.made.write(&args.map, &surfaces(&grid, &settings), help)
}
