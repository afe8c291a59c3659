//! Evaluation of a recorded scan: accepted, rejected or incomplete.

use std::{collections::HashSet, path::Path, time::Duration};

use sonard_log::{LogWriter, load};
use sonard_records::{PingStatus, ScanView};
use tokio::time::sleep;

use super::{
    super::{
        Action, CheckFinding, CollectError, JournalEntry, Observer, RetrySchedule, ScanAttempt,
        ScanDevice, ScanFigures, ScanOutcome, SealedFile, Slot, check_figures, ended_early,
        pose_source::answered,
        record_scan::{self, RecordedScan},
        strongest_action,
    },
    Collector, Next,
};

impl<D: ScanDevice, W: Observer> Collector<D, W> {
    /// Accepts a scan or sets it aside, and returns the next step.
    pub(super) async fn evaluate(
        &mut self,
        slot: Slot,
        (taken, change_c): (RecordedScan, Option<f64>),
    ) -> Result<Next, CollectError> {
        let RecordedScan { view, failure: lost, stopped, wall_s, needs_reconnect: _ } = taken;
        let lost = lost
            .or_else(|| view.as_ref().filter(|view| lacks_readings(view)).map(|_| ranger_lost()));
        let Some(view) = view.filter(|view| !ended_early(view) && is_measured(view)) else {
            return self.set_aside_incomplete(slot, lost, stopped).await;
        };
        if lost.is_none() {
            self.losses = None;
        }
        let figures = ScanFigures::from_scan(&view, change_c);
        let findings = check_figures(&figures, &self.plan.keys.checks);
        let mut action = strongest_action(&findings);
        self.report_findings(slot, &figures, &findings);
        if action == Action::Ask {
            action = self.prompt_action().await?;
        }
        if action == Action::Note {
            self.accept(slot, &view, figures, findings, Some(wall_s))?;
            return Ok(Next::Continue);
        }
        let reason = rejection_reason(&findings);
        let scan = Some((&view, figures, wall_s));
        self.set_aside(slot, scan, ScanOutcome::Rejected, findings, &reason)?;
        if self.interrupts.happened() {
            return Ok(Next::Stop("stopped on request".into()));
        }
        match action {
            Action::Stop | Action::Ask => Ok(Next::Stop(format!("stopped: {reason}"))),
            Action::Note | Action::Retake => match lost {
                Some(lost) => self.wait_for_ranger(lost).await,
                None => self.count_rejection(slot),
            },
        }
    }

    /// Sets aside a scan without end or without readings, and returns the next step.
    async fn set_aside_incomplete(
        &mut self,
        slot: Slot,
        lost: Option<CollectError>,
        stopped: bool,
    ) -> Result<Next, CollectError> {
        let stop = match (self.interrupts.happened(), stopped) {
            (true, _) => Some("stopped on request"),
            (_, true) => Some("the daemon was stopped by another client"),
            _ => None,
        };
        // Scans lost before their first reading are removed, or repeated losses would fill the
        // folder.
        if stop.is_some()
            || read(&self.folder.draft_path(slot))?.is_some_and(|view| is_measured(&view))
        {
            self.set_aside(slot, None, ScanOutcome::Incomplete, Vec::new(), "incomplete")?;
        } else {
            self.folder.discard(slot)?;
        }
        if let Some(reason) = stop {
            return Ok(Next::Stop(reason.into()));
        }
        self.wait_for_ranger(lost.unwrap_or_else(ranger_lost)).await
    }

    /// Waits after a lost scan, longer after each one. A loss is independent of the pose, so it
    /// does not count as a retake; the collection ends after `collection.retry_limit_s`.
    async fn wait_for_ranger(&mut self, lost: CollectError) -> Result<Next, CollectError> {
        let retry_limit = Duration::from_secs_f64(self.plan.keys.collection.retry_limit_s);
        let losses = self.losses.get_or_insert_with(|| RetrySchedule::for_lost_scans(retry_limit));
        let (CollectError::Failed { .. }, Some(wait)) = (&lost, losses.next_delay()) else {
            return match lost {
                // The daemon dropped the request.
                CollectError::Stopped(reason) => Ok(Next::Stop(reason)),
                lost => Err(lost),
            };
        };
        self.watcher
            .message(&format!("ranger lost; repeating the scan in {} s: {lost}", wait.as_secs()));
        tokio::select! {
            () = sleep(wait) => Ok(Next::Continue),
            () = self.interrupts.clone().wait() => Ok(Next::Stop("stopped on request".into())),
        }
    }

    /// Recovers the scans of an interrupted run: complete ones are evaluated like new scans, others
    /// are set aside.
    pub(super) fn recover_scans(&mut self) -> Result<(), CollectError> {
        // The rename accepts a scan; its journal entry may be missing after a crash.
        let history = self.journal.history();
        let journaled: HashSet<Slot> = history.accepted().map(|take| take.slot).collect();
        let scans = self.folder.scans()?;
        for slot in scans.into_iter().filter(|slot| !journaled.contains(slot)) {
            let sealed = self.folder.digest_of_scan(slot)?;
            let path = self.folder.root().join(&sealed.file);
            let Some(view) = read(&path)? else { continue };
            let figures = ScanFigures::from_scan(&view, None);
            let findings = check_figures(&figures, &self.plan.keys.checks);
            let entry =
                take_entry(slot, Some(&view), ScanOutcome::Accepted, sealed, figures, findings);
            self.append(entry)?;
        }
        for slot in self.folder.interrupted_scans()? {
            let path = self.folder.draft_path(slot);
            // Opening removes an incomplete last line.
            LogWriter::open(&path).and_then(LogWriter::close)?;
            let view = read(&path)?.filter(|view| !ended_early(view));
            let done = self.folder.digest_of_scan(slot).is_ok();
            match view {
                Some(view) if !done => self.evaluate_recovered(slot, &view)?,
                _ => {
                    let reason = "the program ended during the scan";
                    self.set_aside(slot, None, ScanOutcome::Incomplete, Vec::new(), reason)?;
                }
            }
        }
        Ok(())
    }

    fn evaluate_recovered(&mut self, slot: Slot, view: &ScanView) -> Result<(), CollectError> {
        let figures = ScanFigures::from_scan(view, None);
        let findings = check_figures(&figures, &self.plan.keys.checks);
        if strongest_action(&findings) == Action::Note {
            return self.accept(slot, view, figures, findings, None);
        }
        let reason = rejection_reason(&findings);
        let wall_s = f64::NAN;
        self.set_aside(
            slot,
            Some((view, figures, wall_s)),
            ScanOutcome::Rejected,
            findings,
            &reason,
        )
    }

    fn accept(
        &mut self,
        slot: Slot,
        view: &ScanView,
        figures: ScanFigures,
        findings: Vec<CheckFinding>,
        wall_s: Option<f64>,
    ) -> Result<(), CollectError> {
        let sealed = self.folder.accept(slot)?;
        let mut entry =
            take_entry(slot, Some(view), ScanOutcome::Accepted, sealed, figures, findings);
        if let JournalEntry::Attempt(take) = &mut entry {
            take.wall_s = wall_s;
        }
        self.append(entry)?;
        if let Some(wall_s) = wall_s {
            self.pace.record_scan(wall_s);
        }
        self.write_manifest()
    }

    fn set_aside(
        &mut self,
        slot: Slot,
        scan: Option<(&ScanView, ScanFigures, f64)>,
        outcome: ScanOutcome,
        findings: Vec<CheckFinding>,
        reason: &str,
    ) -> Result<(), CollectError> {
        let path = self.folder.draft_path(slot);
        record_scan::mark_rejected(&path, reason)?;
        let sealed = self.folder.set_aside(slot)?;
        let stored = match scan {
            Some(_) => None,
            None => read(&self.folder.root().join(&sealed.file))?,
        };
        let view = scan.map(|(view, ..)| view).or(stored.as_ref());
        let figures = scan.map_or_else(
            || view.map(|view| ScanFigures::from_scan(view, None)).unwrap_or_default(),
            |(_, figures, _)| figures,
        );
        let mut entry = take_entry(slot, view, outcome, sealed, figures, findings);
        if let JournalEntry::Attempt(take) = &mut entry {
            take.wall_s = scan.map(|(.., wall_s)| wall_s).filter(|wall_s| wall_s.is_finite());
            take.incomplete_reason =
                (outcome == ScanOutcome::Incomplete).then(|| reason.to_owned());
        }
        self.append(entry)
    }

    /// Counts a rejection; the scan is given up once `collection.retakes` are used.
    fn count_rejection(&mut self, slot: Slot) -> Result<Next, CollectError> {
        let rejections = self.rejections.entry(slot).or_default();
        *rejections += 1;
        if *rejections > self.plan.keys.collection.retakes {
            return self.give_up(slot);
        }
        Ok(Next::Continue)
    }

    async fn prompt_action(&mut self) -> Result<Action, CollectError> {
        self.watcher.measuring_paused();
        loop {
            let question = "keep it, retake it or stop? [k/r/s]";
            let answer = answered(&mut self.watcher, question, &self.interrupts).await?;
            match answer.as_deref() {
                Some("k" | "keep") => return Ok(Action::Note),
                Some("r" | "retake") => return Ok(Action::Retake),
                Some("s" | "stop") | None => return Ok(Action::Stop),
                Some(_) => {}
            }
        }
    }

    /// Reports a line about a scan and a line about each finding.
    fn report_findings(&self, slot: Slot, figures: &ScanFigures, findings: &[CheckFinding]) {
        let percent = |share: Option<f64>| {
            share.map_or_else(|| "-".into(), |share| format!("{:.0} %", 100.0 * share))
        };
        self.watcher.message(&format!(
            "pose {} ({}), repeat {}: {} of {} beams, {} of the echoes agree",
            slot.pose,
            self.pose(slot.pose).label(),
            slot.repeat,
            figures.beams - figures.missing,
            figures.beams,
            percent(figures.agree_fraction),
        ));
        for finding in findings {
            let consequence = match finding.action {
                Action::Note => "noted",
                Action::Retake => "to be retaken",
                Action::Ask => "prompting",
                Action::Stop => "stopping",
            };
            self.watcher.message(&format!("  {}: {consequence}", finding.detail));
        }
    }
}

/// Returns `true` if any beam has a reading from the ranger.
fn is_measured(view: &ScanView) -> bool {
    view.pings.iter().any(|ping| ping.status != PingStatus::LinkLost)
}

/// Returns `true` if the link was lost before the last beam.
fn lacks_readings(view: &ScanView) -> bool {
    view.pings.iter().any(|ping| ping.status == PingStatus::LinkLost)
}

fn ranger_lost() -> CollectError {
    CollectError::failed(
        "the ranger was lost during the scan",
        "check its cable and supply with `sonard doctor --port PORT`",
    )
}

/// Details of all findings that reject a scan.
fn rejection_reason(findings: &[CheckFinding]) -> String {
    let details: Vec<_> = findings
        .iter()
        .filter(|finding| finding.action != Action::Note)
        .map(|finding| finding.detail.as_str())
        .collect();
    details.join("; ")
}

fn take_entry(
    slot: Slot,
    view: Option<&ScanView>,
    outcome: ScanOutcome,
    sealed: SealedFile,
    figures: ScanFigures,
    findings: Vec<CheckFinding>,
) -> JournalEntry {
    let start = view.and_then(|view| view.start.as_ref());
    JournalEntry::Attempt(Box::new(ScanAttempt {
        slot,
        scan: view.map(|view| view.scan),
        started: start.map(|start| start.time),
        outcome,
        file: sealed.file,
        bytes: sealed.bytes,
        sha256: sealed.sha256,
        figures,
        findings,
        incomplete_reason: None,
        wall_s: None,
    }))
}

/// Reads the first scan of a file, if any.
fn read(path: &Path) -> Result<Option<ScanView>, CollectError> {
    let loaded = load(path)?;
    Ok(ScanView::from_records(loaded.records).into_iter().next())
}
