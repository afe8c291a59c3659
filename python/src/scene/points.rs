//! Scenes from arrays of points, and parts shared with other sources.

use pyo3::{exceptions::PyValueError, prelude::*};
use sonard_model::{
    geometry::DVec2,
    scene::{self, SceneBuilder},
};

use crate::{arrays, error};

/// Material of all surfaces.
pub(super) const MATERIAL: &str = "wall";

/// Parts of a scene other than its outlines.
pub(super) struct OtherParts<'a, 'py> {
    pub(super) cylinders: Option<&'a Bound<'py, PyAny>>,
    pub(super) heights_m: [Option<f64>; 2],
}

impl OtherParts<'_, '_> {
    /// Adds the parts to a scene and builds it.
    pub(super) fn build(
        &self,
        py: Python<'_>,
        mut builder: SceneBuilder,
    ) -> PyResult<scene::Scene> {
        if let Some(cylinders) = self.cylinders {
            let (numbers, _) = arrays::rows(cylinders, "cylinders", 3, "x_m, y_m, radius_m")?;
            for (number, row) in numbers.chunks_exact(3).enumerate() {
                let id = format!("cylinder-{number}");
                builder = builder.cylinder(&id, [row[0], row[1]], row[2], MATERIAL);
            }
        }
        match self.heights_m {
            [Some(floor_z_m), Some(ceiling_z_m)] => {
                builder = builder.heights(floor_z_m, ceiling_z_m);
            }
            [None, None] => {}
            _ => {
                return Err(PyValueError::new_err(
                    "pass both floor_z_m and ceiling_z_m, or neither",
                ));
            }
        }
        builder.build().map_err(|error| error::scene(py, &error, false))
    }
}

/// Adds walls along the outlines of a room and of its obstacles.
pub(super) fn with_outlines(
    mut builder: SceneBuilder,
    points: &Bound<'_, PyAny>,
    closed: bool,
    obstacles: Option<&Bound<'_, PyAny>>,
) -> PyResult<SceneBuilder> {
    builder = with_outline(builder, "wall", points, "points", closed)?;
    let obstacles = obstacles.map(|given| given.try_iter()).transpose()?;
    for (number, outline) in obstacles.into_iter().flatten().enumerate() {
        let (id, name) = (format!("obstacle-{number}"), format!("obstacles[{number}]"));
        builder = with_outline(builder, &id, &outline?, &name, true)?;
    }
    Ok(builder)
}

/// Adds walls along an outline given as an array.
fn with_outline(
    builder: SceneBuilder,
    id: &str,
    given: &Bound<'_, PyAny>,
    name: &str,
    closed: bool,
) -> PyResult<SceneBuilder> {
    let (mut corners, _) = arrays::points(given, name)?;
    if closed && corners.len() > 1 && corners.first() == corners.last() {
        corners.pop();
    }
    let corners: Vec<[f64; 2]> = corners.into_iter().map(DVec2::into).collect();
    Ok(if closed {
        builder.room(id, &corners, MATERIAL)
    } else {
        builder.walls(id, &corners, MATERIAL)
    })
}
