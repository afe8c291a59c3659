//! Outlines from shapes of other packages: what shapely, geopandas, fiona and GeoJSON have in common.

use pyo3::{
    exceptions::{PyTypeError, PyValueError},
    prelude::*,
    types::{PyMapping, PyString},
};
use sonard_model::scene::SceneBuilder;

use super::points::MATERIAL;
use crate::arrays::Numbers;

/// Collections in collections are followed so far.
const DEEPEST: usize = 32;

/// Walls along some shapes.
pub(super) fn with_shapes(
    builder: SceneBuilder,
    given: &Bound<'_, PyAny>,
) -> PyResult<SceneBuilder> {
    let mut outlines = Outlines::default();
    outlines.gather(given, "shapes", 0)?;
    if outlines.found.is_empty() {
        return Err(PyValueError::new_err("shapes have no line: give lines or polygons"));
    }
    Ok(outlines.found.into_iter().fold(builder, |builder, Outline { id, corners, is_closed }| {
        match is_closed {
            true => builder.room(&id, &corners, MATERIAL),
            false => builder.walls(&id, &corners, MATERIAL),
        }
    }))
}

struct Outline {
    id: String,
    corners: Vec<[f64; 2]>,
    is_closed: bool,
}

/// What was found so far.
#[derive(Default)]
struct Outlines {
    found: Vec<Outline>,
    lines: usize,
    polygons: usize,
}

impl Outlines {
    /// Whatever a shape is: `name` is what messages call it.
    fn gather(&mut self, given: &Bound<'_, PyAny>, name: &str, depth: usize) -> PyResult<()> {
        if depth > DEEPEST {
            let message = format!("{name}: collections in collections, more than {DEEPEST} deep");
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
                "{name} is a {kind}: give shapes with __geo_interface__ or coords, or a list of them"
            )));
        };
        for (number, item) in items.enumerate() {
            self.gather(&item?, &format!("{name}[{number}]"), depth + 1)?;
        }
        Ok(())
    }

    /// A geometry or feature as GeoJSON has it.
    fn geo(&mut self, geo: &Bound<'_, PyMapping>, name: &str, depth: usize) -> PyResult<()> {
        let Ok(kind) = geo.get_item("type").and_then(|kind| kind.extract::<String>()) else {
            let message = format!("{name} is a mapping without a type: give it as GeoJSON has it");
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
                "{name} is a {kind}, along which there is no wall: give its buffer, or cylinders"
            ))),
            _ => Err(PyValueError::new_err(format!("{name} is a `{kind}`, which has no outline"))),
        }
    }

    /// One that comes back to where it began is closed.
    fn line(&mut self, given: &Bound<'_, PyAny>, name: &str) -> PyResult<()> {
        let corners = corners(given, name)?;
        let is_closed = corners.len() > 3 && corners.first() == corners.last();
        let id = format!("line-{}", self.lines);
        self.lines += 1;
        self.keep(id, corners, is_closed);
        Ok(())
    }

    /// Its outer ring, and its holes.
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

    /// What is empty is none.
    fn keep(&mut self, id: String, mut corners: Vec<[f64; 2]>, is_closed: bool) {
        corners.dedup();
        if is_closed && corners.len() > 1 && corners.first() == corners.last() {
            corners.pop();
        }
        if !corners.is_empty() {
            self.found.push(Outline { id, corners, is_closed });
        }
    }
}

/// Hands over each part of a shape with its name.
fn each<'py>(
    parts: &Bound<'py, PyAny>,
    name: &str,
    mut take: impl FnMut(&Bound<'py, PyAny>, &str) -> PyResult<()>,
) -> PyResult<()> {
    parts.try_iter()?.enumerate().try_for_each(|(at, part)| take(&part?, &format!("{name}[{at}]")))
}

/// Rows of x and y; heights are left out.
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
