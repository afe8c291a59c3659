//! Outlines from shapes of other packages: shapely, geopandas, fiona and GeoJSON.

use pyo3::{
    exceptions::{PyTypeError, PyValueError},
    prelude::*,
    types::{PyMapping, PyString},
};
use sonard_model::scene::SceneBuilder;

use super::points::MATERIAL;
use crate::arrays::Numbers;

/// Maximum depth of nested collections.
const MAX_DEPTH: usize = 32;

/// Adds walls along the outlines of shapes.
pub(super) fn with_shapes(
    builder: SceneBuilder,
    given: &Bound<'_, PyAny>,
) -> PyResult<SceneBuilder> {
    let mut outlines = ShapeOutlines::default();
    outlines.gather(given, "shapes", 0)?;
    if outlines.found.is_empty() {
        return Err(PyValueError::new_err("shapes contain no line: pass lines or polygons"));
    }
    Ok(outlines.found.into_iter().fold(
        builder,
        |builder, ShapeOutline { id, corners, is_closed }| match is_closed {
            true => builder.room(&id, &corners, MATERIAL),
            false => builder.walls(&id, &corners, MATERIAL),
        },
    ))
}

struct ShapeOutline {
    id: String,
    corners: Vec<[f64; 2]>,
    is_closed: bool,
}

/// Outlines collected so far.
#[derive(Default)]
struct ShapeOutlines {
    found: Vec<ShapeOutline>,
    lines: usize,
    polygons: usize,
}

impl ShapeOutlines {
    /// Collects the outlines of any shape; `name` identifies it in messages.
    fn gather(&mut self, given: &Bound<'_, PyAny>, name: &str, depth: usize) -> PyResult<()> {
        if depth > MAX_DEPTH {
            let message = format!("{name}: nested collections, more than {MAX_DEPTH} deep");
            return Err(PyValueError::new_err(message));
        }
        if let Ok(mapping) = given.cast::<PyMapping>() {
            return self.geo(mapping, name, depth);
        }
        if let Some(geo) = given.getattr_opt("__geo_interface__")? {
            return self.gather(&geo, name, depth + 1);
        }
        if let Some(coords) = given.getattr_opt("coords")? {
            return self.line(&coords, name);
        }
        let items = match given.is_instance_of::<PyString>() {
            false => given.try_iter().ok(),
            true => None,
        };
        let Some(items) = items else {
            let kind = given.get_type();
            return Err(PyTypeError::new_err(format!(
                "{name} is a {kind}: must be shapes with __geo_interface__ or coords, or a list of them"
            )));
        };
        for (number, item) in items.enumerate() {
            self.gather(&item?, &format!("{name}[{number}]"), depth + 1)?;
        }
        Ok(())
    }

    /// Collects the outlines of a GeoJSON geometry or feature.
    fn geo(&mut self, geo: &Bound<'_, PyMapping>, name: &str, depth: usize) -> PyResult<()> {
        let Ok(kind) = geo.get_item("type").and_then(|kind| kind.extract::<String>()) else {
            let message = format!("{name} is a mapping without a type: must be GeoJSON");
            return Err(PyValueError::new_err(message));
        };
        match kind.as_str() {
            "LineString" | "LinearRing" => self.line(&geo.get_item("coordinates")?, name),
            "Polygon" => self.polygon(&geo.get_item("coordinates")?, name),
            "MultiLineString" => {
                each(&geo.get_item("coordinates")?, name, |line, name| self.line(line, name))
            }
            "MultiPolygon" => {
                each(&geo.get_item("coordinates")?, name, |rings, name| self.polygon(rings, name))
            }
            "GeometryCollection" => self.gather(&geo.get_item("geometries")?, name, depth + 1),
            "FeatureCollection" => self.gather(&geo.get_item("features")?, name, depth + 1),
            "Feature" => {
                let geometry = geo.get_item("geometry")?;
                if geometry.is_none() { Ok(()) } else { self.gather(&geometry, name, depth + 1) }
            }
            "Point" | "MultiPoint" => Err(PyValueError::new_err(format!(
                "{name} is a {kind}, which has no wall: pass its buffer, or cylinders"
            ))),
            _ => Err(PyValueError::new_err(format!("{name} is a `{kind}`, which has no outline"))),
        }
    }

    /// Collects a line, which is closed if it ends at its start.
    fn line(&mut self, given: &Bound<'_, PyAny>, name: &str) -> PyResult<()> {
        let corners = corners(given, name)?;
        let is_closed = corners.len() > 3 && corners.first() == corners.last();
        let id = format!("line-{}", self.lines);
        self.lines += 1;
        self.keep(id, corners, is_closed);
        Ok(())
    }

    /// Collects the outer ring of a polygon and its holes.
    fn polygon(&mut self, rings: &Bound<'_, PyAny>, name: &str) -> PyResult<()> {
        let polygon = format!("polygon-{}", self.polygons);
        self.polygons += 1;
        for (number, ring) in rings.try_iter()?.enumerate() {
            let id = match number {
                0 => polygon.clone(),
                hole => format!("{polygon}-hole-{}", hole - 1),
            };
            self.keep(id, corners(&ring?, name)?, true);
        }
        Ok(())
    }

    /// Stores an outline unless it is empty.
    fn keep(&mut self, id: String, mut corners: Vec<[f64; 2]>, is_closed: bool) {
        corners.dedup();
        if is_closed && corners.len() > 1 && corners.first() == corners.last() {
            corners.pop();
        }
        if !corners.is_empty() {
            self.found.push(ShapeOutline { id, corners, is_closed });
        }
    }
}

/// Calls `take` for each part of a shape, with the name of the part.
fn each<'py>(
    parts: &Bound<'py, PyAny>,
    name: &str,
    mut take: impl FnMut(&Bound<'py, PyAny>, &str) -> PyResult<()>,
) -> PyResult<()> {
    parts.try_iter()?.enumerate().try_for_each(|(at, part)| take(&part?, &format!("{name}[{at}]")))
}

/// Converts rows of x and y; heights are ignored.
fn corners(given: &Bound<'_, PyAny>, name: &str) -> PyResult<Vec<[f64; 2]>> {
    let list = given
        .py()
        .import("numpy")?
        .call_method1("array", (given.try_iter()?.collect::<PyResult<Vec<_>>>()?,))?;
    let array: Numbers = list.extract()?;
    let array = array.as_array();
    match *array.shape() {
        [0] | [0, _] => Ok(Vec::new()),
        [_, 2 | 3] => Ok(array.outer_iter().map(|row| [row[[0]], row[[1]]]).collect()),
        _ => Err(PyValueError::new_err(format!(
            "{name} has coordinates of the shape {:?}: it must be (n, 2) or (n, 3)",
            array.shape()
        ))),
    }
}
