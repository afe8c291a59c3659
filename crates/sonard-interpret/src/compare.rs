//! Comparison of measured readings with predictions: residuals and verdicts.
//!
//! [`classify`] classifies one reading against its prediction; [`compare`] does so for whole scans
//! and counts. The counts are defined so that they add up:
//!
//! - Every beam is either *compared* (`beams`) or not (`not_compared`): its reading was lost on
//!   the serial link, the motor position is uncertain, there is no prediction, or a range is
//!   missing although the status implies one. A beam logged twice counts once, with the last
//!   reading that was received.
//! - Measurement and prediction each report *no echo* (`no_echo`), a target below the minimum
//!   range (`min_range`) or an *echo*. So `beams` = `both_echo` + `measured_only` +
//!   `simulated_only` + `both_silent` + `near`. `measured_only` and `simulated_only` count beams
//!   without an echo in the other; `near` counts beams detected by both, at least one of them
//!   below the minimum range.
//! - Two ranges *agree* when they differ by at most 1 % of the measured range or 10 mm,
//!   whichever is larger: the module is specified to 1 % of the reading, and 10 mm is about
//!   the spread of the threshold crossing within one pulse.
//! - Every compared beam has one [`Verdict`], so the verdicts add up to `beams`; `agree` counts
//!   pairs of `both_echo` only, and the residual statistics are taken over those pairs.

mod annotations;
mod explain;
mod statistics;

use std::collections::{HashMap, HashSet};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use sonard_model::geometry::Pose;
use sonard_records::{PathKind, Ping, PingStatus, ScanView, SimRecord};

pub use annotations::{AnnotatedPing, Annotations, Classification};
pub use explain::{ChangeEstimate, ChangedQuantity, Explanation};
pub use statistics::{keep_every_second, quantile};

/// Absolute tolerance within which two ranges agree, metres.
pub const AGREE_WITHIN_M: f64 = 0.010;
/// Relative tolerance within which two ranges agree, as a fraction of the measured range.
pub const AGREE_WITHIN_SHARE: f64 = 0.01;

/// Classification of a compared reading.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Echoes agree; the predicted path has at most one reflection, or no listed interactions.
    Direct,
    /// Echoes agree; the predicted path has two or more reflections.
    Multiple,
    /// Echoes agree; the predicted path is diffracted at an edge.
    Edge,
    /// Both are at minimum range, or one is and the ranges agree.
    MinRange,
    /// Neither measurement nor prediction has an echo.
    NoEcho,
    /// Disagreement: an echo in only one of the two, different ranges, or equal ranges without a
    /// predicted path.
    Unexplained,
}

/// Reason why a reading can't be compared with a prediction.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum NotCompared {
    /// Reading lost on the serial link.
    LinkLost,
    /// Uncertain motor position: the motor or the model may be off the logged step.
    StepUncertain,
    /// Ranging module failed to fire.
    ModuleFault,
    /// No prediction logged for the reading.
    NoPrediction,
    /// Echo without a finite range, measured or predicted.
    NoRange,
}

/// Reading classified against its prediction.
#[derive(Debug, Clone, PartialEq)]
pub struct ClassifiedPing<'a> {
    /// Reading with its prediction.
    pub ping: &'a Ping,
    /// Classification, or the reason why the reading can't be compared.
    pub verdict: Result<Verdict, NotCompared>,
    /// Measured minus predicted range if both have an echo, metres.
    pub residual_m: Option<f64>,
}

/// Counts and residual statistics of a comparison, as defined in the module documentation.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Comparison {
    /// Beams compared.
    pub beams: u32,
    /// Beams with an echo in both measurement and prediction.
    pub both_echo: u32,
    /// Beams of `both_echo` whose ranges agree.
    pub agree: u32,
    /// `agree / both_echo`; `null` without a pair.
    pub agree_fraction: Option<f64>,
    /// Median absolute residual over `both_echo`, metres.
    pub median_abs_residual_m: Option<f64>,
    /// 90th percentile of the absolute residual over `both_echo`, metres.
    pub p90_abs_residual_m: Option<f64>,
    /// Median of measured minus predicted range (bias), metres.
    pub median_residual_m: Option<f64>,
    /// Beams detected by the ranger and without an echo in the model.
    pub measured_only: u32,
    /// Beams with an echo in the model and none measured.
    pub simulated_only: u32,
    /// Beams detected by both, at least one of them below the minimum range.
    pub min_range: u32,
    /// Beams without an echo in both.
    pub both_no_echo: u32,
    /// Beams by verdict.
    pub verdicts: VerdictCounts,
    /// Median absolute residual over `both_echo` by verdict, metres.
    pub median_abs_residual_by_verdict_m: MedianByVerdict,
    /// Beams that could not be compared, by reason.
    pub not_compared: NotComparedCounts,
    /// Readings superseded by a later reading of the same beam.
    pub duplicates: u32,
    /// Number of scans compared.
    pub scans: u32,
    /// Number of distinct poses; the statistics pool all of them.
    pub poses: u32,
    /// Single changes of the model that would fit the readings better, largest gain first.
    pub explanations: Vec<Explanation>,
}

/// Number of beams with each verdict.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct VerdictCounts {
    /// Beams classified as [`Verdict::Direct`].
    pub direct: u32,
    /// Beams classified as [`Verdict::Multiple`].
    pub multiple: u32,
    /// Beams classified as [`Verdict::Edge`].
    pub edge: u32,
    /// Beams classified as [`Verdict::MinRange`].
    pub min_range: u32,
    /// Beams classified as [`Verdict::NoEcho`].
    pub silent: u32,
    /// Beams classified as [`Verdict::Unexplained`].
    pub unexplained: u32,
}

/// Statistic for each verdict that a pair of echoes can have; `null` without a pair.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct MedianByVerdict {
    /// Value over pairs with [`Verdict::Direct`].
    pub direct: Option<f64>,
    /// Value over pairs with [`Verdict::Multiple`].
    pub multiple: Option<f64>,
    /// Value over pairs with [`Verdict::Edge`].
    pub edge: Option<f64>,
    /// Value over pairs with [`Verdict::Unexplained`].
    pub unexplained: Option<f64>,
}

/// Beams that could not be compared, by reason.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct NotComparedCounts {
    /// Beams excluded by [`NotCompared::LinkLost`].
    pub link_lost: u32,
    /// Beams excluded by [`NotCompared::StepUncertain`].
    pub step_uncertain: u32,
    /// Beams excluded by [`NotCompared::ModuleFault`].
    pub module_fault: u32,
    /// Beams excluded by [`NotCompared::NoPrediction`].
    pub no_prediction: u32,
    /// Beams excluded by [`NotCompared::NoRange`].
    pub no_range: u32,
}

impl NotComparedCounts {
    /// Sum over all reasons.
    #[must_use]
    pub fn total(&self) -> u32 {
        self.link_lost
            + self.step_uncertain
            + self.module_fault
            + self.no_prediction
            + self.no_range
    }
}

/// Compares every beam of the scans and returns the statistics with the classified beams.
#[must_use]
pub fn compare(scans: &[ScanView]) -> (Comparison, Vec<ClassifiedPing<'_>>) {
    let mut comparer = Comparer::default();
    let classified = scans.iter().flat_map(|scan| comparer.add(scan)).collect();
    (comparer.finish(), classified)
}

/// Incremental comparison, for logs too long to be held in memory: 16 bytes per pair of echoes.
#[derive(Debug, Default)]
pub struct Comparer {
    comparison: Comparison,
    residuals_m: Vec<(Verdict, f64)>,
    poses: HashSet<[u64; 3]>,
    explainer: explain::Explainer,
}

impl Comparer {
    /// Compares a scan and returns its classified beams.
    pub fn add<'a>(&mut self, scan: &'a ScanView) -> Vec<ClassifiedPing<'a>> {
        let beams = last_readings(&scan.pings);
        self.comparison.scans += 1;
        self.comparison.duplicates += (scan.pings.len() - beams.len()) as u32;
        let bits = |pose: Pose| [pose.x_m, pose.y_m, pose.heading_deg].map(f64::to_bits);
        self.poses.extend(scan.pose().map(bits));
        let classified: Vec<ClassifiedPing<'a>> = beams.into_iter().map(classify).collect();
        for beam in &classified {
            self.comparison.count(beam);
            let residual_m = beam.verdict.ok().zip(beam.residual_m);
            self.residuals_m.extend(residual_m);
        }
        self.explainer.add(scan, &classified);
        classified
    }

    /// Returns the statistics over all scans.
    #[must_use]
    pub fn finish(self) -> Comparison {
        let mut comparison = self.comparison;
        comparison.poses = self.poses.len() as u32;
        comparison.set_statistics(&self.residuals_m);
        comparison.explanations = self.explainer.finish();
        comparison
    }
}

/// Classifies one reading against its prediction.
#[must_use]
pub fn classify(ping: &Ping) -> ClassifiedPing<'_> {
    let detections = detection(ping.status, ping.range_m).and_then(|measured| {
        let sim = ping.sim.as_ref().ok_or(NotCompared::NoPrediction)?;
        Ok((measured, detection(sim.status, sim.range_m)?, sim))
    });
    let (verdict, residual_m) = match detections {
        Ok((measured, simulated, sim)) => {
            let residual_m = match (measured, simulated) {
                (Detection::Echo(measured_m), Detection::Echo(sim_m)) => Some(measured_m - sim_m),
                _ => None,
            };
            (Ok(classify_pair(measured, simulated, sim)), residual_m)
        }
        Err(reason) => (Err(reason), None),
    };
    ClassifiedPing { ping, verdict, residual_m }
}

/// Returns `true` if a measured and a predicted range, in metres, agree within the tolerances.
#[must_use]
pub fn agrees(measured_m: f64, predicted_m: f64) -> bool {
    let tolerance_m = AGREE_WITHIN_M.max(AGREE_WITHIN_SHARE * measured_m);
    // A difference of exactly the tolerance must not fail by rounding.
    (measured_m - predicted_m).abs() <= tolerance_m + 1e-9
}

/// Detection reported by either measurement or prediction.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Detection {
    NoEcho,
    /// Target below the minimum range, with a range in metres if the source reports one.
    MinRange(Option<f64>),
    Echo(f64),
}

fn detection(status: PingStatus, range_m: Option<f64>) -> Result<Detection, NotCompared> {
    let range_m = range_m.filter(|range_m| range_m.is_finite());
    match status {
        PingStatus::NoEcho => Ok(Detection::NoEcho),
        PingStatus::MinRange => Ok(Detection::MinRange(range_m)),
        PingStatus::Echo => range_m.map(Detection::Echo).ok_or(NotCompared::NoRange),
        PingStatus::LinkLost => Err(NotCompared::LinkLost),
        PingStatus::StepUncertain => Err(NotCompared::StepUncertain),
        PingStatus::ModuleFault => Err(NotCompared::ModuleFault),
    }
}

fn classify_pair(measured: Detection, simulated: Detection, sim: &SimRecord) -> Verdict {
    match (measured, simulated) {
        (Detection::NoEcho, Detection::NoEcho) => Verdict::NoEcho,
        (Detection::MinRange(_), Detection::MinRange(_)) => Verdict::MinRange,
        (Detection::MinRange(Some(a)), Detection::Echo(b))
        | (Detection::Echo(a), Detection::MinRange(Some(b)))
            if agrees(a, b) =>
        {
            Verdict::MinRange
        }
        (Detection::Echo(measured_m), Detection::Echo(sim_m)) if agrees(measured_m, sim_m) => {
            match &sim.path {
                Some(path) if path.kind == PathKind::Diffracted => Verdict::Edge,
                Some(path) if path.order >= 2 => Verdict::Multiple,
                Some(_) => Verdict::Direct,
                None => Verdict::Unexplained,
            }
        }
        _ => Verdict::Unexplained,
    }
}

/// Last received reading of each beam, else its last one, in order of first appearance.
fn last_readings(pings: &[Ping]) -> Vec<&Ping> {
    let mut position: HashMap<u32, usize> = HashMap::new();
    let mut beams: Vec<&Ping> = Vec::with_capacity(pings.len());
    for ping in pings {
        match position.get(&ping.index) {
            None => {
                position.insert(ping.index, beams.len());
                beams.push(ping);
            }
            Some(&at) => {
                let lost = |ping: &Ping| ping.status == PingStatus::LinkLost;
                if !lost(ping) || lost(beams[at]) {
                    beams[at] = ping;
                }
            }
        }
    }
    beams
}

impl Comparison {
    fn count(&mut self, beam: &ClassifiedPing<'_>) {
        let verdict = match beam.verdict {
            Ok(verdict) => verdict,
            Err(reason) => return *self.not_compared.counter_mut(reason) += 1,
        };
        self.beams += 1;
        *self.verdicts.counter_mut(verdict) += 1;
        let measured = beam.ping.status;
        let simulated = beam.ping.sim.as_ref().map_or(PingStatus::NoEcho, |sim| sim.status);
        *match (measured, simulated) {
            (PingStatus::Echo, PingStatus::Echo) => &mut self.both_echo,
            (PingStatus::NoEcho, PingStatus::NoEcho) => &mut self.both_no_echo,
            (_, PingStatus::NoEcho) => &mut self.measured_only,
            (PingStatus::NoEcho, _) => &mut self.simulated_only,
            _ => &mut self.min_range,
        } += 1;
        let agree = beam.ping.range_m.zip(beam.residual_m);
        self.agree += u32::from(agree.is_some_and(|(range_m, m)| agrees(range_m, range_m - m)));
    }

    fn set_statistics(&mut self, residuals_m: &[(Verdict, f64)]) {
        let residuals = |filter: Option<Verdict>, transform: fn(f64) -> f64| -> Vec<f64> {
            residuals_m
                .iter()
                .filter(|(verdict, _)| filter.is_none_or(|filter| *verdict == filter))
                .map(|(_, residual_m)| transform(*residual_m))
                .collect()
        };
        let median_of = |verdict| quantile(residuals(Some(verdict), f64::abs), 0.5);
        if self.both_echo > 0 {
            self.agree_fraction = Some(f64::from(self.agree) / f64::from(self.both_echo));
        }
        self.median_abs_residual_m = quantile(residuals(None, f64::abs), 0.5);
        self.p90_abs_residual_m = quantile(residuals(None, f64::abs), 0.9);
        self.median_residual_m = quantile(residuals(None, |m| m), 0.5);
        self.median_abs_residual_by_verdict_m = MedianByVerdict {
            direct: median_of(Verdict::Direct),
            multiple: median_of(Verdict::Multiple),
            edge: median_of(Verdict::Edge),
            unexplained: median_of(Verdict::Unexplained),
        };
    }
}

impl VerdictCounts {
    fn counter_mut(&mut self, verdict: Verdict) -> &mut u32 {
        match verdict {
            Verdict::Direct => &mut self.direct,
            Verdict::Multiple => &mut self.multiple,
            Verdict::Edge => &mut self.edge,
            Verdict::MinRange => &mut self.min_range,
            Verdict::NoEcho => &mut self.silent,
            Verdict::Unexplained => &mut self.unexplained,
        }
    }
}

impl NotComparedCounts {
    fn counter_mut(&mut self, reason: NotCompared) -> &mut u32 {
        match reason {
            NotCompared::LinkLost => &mut self.link_lost,
            NotCompared::StepUncertain => &mut self.step_uncertain,
            NotCompared::ModuleFault => &mut self.module_fault,
            NotCompared::NoPrediction => &mut self.no_prediction,
            NotCompared::NoRange => &mut self.no_range,
        }
    }
}

#[cfg(test)]
mod tests;
