//! `sonard scene from-dxf`.

use std::{collections::BTreeSet, panic, path::PathBuf};

use dxf::{
    Drawing, Point, Vector,
    entities::{Arc, Circle, Entity, EntityType, LwPolyline, Polyline},
    enums::Units,
};

use super::{
    super::{Failure, Outcome, numbers::positive},
    made::{MadeArgs, arc, read, refuse},
};
use crate::{geometry::DVec2, scene::Surfaces};

/// Options of `sonard scene from-dxf`.
#[derive(Debug, clap::Args)]
pub(in crate::cli) struct FromDxfArgs {
    /// Drawing of the plan, a DXF file
    #[arg(value_name = "DRAWING")]
    drawing: PathBuf,
    /// Length of a unit of the drawing, metres [default: as its $INSUNITS says]
    #[arg(long, value_name = "M", value_parser = positive)]
    unit_m: Option<f64>,
    /// Layers with walls, separated by commas [default: all that are not switched off]
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    layer: Vec<String>,
    #[command(flatten)]
    made: MadeArgs,
}

pub(super) const ABOUT: &str = "\
Make a scene of a drawing of a CAD program: lines are walls, circles are columns.

LINE, LWPOLYLINE, POLYLINE and ARC become walls (curves short ones, off the curve by a millimetre at most), CIRCLE \
becomes a cylinder, each named by its layer. Texts, dimensions and hatches are none; blocks, splines and \
ellipses are left out with a warning: explode them in the CAD program, or turn them into polylines. The drawing is \
seen from above, x and y are the world's. All is of one material: give walls their own in the file that comes out.";

pub(super) const EXAMPLES: &str = "\
Examples:
  sonard scene from-dxf plan.dxf -o plan.json
  sonard scene from-dxf plan.dxf --layer A-WALL,A-COLS --unit-m 0.001 -o plan.json
  sonard scene draw plan.json -o check.svg";

pub(super) fn run(args: &FromDxfArgs) -> Outcome {
    let help = "give a DXF file, ASCII or binary, as a CAD program writes it";
    let bytes = read(&args.drawing, help)?;
    let drawing =
        load(&bytes).map_err(|error| refuse(&args.drawing, &format!("no DXF: {error}"), help))?;
    let unit_m = match args.unit_m {
        Some(unit_m) => unit_m,
        None => metres(drawing.header.default_drawing_units).ok_or_else(|| {
            let help = "say how long a unit of it is: --unit-m 0.001 for millimetres";
            refuse(&args.drawing, &"the drawing has no units ($INSUNITS)", help)
        })?,
    };
    let layers = layers(args, &drawing)?;
    let shown = drawing.entities().filter(|entity| {
        let common = &entity.common;
        common.is_visible && !common.is_in_paper_space && layers.contains(&common.layer)
    });
    let mut found = Plan { unit_m, found: Surfaces::default() };
    for entity in shown {
        found.add(entity);
    }
    let help =
        "draw walls as lines or polylines, on layers that are switched on or named with --layer";
    args.made.write(&args.drawing, &found.found, help)
}

/// What a file holds. The crate that reads it panics at dates out of range.
fn load(bytes: &[u8]) -> Result<Drawing, String> {
    let hook = panic::take_hook();
    panic::set_hook(Box::new(|_| {}));
    let loaded = panic::catch_unwind(|| Drawing::load(&mut &bytes[..]));
    panic::set_hook(hook);
    match loaded {
        Ok(loaded) => loaded.map_err(|error| error.to_string()),
        Err(_) => Err("a figure in it is out of range".to_owned()),
    }
}

/// The layers that count.
fn layers(args: &FromDxfArgs, drawing: &Drawing) -> Result<BTreeSet<String>, Failure> {
    let off = drawing.layers().filter(|layer| !layer.is_layer_on).map(|layer| &layer.name);
    let off: BTreeSet<&String> = off.collect();
    let used: BTreeSet<&String> = drawing.entities().map(|entity| &entity.common.layer).collect();
    if let Some(wanted) = args.layer.iter().find(|wanted| !used.contains(wanted)) {
        let names: Vec<&str> = used.iter().map(|name| name.as_str()).collect();
        let help = format!("these have something: {}", names.join(", "));
        return Err(refuse(&args.drawing, &format!("nothing is on layer `{wanted}`"), &help));
    }
    Ok(match args.layer.is_empty() {
        true => used.difference(&off).map(|name| (*name).clone()).collect(),
        false => args.layer.iter().cloned().collect(),
    })
}

/// What was found so far.
struct Plan {
    /// Metres a unit.
    unit_m: f64,
    found: Surfaces,
}

impl Plan {
    fn add(&mut self, entity: &Entity) {
        let layer = entity.common.layer.as_str();
        match &entity.specific {
            EntityType::Line(line) => {
                let ends = [&line.p1, &line.p2].map(|end| self.place(end.x, end.y));
                self.found.walls(layer, ends.to_vec(), false);
            }
            EntityType::LwPolyline(line) => self.light_polyline(layer, line),
            EntityType::Polyline(line) => self.polyline(layer, line),
            EntityType::Circle(circle) => self.circle(layer, circle),
            EntityType::Arc(arc) => self.arc(layer, arc),
            EntityType::Insert(_) => self.found.leave_out("blocks (INSERT)"),
            EntityType::Spline(_) | EntityType::Ellipse(_) => {
                self.found.leave_out("splines and ellipses");
            }
            EntityType::MLine(_) | EntityType::Face3D(_) | EntityType::Solid3D(_) => {
                self.found.leave_out("multiple lines, faces and solids");
            }
            _ => {}
        }
    }

    fn light_polyline(&mut self, layer: &str, line: &LwPolyline) {
        let vertices = line.vertices.iter().map(|vertex| (vertex.x, vertex.y, vertex.bulge));
        let vertices: Vec<_> = vertices.collect();
        self.bulged(layer, &vertices, line.is_closed(), &line.extrusion_direction);
    }

    fn polyline(&mut self, layer: &str, line: &Polyline) {
        if line.is_3d_polygon_mesh() || line.is_polyface_mesh() {
            return self.found.leave_out("multiple lines, faces and solids");
        }
        let vertices = line.vertices().filter(|vertex| !vertex.is_spline_frame_control_point());
        let vertices = vertices.map(|vertex| (vertex.location.x, vertex.location.y, vertex.bulge));
        let vertices: Vec<_> = vertices.collect();
        self.bulged(layer, &vertices, line.is_closed(), &line.normal);
    }

    /// A row of lines and arcs: x, y, and the bulge of what leads to the next corner, the tangent of a quarter of its
    /// turn.
    fn bulged(
        &mut self,
        layer: &str,
        vertices: &[(f64, f64, f64)],
        is_closed: bool,
        normal: &Vector,
    ) {
        let Some(side) = self.side(normal) else { return };
        let Some(&first) = vertices.first() else { return };
        let place = |vertex: (f64, f64, f64)| self.place(side * vertex.0, vertex.1);
        let mut corners = vec![place(first)];
        let next = vertices.iter().skip(1).copied().chain(is_closed.then_some(first));
        for (&from, to) in vertices.iter().zip(next) {
            let (a, b, bulge) = (place(from), place(to), side * from.2);
            if bulge.abs() < LEAST_BULGE {
                corners.push(b);
                continue;
            }
            let center = a.midpoint(b) + (b - a).perp() * ((1.0 - bulge * bulge) / (4.0 * bulge));
            corners.extend(arc(center, a, 4.0 * bulge.atan()));
        }
        self.found.walls(layer, corners, is_closed);
    }

    fn circle(&mut self, layer: &str, circle: &Circle) {
        if let Some(side) = self.side(&circle.normal) {
            let center = self.place(side * circle.center.x, circle.center.y);
            self.found.round(layer, center, self.unit_m * circle.radius);
        }
    }

    fn arc(&mut self, layer: &str, drawn: &Arc) {
        let Some(side) = self.side(&drawn.normal) else { return };
        let Arc { center: Point { x, y, .. }, radius, start_angle, end_angle, .. } = *drawn;
        let center = self.place(side * x, y);
        let from = DVec2::from_angle(start_angle.to_radians()) * (self.unit_m * radius);
        let from = center + DVec2::new(side * from.x, from.y);
        let turn_deg = (end_angle - start_angle).rem_euclid(360.0);
        let corners = arc(center, from, side * turn_deg.to_radians());
        let corners = std::iter::once(from).chain(corners).collect();
        self.found.walls(layer, corners, false);
    }

    /// 1 for what is drawn as it is seen from above, -1 for what is mirrored, because it is seen from below; the rest
    /// does not stand upright.
    fn side(&mut self, normal: &Vector) -> Option<f64> {
        let along_z =
            normal.z / (normal.x * normal.x + normal.y * normal.y + normal.z * normal.z).sqrt();
        if along_z.abs() > 1.0 - 1e-6 {
            return Some(along_z.signum());
        }
        self.found.leave_out("outlines that are not level");
        None
    }

    fn place(&self, x: f64, y: f64) -> DVec2 {
        self.unit_m * DVec2::new(x, y)
    }
}

/// Less than this is straight: a turn of a thousandth of a degree.
const LEAST_BULGE: f64 = 4e-6;

/// Length of a unit, metres.
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
