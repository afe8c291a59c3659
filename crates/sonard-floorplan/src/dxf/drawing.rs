//! Reading of DXF with the crate `dxf`.

mod layers;
mod pairs;
mod plan;
mod reduce;

use std::panic;

use dxf::{Drawing, enums::Units};

use super::DxfOptions;
use crate::{FloorPlan, PlanError, check_size};
use layers::Layers;
use plan::Plan;
use reduce::reduce;

/// Plausible sizes of a plan, metres.
const SIZES_M: std::ops::RangeInclusive<f64> = 1.5..=2000.0;

/// Advice for a file that is not a drawing.
const HELP: &str = "give a DXF file, ASCII or binary, from a CAD program";

/// Reads the walls of a drawing.
///
/// # Errors
/// Returns an error for a file that is not DXF or above the size limit, for an unknown or
/// implausible unit, and for a requested layer that is empty.
pub fn read(bytes: &[u8], options: &DxfOptions) -> Result<FloorPlan, PlanError> {
    if let Some((_, what, help)) = OTHER_KINDS.iter().find(|(magic, ..)| bytes.starts_with(magic)) {
        return Err(PlanError::new(format!("the file is {what}"), *help));
    }
    check_size(bytes)?;
    let bytes = pairs::with_line_feeds(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes));
    let reduced = reduce(&bytes);
    let drawing = load(&reduced.bytes)
        .map_err(|error| PlanError::new(format!("invalid DXF: {error}"), HELP))?;
    let stated_m = metres(drawing.header.default_drawing_units);
    let unit_m = options.unit_m.or(stated_m).ok_or_else(|| {
        let help = "give the length of a unit: --unit-m 0.001 for millimetres";
        PlanError::new("the drawing has no units ($INSUNITS)", help)
    })?;
    let layers = Layers::select(&drawing, &reduced, &options.layers)
        .map_err(|(what, help)| PlanError::new(what, help))?;
    let mut plan = Plan::new(&drawing, &reduced, &layers, unit_m);
    plan.add_all();
    let size_m = plan.size_m();
    if options.unit_m.is_none() && size_m.is_some_and(|size_m| !SIZES_M.contains(&size_m)) {
        return Err(implausible(&drawing, unit_m, size_m.unwrap_or_default()));
    }
    let (surfaces, mut notes) = plan.finish();
    notes.extend(layers.notes(&options.layers));
    Ok(FloorPlan { surfaces, notes })
}

/// Files that are given in place of a DXF, by their first bytes, with advice.
const OTHER_KINDS: [(&[u8], &str, &str); 5] = [
    (b"AC10", "a DWG drawing", "save it as DXF in the CAD program, or convert it: `dwg2dxf FILE`"),
    (b"\x1f\x8b", "compressed by gzip", "unpack it first: `gunzip FILE`"),
    (b"PK\x03\x04", "a ZIP archive", "unpack it first: `unzip FILE`"),
    (b"%PDF", "a PDF document", "export the drawing as DXF"),
    (b"<", "an XML document", "for an SVG drawing: `sonard scene from-svg`"),
];

/// Error for a plan of implausible size.
fn implausible(drawing: &Drawing, unit_m: f64, size_m: f64) -> PlanError {
    let units = drawing.header.default_drawing_units;
    let what = format!(
        "by its units ($INSUNITS: {units:?}) the plan is {size_m:.3} m across, which is implausible: check the unit"
    );
    let fits = |unit: &&f64| (2.0..=200.0).contains(&(size_m / unit_m * **unit));
    let options = [1.0, 0.01, 0.001, 0.0254, 0.3048];
    let options: Vec<String> =
        options.iter().filter(fits).map(|unit| format!("--unit-m {unit}")).collect();
    let help = match options.is_empty() {
        true => format!(
            "give the length of a unit (--unit-m {unit_m} accepts this size), or leave out entities far from the plan: --layer NAME"
        ),
        false => format!(
            "give the length of a unit: {}; --unit-m {unit_m} accepts this size",
            options.join(" or ")
        ),
    };
    PlanError::new(what, help)
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
        Units::Feet => 0.3048,
        Units::Miles => 63_360.0 * INCH,
        Units::Millimeters => 1e-3,
        Units::Centimeters => 1e-2,
        Units::Meters => 1.0,
        Units::Kilometers => 1e3,
        Units::Microinches => 1e-6 * INCH,
        Units::Mils => 1e-3 * INCH,
        Units::Yards => 0.9144,
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
