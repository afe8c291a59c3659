//! `sonard scene from-dxf`.

use std::path::PathBuf;

use super::{
    super::{Outcome, numbers::positive},
    made::{MadeArgs, plan_failure, read},
};
use crate::floorplan::dxf::{self, DxfOptions};

/// Options of `sonard scene from-dxf`.
#[derive(Debug, clap::Args)]
pub(in crate::cli) struct FromDxfArgs {
    /// Drawing of the plan, a DXF file
    #[arg(value_name = "DRAWING")]
    drawing: PathBuf,
    /// Length of a drawing unit, metres [default: from $INSUNITS]
    #[arg(long, value_name = "M", value_parser = positive)]
    unit_m: Option<f64>,
    /// Layers with walls, separated by commas [default: all layers that are on and not frozen]
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    layer: Vec<String>,
    #[command(flatten)]
    made: MadeArgs,
}

pub(super) const ABOUT: &str = "\
Make a scene of a drawing of a CAD program: lines are walls, circles are columns.

LINE, LWPOLYLINE, POLYLINE and ARC become walls (curves are approximated to a millimetre), SOLID \
and TRACE their outlines, CIRCLE a cylinder, each named after its layer; blocks (INSERT) are \
expanded. Layers that are off or frozen are used only if named with --layer. Other entities are \
ignored with a warning: explode splines and ellipses in the CAD program, or convert them to \
polylines. The drawing is viewed from above, x and y are the world's; a plan far from its origin, \
as in surveying, is moved to it. A plan of implausible size is rejected, because $INSUNITS is \
often wrong; --unit-m overrides it. All walls have the same material, which can be changed in the \
resulting file.";

pub(super) const EXAMPLES: &str = "\
Examples:
  sonard scene from-dxf plan.dxf -o plan.json
  sonard scene from-dxf plan.dxf --layer A-WALL,A-COLS --unit-m 0.001 -o plan.json
  sonard scene draw plan.json -o check.svg";

pub(super) fn run(args: &FromDxfArgs) -> Outcome {
    let bytes = read(&args.drawing, "give a DXF file, ASCII or binary, from a CAD program")?;
    let options = DxfOptions { unit_m: args.unit_m, layers: args.layer.clone() };
    let plan = dxf::read(&bytes, &options).map_err(|error| plan_failure(&args.drawing, &error))?;
    let help =
        "draw walls as lines or polylines, on layers that are switched on or named with --layer";
    args.made.write_plan(&args.drawing, &plan, help)
}
