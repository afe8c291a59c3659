//! Quality checks of a recorded scan. Pure.

use serde::{Deserialize, Serialize};
use sonard_interpret::compare::compare;
use sonard_records::{EventKind, PingStatus, ScanView};

use super::keys::{Action, CheckKeys};

/// Violation of a quality check by a scan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CheckFinding {
    /// Name of the check: its key in `[checks]` without `max_`.
    pub check: String,
    /// Description with the measured values.
    pub detail: String,
    /// Action that the plan requires.
    pub action: Action,
}

/// Quality figures of a complete scan, for the report and its plots.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct ScanFigures {
    /// Beams of the plan.
    pub beams: u32,
    /// Beams without a usable reading.
    pub missing: u32,
    /// Beams compared with a prediction.
    pub compared: u32,
    /// Share of echoes present in both measurement and prediction that agree; `null` without any.
    pub agree_fraction: Option<f64>,
    /// Share of the compared beams that disagree with the model; `null` without any.
    pub unexplained_share: Option<f64>,
    /// Median of measured minus predicted range, metres.
    pub median_residual_m: Option<f64>,
    /// 90th percentile of the absolute residual, metres.
    pub p90_abs_residual_m: Option<f64>,
    /// Index error after the scan, motor steps.
    pub home_drift_steps: Option<i32>,
    /// Air temperature used for the scan's ranges, degrees Celsius.
    pub temperature_c: Option<f64>,
    /// Change of the measured temperature during the scan, degrees Celsius.
    pub temperature_change_c: Option<f64>,
}

impl ScanFigures {
    /// Computes the figures of a finished scan.
    #[must_use]
    pub fn from_scan(view: &ScanView, temperature_change_c: Option<f64>) -> Self {
        let views = std::slice::from_ref(view);
        let comparison = compare(views).0;
        let beams = view.start.as_ref().map_or(0, |start| start.plan.beams());
        let usable =
            |status| matches!(status, PingStatus::Echo | PingStatus::NoEcho | PingStatus::MinRange);
        let usable = view.pings.iter().filter(|ping| usable(ping.status)).count() as u32;
        let session = view.session.as_ref().map(|session| session.air.temperature_c);
        let air = view.start.as_ref().and_then(|start| start.air);
        Self {
            beams,
            missing: beams.saturating_sub(usable),
            compared: comparison.beams,
            agree_fraction: comparison.agree_fraction,
            unexplained_share: (comparison.beams > 0)
                .then(|| f64::from(comparison.verdicts.unexplained) / f64::from(comparison.beams)),
            median_residual_m: comparison.median_residual_m,
            p90_abs_residual_m: comparison.p90_abs_residual_m,
            home_drift_steps: view.end.as_ref().and_then(|end| end.home_drift_steps),
            temperature_c: air.map(|air| air.temperature_c).or(session),
            temperature_change_c,
        }
    }
}

/// Returns `true` if the scan ended early: by a signal, a crash or a power cut.
///
/// A scan whose ranger was lost is not incomplete in this sense. It has an end and a reading for
/// each beam, some of them `link_lost`, and is rated by the checks.
#[must_use]
pub fn ended_early(view: &ScanView) -> bool {
    let beams = view.start.as_ref().map_or(u32::MAX, |start| start.plan.beams());
    let stopped = view.events.iter().any(|event| event.kind == EventKind::Stopped);
    view.end.is_none() || stopped || view.pings.len() < beams as usize
}

/// Applies the plan's checks to a scan's figures.
#[must_use]
pub fn check_figures(figures: &ScanFigures, keys: &CheckKeys) -> Vec<CheckFinding> {
    let mut findings = Vec::new();
    let mut find = |check: &str, action, detail| {
        findings.push(CheckFinding { check: check.to_owned(), detail, action });
    };
    if figures.missing > keys.max_missing_beams {
        let ScanFigures { missing, beams, .. } = figures;
        let detail = format!("{missing} of {beams} beams have no usable reading");
        find("missing_beams", keys.on_missing_beams, detail);
    }
    if let Some(drift) = figures.home_drift_steps
        && drift.unsigned_abs() > keys.max_home_drift_steps
    {
        let detail = format!("index error {drift} motor steps: the motor missed steps");
        find("home_drift_steps", keys.on_home_drift, detail);
    }
    if let Some(change_c) = figures.temperature_change_c
        && change_c.abs() > keys.max_temperature_change_c
    {
        let detail = format!("air temperature changed by {change_c:+.2} C during the scan");
        find("temperature_change_c", keys.on_temperature_change, detail);
    }
    if let Some(share) = figures.unexplained_share
        && share > keys.max_unexplained_share
    {
        let detail = format!(
            "{:.0} % of {} beams disagree with the model: check pose and scene",
            100.0 * share,
            figures.compared
        );
        find("unexplained_share", keys.on_unexplained, detail);
    }
    findings
}

/// Returns the strongest action among the findings.
#[must_use]
pub fn strongest_action(findings: &[CheckFinding]) -> Action {
    findings.iter().map(|finding| finding.action).max().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn good() -> ScanFigures {
        ScanFigures {
            beams: 400,
            compared: 400,
            unexplained_share: Some(0.02),
            home_drift_steps: Some(0),
            temperature_change_c: Some(0.1),
            ..ScanFigures::default()
        }
    }

    #[test]
    fn limits_and_strongest_action() {
        let keys = CheckKeys { on_unexplained: Action::Stop, ..CheckKeys::default() };
        assert_eq!(check_figures(&good(), &keys), []);
        for (figures, name, action) in [
            (ScanFigures { missing: 1, ..good() }, "missing_beams", Action::Retake),
            (
                ScanFigures { home_drift_steps: Some(-1), ..good() },
                "home_drift_steps",
                Action::Retake,
            ),
            (
                ScanFigures { temperature_change_c: Some(-0.6), ..good() },
                "temperature_change_c",
                Action::Retake,
            ),
            (
                ScanFigures { unexplained_share: Some(0.51), ..good() },
                "unexplained_share",
                Action::Stop,
            ),
        ] {
            let found = check_figures(&figures, &keys);
            assert_eq!(found.len(), 1, "{found:?}");
            assert_eq!((found[0].check.as_str(), found[0].action), (name, action));
        }
        let all = ScanFigures {
            missing: 3,
            unexplained_share: Some(0.9),
            home_drift_steps: Some(4),
            ..good()
        };
        assert_eq!(strongest_action(&check_figures(&all, &keys)), Action::Stop);
        assert_eq!(strongest_action(&[]), Action::Note);
    }
}
