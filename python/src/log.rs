//! Python classes for logs.

mod table;

use std::{
    path::{Path, PathBuf, absolute},
    sync::Arc,
};

use pyo3::{
    exceptions::{PyIndexError, PyTypeError},
    prelude::*,
    types::{PyIterator, PyList, PyTuple},
};
use sonard::{
    scan::{Provenance, ScanView, Session},
    store::{StoreError, logged_scene},
};
use sonard_model::{acoustics, model::Options};

pub(crate) use table::{logged_dtype, shaped_readings};

use crate::{
    air::Air,
    array::{ArrayModel, RangerArray},
    error::{self, LogError, new_error},
    json,
    model::Model,
    scene::{PoseTuple, Scene, tuple_of},
    sensor::Sensor,
};

/// Content of a log file.
pub(crate) struct LogData {
    path: PathBuf,
    scans: Vec<ScanView>,
    damaged: Vec<(u64, String)>,
}

/// Scans of a log, in the order in which they begin; created by ``read_log``.
///
/// Supports ``len(log)``, ``log[0]`` and ``for scan in log`` like a list.
#[pyclass(frozen, module = "sonard")]
pub(crate) struct Log {
    data: Arc<LogData>,
}

/// Scan of a log, with its session.
#[pyclass(frozen, module = "sonard")]
pub(crate) struct Scan {
    log: Py<Log>,
    at: usize,
}

/// Reads a log written by ``sonard scan``, ``sonard simulate`` or the daemon.
///
/// Lines without a valid record are skipped; ``log.damaged`` lists them.
///
/// Parameters
/// ----------
/// path : str or path-like
///     Path of the file.
///
/// Raises
/// ------
/// LogError
///     If the file is not a log, or contains no record.
#[pyfunction]
pub(crate) fn read_log(py: Python<'_>, path: PathBuf) -> PyResult<Log> {
    // The library interprets a dash as standard input.
    let path = absolute(&path).unwrap_or(path);
    match py.detach(|| load(&path)) {
        Ok(data) if data.scans.is_empty() && !data.damaged.is_empty() => {
            let (line, fault) = &data.damaged[0];
            let message =
                format!("{} contains no valid record: line {line}: {fault}", path.display());
            Err(new_error::<LogError>(
                py,
                &message,
                "pass a log of `sonard scan` or `sonard simulate`",
            ))
        }
        Ok(data) => Ok(Log { data: Arc::new(data) }),
        Err(StoreError::Unreadable { source, .. } | StoreError::Read { source, .. }) => {
            Err(error::unreadable(py, path, &source))
        }
        Err(error) => {
            let help = match &error {
                StoreError::NotALog { kind, .. } => kind.help_for_log(),
                _ => "",
            };
            Err(new_error::<LogError>(py, &error.to_string(), help))
        }
    }
}

fn load(path: &Path) -> Result<LogData, StoreError> {
    let loaded = sonard::store::load(path)?;
    let damaged = loaded.damaged.iter().map(|error| (error.line, error.fault.to_string()));
    let damaged = damaged.collect();
    Ok(LogData { path: path.into(), scans: ScanView::from_records(loaded.records), damaged })
}

#[pymethods]
impl Log {
    /// Path of the file.
    #[getter]
    fn path(&self) -> &Path {
        &self.data.path
    }

    /// Lines without a valid record: their numbers, from 1, and the reasons.
    #[getter]
    fn damaged(&self) -> Vec<(u64, String)> {
        self.data.damaged.clone()
    }

    /// Readings of all scans, as for ``Scan.readings``.
    #[getter]
    fn readings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        shaped_readings(py, self.data.scans.iter().enumerate())
    }

    fn __len__(&self) -> usize {
        self.data.scans.len()
    }

    fn __iter__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyIterator>> {
        PyList::new(slf.py(), scans_of(slf)?)?.try_iter()
    }

    fn __getitem__(slf: &Bound<'_, Self>, index: isize) -> PyResult<Scan> {
        let count = slf.get().data.scans.len();
        let at = if index < 0 { index.checked_add_unsigned(count) } else { Some(index) };
        let at = at.and_then(|at| usize::try_from(at).ok()).filter(|at| *at < count);
        match at {
            Some(at) => Ok(Scan { log: slf.clone().unbind(), at }),
            None => Err(PyIndexError::new_err(format!("no scan {index}: the log has {count}"))),
        }
    }

    fn __repr__(&self) -> String {
        let readings: usize = self.data.scans.iter().map(|scan| scan.pings.len()).sum();
        let LogData { path, scans, damaged } = &*self.data;
        let damaged = match damaged.len() {
            0 => String::new(),
            count => format!(", {count} damaged lines"),
        };
        format!("<Log '{}': {} scans, {readings} readings{damaged}>", path.display(), scans.len())
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (PathBuf,))> {
        Ok((py.import("sonard")?.getattr("read_log")?, (self.data.path.clone(),)))
    }
}

#[pymethods]
impl Scan {
    /// Identifier of the scan.
    #[getter]
    fn id(&self) -> String {
        self.view().scan.to_string()
    }

    /// Pose of the scan: x and y (metres) and heading (degrees); ``None`` if the log lacks it.
    #[getter]
    fn pose(&self) -> Option<PoseTuple> {
        self.view().pose().as_ref().map(tuple_of)
    }

    /// Origin of the readings: ``"hardware"``, ``"mock"``, ``"simulated"``, ``"imported"``, ...;
    /// ``None`` without a session.
    #[getter]
    fn provenance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let provenance: Option<Provenance> =
            self.view().session.as_ref().map(|session| session.provenance);
        json::to_python(py, &provenance)
    }

    /// Record of the session as a dict, as described in docs/log.md; ``None`` if the log lacks it.
    #[getter]
    fn session<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to_python(py, &self.view().session.as_deref())
    }

    /// Record of the scan's start as a dict (pose, plan, time, ...); ``None`` if the log lacks it.
    #[getter]
    fn start<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to_python(py, &self.view().start)
    }

    /// Record of the scan's end as a dict; ``None`` for a scan that did not end.
    #[getter]
    fn end<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to_python(py, &self.view().end)
    }

    /// Events during the scan, as dicts.
    #[getter]
    fn events<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to_python(py, &self.view().events)
    }

    /// Readings in the order of the log: array of dtype LOGGED, shape (readings,).
    ///
    /// Fields: ``scan`` (index of the scan in the log) and ``index`` (in the plan); ``status`` and
    /// ``sim_status`` (see ``Status``; 255 without a prediction); ``azimuth_deg``; ``x_m``,
    /// ``y_m``, ``heading_deg`` of the pose; ``range_m``, ``tof_us``, ``amplitude``, ``margin_db``;
    /// the logged prediction, ``sim_range_m``, ``sim_amplitude``, ``sim_margin_db``; ``residual_m``
    /// (measured minus predicted); ``confidence``; ``time`` (datetime64[ns], UTC). As in
    /// predictions, ranges and times of flight without an echo are ``inf``, and missing values are
    /// ``nan`` or ``NaT``.
    #[getter]
    fn readings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        shaped_readings(py, [(self.at, self.view())])
    }

    /// Sensor of the session.
    #[getter]
    fn sensor(&self, py: Python<'_>) -> PyResult<Sensor> {
        Ok(Sensor { sensor: self.session_of(py)?.sensor.clone() })
    }

    /// Air of the session.
    #[getter]
    pub(crate) fn air(&self, py: Python<'_>) -> PyResult<Air> {
        let air = acoustics::Air::try_from(&self.session_of(py)?.air);
        let air = air.map_err(|error| new_error::<LogError>(py, &error.to_string(), ""))?;
        Ok(air.into())
    }

    /// Scene used for the predictions, as logged; ``None`` without predictions.
    #[getter]
    fn scene(&self, py: Python<'_>) -> PyResult<Option<Scene>> {
        let scene = logged_scene(self.session_of(py)?, &self.log.get().data.path);
        let scene = scene.map_err(|error| {
            new_error::<LogError>(py, &error.to_string(), "pass a scene to the model")
        })?;
        Ok(scene.map(|scene| Scene { scene: Arc::new(scene) }))
    }

    /// Creates the model of the session: its scene, sensor, air and options.
    ///
    /// Parameters
    /// ----------
    /// scene : Scene or str, optional
    ///     Scene that replaces the logged one.
    #[pyo3(signature = (scene = None))]
    pub(crate) fn model(
        &self,
        py: Python<'_>,
        scene: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Model> {
        let scene = self.scene_or_logged(py, scene)?;
        let sensor = Py::new(py, self.sensor(py)?)?;
        Model::build(py, scene, sensor, self.air(py)?, self.options(py)?)
    }

    /// Array of the session; ``None`` for a ranger on a stepper.
    #[getter]
    fn array(&self, py: Python<'_>) -> PyResult<Option<RangerArray>> {
        let array = self.session_of(py)?.array.as_ref();
        array.map(|array| RangerArray::checked(py, array.clone())).transpose()
    }

    /// Creates the model of the session's array: its scene, sensor, air and options.
    ///
    /// Parameters
    /// ----------
    /// scene : Scene or str, optional
    ///     Scene that replaces the logged one.
    #[pyo3(signature = (scene = None))]
    fn array_model(
        &self,
        py: Python<'_>,
        scene: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<ArrayModel> {
        let none = || {
            let help = "use scan.model() for a ranger on a stepper";
            new_error::<LogError>(py, "the scan is not from an array", help)
        };
        let array = Py::new(py, self.array(py)?.ok_or_else(none)?)?;
        let scene = self.scene_or_logged(py, scene)?;
        let sensor = Py::new(py, self.sensor(py)?)?;
        ArrayModel::build(py, scene, array, sensor, self.air(py)?, self.options(py)?)
    }

    fn __repr__(&self) -> String {
        let view = self.view();
        let at = view.pose().map(|pose| format!(" at {:?}", tuple_of(&pose)));
        format!("<Scan {}{}: {} readings>", view.scan, at.unwrap_or_default(), view.pings.len())
    }

    fn __reduce__<'py>(
        slf: &Bound<'py, Self>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let (py, scan) = (slf.py(), slf.get());
        let item = (scan.log.clone_ref(py), scan.at).into_pyobject(py)?;
        Ok((py.import("operator")?.getattr("getitem")?, item))
    }
}

impl Scan {
    pub(crate) fn view(&self) -> &ScanView {
        &self.log.get().data.scans[self.at]
    }

    /// Returns the given scene, or else the logged one.
    fn scene_or_logged(
        &self,
        py: Python<'_>,
        given: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Py<Scene>> {
        if let Some(given) = given {
            return crate::scene::resolve(given);
        }
        let help = "pass a scene: scan.model(scene)";
        let none = || new_error::<LogError>(py, "the log contains no scene", help);
        Py::new(py, self.scene(py)?.ok_or_else(none)?)
    }

    pub(crate) fn options(&self, py: Python<'_>) -> PyResult<Options> {
        let Some(model) = &self.session_of(py)?.model else { return Ok(Options::default()) };
        model.options().ok_or_else(|| {
            let message = format!("the logged model ({}) cannot be reconstructed", model.engine);
            new_error::<LogError>(py, &message, "create a Model explicitly")
        })
    }

    pub(crate) fn session_of(&self, py: Python<'_>) -> PyResult<&Session> {
        let none = || new_error::<LogError>(py, "the log lacks the session of this scan", "");
        self.view().session.as_deref().ok_or_else(none)
    }
}

/// Collects scans from a log, a scan, or a sequence of these.
pub(crate) fn scans_of(given: &Bound<'_, PyAny>) -> PyResult<Vec<Py<Scan>>> {
    if let Ok(scan) = given.cast::<Scan>() {
        return Ok(vec![scan.clone().unbind()]);
    }
    if let Ok(log) = given.cast::<Log>() {
        let count = log.get().data.scans.len();
        let scan = |at| Py::new(given.py(), Scan { log: log.clone().unbind(), at });
        return (0..count).map(scan).collect();
    }
    let Ok(parts) = given.try_iter() else {
        let kind = given.get_type();
        return Err(PyTypeError::new_err(format!(
            "scans is a {kind}: must be a Log, a Scan or a list of them"
        )));
    };
    let mut scans = Vec::new();
    for part in parts {
        let part = part?;
        if !part.is_instance_of::<Scan>() && !part.is_instance_of::<Log>() {
            let kind = part.get_type();
            return Err(PyTypeError::new_err(format!(
                "scans contains a {kind}: must contain Logs and Scans only"
            )));
        }
        scans.extend(scans_of(&part)?);
    }
    Ok(scans)
}
