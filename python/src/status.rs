//! Conversion of the status of a firing.

use pyo3::prelude::*;
use sonard_model::reading::PingStatus;

/// Code of a status: the values of `Status` in `package/sonard/_status.py`.
pub(crate) const fn code(status: PingStatus) -> u8 {
    match status {
        PingStatus::Echo => 0,
        PingStatus::NoEcho => 1,
        PingStatus::MinRange => 2,
        PingStatus::LinkLost => 3,
        PingStatus::StepUncertain => 4,
        PingStatus::ModuleFault => 5,
    }
}

/// Converts a status to a member of `Status`.
pub(crate) fn member<'py>(py: Python<'py>, status: PingStatus) -> PyResult<Bound<'py, PyAny>> {
    py.import("sonard._status")?.getattr("Status")?.call1((code(status),))
}

/// Returns the status with the given code, if there is one.
pub(crate) fn from_code(number: u8) -> Option<PingStatus> {
    use PingStatus::{Echo, LinkLost, MinRange, ModuleFault, NoEcho, StepUncertain};
    let all = [Echo, NoEcho, MinRange, LinkLost, StepUncertain, ModuleFault];
    all.into_iter().find(|status| code(*status) == number)
}
