//! Sensors.

use std::{
    fs,
    hash::{DefaultHasher, Hash as _, Hasher as _},
    path::PathBuf,
};

use pyo3::{
    exceptions::PyTypeError,
    prelude::*,
    types::{PyDict, PyType},
};
use serde_json::Value;
use sonard_model::{acoustics, scene::suggest};

use crate::{
    error::{self, SensorError, refuse},
    json,
};

/// A ranger's data: transducer, pulse, amplifier, threshold and where it is mounted.
///
/// ``Sensor.preset("senscomp-6500")``, ``Sensor.from_json(text)`` and ``Sensor.load(path)`` make one;
/// ``sensor.replace(threshold=0.02)`` one with other figures.
#[pyclass(frozen, module = "sonard")]
pub(crate) struct Sensor {
    pub(crate) sensor: acoustics::Sensor,
}

#[pymethods]
impl Sensor {
    /// A sensor that comes with the package, by its name.
    #[staticmethod]
    pub(crate) fn preset(py: Python<'_>, name: &str) -> PyResult<Self> {
        named(py, name).map(|sensor| Self { sensor })
    }

    /// The names of the presets, the default one first.
    #[staticmethod]
    fn preset_names() -> Vec<&'static str> {
        acoustics::Sensor::preset_names().collect()
    }

    /// A sensor from the text of a data file.
    #[staticmethod]
    pub(crate) fn from_json(py: Python<'_>, text: &str) -> PyResult<Self> {
        let sensor =
            acoustics::Sensor::from_json(text).map_err(|error| error::sensor(py, &error))?;
        Ok(Self { sensor })
    }

    /// A sensor from a data file.
    #[staticmethod]
    pub(crate) fn load(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let text =
            fs::read_to_string(&path).map_err(|error| error::unreadable(py, path, &error))?;
        Self::from_json(py, &text)
    }

    /// The same sensor with other figures, by the names of the data file; those of ``mounting``, ``aperture``,
    /// ``pulse``, ``face`` and ``gain`` are given as a dict, of which ``mounting`` may leave out what stays.
    #[pyo3(signature = (**figures))]
    fn replace(&self, py: Python<'_>, figures: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let Some(figures) = figures else { return Ok(Self { sensor: self.sensor.clone() }) };
        let given: Value = parsed(py, &json::text_of(figures)?)?;
        let mut data: Value = parsed(py, &self.to_json(py)?)?;
        let schema = schemars::schema_for!(acoustics::Sensor);
        let known = schema.get("properties").and_then(Value::as_object);
        let known: Vec<String> =
            known.into_iter().flatten().map(|(name, _)| name.clone()).collect();
        for (name, value) in given.as_object().into_iter().flatten() {
            if !known.contains(name) {
                return Err(PyTypeError::new_err(format!(
                    "a sensor has no figure `{name}`: {}",
                    suggest(name, &known, "figures")
                )));
            }
            match (name.as_str(), value, &mut data["mounting"]) {
                ("mounting", Value::Object(new), Value::Object(old)) => {
                    old.extend(new.iter().map(|(key, value)| (key.clone(), value.clone())));
                }
                _ => data[name] = value.clone(),
            }
        }
        // What a preset leaves out reads as its default; null is no value of a sensor's file.
        if let Some(data) = data.as_object_mut() {
            data.retain(|_, value| !value.is_null());
        }
        Self::from_json(py, &data.to_string())
    }

    /// The text of its data file.
    fn to_json(&self, py: Python<'_>) -> PyResult<String> {
        serde_json::to_string_pretty(&self.sensor)
            .map_err(|error| refuse::<SensorError>(py, &error.to_string(), ""))
    }

    /// The preset's name.
    #[getter]
    fn name(&self) -> &str {
        &self.sensor.name
    }

    /// What it is, in a sentence.
    #[getter]
    fn description(&self) -> &str {
        &self.sensor.description
    }

    /// Carrier frequency, hertz.
    #[getter]
    fn frequency_hz(&self) -> f64 {
        self.sensor.frequency_hz
    }

    /// From firing until the receiver listens, microseconds.
    #[getter]
    fn blanking_us(&self) -> f64 {
        self.sensor.blanking_us
    }

    /// The same when the blanking is shortened by hand, microseconds.
    #[getter]
    fn short_blanking_us(&self) -> Option<f64> {
        self.sensor.short_blanking_us
    }

    /// After an echo, how long the detector is held before it can report another, microseconds.
    #[getter]
    fn rearm_us(&self) -> f64 {
        self.sensor.rearm_us
    }

    /// How long an echo has to stay above the threshold to be taken for one, microseconds.
    #[getter]
    fn integration_us(&self) -> f64 {
        self.sensor.integration_us
    }

    /// Farthest range it is made for, metres.
    #[getter]
    fn max_range_m(&self) -> f64 {
        self.sensor.max_range_m
    }

    /// Least amplitude that is detected; a head-on, perfectly reflecting wall gives 1.
    #[getter]
    fn threshold(&self) -> f64 {
        self.sensor.threshold
    }

    /// How long the pulse lasts, microseconds.
    #[getter]
    fn pulse_us(&self) -> f64 {
        self.sensor.pulse_s() * 1e6
    }

    /// Half the width of the face in the plane of the scan, metres.
    #[getter]
    fn half_width_m(&self) -> f64 {
        self.sensor.half_width_m()
    }

    /// Shape of the radiating face, as in the data file.
    #[getter]
    fn aperture<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to_python(py, &self.sensor.aperture)
    }

    /// Face and housing as a reflector; ``None``: sound passes the ranger as if it were not there.
    #[getter]
    fn face<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to_python(py, &self.sensor.face)
    }

    /// Where it sits on the rotation axis, metres and degrees, as in the data file.
    #[getter]
    fn mounting<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to_python(py, &self.sensor.mounting)
    }

    /// What it sends, as in the data file.
    #[getter]
    fn pulse<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to_python(py, &self.sensor.pulse)
    }

    /// How the amplifier follows the spreading of the sound, as in the data file.
    #[getter]
    fn gain<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to_python(py, &self.sensor.gain)
    }

    /// How the face answers to a pulse: ``"stationary"`` or ``"full"``.
    #[getter]
    fn response<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to_python(py, &self.sensor.response)
    }

    /// What edges send back: ``"utd"``, ``"kuc-siegel"``, ``"bozma-kuc"``, or ``None`` for ``"utd"``.
    #[getter]
    fn edge_law<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to_python(py, &self.sensor.edge_law)
    }

    /// For each figure, by its name, where it comes from.
    #[getter]
    fn sources(&self) -> std::collections::BTreeMap<String, String> {
        self.sensor.sources.clone()
    }

    fn __repr__(&self) -> String {
        let acoustics::Sensor { name, frequency_hz, max_range_m, .. } = &self.sensor;
        format!("<Sensor '{name}': {:.1} kHz, up to {max_range_m} m>", frequency_hz / 1e3)
    }

    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        other.cast::<Self>().is_ok_and(|other| self.sensor == other.get().sensor)
    }

    fn __hash__(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        (&self.sensor.name, self.sensor.frequency_hz.to_bits()).hash(&mut hasher);
        hasher.finish()
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (String,))> {
        Ok((PyType::new::<Self>(py).getattr("from_json")?, (self.to_json(py)?,)))
    }
}

fn parsed(py: Python<'_>, text: &str) -> PyResult<Value> {
    serde_json::from_str(text).map_err(|error| refuse::<SensorError>(py, &error.to_string(), ""))
}

/// A preset by its name.
fn named(py: Python<'_>, name: &str) -> PyResult<acoustics::Sensor> {
    acoustics::Sensor::preset(name).map_err(|error| error::sensor(py, &error))
}

/// The sensor meant by a `Sensor` or by a preset's name.
pub(crate) fn meant(given: &Bound<'_, PyAny>) -> PyResult<Py<Sensor>> {
    if let Ok(sensor) = given.cast::<Sensor>() {
        return Ok(sensor.clone().unbind());
    }
    let Ok(name) = given.extract::<String>() else {
        let kind = given.get_type();
        return Err(PyTypeError::new_err(format!(
            "sensor is a {kind}: give a Sensor or a preset's name"
        )));
    };
    Py::new(given.py(), Sensor { sensor: named(given.py(), &name)? })
}

/// The sensor that is meant when none is named.
pub(crate) fn default(py: Python<'_>) -> PyResult<Py<Sensor>> {
    let name = acoustics::Sensor::preset_names().next().unwrap_or_default();
    Py::new(py, Sensor { sensor: named(py, name)? })
}
