//! What became of a firing, as a number.

use pyo3::prelude::*;
use sonard_model::reading::PingStatus;

/// The number of a status: the values of `Status` in `package/sonard/_status.py`.
pub(crate) const fn code(status: PingStatus) -> u8 {
    match status {
        PingStatus::Echo => 0,
        PingStatus::NoEcho => 1,
        PingStatus::MinRange => 2,
        PingStatus::LinkLost => 3,
        PingStatus::StepDoubtful => 4,
        PingStatus::ModuleFault => 5,
    }
}

/// The same as a member of `Status`.
pub(crate) fn member<'py>(py: Python<'py>, status: PingStatus) -> PyResult<Bound<'py, PyAny>> {
    py.import("sonard._status")?.getattr("Status")?.call1((code(status),))
}

/// The status of a number, if it is of one.
pub(crate) fn of_code(number: u8) -> Option<PingStatus> {
    use PingStatus::{Echo, LinkLost, MinRange, ModuleFault, NoEcho, StepDoubtful};
    let all = [Echo, NoEcho, MinRange, LinkLost, StepDoubtful, ModuleFault];
    all.into_iter().find(|status| code(*status) == number)
}
