//! Conversion of a drawing's entities to surfaces.

use std::collections::BTreeMap;

use dxf::{
    Block, Drawing, Point, Vector,
    entities::{Arc, Circle, Entity, EntityType, Insert, LwPolyline, Polyline, Solid, Trace},
};
use glam::DAffine2;

use sonard_model::{geometry::DVec2, scene::Surfaces};

use super::{
    layers::Layers,
    reduce::{IgnoredEntity, Reduced},
};
use crate::curve::arc;

/// Surface before it is moved to the origin, metres.
enum Shape {
    Walls { layer: String, corners: Vec<DVec2>, is_closed: bool },
    Round { layer: String, center: DVec2, radius_m: f64 },
}

/// Surfaces and notes collected so far.
pub(super) struct Plan<'a> {
    drawing: &'a Drawing,
    layers: &'a Layers,
    reduced: &'a Reduced,
    /// Transformation from units of the drawing or block to metres.
    frame: DAffine2,
    /// Layer of the current block, which its entities on layer 0 inherit.
    block_layer: Option<String>,
    depth: usize,
    count: usize,
    shapes: Vec<Shape>,
    ignored: BTreeMap<String, usize>,
    filled: usize,
}

/// Maximum nesting depth of blocks.
const MAX_DEPTH: usize = 8;
/// Maximum number of entities, with those of blocks counted at each insertion.
const MAX_ENTITIES: usize = 1 << 20;
/// Distance from the origin above which a plan is moved to it, metres.
const FAR_M: f64 = 1000.0;

impl<'a> Plan<'a> {
    pub(super) fn new(
        drawing: &'a Drawing,
        reduced: &'a Reduced,
        layers: &'a Layers,
        unit_m: f64,
    ) -> Self {
        Self {
            drawing,
            layers,
            reduced,
            frame: DAffine2::from_scale(DVec2::splat(unit_m)),
            block_layer: None,
            depth: 0,
            count: 0,
            shapes: Vec::new(),
            ignored: BTreeMap::new(),
            filled: 0,
        }
    }

    /// Adds all visible entities of the drawing.
    pub(super) fn add_all(&mut self) {
        let drawing = self.drawing;
        for entity in drawing.entities() {
            self.add(entity);
        }
        self.ignore_entities("");
    }

    /// Counts the entities of a block that are not converted.
    fn ignore_entities(&mut self, block: &str) {
        let reduced = self.reduced;
        for IgnoredEntity { kind: name, layer } in reduced.ignored.get(block).into_iter().flatten()
        {
            let layer = self.block_layer.clone().filter(|_| layer == "0").unwrap_or(layer.clone());
            if self.layers.has(&layer) && name != "VIEWPORT" {
                match kind(name) {
                    Some(what) => self.ignore(what),
                    None => self.ignore(&format!("other entities ({name})")),
                }
            }
        }
    }

    /// Length of the plan's longer side, metres.
    pub(super) fn size_m(&self) -> Option<f64> {
        let (low, high) = self.bounds()?;
        Some((high - low).max_element())
    }

    fn bounds(&self) -> Option<(DVec2, DVec2)> {
        let points = self.shapes.iter().flat_map(|shape| match shape {
            Shape::Walls { corners, .. } => corners.clone(),
            Shape::Round { center, radius_m, .. } => {
                vec![*center - DVec2::splat(*radius_m), *center + DVec2::splat(*radius_m)]
            }
        });
        let mut points = points.filter(|point| point.is_finite()).peekable();
        points.peek()?;
        Some(points.fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), point| {
            (low.min(point), high.max(point))
        }))
    }

    /// Returns the surfaces, near the origin, and a note for everything ignored or moved.
    pub(super) fn finish(self) -> (Surfaces, Vec<String>) {
        let mut notes: Vec<String> =
            self.ignored.iter().map(|(what, count)| format!("ignored: {count} {what}")).collect();
        if self.filled > 0 {
            notes.push(format!(
                "{} filled areas (SOLID, TRACE) are replaced by their outlines",
                self.filled
            ));
        }
        let far =
            self.bounds().filter(|(low, high)| low.abs().max(high.abs()).max_element() > FAR_M);
        let shift = far.map_or(DVec2::ZERO, |(low, _)| low.floor());
        if shift != DVec2::ZERO {
            notes.push(format!(
                "plan moved to the origin, by {} m in x and {} m in y",
                0.0 - shift.x,
                0.0 - shift.y
            ));
        }
        let mut found = Surfaces::default();
        for shape in self.shapes {
            match shape {
                Shape::Walls { layer, corners, is_closed } => {
                    let corners = corners.into_iter().map(|corner| corner - shift);
                    found.walls(&layer, corners.collect(), is_closed);
                }
                Shape::Round { layer, center, radius_m } => {
                    found.round(&layer, center - shift, radius_m);
                }
            }
        }
        (found, notes)
    }

    fn ignore(&mut self, what: &str) {
        *self.ignored.entry(what.to_owned()).or_default() += 1;
    }

    fn walls(&mut self, layer: &str, corners: Vec<DVec2>, is_closed: bool) {
        self.shapes.push(Shape::Walls { layer: layer.to_owned(), corners, is_closed });
    }

    fn add(&mut self, entity: &Entity) {
        let common = &entity.common;
        let own = common.layer.as_str();
        let block_layer = self.block_layer.clone().filter(|_| own == "0");
        let layer = block_layer.as_deref().unwrap_or(own);
        if !common.is_visible || common.is_in_paper_space || !self.layers.has(layer) {
            return;
        }
        self.count += 1;
        if self.count > MAX_ENTITIES {
            return self.ignore("entities after the first million");
        }
        match &entity.specific {
            EntityType::Line(line) => {
                let ends = [&line.p1, &line.p2].map(|end| self.place(end.x, end.y));
                self.walls(layer, ends.to_vec(), false);
            }
            EntityType::LwPolyline(line) => self.light_polyline(layer, line),
            EntityType::Polyline(line) => self.polyline(layer, line),
            EntityType::Circle(circle) => self.circle(layer, circle),
            EntityType::Arc(arc) => self.arc(layer, arc),
            EntityType::Insert(insert) => self.insert(layer, insert),
            // The third and the fourth corner are exchanged in the file.
            EntityType::Solid(Solid {
                first_corner: a,
                second_corner: b,
                third_corner: d,
                fourth_corner: c,
                extrusion_direction,
                ..
            })
            | EntityType::Trace(Trace {
                first_corner: a,
                second_corner: b,
                third_corner: d,
                fourth_corner: c,
                extrusion_direction,
                ..
            }) => self.filled(layer, [a, b, c, d], extrusion_direction),
            _ => {}
        }
    }

    /// Adds the outline of a quadrilateral with corners in order; a triangle repeats its last
    /// corner.
    fn filled(&mut self, layer: &str, corners: [&Point; 4], normal: &Vector) {
        let Some(side) = self.side(normal) else { return };
        let corners = corners.map(|corner| self.place(side * corner.x, corner.y));
        self.filled += 1;
        self.walls(layer, corners.to_vec(), true);
    }

    /// Adds the entities of an inserted block.
    fn insert(&mut self, layer: &str, insert: &Insert) {
        let drawing = self.drawing;
        let named = |block: &&Block| block.name.eq_ignore_ascii_case(&insert.name);
        let Some(block) = drawing.blocks().find(named).filter(|block| !block.is_xref()) else {
            return self.ignore("blocks (INSERT) that are not in the file");
        };
        if self.depth == MAX_DEPTH {
            return self.ignore("blocks (INSERT) nested too deeply");
        }
        let Some(side) = self.side(&insert.extrusion_direction) else { return };
        let outer = (self.frame, self.block_layer.take());
        self.block_layer = Some(layer.to_owned());
        self.depth += 1;
        let (columns, rows) = (insert.column_count.clamp(1, 1000), insert.row_count.clamp(1, 1000));
        let turn = DAffine2::from_angle(insert.rotation.to_radians());
        let scale = DAffine2::from_scale(DVec2::new(insert.x_scale_factor, insert.y_scale_factor));
        let base = DAffine2::from_translation(-DVec2::new(block.base_point.x, block.base_point.y));
        let at = DAffine2::from_translation(DVec2::new(insert.location.x, insert.location.y));
        let seen = DAffine2::from_scale(DVec2::new(side, 1.0));
        for (column, row) in (0..columns).flat_map(|column| (0..rows).map(move |row| (column, row)))
        {
            let [column, row] = [column, row].map(f64::from);
            let aside = DVec2::new(column * insert.column_spacing, row * insert.row_spacing);
            self.frame =
                outer.0 * seen * at * turn * DAffine2::from_translation(aside) * scale * base;
            for entity in &block.entities {
                self.add(entity);
            }
            self.ignore_entities(&block.name.to_uppercase());
        }
        self.depth -= 1;
        (self.frame, self.block_layer) = outer;
    }

    fn light_polyline(&mut self, layer: &str, line: &LwPolyline) {
        let vertices = line.vertices.iter().map(|vertex| (vertex.x, vertex.y, vertex.bulge));
        let vertices: Vec<_> = vertices.collect();
        self.add_bulged(layer, &vertices, line.is_closed(), &line.extrusion_direction);
    }

    fn polyline(&mut self, layer: &str, line: &Polyline) {
        if line.is_3d_polygon_mesh() || line.is_polyface_mesh() {
            return self.ignore("meshes (POLYLINE)");
        }
        let vertices = line.vertices().filter(|vertex| !vertex.is_spline_frame_control_point());
        let vertices = vertices.map(|vertex| (vertex.location.x, vertex.location.y, vertex.bulge));
        let vertices: Vec<_> = vertices.collect();
        self.add_bulged(layer, &vertices, line.is_closed(), &line.normal);
    }

    /// Adds a sequence of lines and arcs: x, y, and the bulge to the next corner, the tangent of a
    /// quarter of the arc's angle.
    fn add_bulged(
        &mut self,
        layer: &str,
        vertices: &[(f64, f64, f64)],
        is_closed: bool,
        normal: &Vector,
    ) {
        let Some(side) = self.side(normal) else { return };
        let Some(&first) = vertices.first() else { return };
        let flat = |vertex: (f64, f64, f64)| DVec2::new(side * vertex.0, vertex.1);
        let mut corners = vec![self.at(flat(first))];
        let next = vertices.iter().skip(1).copied().chain(is_closed.then_some(first));
        for (&from, to) in vertices.iter().zip(next) {
            let (a, b, bulge) = (flat(from), flat(to), side * from.2);
            if bulge.abs() < MIN_BULGE {
                corners.push(self.at(b));
                continue;
            }
            let center = a.midpoint(b) + (b - a).perp() * ((1.0 - bulge * bulge) / (4.0 * bulge));
            corners.extend(self.arc_about(center, a, 4.0 * bulge.atan()));
        }
        self.walls(layer, corners, is_closed);
    }

    fn circle(&mut self, layer: &str, circle: &Circle) {
        let Some(side) = self.side(&circle.normal) else { return };
        let center = DVec2::new(side * circle.center.x, circle.center.y);
        if self.is_uniform() {
            let radius_m = self.scale_m() * circle.radius;
            let center = self.at(center);
            self.shapes.push(Shape::Round { layer: layer.to_owned(), center, radius_m });
        } else {
            let from = center + DVec2::new(circle.radius, 0.0);
            let corners = self.arc_about(center, from, std::f64::consts::TAU);
            self.walls(layer, corners, true);
        }
    }

    fn arc(&mut self, layer: &str, drawn: &Arc) {
        let Some(side) = self.side(&drawn.normal) else { return };
        let Arc { center: Point { x, y, .. }, radius, start_angle, end_angle, .. } = *drawn;
        let center = DVec2::new(side * x, y);
        let from = DVec2::from_angle(start_angle.to_radians()) * radius;
        let from = center + DVec2::new(side * from.x, from.y);
        let turn_deg = (end_angle - start_angle).rem_euclid(360.0);
        let mut corners = vec![self.at(from)];
        corners.extend(self.arc_about(center, from, side * turn_deg.to_radians()));
        self.walls(layer, corners, false);
    }

    /// Corners along an arc of the drawing, with a spacing suitable for its size in metres.
    fn arc_about(&self, center: DVec2, from: DVec2, turn_rad: f64) -> Vec<DVec2> {
        let scale_m = self.scale_m().max(f64::MIN_POSITIVE);
        let corners = arc(scale_m * center, scale_m * from, turn_rad);
        corners.map(|corner| self.at(corner / scale_m)).collect()
    }

    /// Metres per unit, the larger scale of the two axes.
    fn scale_m(&self) -> f64 {
        self.frame.matrix2.x_axis.length().max(self.frame.matrix2.y_axis.length())
    }

    /// Returns `true` if circles remain circles.
    fn is_uniform(&self) -> bool {
        let [x, y] = [self.frame.matrix2.x_axis, self.frame.matrix2.y_axis];
        let size = x.length().max(y.length());
        (x.length() - y.length()).abs() < 1e-6 * size && x.dot(y).abs() < 1e-6 * size * size
    }

    /// Returns 1 for an entity seen from above, and -1 for one seen from below, which is mirrored.
    /// Others are ignored.
    fn side(&mut self, normal: &Vector) -> Option<f64> {
        let along_z =
            normal.z / (normal.x * normal.x + normal.y * normal.y + normal.z * normal.z).sqrt();
        if along_z.abs() > 1.0 - 1e-6 {
            return Some(along_z.signum());
        }
        self.ignore("outlines that are not horizontal");
        None
    }

    fn at(&self, point: DVec2) -> DVec2 {
        self.frame.transform_point2(point)
    }

    fn place(&self, x: f64, y: f64) -> DVec2 {
        self.at(DVec2::new(x, y))
    }
}

/// Returns the description of an entity that is not converted.
fn kind(name: &str) -> Option<&'static str> {
    Some(match name {
        "SPLINE" | "ELLIPSE" | "HELIX" => "splines and ellipses",
        "MLINE" => "multiple lines (MLINE)",
        "HATCH" | "MPOLYGON" => "hatches (HATCH, MPOLYGON)",
        "3DFACE" | "3DSOLID" | "BODY" | "REGION" | "SURFACE" => {
            "faces, regions and solids (3DFACE, REGION, 3DSOLID)"
        }
        "MESH" => "meshes (MESH)",
        "TEXT" | "MTEXT" | "RTEXT" | "ARCALIGNEDTEXT" | "ATTDEF" => "texts",
        "DIMENSION"
        | "ARC_DIMENSION"
        | "LARGE_RADIAL_DIMENSION"
        | "LEADER"
        | "MULTILEADER"
        | "MLEADER"
        | "TOLERANCE" => "dimensions and leaders",
        "IMAGE" | "OLEFRAME" | "OLE2FRAME" | "WIPEOUT" | "DGNUNDERLAY" | "DWFUNDERLAY"
        | "PDFUNDERLAY" => "images and underlays",
        "RAY" | "XLINE" => "infinite lines (RAY, XLINE)",
        "POINT" => "points",
        "SHAPE" => "shapes of fonts (SHAPE)",
        "ACAD_TABLE" => "tables (ACAD_TABLE)",
        _ => return None,
    })
}

/// Bulge below which a segment is straight: an angle of a thousandth of a degree.
const MIN_BULGE: f64 = 4e-6;
