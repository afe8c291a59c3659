//! Python class for sensors.

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
    error::{self, SensorError, new_error},
    json,
};

/// Data of a ranger: transducer, pulse, amplifier, threshold and mounting.
///
/// Created by ``Sensor.preset("senscomp-6500")``, ``Sensor.from_json(text)`` and
/// ``Sensor.load(path)``; ``sensor.replace(threshold=0.02)`` returns a modified copy.
#[pyclass(frozen, module = "sonard")]
pub(crate) struct Sensor {
    pub(crate) sensor: acoustics::Sensor,
}

#[pymethods]
impl Sensor {
    /// Returns a shipped sensor by its name.
    #[staticmethod]
    pub(crate) fn preset(py: Python<'_>, name: &str) -> PyResult<Self> {
        named(py, name).map(|sensor| Self { sensor })
    }

    /// Names of the presets, the default one first.
    #[staticmethod]
    fn preset_names() -> Vec<&'static str> {
        acoustics::Sensor::preset_names().collect()
    }

    /// Creates a sensor from the text of a data file.
    #[staticmethod]
    pub(crate) fn from_json(py: Python<'_>, text: &str) -> PyResult<Self> {
        let sensor =
            acoustics::Sensor::from_json(text).map_err(|error| error::sensor(py, &error))?;
        Ok(Self { sensor })
    }

    /// Creates a sensor from a data file.
    #[staticmethod]
    pub(crate) fn load(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let text =
            fs::read_to_string(&path).map_err(|error| error::unreadable(py, path, &error))?;
        Self::from_json(py, &text)
    }

    /// Returns a copy with other values, named as in the data file. Values of ``mounting``,
    /// ``aperture``, ``pulse``, ``face`` and ``gain`` are dicts; that of ``mounting`` may omit
    /// unchanged entries.
    #[pyo3(signature = (**values))]
    fn replace(&self, py: Python<'_>, values: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let Some(values) = values else { return Ok(Self { sensor: self.sensor.clone() }) };
        let given: Value = parsed(py, &json::to_text(values)?)?;
        let mut data: Value = parsed(py, &self.to_json(py)?)?;
        let schema = schemars::schema_for!(acoustics::Sensor);
        let known = schema.get("properties").and_then(Value::as_object);
        let known: Vec<String> =
            known.into_iter().flatten().map(|(name, _)| name.clone()).collect();
        for (name, value) in given.as_object().into_iter().flatten() {
            if !known.contains(name) {
                return Err(PyTypeError::new_err(format!(
                    "unknown sensor value `{name}`: {}",
                    suggest(name, &known, "values")
                )));
            }
            match (name.as_str(), value, &mut data["mounting"]) {
                ("mounting", Value::Object(new), Value::Object(old)) => {
                    old.extend(new.iter().map(|(key, value)| (key.clone(), value.clone())));
                }
                _ => data[name] = value.clone(),
            }
        }
        // Omitted values of a preset are defaults; null is not a valid value in a sensor file.
        if let Some(data) = data.as_object_mut() {
            data.retain(|_, value| !value.is_null());
        }
        Self::from_json(py, &data.to_string())
    }

    /// Text of the data file.
    fn to_json(&self, py: Python<'_>) -> PyResult<String> {
        serde_json::to_string_pretty(&self.sensor)
            .map_err(|error| new_error::<SensorError>(py, &error.to_string(), ""))
    }

    /// Name of the preset.
    #[getter]
    fn name(&self) -> &str {
        &self.sensor.name
    }

    /// Description in a sentence.
    #[getter]
    fn description(&self) -> &str {
        &self.sensor.description
    }

    /// Carrier frequency, hertz.
    #[getter]
    fn frequency_hz(&self) -> f64 {
        self.sensor.frequency_hz
    }

    /// Time from firing to the end of the blanking, microseconds.
    #[getter]
    fn blanking_us(&self) -> f64 {
        self.sensor.blanking_us
    }

    /// Time from firing to the end of the shortened blanking, microseconds.
    #[getter]
    fn short_blanking_us(&self) -> Option<f64> {
        self.sensor.short_blanking_us
    }

    /// Hold time of the detector after an echo, before it can report another, microseconds.
    #[getter]
    fn rearm_us(&self) -> f64 {
        self.sensor.rearm_us
    }

    /// Minimum time above the threshold for the detection of an echo, microseconds.
    #[getter]
    fn integration_us(&self) -> f64 {
        self.sensor.integration_us
    }

    /// Maximum specified range, metres.
    #[getter]
    fn max_range_m(&self) -> f64 {
        self.sensor.max_range_m
    }

    /// Detection threshold, relative to the amplitude of a head-on, perfectly reflecting wall.
    #[getter]
    fn threshold(&self) -> f64 {
        self.sensor.threshold
    }

    /// Duration of the pulse, microseconds.
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

    /// Face and housing as a reflector; ``None`` if the ranger is transparent to sound.
    #[getter]
    fn face<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to_python(py, &self.sensor.face)
    }

    /// Mounting on the rotation axis, metres and degrees, as in the data file.
    #[getter]
    fn mounting<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to_python(py, &self.sensor.mounting)
    }

    /// Transmitted pulse, as in the data file.
    #[getter]
    fn pulse<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to_python(py, &self.sensor.pulse)
    }

    /// Gain against time, which compensates the spreading of the sound, as in the data file.
    #[getter]
    fn gain<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to_python(py, &self.sensor.gain)
    }

    /// Aperture response of the face to a pulse: ``"stationary"`` or ``"full"``.
    #[getter]
    fn response<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to_python(py, &self.sensor.response)
    }

    /// Edge diffraction model: ``"utd"``, ``"kuc-siegel"``, ``"bozma-kuc"``, or ``None`` for
    /// ``"utd"``.
    #[getter]
    fn edge_law<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to_python(py, &self.sensor.edge_law)
    }

    /// Sources of the values, by name.
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
    serde_json::from_str(text).map_err(|error| new_error::<SensorError>(py, &error.to_string(), ""))
}

/// Returns a preset by its name.
fn named(py: Python<'_>, name: &str) -> PyResult<acoustics::Sensor> {
    acoustics::Sensor::preset(name).map_err(|error| error::sensor(py, &error))
}

/// Resolves a `Sensor` or the name of a preset.
pub(crate) fn resolve(given: &Bound<'_, PyAny>) -> PyResult<Py<Sensor>> {
    if let Ok(sensor) = given.cast::<Sensor>() {
        return Ok(sensor.clone().unbind());
    }
    let Ok(name) = given.extract::<String>() else {
        let kind = given.get_type();
        return Err(PyTypeError::new_err(format!(
            "sensor is a {kind}: must be a Sensor or the name of a preset"
        )));
    };
    Py::new(given.py(), Sensor { sensor: named(given.py(), &name)? })
}

/// Returns the default sensor.
pub(crate) fn default(py: Python<'_>) -> PyResult<Py<Sensor>> {
    let name = acoustics::Sensor::preset_names().next().unwrap_or_default();
    Py::new(py, Sensor { sensor: named(py, name)? })
}
