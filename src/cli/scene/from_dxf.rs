//! `sonard scene from-dxf`.

mod layers;
mod plan;

use std::{panic, path::PathBuf};

use dxf::{Drawing, enums::Units};

use super::{
    super::{Failure, Outcome, numbers::positive},
    made::{MadeArgs, file_failure, read},
};
use layers::Layers;
use plan::Plan;

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

/// Plausible sizes of a plan, metres.
const SIZES_M: std::ops::RangeInclusive<f64> = 0.5..=2000.0;

pub(super) fn run(args: &FromDxfArgs) -> Outcome {
    let help = "give a DXF file, ASCII or binary, from a CAD program";
    let bytes = read(&args.drawing, help)?;
    let drawing = load(&bytes)
        .map_err(|error| file_failure(&args.drawing, &format!("invalid DXF: {error}"), help))?;
    let stated_m = metres(drawing.header.default_drawing_units);
    let unit_m = args.unit_m.or(stated_m).ok_or_else(|| {
        let help = "give the length of a unit: --unit-m 0.001 for millimetres";
        file_failure(&args.drawing, &"the drawing has no units ($INSUNITS)", help)
    })?;
    let layers = Layers::select(&drawing, &bytes, &args.layer)
        .map_err(|(what, help)| file_failure(&args.drawing, &what, &help))?;
    let mut plan = Plan::new(&drawing, &layers, unit_m);
    plan.add_all();
    let size_m = plan.size_m();
    if args.unit_m.is_none() && size_m.is_some_and(|size_m| !SIZES_M.contains(&size_m)) {
        return Err(implausible(args, &drawing, unit_m, size_m.unwrap_or_default()));
    }
    let help =
        "draw walls as lines or polylines, on layers that are switched on or named with --layer";
    let (found, mut notes) = plan.finish();
    notes.extend(layers.notes(&args.layer));
    args.made.write(&args.drawing, &found, &notes, help)
}

/// Failure for a plan of implausible size.
fn implausible(args: &FromDxfArgs, drawing: &Drawing, unit_m: f64, size_m: f64) -> Failure {
    let units = drawing.header.default_drawing_units;
    let what = format!(
        "by its units ($INSUNITS: {units:?}) the plan is {size_m:.3} m across, which is implausible: check the unit"
    );
    let fits = |unit: &&f64| (2.0..=200.0).contains(&(size_m / unit_m * **unit));
    let options = [1.0, 0.01, 0.001, 0.0254, 0.3048];
    let options: Vec<String> =
        options.iter().filter(fits).map(|unit| format!("--unit-m {unit}")).collect();
    let help = match options.is_empty() {
        true => format!("give the length of a unit: --unit-m {unit_m} accepts this size"),
        false => format!(
            "give the length of a unit: {}; --unit-m {unit_m} accepts this size",
            options.join(" or ")
        ),
    };
    file_failure(&args.drawing, &what, &help)
}

/// Parses a drawing, despite panics of the parser at dates out of range.
fn load(bytes: &[u8]) -> Result<Drawing, String> {
    let hook = panic::take_hook();
    panic::set_hook(Box::new(|_| {}));
    let loaded = panic::catch_unwind(|| Drawing::load(&mut &bytes[..]));
    panic::set_hook(hook);
    match loaded {
        Ok(loaded) => loaded.map_err(|error| error.to_string()),
        Err(_) => Err("a value is out of range".to_owned()),
    }
}

/// Length of a drawing unit, metres.
const fn metres(units: Units) -> Option<f64> {
    const INCH: f64 = 0.0254;
    const SURVEY_FOOT: f64 = 1200.0 / 3937.0;
    Some(match units {
        Units::Unitless => return None,
        Units::Inches => INCH,
        Units::Feet => 12.0 * INCH,
        Units::Miles => 63_360.0 * INCH,
        Units::Millimeters => 1e-3,
        Units::Centimeters => 1e-2,
        Units::Meters => 1.0,
        Units::Kilometers => 1e3,
        Units::Microinches => 1e-6 * INCH,
        Units::Mils => 1e-3 * INCH,
        Units::Yards => 36.0 * INCH,
        Units::Angstroms => 1e-10,
        Units::Nanometers => 1e-9,
        Units::Microns => 1e-6,
        Units::Decimeters => 0.1,
        Units::Decameters => 10.0,
        Units::Hectometers => 100.0,
        Units::Gigameters => 1e9,
        Units::AstronomicalUnits => 149_597_870_700.0,
        Units::LightYears => 9_460_730_472_580_800.0,
        Units::Parsecs => 3.085_677_581_491_367e16,
        Units::USSurveyFeet => SURVEY_FOOT,
        Units::USSurveyInch => SURVEY_FOOT / 12.0,
        Units::USSurveyYard => 3.0 * SURVEY_FOOT,
        Units::USSurveyMile => 5280.0 * SURVEY_FOOT,
    })
}
