//! Agreement of the running scan with its prediction, and hypotheses that fit better.

use std::{collections::BTreeMap, sync::Arc};

use sonard_api::ScanFit;
use sonard_interpret::compare::{Explanation, agrees, classify, compare, quantile};
use sonard_records::{Ping, ScanEnd, ScanStart, ScanView, Session};

/// Maximum number of readings of a scan that is explained. They are kept in memory until the scan
/// ends, about a kilobyte each.
const MAX_READINGS: usize = 4096;
/// Minimum number of residuals of a scan that is explained: a few readings fit many hypotheses.
const MIN_RESIDUALS: usize = 30;
/// Maximum number of explanations reported for a scan.
const MAX_EXPLANATIONS: usize = 6;

/// Accumulated residuals and readings of the running scan.
#[derive(Debug, Default)]
pub(super) struct FitAccumulator {
    /// Residuals in metres of the beams with both a measured and a predicted echo, by beam index,
    /// and whether the ranges agree. A plan has at most 65,535 beams; a repeated beam counts once.
    residuals: BTreeMap<u32, (f64, bool)>,
    /// Scan with its readings; `None` once they exceed `MAX_READINGS`.
    scan: Option<ScanView>,
}

impl FitAccumulator {
    pub(super) fn new(start: &ScanStart, session: Option<Arc<Session>>) -> Self {
        let (pings, events) = (Vec::new(), Vec::new());
        let scan = ScanView {
            scan: start.scan,
            session,
            start: Some(start.clone()),
            pings,
            events,
            end: None,
        };
        Self { residuals: BTreeMap::new(), scan: Some(scan) }
    }

    pub(super) fn add(&mut self, ping: &Ping) {
        let comparison = classify(ping);
        let predicted_m = ping.sim.as_ref().and_then(|sim| sim.range_m);
        let residual_m = comparison.residual_m.filter(|_| comparison.verdict.is_ok());
        match residual_m.zip(ping.range_m.zip(predicted_m)) {
            Some((residual_m, (measured_m, predicted_m))) => {
                let agrees = agrees(measured_m, predicted_m);
                self.residuals.insert(ping.index, (residual_m, agrees));
            }
            None => {
                self.residuals.remove(&ping.index);
            }
        }
        self.scan = self.scan.take().filter(|scan| scan.pings.len() < MAX_READINGS);
        if let Some(scan) = &mut self.scan {
            scan.pings.push(ping.clone());
        }
    }

    pub(super) fn report(&self, end: &ScanEnd) -> ScanFit {
        let agree = self.residuals.values().filter(|(_, agrees)| *agrees).count();
        let both_echo = self.residuals.len();
        let residuals = || self.residuals.values().map(|(residual_m, _)| *residual_m);
        ScanFit {
            scan: end.scan,
            ended: end.time,
            both_echo: both_echo as u32,
            agree_fraction: (both_echo > 0).then(|| agree as f64 / both_echo as f64),
            median_abs_residual_m: quantile(residuals().map(f64::abs).collect(), 0.5),
            median_residual_m: quantile(residuals().collect(), 0.5),
            missing: end.missing,
            explanations: Vec::new(),
        }
    }

    /// Returns the scan, unless it had more than `MAX_READINGS` readings.
    pub(super) fn into_scan(self) -> Option<ScanView> {
        self.scan
    }
}

/// Finds hypotheses that fit a scan better than its settings, by decreasing gain. Takes
/// milliseconds. A scan with fewer than `MIN_RESIDUALS` has none.
pub(super) fn explanations(scan: ScanView) -> Vec<Explanation> {
    let residuals = scan.pings.iter().filter(|ping| classify(ping).residual_m.is_some()).count();
    if residuals < MIN_RESIDUALS {
        return Vec::new();
    }
    let mut found = compare(&[scan]).0.explanations;
    found.truncate(MAX_EXPLANATIONS);
    found
}

/// Describes the change from the last published explanation to the best one. Returns `None` if they
/// are equal within their uncertainty.
pub(super) fn describe_change(
    published: Option<&Explanation>,
    best: Option<&Explanation>,
) -> Option<String> {
    match (published, best) {
        (Some(published), Some(best)) if is_similar(published, best) => None,
        (_, Some(best)) => Some(format!("better explained: {best}")),
        (Some(published), None) => {
            Some(format!("no longer better explained: {}", published.change))
        }
        (None, None) => None,
    }
}

fn is_similar(a: &Explanation, b: &Explanation) -> bool {
    const SIGMAS: f64 = 3.0;
    a.change == b.change
        && a.estimates
            .iter()
            .zip(&b.estimates)
            .all(|(a, b)| (a.value - b.value).abs() <= SIGMAS * a.sigma.hypot(b.sigma))
}

#[cfg(test)]
mod tests {
    use super::*;
    use sonard_records::{Record, decode_line};

    #[test]
    fn report_equals_the_comparison() {
        let log = include_str!("../../../tests/fixtures/small.jsonl");
        let records = || log.lines().map(|line| decode_line(line.as_bytes()).expect("a record"));
        let mut fit = FitAccumulator::default();
        let mut report = None;
        // Each beam is measured twice; the second reading counts.
        for record in records() {
            match record {
                Record::Ping(ping) => {
                    let mut first = ping.clone();
                    (first.range_m, first.residual_m) = (Some(9.0), Some(5.0));
                    fit.add(&first);
                    fit.add(&ping);
                }
                Record::ScanEnd(end) => report = Some(fit.report(&end)),
                _ => {}
            }
        }
        let report = report.expect("a whole scan");
        let scans = ScanView::from_records(records());
        let (comparison, _) = compare(&scans);
        assert!(comparison.both_echo > 0);
        assert_eq!(report.both_echo, comparison.both_echo);
        assert_eq!(report.agree_fraction, comparison.agree_fraction);
        assert_eq!(report.median_abs_residual_m, comparison.median_abs_residual_m);
        assert_eq!(report.median_residual_m, comparison.median_residual_m);
        assert_eq!(
            FitAccumulator::default().report(scans[0].end.as_ref().expect("an end")).agree_fraction,
            None
        );
    }
}
