//! How the scan under way agrees with its prediction.

use std::{collections::BTreeMap, sync::Arc};

use sonard_api::ScanFit;
use sonard_interpret::compare::{Explanation, agrees, compare, judge, quantile};
use sonard_records::{Ping, ScanEnd, ScanStart, ScanView, Session};

/// Readings of the longest scan of which it is told what would explain it better. They wait in memory until the scan
/// ends, about a kilobyte each.
const MOST_READINGS: usize = 4096;
/// So many changes are told.
const MOST_EXPLANATIONS: usize = 6;

/// What is gathered of the scan under way.
#[derive(Debug, Default)]
pub(super) struct Fit {
    /// Residuals of the beams with an echo on both sides, metres, and whether the ranges agree. A plan's beams are at
    /// most 65,535, and a beam that is measured again counts once.
    residuals: BTreeMap<u32, (f64, bool)>,
    /// The scan with its readings; `None` once they are too many.
    scan: Option<ScanView>,
}

impl Fit {
    pub(super) fn of(start: &ScanStart, session: Option<Arc<Session>>) -> Self {
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
        let judged = judge(ping);
        let predicted_m = ping.sim.as_ref().and_then(|sim| sim.range_m);
        let residual_m = judged.residual_m.filter(|_| judged.verdict.is_ok());
        match residual_m.zip(ping.range_m.zip(predicted_m)) {
            Some((residual_m, (measured_m, predicted_m))) => {
                let agrees = agrees(measured_m, predicted_m);
                self.residuals.insert(ping.index, (residual_m, agrees));
            }
            None => {
                self.residuals.remove(&ping.index);
            }
        }
        self.scan = self.scan.take().filter(|scan| scan.pings.len() < MOST_READINGS);
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

    /// The scan, if its readings were few enough to be kept.
    pub(super) fn into_scan(self) -> Option<ScanView> {
        self.scan
    }
}

/// What would explain a scan better, most gain first. Takes milliseconds.
pub(super) fn explanations(scan: ScanView) -> Vec<Explanation> {
    let mut found = compare(&[scan]).0.explanations;
    found.truncate(MOST_EXPLANATIONS);
    found
}

/// What to say of the best explanation beside the one that was told last; nothing of much the same.
pub(super) fn news(told: Option<&Explanation>, best: Option<&Explanation>) -> Option<String> {
    match (told, best) {
        (Some(told), Some(best)) if is_much_the_same(told, best) => None,
        (_, Some(best)) => Some(format!("better explained: {best}")),
        (Some(told), None) => Some(format!("no longer better explained: {}", told.change)),
        (None, None) => None,
    }
}

fn is_much_the_same(told: &Explanation, best: &Explanation) -> bool {
    const SIGMAS: f64 = 3.0;
    told.change == best.change
        && told.estimates.iter().zip(&best.estimates).all(|(one, other)| {
            (one.value - other.value).abs() <= SIGMAS * one.sigma.hypot(other.sigma)
        })
}

#[cfg(test)]
mod tests {
    use super::*;
    use sonard_records::{Record, decode_line};

    #[test]
    fn it_says_what_a_comparison_of_the_scan_does() {
        let log = include_str!("../../../tests/fixtures/small.jsonl");
        let records = || log.lines().map(|line| decode_line(line.as_bytes()).expect("a record"));
        let mut fit = Fit::default();
        let mut report = None;
        // Each reading twice: the second is the one that counts.
        for record in records() {
            match record {
                Record::Ping(ping) => {
                    let mut other = ping.clone();
                    (other.range_m, other.residual_m) = (Some(9.0), Some(5.0));
                    fit.add(&other);
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
            Fit::default().report(scans[0].end.as_ref().expect("an end")).agree_fraction,
            None
        );
    }
}
