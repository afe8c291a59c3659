//! Python class for the model of a ranger.

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
    options::{self, NamedOptions},
    pool::PerProcess,
    scene::{self, Scene},
    sensor::{self, Sensor},
};

/// Predicts the readings of a ranger in a scene.
///
/// Parameters
/// ----------
/// scene : Scene or str
///     Scene, or the name of a shipped one.
/// sensor : Sensor or str
///     Sensor, or the name of a preset.
/// air : Air, optional
///     State of the air. Defaults to 20 degrees Celsius, 50 percent and one atmosphere.
/// engine : str
///     ``"paths"``: exact echo paths, all of them; ``"fan"``: rays with mirror reflections and
///     diffraction, after Dudek, Jenkin, Milios and Wilkes; ``"cone"``: nearest intersection of one
///     ray per degree.
/// max_range_m : float, optional
///     Maximum range of listening window and prediction, metres, in place of the sensor's.
/// threshold : float, optional
///     Detection threshold, in place of the sensor's, relative to the amplitude of a head-on,
///     perfect wall.
/// response : {"stationary", "full"}, optional
///     Aperture response of the transducer's face to a pulse, in place of the sensor's; with
///     ``paths``.
/// ideal_receiver : bool
///     Ideal receiver without interference and time walk; with ``paths``. The other engines always
///     use it.
/// lossless : bool
///     Omit the absorption of the air; with ``paths`` and ``fan``.
/// max_order : int, optional
///     Maximum number of mirror reflections on a path. Unlimited by default, as far as a path can
///     be detected; with ``paths`` and ``fan``.
/// edge_law : {"utd", "kuc-siegel", "bozma-kuc"}, optional
///     Edge diffraction model, in place of the sensor's; with ``paths``.
/// double_diffraction : bool
///     Include paths diffracted at two edges; with ``paths``.
/// ray_spacing_deg : float, optional
///     Angle between the rays, degrees. Defaults to 0.05; with ``fan``.
/// aperture_deg : float, optional
///     Full aperture, degrees. Defaults to the sensor's two-way -6 dB width; with ``cone``.
#[pyclass(frozen, module = "sonard")]
pub(crate) struct Model {
    scene: Py<Scene>,
    sensor: Py<Sensor>,
    air: Air,
    options: Options,
    simulator: PerProcess<Simulator>,
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
        let named = NamedOptions { engine, response, edge_law };
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
        let options = options::options(py, &named, keys)?;
        let scene = scene::resolve(scene)?;
        let sensor = match sensor {
            Some(sensor) => sensor::resolve(sensor)?,
            None => sensor::default(py)?,
        };
        let air = air.map_or_else(|| acoustics::Air::default().into(), |air| *air.get());
        Self::build(py, scene, sensor, air, options)
    }

    /// Scene of the model.
    #[getter]
    fn scene(&self, py: Python<'_>) -> Py<Scene> {
        self.scene.clone_ref(py)
    }

    /// Sensor of the model.
    #[getter]
    fn sensor(&self, py: Python<'_>) -> Py<Sensor> {
        self.sensor.clone_ref(py)
    }

    /// State of the air.
    #[getter]
    fn air(&self) -> Air {
        self.air
    }

    /// Simulation engine: ``"paths"``, ``"fan"`` or ``"cone"``.
    #[getter]
    fn engine(&self) -> &'static str {
        self.options.engine.kind().name()
    }

    /// Options other than the defaults, by name.
    #[getter]
    fn options<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        options::given(py, &self.options)
    }

    /// Speed of sound, metres per second.
    #[getter]
    fn sound_speed_m_s(&self) -> f64 {
        self.air.air.sound_speed_m_s()
    }

    /// Maximum range, at the end of the listening window, metres.
    #[getter]
    fn max_range_m(&self, py: Python<'_>) -> PyResult<f64> {
        Ok(self.simulator(py)?.receiver().max_range_m)
    }

    /// Minimum range, at the end of the blanking, metres.
    #[getter]
    fn min_range_m(&self, py: Python<'_>) -> PyResult<f64> {
        Ok(self.simulator(py)?.receiver().min_range_m())
    }

    /// Predicts the readings of all poses and azimuths.
    ///
    /// Releases the interpreter lock during the computation; an interrupt (Ctrl-C) ends it.
    ///
    /// Parameters
    /// ----------
    /// poses : array_like, shape (..., 3)
    ///     Positions of the ranger's rotation axis and directions of azimuth 0: x and y in metres,
    ///     heading in degrees counter-clockwise from +x, -360 to 360.
    /// azimuths_deg : array_like, shape (beams,), optional
    ///     Azimuths of the firings, degrees counter-clockwise from the heading. Default to 400
    ///     azimuths from 0 to 359.1.
    /// threads : int, optional
    ///     Number of threads, 1 to 1024. Defaults to the environment variable
    ///     ``RAYON_NUM_THREADS``, else to the number of cores. The results do not depend on it.
    ///
    /// Returns
    /// -------
    /// ndarray of dtype READING, shape (..., beams)
    ///     Fields ``status`` (uint8, see ``Status``), ``range_m``, ``amplitude``, ``margin_db`` and
    ///     ``tof_us`` (float64). Without an echo ``range_m`` and ``tof_us`` are ``inf``, and
    ///     ``margin_db`` is the level of the strongest candidate relative to the threshold. Missing
    ///     values are ``nan``.
    ///
    /// Raises
    /// ------
    /// PoseError
    ///     If no ranger can be placed at one of the poses; nothing is predicted then.
    /// TooManyPathsError
    ///     If the number of echo paths exceeds the limits of computation and memory.
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

    /// Predicts the readings of a moving ranger: one firing at each pose.
    ///
    /// Parameters
    /// ----------
    /// poses : array_like, shape (..., 3)
    ///     Pose of the ranger's rotation axis at each firing, as for ``predict``.
    /// azimuths_deg : array_like, shape (...)
    ///     Azimuth of each firing, degrees counter-clockwise from the heading. Broadcast to the
    ///     shape of the poses.
    /// threads : int, optional
    ///     As for ``predict``.
    ///
    /// Returns
    /// -------
    /// ndarray of dtype READING, shape (...)
    ///     As for ``predict``. Each firing costs as much as a pose there.
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

    /// Predicts a single reading with its propagation path.
    ///
    /// Parameters
    /// ----------
    /// pose : array_like, shape (3,)
    ///     x and y (metres) and heading (degrees).
    /// azimuth_deg : float
    ///     Azimuth of the firing, degrees counter-clockwise from the heading.
    #[pyo3(signature = (pose, azimuth_deg = 0.0))]
    fn reading<'py>(
        &self,
        pose: &Bound<'py, PyAny>,
        azimuth_deg: f64,
    ) -> PyResult<Bound<'py, PyAny>> {
        single::reading(self, pose, azimuth_deg)
    }

    /// Computes all propagation paths of echoes at a position, shortest first.
    ///
    /// Parameters
    /// ----------
    /// pose : array_like, shape (3,)
    ///     x and y (metres) and heading (degrees), which matters only if the scene contains a
    ///     robot's body.
    /// min_amplitude : float, optional
    ///     Minimum amplitude of the paths, 0.000001 to 1, relative to a head-on, perfect wall. By
    ///     default 0.001, and 0.01 for paths that touch cylinders more than once, or a cylinder and
    ///     an edge, and are longer than the blanking covers.
    ///
    /// Returns
    /// -------
    /// list of Path
    ///     A path that can be traversed in both directions is listed twice, with departure and
    ///     arrival swapped. The amplitude excludes the beam pattern: it is the echo of a ranger
    ///     that faces the path.
    #[pyo3(signature = (pose, min_amplitude = None))]
    fn paths<'py>(
        &self,
        pose: &Bound<'py, PyAny>,
        min_amplitude: Option<f64>,
    ) -> PyResult<Vec<Bound<'py, PyAny>>> {
        single::paths(self, pose, min_amplitude)
    }

    /// Computes the signal of a firing against time, as on an oscilloscope.
    ///
    /// Parameters
    /// ----------
    /// pose : array_like, shape (3,)
    ///     x and y (metres) and heading (degrees).
    /// azimuth_deg : float
    ///     Azimuth of the firing, degrees counter-clockwise from the heading.
    /// max_range_m : float, optional
    ///     End of the trace as a range, metres. Defaults to the maximum range.
    /// step_us : float
    ///     Sampling interval, microseconds, 1 to 1000.
    #[pyo3(signature = (pose, azimuth_deg = 0.0, max_range_m = None, step_us = 5.0))]
    fn trace<'py>(
        &self,
        pose: &Bound<'py, PyAny>,
        azimuth_deg: f64,
        max_range_m: Option<f64>,
        step_us: f64,
    ) -> PyResult<Bound<'py, PyAny>> {
        single::trace(self, pose, azimuth_deg, max_range_m, step_us)
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let (scene, sensor) = (&self.scene.get().scene.name, &self.sensor.get().sensor.name);
        Ok(format!("<Model of '{sensor}' in '{scene}', {}>", options::sanitize(py, &self.options)?))
    }

    fn __getnewargs_ex__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyTuple>, Bound<'py, PyDict>)> {
        let arguments = (self.scene(py), self.sensor(py), self.air, self.engine());
        Ok((arguments.into_pyobject(py)?, self.options(py)?))
    }
}
