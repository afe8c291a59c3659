//! Findings of the log check.

use super::*;
use crate::{FindingKind, LogTotals, Severity, check_log};

/// Line and kind of each finding.
type Found = Vec<(u64, FindingKind)>;

fn found(log: &str) -> (Found, Found, LogTotals) {
    let (mut problems, mut warnings) = (Vec::new(), Vec::new());
    let totals = check_log(log.as_bytes(), |finding| match finding.severity {
        Severity::Problem => problems.push((finding.line, finding.kind)),
        Severity::Warning => warnings.push((finding.line, finding.kind)),
    })
    .expect("memory can be read");
    assert_eq!(totals.problems as usize, problems.len());
    assert_eq!(totals.warnings as usize, warnings.len());
    (problems, warnings, totals)
}

/// Changes one line of the fixture; `None` removes the line.
fn with_line(number: usize, change: impl Fn(&str) -> Option<String>) -> String {
    let lines = LOG
        .lines()
        .enumerate()
        .filter_map(|(i, line)| if i + 1 == number { change(line) } else { Some(line.into()) });
    lines.map(|line| line + "\n").collect()
}

fn replaced(number: usize, from: &str, to: &str) -> String {
    with_line(number, |line| {
        assert!(line.contains(from), "{from} is not in {line}");
        Some(line.replacen(from, to, 1))
    })
}

#[test]
fn the_fixture_is_clean() {
    let (problems, warnings, totals) = found(LOG);
    assert_eq!((problems, warnings), (vec![], vec![]));
    let LogTotals { lines, sessions, scans, pings, events, .. } = totals;
    assert_eq!((lines, sessions, scans, pings, events), (11, 1, 1, 7, 1));
}

#[test]
fn line_of_each_problem() {
    use FindingKind::*;
    let second = LOG.replace("5a0e7f5e", "6b1f8a6f");
    let without_end = with_line(10, |_| None);
    for (log, expected) in [
        (String::new(), vec![(0, EmptyLog)]),
        (LOG[..LOG.len() - 9].into(), vec![(11, TornTail)]),
        (LOG.trim_end().into(), vec![(11, NoNewline)]),
        (with_line(11, |_| Some("rubbish".into())), vec![(11, Damaged)]),
        (
            with_line(4, |_| Some("{}".into())),
            vec![(4, Damaged), (10, WrongCount), (10, WrongCount)],
        ),
        (replaced(1, "\"format\":1", "\"format\":2"), vec![(1, UnsupportedFormat)]),
        (with_line(1, |_| None), vec![(1, NoSession)]),
        (with_line(2, |_| None), vec![(2, OutsideScan)]),
        (
            with_line(2, |_| LOG.lines().nth(9).map(String::from)),
            vec![(2, OutsideScan), (2, WrongCount), (3, OutsideScan)],
        ),
        (format!("{LOG}{LOG}"), vec![(13, ScanTwice)]),
        (replaced(2, "\"step_deg\":0.9", "\"step_deg\":-1"), vec![(2, BadPlan)]),
        (
            replaced(4, "\"index\":1", "\"index\":0"),
            vec![(4, WrongAzimuth), (4, DuplicateBeam), (10, WrongCount), (10, WrongCount)],
        ),
        (replaced(9, "\"index\":6", "\"index\":7"), vec![(9, NoSuchBeam), (10, WrongCount)]),
        (replaced(10, "\"beams\":7", "\"beams\":8"), vec![(10, WrongCount)]),
        (replaced(10, "\"missing\":0", "\"missing\":2"), vec![(10, WrongCount)]),
        (
            format!(
                "{}{second}",
                without_end.lines().take(9).map(|l| format!("{l}\n")).collect::<String>()
            ),
            vec![(10, NotEnded)],
        ),
        (replaced(7, "\"range_m\":null", "\"range_m\":1.5"), vec![(7, Contradiction)]),
        (
            replaced(3, "\"range_m\":0.6602", "\"range_m\":null"),
            vec![(3, Contradiction), (3, Contradiction)],
        ),
        (replaced(3, "\"range_m\":0.657", "\"range_m\":0.857"), vec![(3, Contradiction)]),
        (replaced(5, "\"azimuth_deg\":1.8", "\"azimuth_deg\":1.9"), vec![(5, WrongAzimuth)]),
    ] {
        assert_eq!(found(&log).0, expected, "{log}");
    }
}

#[test]
fn warnings() {
    use FindingKind::*;
    // Running scan, or truncated and repaired log.
    let running: String = LOG.lines().take(6).map(|line| format!("{line}\n")).collect();
    assert_eq!(found(&running).0, []);
    assert_eq!(found(&running).1, [(6, NotEnded)]);
    // An event explains the missing end.
    let second = LOG.replace("5a0e7f5e", "6b1f8a6f");
    let stopped = with_line(10, |_| None) + &second;
    assert_eq!((found(&stopped).0, found(&stopped).1[0]), (vec![], (11, NotEnded)));
    let back = replaced(9, "\"time\":null", "\"time\":\"2026-11-21T13:00:00Z\"");
    assert_eq!((found(&back).0, found(&back).1), (vec![], vec![(9, TimeBackwards)]));
    // Half a second between the host's clock and the fitted device clock is tolerated.
    let apart = replaced(11, "14:00:01", "14:00:00");
    assert_eq!((found(&apart).0, found(&apart).1), (vec![], vec![]));
}

#[test]
fn repaired_reading_may_repeat() {
    let lost = LOG.lines().nth(8).expect("the lost one");
    let fetched = LOG.lines().nth(7).expect("a repaired one");
    let fetched = fetched.replace("\"index\":5", "\"index\":6").replace("4.5", "5.4");
    let log = with_line(9, |_| Some(format!("{lost}\n{fetched}")));
    assert_eq!(found(&log).0, []);
}
