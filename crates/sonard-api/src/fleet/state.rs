//! Derives a robot's state from the result of a poll. Pure.

use super::DaemonReport;

use crate::{api::FleetState, config::is_robot_name};

/// Maximum number of problems shown per robot, and of characters each: the texts come from another
/// host.
const MAX_REASONS: usize = 3;
const MAX_CHARACTERS: usize = 120;

/// Failed poll of a daemon, with the error message.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum PollError {
    /// No response within the time limit.
    NoResponse(String),
    /// Rejected request.
    Rejected(String),
    /// Response that is not that of a daemon of this version.
    Invalid(String),
}

/// State of a robot derived from one poll.
#[derive(Debug, Clone, PartialEq)]
pub struct Observation {
    /// Observed state.
    pub state: FleetState,
    /// Problems, sanitized for display.
    pub problems: Vec<String>,
    /// Report of the daemon, if it belongs to the expected robot.
    pub report: Option<DaemonReport>,
}

/// Derives the state of the robot `expected` from the result of a poll.
#[must_use]
pub fn observe(expected: Option<&str>, polled: Result<DaemonReport, PollError>) -> Observation {
    let without =
        |state, why: &str| Observation { state, problems: vec![sanitize(why)], report: None };
    let report = match polled {
        Ok(report) => report,
        Err(PollError::NoResponse(why)) => return without(FleetState::NoResponse, &why),
        Err(PollError::Rejected(why)) => return without(FleetState::Rejected, &why),
        Err(PollError::Invalid(why)) => return without(FleetState::InvalidResponse, &why),
    };
    let robot = &report.status.robot;
    if !is_robot_name(robot) {
        return without(FleetState::InvalidResponse, &format!("invalid robot name {robot:?}"));
    }
    if let Some(expected) = expected.filter(|expected| expected != robot) {
        let why = format!("{robot} responds in place of {expected}");
        return without(FleetState::OtherRobot, &why);
    }
    let (health, status) = (&report.health, &report.status);
    let missing = health.fit.as_ref().map_or(0, |fit| fit.missing);
    let missing_beams = (missing > 0).then(|| format!("{missing} beams missing in the last scan"));
    let rejected = status.configuration.error.as_ref();
    let rejected = rejected.map(|error| format!("configuration rejected: {error}"));
    let problems = health.reasons.iter().cloned().chain(missing_beams).chain(rejected);
    Observation {
        state: if health.healthy { FleetState::Healthy } else { FleetState::Unhealthy },
        problems: problems.take(MAX_REASONS).map(|why| sanitize(&why)).collect(),
        report: Some(report),
    }
}

/// Sanitizes a text from another host: one line of limited length, without control characters.
#[must_use]
pub fn sanitize(text: &str) -> String {
    let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
    let shown =
        text.chars().map(|character| if is_plain(character) { character } else { '\u{fffd}' });
    let mut shown: String = shown.take(MAX_CHARACTERS + 1).collect();
    if shown.chars().count() > MAX_CHARACTERS {
        shown = shown.chars().take(MAX_CHARACTERS - 1).collect();
        shown.push('\u{2026}');
    }
    shown
}

/// Returns `true` unless the character is a control character or changes the writing direction.
fn is_plain(character: char) -> bool {
    !character.is_control()
        && !matches!(character, '\u{200b}'..='\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn remote_texts_are_sanitized() {
        assert_eq!(sanitize("a\x1b[2Jb\n c"), "a\u{fffd}[2Jb c");
        assert_eq!(sanitize("x\u{202e}y"), "x\u{fffd}y");
        let long = sanitize(&"<html>".repeat(1000));
        assert_eq!(long.chars().count(), MAX_CHARACTERS);
    }

    #[test]
    fn failed_polls() {
        for (error, state) in [
            (PollError::NoResponse("gone".into()), FleetState::NoResponse),
            (PollError::Rejected("no".into()), FleetState::Rejected),
            (PollError::Invalid("html".into()), FleetState::InvalidResponse),
        ] {
            let seen = observe(Some("kiwi"), Err(error));
            assert_eq!((seen.state, seen.problems.len(), seen.report), (state, 1, None));
        }
    }
}
