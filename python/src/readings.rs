//! Conversion of readings passed by the user.

use pyo3::{exceptions::PyValueError, prelude::*};
use sonard::inverse::{FiringOutcome, SweepFiring};
use sonard_model::reading::PingStatus;

use crate::{arrays, model::predict::full_turn, status};

/// Readings from a single position.
pub(crate) struct BeamReadings {
    /// Azimuth in degrees, status, and range in metres if the status is an echo.
    pub(crate) beams: Vec<(f64, PingStatus, f64)>,
}

impl BeamReadings {
    /// Converts an array of readings with `status` and `range_m`, or an array of ranges.
    pub(crate) fn from_python(
        readings: &Bound<'_, PyAny>,
        azimuths_deg: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let numpy = readings.py().import("numpy")?;
        let array = numpy.call_method1("asarray", (readings,))?;
        let has_fields = !array.getattr("dtype")?.getattr("names")?.is_none();
        let (ranges_m, statuses) = if has_fields {
            let ranges_m = arrays::list(&array.get_item("range_m")?, "readings")?;
            let codes = arrays::list(&array.get_item("status")?, "readings")?;
            (ranges_m, codes.into_iter().map(|code| status::from_code(code as u8)).collect())
        } else {
            let ranges_m = arrays::list(&array, "readings")?;
            let statuses = ranges_m.iter().map(|range_m| status_of(*range_m)).collect();
            (ranges_m, statuses)
        };
        let statuses: Vec<Option<PingStatus>> = statuses;
        let azimuths_deg = match azimuths_deg {
            Some(given) => arrays::list(given, "azimuths_deg")?,
            None => full_turn(),
        };
        if azimuths_deg.len() != ranges_m.len() {
            return Err(PyValueError::new_err(format!(
                "{} readings, but {} azimuths_deg: the lengths must be equal",
                ranges_m.len(),
                azimuths_deg.len()
            )));
        }
        let beams = azimuths_deg.into_iter().zip(statuses).zip(ranges_m);
        let beams = beams.filter_map(|((azimuth_deg, status), range_m)| {
            let status = status?;
            let usable =
                azimuth_deg.is_finite() && (status != PingStatus::Echo || range_m.is_finite());
            usable.then_some((azimuth_deg, status, range_m))
        });
        Ok(Self { beams: beams.collect() })
    }

    /// Firings with an outcome, their times of flight by the speed of sound.
    pub(crate) fn firings(self, sound_speed_m_s: f64) -> Vec<SweepFiring> {
        let us_per_m = 2e6 / sound_speed_m_s;
        let firing = |(azimuth_deg, status, range_m)| {
            let outcome = match status {
                PingStatus::Echo => FiringOutcome::Echo { tof_us: range_m * us_per_m },
                PingStatus::NoEcho => FiringOutcome::NoEcho,
                PingStatus::MinRange => FiringOutcome::BelowMinRange,
                _ => return None,
            };
            Some(SweepFiring { azimuth_deg, outcome })
        };
        self.beams.into_iter().filter_map(firing).collect()
    }
}

/// Status of a bare range: infinite for no echo; `None` for an invalid range.
fn status_of(range_m: f64) -> Option<PingStatus> {
    if range_m == f64::INFINITY {
        return Some(PingStatus::NoEcho);
    }
    (range_m.is_finite() && range_m > 0.0).then_some(PingStatus::Echo)
}
