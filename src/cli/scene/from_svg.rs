//! `sonard scene from-svg`.

use std::path::PathBuf;

use super::{
    super::{Outcome, numbers::positive},
    made::{MadeArgs, plan_failure, read},
};
use crate::floorplan::svg::{self, SvgOptions};

/// Options of `sonard scene from-svg`.
#[derive(Debug, clap::Args)]
pub(in crate::cli) struct FromSvgArgs {
    /// Drawing of the plan, an SVG file
    #[arg(value_name = "DRAWING")]
    drawing: PathBuf,
    /// Width of the whole drawing (its `width`, else its `viewBox`, else the extent of its
    /// contents) in the world, metres
    #[arg(long, value_name = "M", value_parser = positive)]
    width_m: f64,
    #[command(flatten)]
    made: MadeArgs,
}

pub(super) const ABOUT: &str = "\
Make a scene from a drawing: every line of an SVG file is a wall.

Lines, polylines, polygons, rectangles, circles and paths are used, with all groups and \
transformations; fills, colours, widths, filters, markers (arrow heads) and texts are ignored. Lines \
are cut at clip paths and at the edge of an inner page; masks are not applied, with a warning. Curves are approximated to a \
millimetre. The lower left corner of the drawing is the origin, y points up. Compressed files (.svgz) \
are accepted. All walls have the same material, which can be changed in the resulting file.";

pub(super) const EXAMPLES: &str = "\
Examples:
  sonard scene from-svg plan.svg --width-m 12.5 -o plan.json
  sonard scene draw plan.json -o check.svg";

pub(super) fn run(args: &FromSvgArgs) -> Outcome {
    let bytes = read(&args.drawing, "give an SVG file, from a drawing program")?;
    let options = SvgOptions { width_m: args.width_m };
    let plan = svg::read(&bytes, &options).map_err(|error| plan_failure(&args.drawing, &error))?;
    args.made.write_plan(&args.drawing, &plan, "draw walls as lines; texts and images are ignored")
}
