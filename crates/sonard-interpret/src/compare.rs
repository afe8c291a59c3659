//! Measured against predicted: residuals and verdicts.
//!
//! [`judge`] sets one reading beside its prediction; [`compare`] does so for whole scans and
//! counts. What each count means, so that they add up:
//!
//! - Every beam is either *compared* (`beams`) or not (`not_compared`): its reading was lost on
//!   the line, the motor's position is in doubt, there is no prediction, or a range is missing
//!   where the status says there is one. A beam logged twice counts once, with its last reading
//!   that came through.
//! - A side is *silent* (`no_echo`), *near* (`min_range`: something is closer than can be
//!   measured) or has an *echo*. So `beams` = `both_echo` + `measured_only` + `simulated_only` +
//!   `both_silent` + `near`, where `measured_only` and `simulated_only` count beams that are
//!   silent on the other side, and `near` those heard on both sides with at least one of them
//!   near.
//! - Two ranges *agree* when they differ by at most 1 % of the measured range or 10 mm,
//!   whichever is more: the module's stated accuracy is 1 % of the reading, and 10 mm is about
//!   the spread of the threshold's crossing within one pulse.
//! - Every compared beam has one [`Verdict`], so the verdicts add up to `beams`; `agree` counts
//!   pairs of `both_echo` only, and the residual statistics are taken over those pairs.

mod beside;
mod explain;
mod statistics;

use std::collections::{HashMap, HashSet};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use sonard_model::geometry::Pose;
use sonard_records::{PathKind, Ping, PingStatus, ScanView, SimRecord};

pub use beside::{Beside, JudgedPing, Word};
pub use explain::{Estimate, Explanation, Quantity};
pub use statistics::{keep_every_second, quantile};

/// Least tolerance within which two ranges agree, metres.
pub const AGREE_WITHIN_M: f64 = 0.010;
/// The same as a share of the measured range.
pub const AGREE_WITHIN_SHARE: f64 = 0.01;

/// What explains a reading.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Echoes agree; the sound met one reflector, or none on a path given without them.
    Direct,
    /// Echoes agree; the sound was mirrored twice or more.
    Multiple,
    /// Echoes agree; the sound was diffracted at an edge.
    Edge,
    /// At least one side is near, and the ranges agree; or both are near.
    MinRange,
    /// Both sides are silent.
    Silent,
    /// One side is silent and the other not, the ranges disagree, or they agree but the
    /// prediction has no path that would explain why.
    Unexplained,
}

/// Why a reading can't be set beside a prediction.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum NotCompared {
    /// The reading never arrived.
    LinkLost,
    /// The motor, or the model's idea of it, may not have been where the step says.
    StepDoubtful,
    /// The module could not be fired.
    ModuleFault,
    /// The log holds no prediction for it.
    NoPrediction,
    /// An echo without a finite range on one of the sides.
    NoRange,
}

/// A reading set beside its prediction.
#[derive(Debug, Clone, PartialEq)]
pub struct Judged<'a> {
    /// The reading, with its prediction.
    pub ping: &'a Ping,
    /// What explains it, or why it can't be compared.
    pub verdict: Result<Verdict, NotCompared>,
    /// Measured minus predicted range where both sides have an echo, metres.
    pub residual_m: Option<f64>,
}

/// A comparison in numbers; the module says what each means.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Comparison {
    /// Beams compared.
    pub beams: u32,
    /// Beams with an echo on both sides.
    pub both_echo: u32,
    /// Those of `both_echo` whose ranges agree.
    pub agree: u32,
    /// `agree / both_echo`; `null` without a pair.
    pub agree_fraction: Option<f64>,
    /// Median distance between the ranges of `both_echo`, metres.
    pub median_abs_residual_m: Option<f64>,
    /// Distance that nine tenths of `both_echo` don't exceed, metres.
    pub p90_abs_residual_m: Option<f64>,
    /// Median of measured minus predicted range: the bias, metres.
    pub median_residual_m: Option<f64>,
    /// Beams heard by the ranger and silent in the model.
    pub measured_only: u32,
    /// Beams heard in the model and not by the ranger.
    pub simulated_only: u32,
    /// Beams heard on both sides, near on at least one.
    pub near: u32,
    /// Beams silent on both sides.
    pub both_silent: u32,
    /// Beams by verdict.
    pub verdicts: Counts,
    /// Median distance between the ranges of `both_echo` by verdict, metres.
    pub median_abs_residual_by_verdict_m: ByVerdict,
    /// Beams that could not be compared, by reason.
    pub not_compared: NotComparedCounts,
    /// Readings passed over because their beam has a later one.
    pub duplicates: u32,
    /// Scans looked at.
    pub scans: u32,
    /// Poses that they were taken at; figures are of all together.
    pub poses: u32,
    /// What would explain the readings better, each by itself, most gain first.
    pub explanations: Vec<Explanation>,
}

/// Beams by verdict.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// [`Verdict::Direct`].
    pub direct: u32,
    /// [`Verdict::Multiple`].
    pub multiple: u32,
    /// [`Verdict::Edge`].
    pub edge: u32,
    /// [`Verdict::MinRange`].
    pub min_range: u32,
    /// [`Verdict::Silent`].
    pub silent: u32,
    /// [`Verdict::Unexplained`].
    pub unexplained: u32,
}

/// A figure for each verdict that pairs of echoes can have; `null` without a pair.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct ByVerdict {
    /// [`Verdict::Direct`].
    pub direct: Option<f64>,
    /// [`Verdict::Multiple`].
    pub multiple: Option<f64>,
    /// [`Verdict::Edge`].
    pub edge: Option<f64>,
    /// [`Verdict::Unexplained`].
    pub unexplained: Option<f64>,
}

/// Beams that could not be compared, by reason.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct NotComparedCounts {
    /// [`NotCompared::LinkLost`].
    pub link_lost: u32,
    /// [`NotCompared::StepDoubtful`].
    pub step_doubtful: u32,
    /// [`NotCompared::ModuleFault`].
    pub module_fault: u32,
    /// [`NotCompared::NoPrediction`].
    pub no_prediction: u32,
    /// [`NotCompared::NoRange`].
    pub no_range: u32,
}

impl NotComparedCounts {
    /// All of them.
    #[must_use]
    pub fn total(&self) -> u32 {
        self.link_lost + self.step_doubtful + self.module_fault + self.no_prediction + self.no_range
    }
}

/// Compares every beam of some scans: the numbers, and the beams they come from.
#[must_use]
pub fn compare(scans: &[ScanView]) -> (Comparison, Vec<Judged<'_>>) {
    let mut comparer = Comparer::default();
    let judged = scans.iter().flat_map(|scan| comparer.add(scan)).collect();
    (comparer.finish(), judged)
}

/// Compares scans one by one, for logs too long to be held whole: 16 bytes a pair of echoes stay in memory.
#[derive(Debug, Default)]
pub struct Comparer {
    comparison: Comparison,
    residuals_m: Vec<(Verdict, f64)>,
    poses: HashSet<[u64; 3]>,
    explainer: explain::Explainer,
}

impl Comparer {
    /// Takes in a scan; gives its beams.
    pub fn add<'a>(&mut self, scan: &'a ScanView) -> Vec<Judged<'a>> {
        let beams = last_readings(&scan.pings);
        self.comparison.scans += 1;
        self.comparison.duplicates += (scan.pings.len() - beams.len()) as u32;
        let bits = |pose: Pose| [pose.x_m, pose.y_m, pose.heading_deg].map(f64::to_bits);
        self.poses.extend(scan.pose().map(bits));
        let judged: Vec<Judged<'a>> = beams.into_iter().map(judge).collect();
        for beam in &judged {
            self.comparison.count(beam);
            let residual_m = beam.verdict.ok().zip(beam.residual_m);
            self.residuals_m.extend(residual_m);
        }
        self.explainer.add(scan, &judged);
        judged
    }

    /// The numbers of all scans together.
    #[must_use]
    pub fn finish(self) -> Comparison {
        let mut comparison = self.comparison;
        comparison.poses = self.poses.len() as u32;
        comparison.take_statistics(&self.residuals_m);
        comparison.explanations = self.explainer.finish();
        comparison
    }
}

/// Sets one reading beside its prediction.
#[must_use]
pub fn judge(ping: &Ping) -> Judged<'_> {
    let sides = side(ping.status, ping.range_m).and_then(|measured| {
        let sim = ping.sim.as_ref().ok_or(NotCompared::NoPrediction)?;
        Ok((measured, side(sim.status, sim.range_m)?, sim))
    });
    let (verdict, residual_m) = match sides {
        Ok((measured, simulated, sim)) => {
            let residual_m = match (measured, simulated) {
                (Side::Echo(measured_m), Side::Echo(sim_m)) => Some(measured_m - sim_m),
                _ => None,
            };
            (Ok(verdict(measured, simulated, sim)), residual_m)
        }
        Err(why) => (Err(why), None),
    };
    Judged { ping, verdict, residual_m }
}

/// Whether a measured and a predicted range agree, both in metres.
#[must_use]
pub fn agrees(measured_m: f64, predicted_m: f64) -> bool {
    let tolerance_m = AGREE_WITHIN_M.max(AGREE_WITHIN_SHARE * measured_m);
    // A difference of exactly the tolerance must not fail by rounding.
    (measured_m - predicted_m).abs() <= tolerance_m + 1e-9
}

/// What one side heard.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Side {
    Silent,
    /// At a range in metres, which not every source gives.
    Near(Option<f64>),
    Echo(f64),
}

fn side(status: PingStatus, range_m: Option<f64>) -> Result<Side, NotCompared> {
    let range_m = range_m.filter(|range_m| range_m.is_finite());
    match status {
        PingStatus::NoEcho => Ok(Side::Silent),
        PingStatus::MinRange => Ok(Side::Near(range_m)),
        PingStatus::Echo => range_m.map(Side::Echo).ok_or(NotCompared::NoRange),
        PingStatus::LinkLost => Err(NotCompared::LinkLost),
        PingStatus::StepDoubtful => Err(NotCompared::StepDoubtful),
        PingStatus::ModuleFault => Err(NotCompared::ModuleFault),
    }
}

fn verdict(measured: Side, simulated: Side, sim: &SimRecord) -> Verdict {
    match (measured, simulated) {
        (Side::Silent, Side::Silent) => Verdict::Silent,
        (Side::Near(_), Side::Near(_)) => Verdict::MinRange,
        (Side::Near(Some(a)), Side::Echo(b)) | (Side::Echo(a), Side::Near(Some(b)))
            if agrees(a, b) =>
        {
            Verdict::MinRange
        }
        (Side::Echo(measured_m), Side::Echo(sim_m)) if agrees(measured_m, sim_m) => {
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

/// For each beam its last reading that came through, else its last; in order of appearance.
fn last_readings(pings: &[Ping]) -> Vec<&Ping> {
    let mut place: HashMap<u32, usize> = HashMap::new();
    let mut beams: Vec<&Ping> = Vec::with_capacity(pings.len());
    for ping in pings {
        match place.get(&ping.index) {
            None => {
                place.insert(ping.index, beams.len());
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
    fn count(&mut self, beam: &Judged<'_>) {
        let verdict = match beam.verdict {
            Ok(verdict) => verdict,
            Err(why) => return *self.not_compared.of(why) += 1,
        };
        self.beams += 1;
        *self.verdicts.of(verdict) += 1;
        let measured = beam.ping.status;
        let simulated = beam.ping.sim.as_ref().map_or(PingStatus::NoEcho, |sim| sim.status);
        *match (measured, simulated) {
            (PingStatus::Echo, PingStatus::Echo) => &mut self.both_echo,
            (PingStatus::NoEcho, PingStatus::NoEcho) => &mut self.both_silent,
            (_, PingStatus::NoEcho) => &mut self.measured_only,
            (PingStatus::NoEcho, _) => &mut self.simulated_only,
            _ => &mut self.near,
        } += 1;
        let agree = beam.ping.range_m.zip(beam.residual_m);
        self.agree += u32::from(agree.is_some_and(|(range_m, m)| agrees(range_m, range_m - m)));
    }

    fn take_statistics(&mut self, residuals_m: &[(Verdict, f64)]) {
        let residuals = |wanted: Option<Verdict>, of: fn(f64) -> f64| -> Vec<f64> {
            residuals_m
                .iter()
                .filter(|(verdict, _)| wanted.is_none_or(|wanted| *verdict == wanted))
                .map(|(_, residual_m)| of(*residual_m))
                .collect()
        };
        let median_of = |verdict| quantile(residuals(Some(verdict), f64::abs), 0.5);
        if self.both_echo > 0 {
            self.agree_fraction = Some(f64::from(self.agree) / f64::from(self.both_echo));
        }
        self.median_abs_residual_m = quantile(residuals(None, f64::abs), 0.5);
        self.p90_abs_residual_m = quantile(residuals(None, f64::abs), 0.9);
        self.median_residual_m = quantile(residuals(None, |m| m), 0.5);
        self.median_abs_residual_by_verdict_m = ByVerdict {
            direct: median_of(Verdict::Direct),
            multiple: median_of(Verdict::Multiple),
            edge: median_of(Verdict::Edge),
            unexplained: median_of(Verdict::Unexplained),
        };
    }
}

impl Counts {
    fn of(&mut self, verdict: Verdict) -> &mut u32 {
        match verdict {
            Verdict::Direct => &mut self.direct,
            Verdict::Multiple => &mut self.multiple,
            Verdict::Edge => &mut self.edge,
            Verdict::MinRange => &mut self.min_range,
            Verdict::Silent => &mut self.silent,
            Verdict::Unexplained => &mut self.unexplained,
        }
    }
}

impl NotComparedCounts {
    fn of(&mut self, why: NotCompared) -> &mut u32 {
        match why {
            NotCompared::LinkLost => &mut self.link_lost,
            NotCompared::StepDoubtful => &mut self.step_doubtful,
            NotCompared::ModuleFault => &mut self.module_fault,
            NotCompared::NoPrediction => &mut self.no_prediction,
            NotCompared::NoRange => &mut self.no_range,
        }
    }
}

#[cfg(test)]
mod tests;
