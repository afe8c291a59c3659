//! Image sources of rooms.

use numpy::{PyArray1, PyArray2, PyArrayMethods as _};
use pyo3::{exceptions::PyValueError, prelude::*};
use sonard_model::model::{self, BoxRoom, ImageSourceError, ImageSources};

use crate::{
    arrays,
    error::{self, SonardError, new_error},
    path::result,
    scene::Scene,
};

/// Default reflectance of the surfaces of a box.
const REFLECTANCE: f64 = 0.97;

/// Default speed of sound, metres per second.
const SOUND_SPEED_M_S: f64 = 343.2;

/// Columns of `ImageSources.walls` that a path does not fill.
const NO_WALL: i32 = -1;

/// Computes the image sources that receivers see: all mirror reflections up to an order.
///
/// Parameters
/// ----------
/// room : Scene or array_like, shape (2,) or (3,)
///     Scene of flat walls of full height, with or without floor and ceiling; or the extent of a
///     box along x, y and z, metres, with a corner at the origin.
/// source : array_like, shape (2,) or (3,)
///     Position of the source, metres; x and y suffice in a planar room.
/// receivers : array_like, shape (..., 2) or (..., 3)
///     Positions of receivers, metres.
/// max_order : int
///     Maximum number of reflections, 0 to 65535.
/// reflectance : float or array_like, optional
///     Amplitude reflectance of a box, 0 to 1: of all surfaces, 0.97 by default, or of each one, in
///     the order of ``ImageSources.walls``. A scene has materials of its own.
/// sound_speed_m_s : float
///     Speed of sound for the delays, metres per second.
///
/// Returns
/// -------
/// ImageSources
///     Arrays with an entry for each image and receiver that sees it, nearest first.
#[pyfunction]
#[pyo3(signature = (room, source, receivers, max_order, *, reflectance = None, sound_speed_m_s = SOUND_SPEED_M_S),
    text_signature = "(room, source, receivers, max_order, *, reflectance=None, sound_speed_m_s=343.2)")]
pub(crate) fn image_sources<'py>(
    room: &Bound<'py, PyAny>,
    source: &Bound<'py, PyAny>,
    receivers: &Bound<'py, PyAny>,
    max_order: u16,
    reflectance: Option<&Bound<'py, PyAny>>,
    sound_speed_m_s: f64,
) -> PyResult<Bound<'py, PyAny>> {
    let py = room.py();
    if !(sound_speed_m_s.is_finite() && sound_speed_m_s > 0.0) {
        return Err(PyValueError::new_err(format!(
            "sound_speed_m_s is {sound_speed_m_s}: it must be greater than 0"
        )));
    }
    let (source_list, _) = places(source, "source")?;
    let &[source_m] = &*source_list else {
        return Err(PyValueError::new_err("source must be one position"));
    };
    let (receivers_m, _) = places(receivers, "receivers")?;
    let found = match room.cast::<Scene>() {
        Ok(_) if reflectance.is_some() => {
            return Err(PyValueError::new_err("reflectance is for boxes: a scene has materials"));
        }
        Ok(scene) => {
            let scene = &scene.get().scene;
            py.detach(|| model::image_sources(scene, source_m, &receivers_m, max_order))
        }
        Err(_) => {
            let (size_m, reflectances) = box_of(room, reflectance)?;
            py.detach(|| {
                let room = BoxRoom::new(&size_m, &reflectances)?;
                room.image_sources(source_m, &receivers_m, max_order)
            })
        }
    };
    let found = found.map_err(|error| match &error {
        ImageSourceError::TooCostly(costly) => error::too_costly(py, costly),
        _ => new_error::<SonardError>(py, &error.to_string(), ""),
    })?;
    into_python(py, &found, sound_speed_m_s)
}

/// Positions of two or three coordinates, and the shape of the other axes.
fn places(given: &Bound<'_, PyAny>, name: &str) -> PyResult<(Vec<[f64; 3]>, Vec<usize>)> {
    let (numbers, mut shape) = arrays::flattened(given)?;
    match shape.pop() {
        Some(2) => Ok((numbers.chunks_exact(2).map(|at| [at[0], at[1], 0.0]).collect(), shape)),
        Some(3) => Ok((numbers.chunks_exact(3).map(|at| [at[0], at[1], at[2]]).collect(), shape)),
        _ => Err(PyValueError::new_err(format!(
            "the last axis of {name} must be x_m, y_m or x_m, y_m, z_m"
        ))),
    }
}

/// Extent of a box, and a reflectance for each of its surfaces.
fn box_of(
    room: &Bound<'_, PyAny>,
    reflectance: Option<&Bound<'_, PyAny>>,
) -> PyResult<(Vec<f64>, Vec<f64>)> {
    let (size_m, shape) = arrays::flattened(room)?;
    if shape.len() != 1 {
        return Err(PyValueError::new_err(
            "room must be a Scene, or the extent of a box; see Scene.from_points for polygons",
        ));
    }
    let all = |value: f64| vec![value; 2 * size_m.len()];
    let reflectances = match reflectance {
        None => all(REFLECTANCE),
        Some(given) => match given.extract::<f64>() {
            Ok(value) => all(value),
            Err(_) => arrays::flattened(given)?.0,
        },
    };
    Ok((size_m, reflectances))
}

fn into_python<'py>(
    py: Python<'py>,
    found: &ImageSources,
    sound_speed_m_s: f64,
) -> PyResult<Bound<'py, PyAny>> {
    let orders = found.orders();
    let columns = orders.iter().copied().max().map_or(0, usize::from);
    let mut walls = vec![NO_WALL; found.len() * columns];
    if columns > 0 {
        for (row, image) in walls.chunks_exact_mut(columns).zip(0..) {
            for (wall, surface) in row.iter_mut().zip(found.surfaces(image)) {
                *wall = *surface as i32;
            }
        }
    }
    let walls = PyArray1::from_vec(py, walls).reshape([found.len(), columns])?;
    let positions = found.positions_m.as_flattened().to_vec();
    let positions: Bound<'py, PyArray2<f64>> =
        PyArray1::from_vec(py, positions).reshape([found.len(), 3])?;
    let fields = (
        PyArray1::from_slice(py, &found.receivers),
        positions,
        PyArray1::from_vec(py, found.delays_s(sound_speed_m_s)),
        PyArray1::from_vec(py, found.amplitudes()),
        PyArray1::from_slice(py, &found.reflectances),
        PyArray1::from_vec(py, orders),
        walls,
    );
    result(py, "ImageSources", fields)
}
