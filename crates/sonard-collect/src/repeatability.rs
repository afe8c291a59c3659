//! Repeatability of scans at one pose. Pure.

use std::collections::BTreeMap;

use serde::Serialize;
use sonard_interpret::compare::quantile;
use sonard_records::{PingStatus, ScanView};

/// Repeatability of the scans at a pose, evaluated per beam.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Repeatability {
    /// Number of scans.
    pub scans: u32,
    /// Beams with an echo in every scan.
    pub steady: u32,
    /// Beams with an echo in some scans only.
    pub unsteady: u32,
    /// Median over the steady beams of the standard deviation of range, metres.
    pub median_spread_m: Option<f64>,
    /// 90th percentile over the steady beams of the standard deviation of range, metres.
    pub p90_spread_m: Option<f64>,
}

/// Spread of the ranges of one beam.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BeamSpread {
    /// Azimuth, degrees.
    pub azimuth_deg: f64,
    /// Standard deviation of the ranges (divisor n - 1), metres.
    pub spread_m: f64,
}

/// Computes the repeatability of scans with the same plan and pose.
///
/// The ranges of a beam are those of its echoes. Several pings at one step are separate beams.
#[must_use]
pub fn repeatability(scans: &[ScanView]) -> (Repeatability, Vec<BeamSpread>) {
    let mut beams: BTreeMap<u32, (f64, Vec<f64>)> = BTreeMap::new();
    for ping in scans.iter().flat_map(|scan| &scan.pings) {
        let beam = beams.entry(ping.index).or_insert((ping.azimuth_deg, Vec::new()));
        if ping.status == PingStatus::Echo {
            beam.1.extend(ping.range_m);
        }
    }
    let mut result = Repeatability { scans: scans.len() as u32, ..Repeatability::default() };
    let mut spreads = Vec::new();
    for (azimuth_deg, ranges) in beams.into_values() {
        if ranges.len() == scans.len() {
            result.steady += 1;
            spreads.extend(deviation(&ranges).map(|spread_m| BeamSpread { azimuth_deg, spread_m }));
        } else if !ranges.is_empty() {
            result.unsteady += 1;
        }
    }
    let all = || spreads.iter().map(|beam| beam.spread_m).collect();
    result.median_spread_m = quantile(all(), 0.5);
    result.p90_spread_m = quantile(all(), 0.9);
    (result, spreads)
}

/// Standard deviation of a sample; `None` for fewer than two values.
fn deviation(values: &[f64]) -> Option<f64> {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let square: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (values.len() > 1).then(|| (square / (n - 1.0)).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use sonard_records::decode_line;

    /// Scan from the fixture with the given ranges per beam; `None` is a missing echo.
    fn scan(ranges_m: &[Option<f64>]) -> ScanView {
        let log = include_str!("../../../tests/fixtures/small.jsonl");
        let records = log.lines().take(3).map(|line| decode_line(line.as_bytes()).expect("clean"));
        let mut view = ScanView::from_records(records).remove(0);
        let ping = view.pings.remove(0);
        view.pings = (0..)
            .zip(ranges_m)
            .map(|(index, &range_m)| {
                let status = if range_m.is_some() { PingStatus::Echo } else { PingStatus::NoEcho };
                sonard_records::Ping { index, range_m, status, ..ping.clone() }
            })
            .collect();
        view
    }

    #[test]
    fn standard_deviation() {
        let scans = [
            scan(&[Some(1.000), Some(2.0), None, None]),
            scan(&[Some(1.002), Some(2.0), Some(3.0), None]),
            scan(&[Some(1.004), Some(2.0), Some(3.0), None]),
        ];
        let (result, beams) = repeatability(&scans);
        assert_eq!((result.scans, result.steady, result.unsteady), (3, 2, 1));
        assert!((beams[0].spread_m - 0.002).abs() < 1e-12, "{beams:?}");
        assert!(beams[1].spread_m.abs() < 1e-12);
        assert!((result.median_spread_m.expect("two beams") - 0.001).abs() < 1e-12);
    }

    #[test]
    fn one_scan_has_no_spread() {
        let (result, beams) = repeatability(&[scan(&[Some(1.0)])]);
        assert_eq!((result.steady, result.median_spread_m, beams.len()), (1, None, 0));
    }
}
