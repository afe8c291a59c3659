//! Python class for the state of the air.

use std::hash::{DefaultHasher, Hash as _, Hasher as _};

use pyo3::prelude::*;
use sonard_model::acoustics::{self, AirError as ModelAirError};

use crate::error::{AirError, new_error};

/// State of the air, which determines the speed of sound and the absorption.
///
/// Parameters
/// ----------
/// temperature_c : float
///     Degrees Celsius, -20 to 50.
/// humidity_percent : float
///     Relative humidity, 0 to 100.
/// pressure_kpa : float
///     Static pressure, kilopascals, 60 to 110.
/// sound_speed_m_s : float, optional
///     Speed of sound, metres per second, 200 to 500, which replaces the computed one. The
///     absorption still follows from the state of the air.
#[pyclass(frozen, module = "sonard")]
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Air {
    pub(crate) air: acoustics::Air,
    given_m_s: Option<f64>,
}

#[pymethods]
impl Air {
    #[new]
    #[pyo3(signature = (temperature_c = 20.0, humidity_percent = 50.0, pressure_kpa = 101.325, sound_speed_m_s = None))]
    fn new(
        py: Python<'_>,
        temperature_c: f64,
        humidity_percent: f64,
        pressure_kpa: f64,
        sound_speed_m_s: Option<f64>,
    ) -> PyResult<Self> {
        let air = acoustics::Air::new(temperature_c, humidity_percent, pressure_kpa);
        let air = air.and_then(|air| match sound_speed_m_s {
            None => Ok(air),
            Some(speed_m_s) => air.with_sound_speed(speed_m_s),
        });
        let to_exception = |error: ModelAirError| new_error::<AirError>(py, &error.to_string(), "");
        Ok(Self { air: air.map_err(to_exception)?, given_m_s: sound_speed_m_s })
    }

    /// Temperature, degrees Celsius.
    #[getter]
    fn temperature_c(&self) -> f64 {
        self.air.temperature_c()
    }

    /// Relative humidity, percent.
    #[getter]
    fn humidity_percent(&self) -> f64 {
        self.air.humidity_percent()
    }

    /// Static pressure, kilopascals.
    #[getter]
    fn pressure_kpa(&self) -> f64 {
        self.air.pressure_kpa()
    }

    /// Speed of sound, metres per second: the given one, else by Cramer (1993).
    #[getter]
    fn sound_speed_m_s(&self) -> f64 {
        self.air.sound_speed_m_s()
    }

    /// Absorption of a tone of the given frequency in hertz, decibels per metre (ISO 9613-1).
    fn absorption_db_per_m(&self, frequency_hz: f64) -> f64 {
        self.air.absorption_db_per_m(frequency_hz)
    }

    fn __repr__(&self) -> String {
        let (t, h, p) = self.state();
        let speed = self.given_m_s.map(|speed| format!(", sound_speed_m_s={speed}"));
        let speed = speed.unwrap_or_default();
        format!("Air(temperature_c={t}, humidity_percent={h}, pressure_kpa={p}{speed})")
    }

    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        other.cast::<Self>().is_ok_and(|other| self == other.get())
    }

    fn __hash__(&self) -> u64 {
        let (t, h, p) = self.state();
        let mut hasher = DefaultHasher::new();
        // 0 and -0 are equal.
        [t, h, p].map(|value| (value + 0.0).to_bits()).hash(&mut hasher);
        hasher.finish()
    }

    fn __getnewargs__(&self) -> (f64, f64, f64, Option<f64>) {
        let (t, h, p) = self.state();
        (t, h, p, self.given_m_s)
    }
}

impl Air {
    fn state(&self) -> (f64, f64, f64) {
        (self.air.temperature_c(), self.air.humidity_percent(), self.air.pressure_kpa())
    }
}

impl From<acoustics::Air> for Air {
    fn from(air: acoustics::Air) -> Self {
        let (t, h, p) = (air.temperature_c(), air.humidity_percent(), air.pressure_kpa());
        let computed = acoustics::Air::new(t, h, p).is_ok_and(|computed| computed == air);
        Self { air, given_m_s: (!computed).then(|| air.sound_speed_m_s()) }
    }
}
