//! The model.

mod parts;
pub(crate) mod predict;
mod single;

use pyo3::{
    prelude::*,
    types::{PyDict, PyTuple},
};
use sonard_model::{
    acoustics,
    model::{OptionKeys, Options, Simulator},
};

use crate::{
    air::Air,
    options::{self, Words},
    pool::OfProcess,
    scene::{self, Scene},
    sensor::{self, Sensor},
};

/// Predicts what a ranger reads in a scene.
///
/// Parameters
/// ----------
/// scene : Scene or str
///     The scene, or the name of a shipped one.
/// sensor : Sensor or str
///     The ranger, or the name of a preset.
/// air : Air, optional
///     The air; 20 degrees Celsius, 50 percent and one atmosphere without it.
/// engine : str
///     ``"paths"``: exact echo paths, all of them; ``"fan"``: rays with mirror reflections and diffraction, after
///     Dudek, Jenkin, Milios and Wilkes; ``"cone"``: nearest hit of one ray a degree.
/// max_range_m : float, optional
///     Listen and predict up to this range, metres, in place of the sensor's.
/// threshold : float, optional
///     Least amplitude detected, in place of the sensor's; a head-on, perfect wall gives 1.
/// response : {"stationary", "full"}, optional
///     How the face answers to a pulse, in place of the sensor's way; with ``paths``.
/// ideal_receiver : bool
///     Detect one sound at a time and time it by its path alone; with ``paths``, the others always do.
/// lossless : bool
///     Leave out the absorption of the air; with ``paths`` and ``fan``.
/// max_order : int, optional
///     Most mirror reflections on a path, in place of as many as can matter; with ``paths`` and ``fan``.
/// edge_law : {"utd", "kuc-siegel", "bozma-kuc"}, optional
///     How edges diffract, in place of the sensor's law; with ``paths``.
/// double_diffraction : bool
///     Also find paths diffracted at two edges; with ``paths``.
/// ray_spacing_deg : float, optional
///     Angle between the rays, degrees, in place of 0.05; with ``fan``.
/// aperture_deg : float, optional
///     Full aperture, degrees, in place of the sensor's two-way -6 dB width; with ``cone``.
#[pyclass(frozen, module = "sonard")]
pub(crate) struct Model {
    scene: Py<Scene>,
    sensor: Py<Sensor>,
    air: Air,
    options: Options,
    simulator: OfProcess<Simulator>,
}

#[pymethods]
impl Model {
    #[new]
    #[pyo3(signature = (scene, sensor = None, air = None, engine = "paths", *, max_range_m = None, threshold = None, response = None, ideal_receiver = false, lossless = false, max_order = None, edge_law = None, double_diffraction = false, ray_spacing_deg = None, aperture_deg = None),
        text_signature = "(scene, sensor='senscomp-6500', air=None, engine='paths', *, max_range_m=None, threshold=None, response=None, ideal_receiver=False, lossless=False, max_order=None, edge_law=None, double_diffraction=False, ray_spacing_deg=None, aperture_deg=None)")]
    #[expect(clippy::too_many_arguments, reason = "they are keywords where they are used")]
    fn new(
        py: Python<'_>,
        scene: &Bound<'_, PyAny>,
        sensor: Option<&Bound<'_, PyAny>>,
        air: Option<&Bound<'_, Air>>,
        engine: &str,
        max_range_m: Option<f64>,
        threshold: Option<f64>,
        response: Option<&str>,
        ideal_receiver: bool,
        lossless: bool,
        max_order: Option<u32>,
        edge_law: Option<&str>,
        double_diffraction: bool,
        ray_spacing_deg: Option<f64>,
        aperture_deg: Option<f64>,
    ) -> PyResult<Self> {
        let words = Words { engine, response, edge_law };
        let keys = OptionKeys {
            max_range_m,
            threshold,
            ideal_receiver,
            lossless,
            max_order,
            double_diffraction,
            ray_spacing_deg,
            aperture_deg,
            ..OptionKeys::default()
        };
        let options = options::options(py, &words, keys)?;
        let scene = scene::meant(scene)?;
        let sensor = match sensor {
            Some(sensor) => sensor::meant(sensor)?,
            None => sensor::default(py)?,
        };
        let air = air.map_or_else(|| acoustics::Air::default().into(), |air| *air.get());
        Self::of(py, scene, sensor, air, options)
    }

    /// The scene.
    #[getter]
    fn scene(&self, py: Python<'_>) -> Py<Scene> {
        self.scene.clone_ref(py)
    }

    /// The ranger.
    #[getter]
    fn sensor(&self, py: Python<'_>) -> Py<Sensor> {
        self.sensor.clone_ref(py)
    }

    /// The air.
    #[getter]
    fn air(&self) -> Air {
        self.air
    }

    /// How echoes are found: ``"paths"``, ``"fan"`` or ``"cone"``.
    #[getter]
    fn engine(&self) -> &'static str {
        self.options.engine.kind().name()
    }

    /// The options that are given, by name.
    #[getter]
    fn options<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        options::given(py, &self.options)
    }

    /// Speed of sound, metres a second.
    #[getter]
    fn sound_speed_m_s(&self) -> f64 {
        self.air.air.sound_speed_m_s()
    }

    /// Farthest range that is listened for, metres.
    #[getter]
    fn max_range_m(&self, py: Python<'_>) -> PyResult<f64> {
        Ok(self.simulator(py)?.receiver().max_range_m)
    }

    /// Nearest range that can be read, at the end of blanking, metres.
    #[getter]
    fn min_range_m(&self, py: Python<'_>) -> PyResult<f64> {
        Ok(self.simulator(py)?.receiver().min_range_m())
    }

    /// Predicted readings of all poses and azimuths.
    ///
    /// The interpreter's lock is free meanwhile, and an interrupt (Ctrl-C) ends it.
    ///
    /// Parameters
    /// ----------
    /// poses : array_like, shape (..., 3)
    ///     Where the ranger's rotation axis stands and where azimuth 0 points: x and y in metres, heading in
    ///     degrees counter-clockwise from +x, -360 to 360.
    /// azimuths_deg : array_like, shape (beams,), optional
    ///     Where to fire, degrees counter-clockwise from the heading; without it 400 azimuths from 0 to 359.1.
    /// threads : int, optional
    ///     Threads to predict on, 1 to 1024; without it what the environment variable ``RAYON_NUM_THREADS`` says,
    ///     else one for each core. Results do not depend on it.
    ///
    /// Returns
    /// -------
    /// ndarray of dtype READING, shape (..., beams)
    ///     Fields ``status`` (uint8, see ``Status``), ``range_m``, ``amplitude``, ``margin_db`` and ``tof_us``
    ///     (float64). Of a silence ``range_m`` and ``tof_us`` are ``inf``, and ``margin_db`` says what it lacked;
    ///     what there is none of is ``nan``.
    ///
    /// Raises
    /// ------
    /// PoseError
    ///     If no ranger can stand at one of the poses; nothing is predicted then.
    /// TooManyPathsError
    ///     If there are more echo paths than can be found within bounds of work and memory.
    #[pyo3(signature = (poses, azimuths_deg = None, threads = None))]
    fn predict<'py>(
        &self,
        py: Python<'py>,
        poses: &Bound<'py, PyAny>,
        azimuths_deg: Option<&Bound<'py, PyAny>>,
        threads: Option<usize>,
    ) -> PyResult<Bound<'py, PyAny>> {
        predict::predict(self, py, poses, azimuths_deg, threads)
    }

    /// Predicted readings of a ranger that moves: one firing at each pose.
    ///
    /// Parameters
    /// ----------
    /// poses : array_like, shape (..., 3)
    ///     Where the ranger's rotation axis stands at each firing, as of ``predict``.
    /// azimuths_deg : array_like, shape (...)
    ///     Where it fires there, degrees counter-clockwise from the heading; what can be broadcast is.
    /// threads : int, optional
    ///     As of ``predict``.
    ///
    /// Returns
    /// -------
    /// ndarray of dtype READING, shape (...)
    ///     As of ``predict``. Each firing costs what a pose costs there.
    #[pyo3(signature = (poses, azimuths_deg, threads = None))]
    fn fire<'py>(
        &self,
        py: Python<'py>,
        poses: &Bound<'py, PyAny>,
        azimuths_deg: &Bound<'py, PyAny>,
        threads: Option<usize>,
    ) -> PyResult<Bound<'py, PyAny>> {
        predict::fire(self, py, poses, azimuths_deg, threads)
    }

    /// One predicted reading with the path of its sound.
    ///
    /// Parameters
    /// ----------
    /// pose : array_like, shape (3,)
    ///     x and y (metres) and heading (degrees).
    /// azimuth_deg : float
    ///     Where the ranger looks, degrees counter-clockwise from the heading.
    #[pyo3(signature = (pose, azimuth_deg = 0.0))]
    fn reading<'py>(
        &self,
        pose: &Bound<'py, PyAny>,
        azimuth_deg: f64,
    ) -> PyResult<Bound<'py, PyAny>> {
        single::reading(self, pose, azimuth_deg)
    }

    /// Every propagation path of echoes at a place, shortest first.
    ///
    /// Parameters
    /// ----------
    /// pose : array_like, shape (3,)
    ///     x and y (metres) and heading (degrees), which matters where a robot's body turns with it.
    /// weakest : float
    ///     Paths weaker than this are left out, 0.000001 to 1; a head-on, perfect wall gives 1. Those that touch
    ///     cylinders more than once, or a cylinder and an edge, are listed from ten times this.
    ///
    /// Returns
    /// -------
    /// list of Path
    ///     A path that can be run through in both directions is there twice, with departure and arrival swapped.
    ///     The amplitude knows no beam pattern: it is what the echo would be if the ranger faced it.
    #[pyo3(signature = (pose, weakest = 0.001))]
    fn paths<'py>(
        &self,
        pose: &Bound<'py, PyAny>,
        weakest: f64,
    ) -> PyResult<Vec<Bound<'py, PyAny>>> {
        single::paths(self, pose, weakest)
    }

    /// What an oscilloscope would show of one firing.
    ///
    /// Parameters
    /// ----------
    /// pose : array_like, shape (3,)
    ///     x and y (metres) and heading (degrees).
    /// azimuth_deg : float
    ///     Where the ranger looks, degrees counter-clockwise from the heading.
    /// until_m : float, optional
    ///     Up to this range, metres; without it as far as is listened.
    /// step_us : float
    ///     Spacing of the samples, microseconds, 1 to 1000.
    #[pyo3(signature = (pose, azimuth_deg = 0.0, until_m = None, step_us = 5.0))]
    fn trace<'py>(
        &self,
        pose: &Bound<'py, PyAny>,
        azimuth_deg: f64,
        until_m: Option<f64>,
        step_us: f64,
    ) -> PyResult<Bound<'py, PyAny>> {
        single::trace(self, pose, azimuth_deg, until_m, step_us)
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let (scene, sensor) = (&self.scene.get().scene.name, &self.sensor.get().sensor.name);
        Ok(format!("<Model of '{sensor}' in '{scene}', {}>", options::shown(py, &self.options)?))
    }

    fn __getnewargs_ex__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyTuple>, Bound<'py, PyDict>)> {
        let made_of = (self.scene(py), self.sensor(py), self.air, self.engine());
        Ok((made_of.into_pyobject(py)?, self.options(py)?))
    }
}
