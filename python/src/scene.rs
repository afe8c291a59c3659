//! Python class for scenes.

mod grid;
mod points;
mod shapes;

use std::{
    collections::BTreeMap,
    fs,
    hash::{DefaultHasher, Hash as _, Hasher as _},
    path::PathBuf,
    sync::Arc,
};

use numpy::PyArray1;
use pyo3::{
    exceptions::{PyTypeError, PyValueError},
    prelude::*,
    types::{PyTuple, PyType},
};
use sonard_model::{
    geometry::Pose,
    scene::{self, shipped, suggest},
};

use crate::{
    arrays,
    error::{self, SceneError, new_error},
};
use points::{MATERIAL, OtherParts};

/// Walls and cylinders with materials, and named poses.
///
/// Created by ``Scene.shipped("simple-room")``, ``Scene.from_points(corners)``,
/// ``Scene.from_shapes(polygons)``, ``Scene.from_grid(map)``, ``Scene.from_json(text)`` and
/// ``Scene.load(path)``. Lengths are in metres.
#[pyclass(frozen, module = "sonard")]
pub(crate) struct Scene {
    pub(crate) scene: Arc<scene::Scene>,
}

/// Pose in Python: x, y (metres) and heading (degrees).
pub(crate) type PoseTuple = (f64, f64, f64);

#[pymethods]
impl Scene {
    /// Creates a room from its corners.
    ///
    /// Parameters
    /// ----------
    /// points : array_like, shape (n, 2)
    ///     Corners of the walls in sequence, x and y in metres. The last corner may repeat the
    ///     first.
    /// closed : bool
    ///     Add a wall from the last corner to the first.
    /// obstacles : sequence of array_like, each of shape (m, 2)
    ///     Closed outlines of obstacles in the room.
    /// cylinders : array_like, shape (k, 3), optional
    ///     Upright cylinders: x, y and radius, metres.
    /// reflectance : float
    ///     Amplitude of the mirror reflection relative to the incident wave, 0 to 1, of all
    ///     surfaces.
    /// roughness : float
    ///     Fraction of the reflected energy that is scattered instead of mirrored, 0 to 1.
    /// floor_z_m, ceiling_z_m : float, optional
    ///     Heights, metres. Pass both or neither; without them the scene is two-dimensional.
    /// name : str
    ///     Name of the scene.
    #[staticmethod]
    #[pyo3(signature = (points, *, closed = true, obstacles = None, cylinders = None, reflectance = 0.97, roughness = 0.0, floor_z_m = None, ceiling_z_m = None, name = "scene"))]
    #[expect(clippy::too_many_arguments, reason = "they are keywords where they are used")]
    fn from_points(
        py: Python<'_>,
        points: &Bound<'_, PyAny>,
        closed: bool,
        obstacles: Option<&Bound<'_, PyAny>>,
        cylinders: Option<&Bound<'_, PyAny>>,
        reflectance: f64,
        roughness: f64,
        floor_z_m: Option<f64>,
        ceiling_z_m: Option<f64>,
        name: &str,
    ) -> PyResult<Self> {
        let empty = scene::Scene::builder(name).rough_material(MATERIAL, reflectance, roughness);
        let builder = points::with_outlines(empty, points, closed, obstacles)?;
        let others = OtherParts { cylinders, heights_m: [floor_z_m, ceiling_z_m] };
        Ok(Self { scene: Arc::new(others.build(py, builder)?) })
    }

    /// Creates a scene from shapes as in shapely, geopandas, fiona or GeoJSON: walls along lines
    /// and around polygons and their holes. The positions of the polygons determine which are rooms
    /// and which are obstacles.
    ///
    /// Parameters
    /// ----------
    /// shapes : object, or sequence of them
    ///     Object with ``__geo_interface__`` or ``coords``, or a mapping as in GeoJSON: LineString,
    ///     LinearRing, Polygon, MultiLineString, MultiPolygon, GeometryCollection, Feature or
    ///     FeatureCollection; x and y in metres. Heights of points are ignored.
    /// cylinders, reflectance, roughness, floor_z_m, ceiling_z_m, name
    ///     As for ``from_points``.
    #[staticmethod]
    #[pyo3(signature = (shapes, *, cylinders = None, reflectance = 0.97, roughness = 0.0, floor_z_m = None, ceiling_z_m = None, name = "scene"))]
    #[expect(clippy::too_many_arguments, reason = "they are keywords where they are used")]
    fn from_shapes(
        py: Python<'_>,
        shapes: &Bound<'_, PyAny>,
        cylinders: Option<&Bound<'_, PyAny>>,
        reflectance: f64,
        roughness: f64,
        floor_z_m: Option<f64>,
        ceiling_z_m: Option<f64>,
        name: &str,
    ) -> PyResult<Self> {
        let empty = scene::Scene::builder(name).rough_material(MATERIAL, reflectance, roughness);
        let builder = shapes::with_shapes(empty, shapes)?;
        let others = OtherParts { cylinders, heights_m: [floor_z_m, ceiling_z_m] };
        Ok(Self { scene: Arc::new(others.build(py, builder)?) })
    }

    /// Traces the walls of a map of ROS's map_server as lines, like ``sonard scene from-grid``.
    ///
    /// Parameters
    /// ----------
    /// path : str or path-like
    ///     Description of the map (YAML), or the folder of map.yaml; the image, PGM or PNG, is
    ///     expected next to it.
    /// tolerance_m : float, optional
    ///     Maximum distance of a wall from the sides of the traced cells, metres. Defaults to one
    ///     and a half cells.
    /// min_length_m : float, optional
    ///     Minimum perimeter of an outline, metres; shorter ones are dropped. Defaults to four
    ///     cells.
    /// reflectance : float
    ///     Amplitude of the mirror reflection relative to the incident wave, 0 to 1, of all
    ///     surfaces.
    /// name : str, optional
    ///     Name of the scene. Defaults to that of the file.
    #[staticmethod]
    #[pyo3(signature = (path, *, tolerance_m = None, min_length_m = None, reflectance = 0.97, name = None))]
    fn from_grid(
        py: Python<'_>,
        path: &Bound<'_, PyAny>,
        tolerance_m: Option<f64>,
        min_length_m: Option<f64>,
        reflectance: f64,
        name: Option<&str>,
    ) -> PyResult<Self> {
        let scene = grid::traced(
            py,
            &path.extract::<PathBuf>()?,
            tolerance_m,
            min_length_m,
            reflectance,
            name,
        )?;
        Ok(Self { scene: Arc::new(scene) })
    }

    /// Creates a scene from the text of a scene file (described by ``sonard scene schema``).
    #[staticmethod]
    pub(crate) fn from_json(py: Python<'_>, text: &str) -> PyResult<Self> {
        let scene =
            scene::Scene::from_json(text).map_err(|error| error::scene(py, &error, true))?;
        Ok(Self { scene: Arc::new(scene) })
    }

    /// Creates a scene from a file.
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let text =
            fs::read_to_string(&path).map_err(|error| error::unreadable(py, path, &error))?;
        Self::from_json(py, &text)
    }

    /// Returns a shipped scene by its name.
    #[staticmethod]
    fn shipped(py: Python<'_>, name: &str) -> PyResult<Self> {
        let Some(text) = shipped::text(name) else {
            let message = format!("unknown shipped scene `{name}`");
            return Err(new_error::<SceneError>(
                py,
                &message,
                &suggest(name, &names(), "shipped scenes"),
            ));
        };
        Self::from_json(py, text)
    }

    /// Names of the shipped scenes.
    #[staticmethod]
    fn shipped_names() -> Vec<String> {
        names()
    }

    /// Name of the scene.
    #[getter]
    fn name(&self) -> &str {
        &self.scene.name
    }

    /// Source of the dimensions.
    #[getter]
    fn source(&self) -> Option<&str> {
        self.scene.source.as_deref()
    }

    /// Ends of the walls, metres: array of shape (walls, 2, 2), last axis x and y.
    #[getter]
    fn walls<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let walls = &self.scene.walls;
        let ends = walls.iter().flat_map(|wall| [wall.a.x, wall.a.y, wall.b.x, wall.b.y]);
        arrays::shaped(py, ends.collect(), &[walls.len(), 2, 2])
    }

    /// Names of the walls, in the order of ``walls``.
    #[getter]
    fn wall_ids(&self) -> Vec<String> {
        self.scene.walls.iter().map(|wall| wall.id.to_string()).collect()
    }

    /// Upright cylinders, metres: array of shape (cylinders, 3) of x, y and radius.
    #[getter]
    fn cylinders<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let cylinders = &self.scene.cylinders;
        let numbers = cylinders.iter().flat_map(|c| [c.center.x, c.center.y, c.radius_m]);
        arrays::shaped(py, numbers.collect(), &[cylinders.len(), 3])
    }

    /// Names of the cylinders, in the order of ``cylinders``.
    #[getter]
    fn cylinder_ids(&self) -> Vec<String> {
        self.scene.cylinders.iter().map(|cylinder| cylinder.id.to_string()).collect()
    }

    /// Height of the floor, metres; ``None`` in a two-dimensional scene.
    #[getter]
    fn floor_z_m(&self) -> Option<f64> {
        self.scene.floor_z_m
    }

    /// Height of the ceiling, metres; ``None`` in a two-dimensional scene.
    #[getter]
    fn ceiling_z_m(&self) -> Option<f64> {
        self.scene.ceiling_z_m
    }

    /// Named poses: x, y (metres) and heading (degrees counter-clockwise from +x).
    #[getter]
    fn poses(&self) -> BTreeMap<String, PoseTuple> {
        self.scene.poses.iter().map(|(name, pose)| (name.clone(), tuple_of(pose))).collect()
    }

    /// Returns the named pose, or the pose written as ``X,Y,DEG``: x, y (metres) and heading
    /// (degrees).
    fn pose(&self, py: Python<'_>, spec: &str) -> PyResult<PoseTuple> {
        let pose = self.scene.pose(spec).map_err(|error| error::pose(py, &[], &error))?;
        Ok(tuple_of(&pose))
    }

    /// Checks at which positions a ranger can be placed: in the room, outside every body, at least
    /// a millimetre from every surface.
    ///
    /// Parameters
    /// ----------
    /// places : array_like, shape (..., 2)
    ///     x and y, metres.
    ///
    /// Returns
    /// -------
    /// ndarray of bool, shape (...)
    fn are_accessible<'py>(
        &self,
        py: Python<'py>,
        places: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (places, shape) = arrays::points(places, "places")?;
        let scene = &self.scene;
        let free: Vec<bool> = py.detach(|| scene.are_accessible(&places));
        PyArray1::from_vec(py, free).call_method1("reshape", (PyTuple::new(py, shape)?,))
    }

    /// Distance of positions (shape (..., 2), metres) from the nearest wall or cylinder, metres
    /// (shape (...)); negative inside a cylinder, infinite in an empty scene.
    fn clearance_m<'py>(
        &self,
        py: Python<'py>,
        places: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (places, shape) = arrays::points(places, "places")?;
        let scene = &self.scene;
        let distances_m: Vec<f64> =
            py.detach(|| places.iter().map(|place| scene.clearance_m(*place)).collect());
        arrays::shaped(py, distances_m, &shape)
    }

    /// Text of the scene file.
    fn to_json(&self) -> &str {
        &self.scene.text
    }

    /// SHA-256 of that text, hexadecimal, by which logs identify the scene.
    #[getter]
    fn sha256(&self) -> &str {
        &self.scene.sha256
    }

    fn __repr__(&self) -> String {
        let scene::Scene { name, walls, cylinders, .. } = &*self.scene;
        format!("<Scene '{name}': {} walls, {} cylinders>", walls.len(), cylinders.len())
    }

    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        other.cast::<Self>().is_ok_and(|other| self.scene.text == other.get().scene.text)
    }

    fn __hash__(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        self.scene.sha256.hash(&mut hasher);
        hasher.finish()
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (String,))> {
        Ok((PyType::new::<Self>(py).getattr("from_json")?, (self.scene.text.to_string(),)))
    }
}

fn names() -> Vec<String> {
    shipped::names().map(str::to_owned).collect()
}

pub(crate) const fn tuple_of(pose: &Pose) -> PoseTuple {
    (pose.x_m, pose.y_m, pose.heading_deg)
}

/// Checks that a number is in a range.
fn check_range(name: &str, value: f64, [min, max]: [f64; 2]) -> PyResult<()> {
    if (min..=max).contains(&value) {
        return Ok(());
    }
    let message = format!("{name} is {value}: it must be from {min} to {max}");
    Err(PyValueError::new_err(message))
}

/// Resolves a `Scene` or the name of a shipped scene.
pub(crate) fn resolve(given: &Bound<'_, PyAny>) -> PyResult<Py<Scene>> {
    if let Ok(scene) = given.cast::<Scene>() {
        return Ok(scene.clone().unbind());
    }
    let Ok(name) = given.extract::<String>() else {
        let kind = given.get_type();
        return Err(PyTypeError::new_err(format!(
            "scene is a {kind}: must be a Scene or the name of a shipped one"
        )));
    };
    Py::new(given.py(), Scene::shipped(given.py(), &name)?)
}
