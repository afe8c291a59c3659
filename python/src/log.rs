//! Logs.

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
    error::{self, LogError, refuse},
    json,
    model::Model,
    scene::{PoseTuple, Scene, tuple_of},
    sensor::Sensor,
};

/// A log as it was read.
pub(crate) struct LogData {
    path: PathBuf,
    scans: Vec<ScanView>,
    damaged: Vec<(u64, String)>,
}

/// The scans of a log, in the order in which they begin; ``read_log`` makes it.
///
/// ``len(log)``, ``log[0]`` and ``for scan in log`` do what they do with a list.
#[pyclass(frozen, module = "sonard")]
pub(crate) struct Log {
    data: Arc<LogData>,
}

/// One scan of a log, with its session.
#[pyclass(frozen, module = "sonard")]
pub(crate) struct Scan {
    log: Py<Log>,
    at: usize,
}

/// Reads a log, as ``sonard scan``, ``sonard simulate`` and the daemon write it.
///
/// Lines that hold no record are left out; ``log.damaged`` names them.
///
/// Parameters
/// ----------
/// path : str or path-like
///     The file.
///
/// Raises
/// ------
/// LogError
///     If the file is no log, or holds no record at all.
#[pyfunction]
pub(crate) fn read_log(py: Python<'_>, path: PathBuf) -> PyResult<Log> {
    // The library takes a dash for standard input.
    let path = absolute(&path).unwrap_or(path);
    match py.detach(|| load(&path)) {
        Ok(data) if data.scans.is_empty() && !data.damaged.is_empty() => {
            let (line, fault) = &data.damaged[0];
            let message = format!("{} holds no record: line {line}: {fault}", path.display());
            Err(refuse::<LogError>(
                py,
                &message,
                "give a log of `sonard scan` or `sonard simulate`",
            ))
        }
        Ok(data) => Ok(Log { data: Arc::new(data) }),
        Err(StoreError::Unreadable { source, .. } | StoreError::Read { source, .. }) => {
            Err(error::unreadable(py, path, &source))
        }
        Err(error) => {
            let help = match &error {
                StoreError::NoLog { kind, .. } => kind.instead_of_a_log(),
                _ => "",
            };
            Err(refuse::<LogError>(py, &error.to_string(), help))
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
    /// The file that it was read from.
    #[getter]
    fn path(&self) -> &Path {
        &self.data.path
    }

    /// Lines that hold no record: their numbers, from 1, and why.
    #[getter]
    fn damaged(&self) -> Vec<(u64, String)> {
        self.data.damaged.clone()
    }

    /// The readings of all scans together, as of ``Scan.readings``.
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
            None => {
                Err(PyIndexError::new_err(format!("there is no scan {index}: the log has {count}")))
            }
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
    /// Its identifier.
    #[getter]
    fn id(&self) -> String {
        self.view().scan.to_string()
    }

    /// Where it was taken: x and y (metres) and heading (degrees); ``None`` if the log does not say.
    #[getter]
    fn pose(&self) -> Option<PoseTuple> {
        self.view().pose().as_ref().map(tuple_of)
    }

    /// Where its readings come from: ``"hardware"``, ``"mock"``, ``"simulated"``, ``"imported"``, ...; ``None``
    /// without a session.
    #[getter]
    fn provenance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let of: Option<Provenance> = self.view().session.as_ref().map(|session| session.provenance);
        json::to_python(py, &of)
    }

    /// The session's record as a dict, as docs/log.md describes it; ``None`` if the log lacks it.
    #[getter]
    fn session<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to_python(py, &self.view().session.as_deref())
    }

    /// The record of its beginning as a dict (pose, plan, time, ...); ``None`` if the log lacks it.
    #[getter]
    fn start<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to_python(py, &self.view().start)
    }

    /// The record of its end as a dict; ``None`` of a scan that did not end.
    #[getter]
    fn end<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to_python(py, &self.view().end)
    }

    /// Events while it was taken, as dicts.
    #[getter]
    fn events<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to_python(py, &self.view().events)
    }

    /// Its readings in the order of the log: array of dtype LOGGED, shape (readings,).
    ///
    /// Fields: ``scan`` (place of the scan in the log) and ``index`` (in the plan); ``status`` and ``sim_status``
    /// (see ``Status``; 255 without a prediction); ``azimuth_deg``; ``x_m``, ``y_m``, ``heading_deg`` of the pose;
    /// ``range_m``, ``tof_us``, ``amplitude``, ``margin_db``; the prediction beside it, ``sim_range_m``,
    /// ``sim_amplitude``, ``sim_margin_db``; ``residual_m`` (measured less predicted); ``confidence``; ``time``
    /// (datetime64[ns], UTC). As in predictions, ranges and times of flight of silences are ``inf``, and what
    /// there is none of is ``nan`` or ``NaT``.
    #[getter]
    fn readings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        shaped_readings(py, [(self.at, self.view())])
    }

    /// The sensor of its session.
    #[getter]
    fn sensor(&self, py: Python<'_>) -> PyResult<Sensor> {
        Ok(Sensor { sensor: self.session_of(py)?.sensor.clone() })
    }

    /// The air of its session.
    #[getter]
    fn air(&self, py: Python<'_>) -> PyResult<Air> {
        let air = acoustics::Air::try_from(&self.session_of(py)?.air);
        let air = air.map_err(|error| refuse::<LogError>(py, &error.to_string(), ""))?;
        Ok(air.into())
    }

    /// The scene that was predicted in, as the log holds it; ``None`` if none was.
    #[getter]
    fn scene(&self, py: Python<'_>) -> PyResult<Option<Scene>> {
        let scene = logged_scene(self.session_of(py)?, &self.log.get().data.path);
        let scene = scene.map_err(|error| {
            refuse::<LogError>(py, &error.to_string(), "give a scene of your own to the model")
        })?;
        Ok(scene.map(|scene| Scene { scene: Arc::new(scene) }))
    }

    /// The model of its session: its scene, sensor, air and options.
    ///
    /// Parameters
    /// ----------
    /// scene : Scene or str, optional
    ///     A scene in place of the log's.
    #[pyo3(signature = (scene = None))]
    pub(crate) fn model(
        &self,
        py: Python<'_>,
        scene: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Model> {
        let scene = self.scene_meant(py, scene)?;
        let sensor = Py::new(py, self.sensor(py)?)?;
        Model::of(py, scene, sensor, self.air(py)?, self.options(py)?)
    }

    /// The array of its session; ``None`` of a ranger on a stepper.
    #[getter]
    fn array(&self, py: Python<'_>) -> PyResult<Option<RangerArray>> {
        let array = self.session_of(py)?.array.as_ref();
        array.map(|array| RangerArray::checked(py, array.clone())).transpose()
    }

    /// The model of its session's array: its scene, sensor, air and options.
    ///
    /// Parameters
    /// ----------
    /// scene : Scene or str, optional
    ///     A scene in place of the log's.
    #[pyo3(signature = (scene = None))]
    fn array_model(
        &self,
        py: Python<'_>,
        scene: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<ArrayModel> {
        let none = || {
            let help = "of a ranger on a stepper: scan.model()";
            refuse::<LogError>(py, "the scan is of no array", help)
        };
        let array = Py::new(py, self.array(py)?.ok_or_else(none)?)?;
        let scene = self.scene_meant(py, scene)?;
        let sensor = Py::new(py, self.sensor(py)?)?;
        ArrayModel::of(py, scene, array, sensor, self.air(py)?, self.options(py)?)
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

    /// The scene given, else the log's.
    fn scene_meant(&self, py: Python<'_>, given: Option<&Bound<'_, PyAny>>) -> PyResult<Py<Scene>> {
        if let Some(given) = given {
            return crate::scene::meant(given);
        }
        let help = "give one of your own: scan.model(scene)";
        let none = || refuse::<LogError>(py, "the log holds no scene", help);
        Py::new(py, self.scene(py)?.ok_or_else(none)?)
    }

    fn options(&self, py: Python<'_>) -> PyResult<Options> {
        let Some(model) = &self.session_of(py)?.model else { return Ok(Options::default()) };
        model.options().ok_or_else(|| {
            let message = format!("the log's model ({}) can't be set up again", model.engine);
            refuse::<LogError>(py, &message, "make a Model of your own")
        })
    }

    pub(crate) fn session_of(&self, py: Python<'_>) -> PyResult<&Session> {
        let none = || refuse::<LogError>(py, "the log lacks the session of this scan", "");
        self.view().session.as_deref().ok_or_else(none)
    }
}

/// Scans that were given as a log, a scan, or a sequence of these.
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
            "scans is a {kind}: give a Log, a Scan or a list of them"
        )));
    };
    let mut scans = Vec::new();
    for part in parts {
        let part = part?;
        if !part.is_instance_of::<Scan>() && !part.is_instance_of::<Log>() {
            let kind = part.get_type();
            return Err(PyTypeError::new_err(format!("scans holds a {kind}: give Logs and Scans")));
        }
        scans.extend(scans_of(&part)?);
    }
    Ok(scans)
}
