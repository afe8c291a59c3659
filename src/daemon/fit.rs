//! How the scan under way agrees with its prediction.

use std::collections::BTreeMap;

use crate::{
    api::ScanFit,
    compare::{agrees, judge, quantile},
    scan::{Ping, ScanEnd},
};

/// Residuals of the beams with an echo on both sides, metres, and whether the ranges agree. A plan's beams are at
/// most 65,535, and a beam that is measured again counts once.
#[derive(Debug, Default)]
pub(super) struct Fit(BTreeMap<u32, (f64, bool)>);

impl Fit {
    pub(super) fn add(&mut self, ping: &Ping) {
        let judged = judge(ping);
        let predicted_m = ping.sim.as_ref().and_then(|sim| sim.range_m);
        let residual_m = judged.residual_m.filter(|_| judged.verdict.is_ok());
        match residual_m.zip(ping.range_m.zip(predicted_m)) {
            Some((residual_m, (measured_m, predicted_m))) => {
                self.0.insert(ping.index, (residual_m, agrees(measured_m, predicted_m)));
            }
            None => {
                self.0.remove(&ping.index);
            }
        }
    }

    pub(super) fn report(&self, end: &ScanEnd) -> ScanFit {
        let agree = self.0.values().filter(|(_, agrees)| *agrees).count();
        let residuals = || self.0.values().map(|(residual_m, _)| *residual_m);
        ScanFit {
            scan: end.scan,
            ended: end.time,
            both_echo: self.0.len() as u32,
            agree_fraction: (!self.0.is_empty()).then(|| agree as f64 / self.0.len() as f64),
            median_abs_residual_m: quantile(residuals().map(f64::abs).collect(), 0.5),
            median_residual_m: quantile(residuals().collect(), 0.5),
            missing: end.missing,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        compare::compare,
        scan::{Record, ScanView, decode_line},
    };

    #[test]
    fn it_says_what_a_comparison_of_the_scan_does() {
        let log = include_str!("../../tests/fixtures/small.jsonl");
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
