//! Evaluation of a recorded scan: accepted, rejected or incomplete.

use std::{collections::HashSet, path::Path, time::Duration};

use sonard_log::{LogWriter, load};
use sonard_records::{PingStatus, ScanView};
use tokio::time::sleep;

use super::{
    super::{
        Action, Device, Entry, Figures, Finding, Halt, Outcome, Patience, Sealed, Slot, Take,
        Watcher, check, is_cut,
        pose_source::answered,
        record_scan::{self, Taken},
        verdict,
    },
    Collector, Next,
};

impl<D: Device, W: Watcher> Collector<D, W> {
    /// Accepts a scan or sets it aside, and returns the next step.
    pub(super) async fn evaluate(
        &mut self,
        slot: Slot,
        (taken, change_c): (Taken, Option<f64>),
    ) -> Result<Next, Halt> {
        let Taken { view, lost, stopped, wall_s, gone: _ } = taken;
        let lost = lost
            .or_else(|| view.as_ref().filter(|view| lacks_readings(view)).map(|_| ranger_lost()));
        let Some(view) = view.filter(|view| !is_cut(view) && is_measured(view)) else {
            return self.set_aside_incomplete(slot, lost, stopped).await;
        };
        if lost.is_none() {
            self.losses = None;
        }
        let figures = Figures::from_scan(&view, change_c);
        let findings = check(&figures, &self.plan.keys.checks);
        let mut action = verdict(&findings);
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
        self.set_aside(slot, scan, Outcome::Refused, findings, &reason)?;
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
        lost: Option<Halt>,
        stopped: bool,
    ) -> Result<Next, Halt> {
        let stop = match (self.interrupts.happened(), stopped) {
            (true, _) => Some("stopped on request"),
            (_, true) => Some("the daemon was stopped by another client"),
            _ => None,
        };
        // Scans lost before their first reading are removed, or repeated losses would fill the
        // folder.
        if stop.is_some() || read(&self.folder.taking(slot))?.is_some_and(|view| is_measured(&view))
        {
            self.set_aside(slot, None, Outcome::Cut, Vec::new(), "incomplete")?;
        } else {
            self.folder.discard(slot)?;
        }
        if let Some(reason) = stop {
            return Ok(Next::Stop(reason.into()));
        }
        self.wait_for_ranger(lost.unwrap_or_else(ranger_lost)).await
    }

    /// Waits after a lost scan, longer after each one. A loss is independent of the pose, so it
    /// does not count as a retake; the collection ends after `collection.patience_s`.
    async fn wait_for_ranger(&mut self, lost: Halt) -> Result<Next, Halt> {
        let patience = Duration::from_secs_f64(self.plan.keys.collection.patience_s);
        let losses = self.losses.get_or_insert_with(|| Patience::with_losses(patience));
        let (Halt::Failed { .. }, Some(wait)) = (&lost, losses.next_wait()) else {
            return match lost {
                // The daemon dropped the request.
                Halt::Stopped(reason) => Ok(Next::Stop(reason)),
                lost => Err(lost),
            };
        };
        self.watcher
            .say(&format!("ranger lost; repeating the scan in {} s: {lost}", wait.as_secs()));
        tokio::select! {
            () = sleep(wait) => Ok(Next::Continue),
            () = self.interrupts.clone().wait() => Ok(Next::Stop("stopped on request".into())),
        }
    }

    /// Recovers the scans of an interrupted run: complete ones are evaluated like new scans, others
    /// are set aside.
    pub(super) fn recover_scans(&mut self) -> Result<(), Halt> {
        // The rename accepts a scan; its journal entry may be missing after a crash.
        let history = self.journal.history();
        let journaled: HashSet<Slot> = history.accepted().map(|take| take.slot).collect();
        let scans = self.folder.scans()?;
        for slot in scans.into_iter().filter(|slot| !journaled.contains(slot)) {
            let sealed = self.folder.sealed(slot)?;
            let path = self.folder.root().join(&sealed.file);
            let Some(view) = read(&path)? else { continue };
            let figures = Figures::from_scan(&view, None);
            let findings = check(&figures, &self.plan.keys.checks);
            let entry = take_entry(slot, Some(&view), Outcome::Accepted, sealed, figures, findings);
            self.append(entry)?;
        }
        for slot in self.folder.left_over()? {
            let path = self.folder.taking(slot);
            // Opening removes an incomplete last line.
            LogWriter::open(&path).and_then(LogWriter::close)?;
            let view = read(&path)?.filter(|view| !is_cut(view));
            let done = self.folder.sealed(slot).is_ok();
            match view {
                Some(view) if !done => self.evaluate_recovered(slot, &view)?,
                _ => {
                    let reason = "the program ended during the scan";
                    self.set_aside(slot, None, Outcome::Cut, Vec::new(), reason)?;
                }
            }
        }
        Ok(())
    }

    fn evaluate_recovered(&mut self, slot: Slot, view: &ScanView) -> Result<(), Halt> {
        let figures = Figures::from_scan(view, None);
        let findings = check(&figures, &self.plan.keys.checks);
        if verdict(&findings) == Action::Note {
            return self.accept(slot, view, figures, findings, None);
        }
        let reason = rejection_reason(&findings);
        let wall_s = f64::NAN;
        self.set_aside(slot, Some((view, figures, wall_s)), Outcome::Refused, findings, &reason)
    }

    fn accept(
        &mut self,
        slot: Slot,
        view: &ScanView,
        figures: Figures,
        findings: Vec<Finding>,
        wall_s: Option<f64>,
    ) -> Result<(), Halt> {
        let sealed = self.folder.accept(slot)?;
        let mut entry = take_entry(slot, Some(view), Outcome::Accepted, sealed, figures, findings);
        if let Entry::Take(take) = &mut entry {
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
        scan: Option<(&ScanView, Figures, f64)>,
        outcome: Outcome,
        findings: Vec<Finding>,
        reason: &str,
    ) -> Result<(), Halt> {
        let path = self.folder.taking(slot);
        record_scan::mark_rejected(&path, reason)?;
        let sealed = self.folder.set_aside(slot)?;
        let stored = match scan {
            Some(_) => None,
            None => read(&self.folder.root().join(&sealed.file))?,
        };
        let view = scan.map(|(view, ..)| view).or(stored.as_ref());
        let figures = scan.map_or_else(
            || view.map(|view| Figures::from_scan(view, None)).unwrap_or_default(),
            |(_, figures, _)| figures,
        );
        let mut entry = take_entry(slot, view, outcome, sealed, figures, findings);
        if let Entry::Take(take) = &mut entry {
            take.wall_s = scan.map(|(.., wall_s)| wall_s).filter(|wall_s| wall_s.is_finite());
            take.cut = (outcome == Outcome::Cut).then(|| reason.to_owned());
        }
        self.append(entry)
    }

    /// Counts a rejection; the scan is given up once `collection.retakes` are used.
    fn count_rejection(&mut self, slot: Slot) -> Result<Next, Halt> {
        let rejections = self.rejections.entry(slot).or_default();
        *rejections += 1;
        if *rejections > self.plan.keys.collection.retakes {
            return self.give_up(slot);
        }
        Ok(Next::Continue)
    }

    async fn prompt_action(&mut self) -> Result<Action, Halt> {
        self.watcher.rest();
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
    fn report_findings(&self, slot: Slot, figures: &Figures, findings: &[Finding]) {
        let percent = |share: Option<f64>| {
            share.map_or_else(|| "-".into(), |share| format!("{:.0} %", 100.0 * share))
        };
        self.watcher.say(&format!(
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
            self.watcher.say(&format!("  {}: {consequence}", finding.detail));
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

fn ranger_lost() -> Halt {
    Halt::failed(
        "the ranger was lost during the scan",
        "check its cable and supply with `sonard doctor --port PORT`",
    )
}

/// Details of all findings that reject a scan.
fn rejection_reason(findings: &[Finding]) -> String {
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
    outcome: Outcome,
    sealed: Sealed,
    figures: Figures,
    findings: Vec<Finding>,
) -> Entry {
    let start = view.and_then(|view| view.start.as_ref());
    Entry::Take(Box::new(Take {
        slot,
        scan: view.map(|view| view.scan),
        started: start.map(|start| start.time),
        outcome,
        file: sealed.file,
        bytes: sealed.bytes,
        sha256: sealed.sha256,
        figures,
        findings,
        cut: None,
        wall_s: None,
    }))
}

/// Reads the first scan of a file, if any.
fn read(path: &Path) -> Result<Option<ScanView>, Halt> {
    let loaded = load(path)?;
    Ok(ScanView::from_records(loaded.records).into_iter().next())
}
