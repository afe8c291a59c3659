//! Readings of logs as a NumPy array.

use numpy::PyArray1;
use pyo3::prelude::*;
use sonard::scan::{Ping, PingStatus, ScanView};

use crate::{arrays, status};

/// Numbers of a logged reading, after its scan, index and statuses.
const NUMBERS: [&str; 14] = [
    "azimuth_deg",
    "x_m",
    "y_m",
    "heading_deg",
    "range_m",
    "tof_us",
    "amplitude",
    "margin_db",
    "sim_range_m",
    "sim_amplitude",
    "sim_margin_db",
    "residual_m",
    "confidence",
    "time",
];

/// Size of a logged reading in words of eight bytes.
const WORDS: usize = 2 + NUMBERS.len();

/// Status code of a missing prediction.
const NO_PREDICTION: u8 = 255;

/// NumPy dtype of a logged reading.
pub(crate) fn logged_dtype(py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
    let leading =
        [("scan", "u4", 0), ("index", "u4", 4), ("status", "u1", 8), ("sim_status", "u1", 9)];
    let format = |name| if name == "time" { "M8[ns]" } else { "f8" };
    let numbers = NUMBERS.iter().enumerate().map(|(at, name)| (*name, format(*name), 8 * (at + 2)));
    let all: Vec<(&str, &str, usize)> = leading.into_iter().chain(numbers).collect();
    arrays::dtype(py, &all, 8 * WORDS)
}

/// Converts the readings of scans, each with its index in the log.
pub(crate) fn shaped_readings<'a, 'py>(
    py: Python<'py>,
    scans: impl IntoIterator<Item = (usize, &'a ScanView)>,
) -> PyResult<Bound<'py, PyAny>> {
    let mut words = Vec::new();
    for (at, scan) in scans {
        scan.pings.iter().for_each(|ping| words.extend(encode_reading(at, scan, ping)));
    }
    PyArray1::from_vec(py, words).call_method1("view", (logged_dtype(py)?,))
}

fn encode_reading(at: usize, scan: &ScanView, ping: &Ping) -> [f64; WORDS] {
    let mut head = [0; 8];
    head[..4].copy_from_slice(&(at as u32).to_ne_bytes());
    head[4..].copy_from_slice(&ping.index.to_ne_bytes());
    let sim = ping.sim.as_ref();
    let mut statuses = [0; 8];
    statuses[0] = status::code(ping.status);
    statuses[1] = sim.map_or(NO_PREDICTION, |sim| status::code(sim.status));
    let pose = ping.pose.or_else(|| scan.pose());

    let time_ns = ping.time.and_then(|time| i64::try_from(time.as_nanosecond()).ok());
    let number = |value: Option<f64>| value.unwrap_or(f64::NAN);
    let none = missing_range(Some(ping.status));
    [
        f64::from_bits(u64::from_ne_bytes(head)),
        f64::from_bits(u64::from_ne_bytes(statuses)),
        ping.azimuth_deg,
        number(pose.map(|pose| pose.x_m)),
        number(pose.map(|pose| pose.y_m)),
        number(pose.map(|pose| pose.heading_deg)),
        ping.range_m.unwrap_or(none),
        ping.tof_us.unwrap_or(none),
        number(ping.amplitude),
        number(ping.margin_db),
        sim.and_then(|sim| sim.range_m).unwrap_or(missing_range(sim.map(|sim| sim.status))),
        number(sim.and_then(|sim| sim.amplitude)),
        number(sim.and_then(|sim| sim.margin_db)),
        number(ping.residual_m),
        number(ping.confidence),
        // NumPy uses the smallest integer for a missing time.
        f64::from_bits(time_ns.unwrap_or(i64::MIN).cast_unsigned()),
    ]
}

/// Value of a missing range: infinite without an echo, else not a number.
const fn missing_range(status: Option<PingStatus>) -> f64 {
    match status {
        Some(PingStatus::NoEcho) => f64::INFINITY,
        _ => f64::NAN,
    }
}
