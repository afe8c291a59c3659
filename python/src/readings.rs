//! Conversion of readings passed by the user.

use pyo3::{exceptions::PyValueError, prelude::*};
use sonard::inverse::{FiringOutcome, SweepFiring};
use sonard_model::reading::PingStatus;

use crate::{arrays, model::predict::full_turn, status};

/// Readings from a single position, or of a round of an array.
pub(crate) struct BeamReadings {
    /// Status, `None` if invalid, and range in metres, which is one if the status is an echo.
    readings: Vec<(Option<PingStatus>, f64)>,
}

impl BeamReadings {
    /// Converts an array of readings with `status` and `range_m`, or an array of ranges.
    pub(crate) fn from_python(readings: &Bound<'_, PyAny>) -> PyResult<Self> {
        let numpy = readings.py().import("numpy")?;
        let array = numpy.call_method1("asarray", (readings,))?;
        let has_fields = !array.getattr("dtype")?.getattr("names")?.is_none();
        let (ranges_m, statuses): (Vec<f64>, Vec<Option<PingStatus>>) = if has_fields {
            let ranges_m = arrays::list(&array.get_item("range_m")?, "readings")?;
            let codes = arrays::list(&array.get_item("status")?, "readings")?;
            (ranges_m, codes.into_iter().map(|code| status::from_code(code as u8)).collect())
        } else {
            let ranges_m = arrays::list(&array, "readings")?;
            let statuses = ranges_m.iter().map(|range_m| status_of(*range_m)).collect();
            (ranges_m, statuses)
        };
        Ok(Self { readings: statuses.into_iter().zip(ranges_m).collect() })
    }

    pub(crate) fn len(&self) -> usize {
        self.readings.len()
    }

    /// Outcomes by the speed of sound, in order; `None` for a missing measurement.
    pub(crate) fn outcomes(&self, sound_speed_m_s: f64) -> Vec<Option<FiringOutcome>> {
        let us_per_m = 2e6 / sound_speed_m_s;
        let outcome = |&(status, range_m): &(Option<PingStatus>, f64)| match status? {
            PingStatus::Echo => {
                range_m.is_finite().then_some(FiringOutcome::Echo { tof_us: range_m * us_per_m })
            }
            PingStatus::NoEcho => Some(FiringOutcome::NoEcho),
            PingStatus::MinRange => Some(FiringOutcome::BelowMinRange),
            _ => None,
        };
        self.readings.iter().map(outcome).collect()
    }

    /// Firings with an outcome at their azimuths, 400 of a full turn if omitted.
    pub(crate) fn firings(
        &self,
        azimuths_deg: Option<&Bound<'_, PyAny>>,
        sound_speed_m_s: f64,
    ) -> PyResult<Vec<SweepFiring>> {
        let azimuths_deg = match azimuths_deg {
            Some(given) => arrays::list(given, "azimuths_deg")?,
            None => full_turn(),
        };
        if azimuths_deg.len() != self.len() {
            return Err(PyValueError::new_err(format!(
                "{} readings, but {} azimuths_deg: the lengths must be equal",
                self.len(),
                azimuths_deg.len()
            )));
        }
        let firing = |(azimuth_deg, outcome): (f64, Option<FiringOutcome>)| {
            azimuth_deg.is_finite().then_some(SweepFiring { azimuth_deg, outcome: outcome? })
        };
        let outcomes = self.outcomes(sound_speed_m_s);
        Ok(azimuths_deg.into_iter().zip(outcomes).filter_map(firing).collect())
    }
}

/// Status of a bare range: infinite for no echo; `None` for an invalid range.
fn status_of(range_m: f64) -> Option<PingStatus> {
    if range_m == f64::INFINITY {
        return Some(PingStatus::NoEcho);
    }
    (range_m.is_finite() && range_m > 0.0).then_some(PingStatus::Echo)
}
