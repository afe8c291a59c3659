//! Consistency check of a log, line by line.

mod finding;
mod open_scan;

use std::{
    collections::HashSet,
    io::{self, BufRead},
    mem,
};

use jiff::{SignedDuration, Timestamp};
use sonard_model::array::{MountedRanger, RangerArray};
use sonard_records::{
    Event, EventKind, Ping, PingStatus, Record, RecordErrorKind, ScanEnd, ScanPlan, ScanStart,
    Session,
};
use uuid::Uuid;

pub use finding::{FindingKind, LogFinding, LogTotals, Severity};
use open_scan::OpenScan;

use super::{Line, read_log};

/// Tolerance of an azimuth for rounding in records, degrees.
const AZIMUTH_TOLERANCE_DEG: f64 = 1e-3;
/// Tolerance of a residual for rounding to millimetres, metres.
const RESIDUAL_TOLERANCE_M: f64 = 1e-3;
/// Tolerance of record order between the host's clock and the fitted device clock.
const TIME_TOLERANCE: SignedDuration = SignedDuration::from_secs(1);

/// Checks a log and passes each finding to `report`, in line order.
///
/// # Errors
/// Returns an error if reading fails.
pub fn check_log<R: BufRead>(
    reader: R,
    mut report: impl FnMut(LogFinding),
) -> io::Result<LogTotals> {
    let mut checker = Checker::default();
    for line in read_log(reader) {
        checker.line(&line?);
        checker.take_findings().for_each(&mut report);
    }
    checker.end();
    checker.take_findings().for_each(&mut report);
    Ok(checker.totals)
}

/// Incremental form of [`check_log`], for callers that supply the lines.
#[derive(Debug, Default)]
pub struct Checker {
    totals: LogTotals,
    findings: Vec<LogFinding>,
    /// Number of the current line.
    at: u64,
    session: bool,
    /// Array of the current session.
    array: Option<RangerArray>,
    /// `true` for imported readings, whose azimuths need not match a plan.
    imported: bool,
    scan: Option<OpenScan>,
    scans: HashSet<Uuid>,
    latest: Option<Timestamp>,
}

impl Checker {
    /// Checks the next line.
    pub fn line(&mut self, line: &Line) {
        self.at = line.number;
        self.totals.lines += 1;
        match &line.record {
            Err(error) if error.fault.kind == RecordErrorKind::Truncated => {
                self.problem(FindingKind::TornTail, error.fault.to_string());
            }
            Err(error) if error.fault.kind == RecordErrorKind::UnsupportedFormat => {
                self.session = true;
                self.problem(FindingKind::UnsupportedFormat, error.fault.to_string());
            }
            Err(error) => self.problem(FindingKind::Damaged, error.fault.to_string()),
            Ok(record) => {
                self.record(record);
                if !line.ended {
                    let detail = "the newline after the last record is missing";
                    self.problem(FindingKind::NoNewline, detail.into());
                }
            }
        }
    }

    /// Checks the end of the log for missing records.
    pub fn end(&mut self) {
        if self.totals.lines == 0 {
            self.problem(FindingKind::EmptyLog, "the log is empty".into());
        }
        if let Some(scan) = self.scan.take() {
            // Only a warning: the scan may be running, or the log was truncated and repaired.
            self.warn(FindingKind::NotEnded, scan.not_ended("at the end of the log"));
        }
    }

    /// Returns the findings since the last call.
    pub fn take_findings(&mut self) -> impl Iterator<Item = LogFinding> + use<> {
        mem::take(&mut self.findings).into_iter()
    }

    /// Numbers of records and findings so far.
    #[must_use]
    pub fn totals(&self) -> LogTotals {
        self.totals
    }

    fn record(&mut self, record: &Record) {
        match record {
            Record::Session(session) => self.session(session),
            Record::ScanStart(start) => self.scan_start(start),
            Record::Ping(ping) => self.ping(ping),
            Record::ScanEnd(end) => self.scan_end(end),
            Record::Event(event) => self.event(event),
        }
    }

    fn session(&mut self, session: &Session) {
        self.totals.sessions += 1;
        self.leave_scan("when another session begins");
        self.session = true;
        self.array.clone_from(&session.array);
        self.imported = session.imported.is_some();
        self.time(session.started);
    }

    fn scan_start(&mut self, start: &ScanStart) {
        self.totals.scans += 1;
        self.leave_scan("when another scan begins");
        self.need_session();
        let id = start.scan;
        if !self.scans.insert(id) {
            self.problem(FindingKind::ScanTwice, format!("scan {id} begins a second time"));
        }
        let plan = start.plan.check();
        if let Err(error) = &plan {
            self.problem(FindingKind::BadPlan, format!("plan: {error}"));
        }
        self.scan = Some(OpenScan::new(id, self.at, plan.is_ok().then_some(start.plan)));
        self.time(start.time);
    }

    fn ping(&mut self, ping: &Ping) {
        self.totals.pings += 1;
        self.enter_scan(ping.scan, "ping");
        for detail in contradictions(ping) {
            self.problem(FindingKind::Contradiction, format!("beam {}: {detail}", ping.index));
        }
        if let Some(plan) = self.scan.as_ref().and_then(|scan| scan.plan) {
            self.check_azimuth(ping, &plan);
        }
        self.count_beam(ping);
        // A repaired reading is older than readings received without loss.
        if let (Some(time), false) = (ping.time, ping.repaired) {
            self.time(time);
        }
    }

    fn scan_end(&mut self, end: &ScanEnd) {
        self.enter_scan(end.scan, "scan_end");
        if let Some(scan) = self.scan.take() {
            for detail in scan.wrong_counts(end) {
                // A gap event explains missing records.
                if scan.has_gap {
                    self.warn(FindingKind::WrongCount, detail);
                } else {
                    self.problem(FindingKind::WrongCount, detail);
                }
            }
        }
        self.time(end.time);
    }

    fn event(&mut self, event: &Event) {
        self.totals.events += 1;
        if let Some(scan) = &mut self.scan {
            scan.interrupted = true;
            scan.has_gap |= event.kind == EventKind::Gap;
        }
        self.time(event.time);
    }

    /// Checks that a record belongs to the open scan; reports a mismatch once per scan.
    fn enter_scan(&mut self, id: Uuid, what: &str) {
        if self.scan.as_ref().is_some_and(|scan| scan.id == id) {
            return;
        }
        self.leave_scan("when records of another scan follow");
        let reason =
            if self.scans.insert(id) { "its scan_start is missing" } else { "it has ended" };
        self.problem(FindingKind::OutsideScan, format!("{what} outside of scan {id}: {reason}"));
        self.need_session();
        self.scan = Some(OpenScan::new(id, self.at, None));
    }

    fn leave_scan(&mut self, when: &str) {
        let Some(scan) = self.scan.take() else { return };
        let detail = scan.not_ended(when);
        if scan.interrupted {
            self.warn(FindingKind::NotEnded, detail);
        } else {
            self.problem(FindingKind::NotEnded, detail);
        }
    }

    fn need_session(&mut self) {
        if !mem::replace(&mut self.session, true) {
            let detail =
                "no session before the first scan: device, sensor, air and scene are unknown";
            self.problem(FindingKind::NoSession, detail.into());
        }
    }

    /// Checks index and azimuth of a reading against the plan.
    fn check_azimuth(&mut self, ping: &Ping, plan: &ScanPlan) {
        let index = ping.index;
        if index >= plan.beams() {
            let detail = format!("beam {index}: the plan has beams 0 to {}", plan.beams() - 1);
            return self.problem(FindingKind::NoSuchBeam, detail);
        }
        if let Some(id) = &ping.ranger {
            return self.check_mounted(ping, id);
        }
        let planned_deg = plan.azimuth_deg(index / plan.pings_per_stop);
        let off = !self.imported && is_off(ping.azimuth_deg, planned_deg);
        if off && ping.status != PingStatus::StepUncertain {
            let is_deg = ping.azimuth_deg;
            let detail =
                format!("beam {index}: azimuth_deg is {is_deg}; the plan has {planned_deg}");
            self.problem(FindingKind::WrongAzimuth, detail);
        }
    }

    /// Checks ranger and azimuth of a reading against the session's array.
    fn check_mounted(&mut self, ping: &Ping, id: &str) {
        let (index, is_deg) = (ping.index, ping.azimuth_deg);
        let ranger = self.array.as_ref().and_then(|array| array.ranger(id));
        match ranger.map(MountedRanger::azimuth_deg) {
            Some(deg) if is_off(is_deg, deg) => {
                let detail =
                    format!("beam {index}: azimuth_deg is {is_deg}; ranger {id} has {deg}");
                self.problem(FindingKind::WrongAzimuth, detail);
            }
            Some(_) => {}
            None => {
                let detail = format!("beam {index}: the session has no array with a ranger {id}");
                self.problem(FindingKind::UnknownRanger, detail);
            }
        }
    }

    fn count_beam(&mut self, ping: &Ping) {
        let (at, index) = (self.at, ping.index);
        let came_through = ping.status != PingStatus::LinkLost;
        let Some(scan) = &mut self.scan else { return };
        // A lost reading may appear again once it was repaired.
        if let Some((first, true)) = scan.beams.insert(index, (at, came_through)) {
            let detail = format!("beam {index} has a reading already, on line {first}");
            self.problem(FindingKind::DuplicateBeam, detail);
        }
    }

    fn time(&mut self, time: Timestamp) {
        if let Some(latest) = self.latest
            && latest.duration_since(time) > TIME_TOLERANCE
        {
            let detail = format!("time goes backwards, from {latest} to {time}");
            self.warn(FindingKind::TimeBackwards, detail);
            self.latest = Some(time);
        }
        self.latest = self.latest.max(Some(time));
    }

    fn problem(&mut self, kind: FindingKind, detail: String) {
        self.totals.problems += 1;
        self.findings.push(LogFinding { line: self.at, severity: Severity::Problem, kind, detail });
    }

    fn warn(&mut self, kind: FindingKind, detail: String) {
        self.totals.warnings += 1;
        self.findings.push(LogFinding { line: self.at, severity: Severity::Warning, kind, detail });
    }
}

/// Returns `true` if two azimuths differ by more than the tolerance, degrees.
fn is_off(a_deg: f64, b_deg: f64) -> bool {
    let difference_deg = (a_deg - b_deg + 180.0).rem_euclid(360.0) - 180.0;
    difference_deg.abs() > AZIMUTH_TOLERANCE_DEG
}

/// Lists contradictions between the fields of a reading.
fn contradictions(ping: &Ping) -> Vec<String> {
    let mut found = Vec::new();
    let mut side = |what: &str, status: PingStatus, range_m: Option<f64>| match range_m {
        Some(range_m) if !status.has_range() => {
            found.push(format!("{what}range_m is {range_m} although status is {status:?}"));
        }
        Some(range_m) if range_m < 0.0 => found.push(format!("{what}range_m is {range_m}")),
        None if status.has_range() => {
            found.push(format!("{what}range_m is null although status is {status:?}"));
        }
        _ => {}
    };
    side("", ping.status, ping.range_m);
    if let Some(sim) = &ping.sim {
        side("sim.", sim.status, sim.range_m);
    }
    let predicted_m = ping.sim.as_ref().and_then(|sim| sim.range_m);
    let difference_m = ping.range_m.zip(predicted_m).map(|(measured, sim)| measured - sim);
    match (ping.residual_m, difference_m) {
        (Some(residual_m), Some(m)) if (residual_m - m).abs() > RESIDUAL_TOLERANCE_M => {
            found.push(format!("residual_m is {residual_m}; the ranges differ by {m:.6}"));
        }
        (Some(residual_m), None) => {
            found.push(format!("residual_m is {residual_m} although a range is missing"));
        }
        _ => {}
    }
    found
}
