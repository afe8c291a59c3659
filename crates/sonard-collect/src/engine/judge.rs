//! What becomes of a scan: accepted, refused or cut.

use std::{collections::HashSet, path::Path, time::Duration};

use sonard_log::{LogWriter, load};
use sonard_records::{PingStatus, ScanView};
use tokio::time::sleep;

use super::{
    super::{
        Action, Device, Entry, Figures, Finding, Halt, Outcome, Patience, Sealed, Slot, Take,
        Watcher, check, is_cut,
        source::answered,
        taking::{self, Taken},
        verdict,
    },
    Collector, Next,
};

impl<D: Device, W: Watcher> Collector<D, W> {
    /// Lets a scan count, or sets it aside, and says what is next.
    pub(super) async fn judge(
        &mut self,
        slot: Slot,
        (taken, change_c): (Taken, Option<f64>),
    ) -> Result<Next, Halt> {
        let Taken { view, lost, stopped, wall_s, gone: _ } = taken;
        let lost =
            lost.or_else(|| view.as_ref().filter(|view| lacks_readings(view)).map(|_| gone()));
        let Some(view) = view.filter(|view| !is_cut(view) && is_measured(view)) else {
            return self.broken_off(slot, lost, stopped).await;
        };
        if lost.is_none() {
            self.losses = None;
        }
        let figures = Figures::of(&view, change_c);
        let findings = check(&figures, &self.plan.keys.checks);
        let mut action = verdict(&findings);
        self.tell(slot, &figures, &findings);
        if action == Action::Ask {
            action = self.ask_what_to_do().await?;
        }
        if action == Action::Note {
            self.accept(slot, &view, figures, findings, Some(wall_s))?;
            return Ok(Next::GoOn);
        }
        let why = words(&findings);
        self.set_aside(slot, Some((&view, figures, wall_s)), Outcome::Refused, findings, &why)?;
        if self.interrupts.happened() {
            return Ok(Next::Stop("stopped on request".into()));
        }
        match action {
            Action::Stop | Action::Ask => Ok(Next::Stop(format!("stopped: {why}"))),
            Action::Note | Action::Retake => match lost {
                Some(lost) => self.wait_for_ranger(lost).await,
                None => self.count_refusal(slot),
            },
        }
    }

    /// Puts away a scan without an end, or without a reading, and says what is next.
    async fn broken_off(
        &mut self,
        slot: Slot,
        lost: Option<Halt>,
        stopped: bool,
    ) -> Result<Next, Halt> {
        let stop = match (self.interrupts.happened(), stopped) {
            (true, _) => Some("stopped on request"),
            (_, true) => Some("the daemon was told to stop"),
            _ => None,
        };
        // A ranger that loses scan after scan before the first reading must not fill the folder.
        if stop.is_some() || read(&self.folder.taking(slot))?.is_some_and(|view| is_measured(&view))
        {
            self.set_aside(slot, None, Outcome::Cut, Vec::new(), "it was broken off")?;
        } else {
            self.folder.discard(slot)?;
        }
        if let Some(why) = stop {
            return Ok(Next::Stop(why.into()));
        }
        self.wait_for_ranger(lost.unwrap_or_else(gone)).await
    }

    /// Gives a ranger that lost a scan time before the next one, longer each time. That says nothing
    /// about the pose, so it is no refusal: the collection ends when the plan's patience does.
    async fn wait_for_ranger(&mut self, lost: Halt) -> Result<Next, Halt> {
        let patience = Duration::from_secs_f64(self.plan.keys.collection.patience_s);
        let losses = self.losses.get_or_insert_with(|| Patience::with_losses(patience));
        let (Halt::Failed { .. }, Some(wait)) = (&lost, losses.next_wait()) else {
            return match lost {
                // The daemon wants no more of it.
                Halt::Stopped(why) => Ok(Next::Stop(why)),
                lost => Err(lost),
            };
        };
        self.watcher.say(&format!(
            "the ranger was lost, the scan is taken again in {} s: {lost}",
            wait.as_secs()
        ));
        tokio::select! {
            () = sleep(wait) => Ok(Next::GoOn),
            () = self.interrupts.clone().wait() => Ok(Next::Stop("stopped on request".into())),
        }
    }

    /// Takes in what an earlier run left behind: a scan that was whole counts as if nothing had
    /// happened, another one is kept beside.
    pub(super) fn take_in_left_overs(&mut self) -> Result<(), Halt> {
        // Renamed, but not told: the rename is what counts.
        let told: HashSet<Slot> = self.journal.history().accepted().map(|take| take.slot).collect();
        let scans = self.folder.scans()?;
        for slot in scans.into_iter().filter(|slot| !told.contains(slot)) {
            let sealed = self.folder.sealed(slot)?;
            let path = self.folder.root().join(&sealed.file);
            let Some(view) = read(&path)? else { continue };
            let figures = Figures::of(&view, None);
            let findings = check(&figures, &self.plan.keys.checks);
            self.note(take_entry(slot, Some(&view), Outcome::Accepted, sealed, figures, findings))?;
        }
        for slot in self.folder.left_over()? {
            let path = self.folder.taking(slot);
            // Opening mends an end that was torn off.
            LogWriter::open(&path).and_then(LogWriter::close)?;
            let view = read(&path)?.filter(|view| !is_cut(view));
            let done = self.folder.sealed(slot).is_ok();
            match view {
                Some(view) if !done => self.judge_left_over(slot, &view)?,
                _ => {
                    let why = "the program ended within it";
                    self.set_aside(slot, None, Outcome::Cut, Vec::new(), why)?;
                }
            }
        }
        Ok(())
    }

    fn judge_left_over(&mut self, slot: Slot, view: &ScanView) -> Result<(), Halt> {
        let figures = Figures::of(view, None);
        let findings = check(&figures, &self.plan.keys.checks);
        if verdict(&findings) == Action::Note {
            return self.accept(slot, view, figures, findings, None);
        }
        let why = words(&findings);
        let wall_s = f64::NAN;
        self.set_aside(slot, Some((view, figures, wall_s)), Outcome::Refused, findings, &why)
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
        self.note(entry)?;
        if let Some(wall_s) = wall_s {
            self.pace.learn(wall_s);
        }
        self.write_manifest()
    }

    fn set_aside(
        &mut self,
        slot: Slot,
        of: Option<(&ScanView, Figures, f64)>,
        outcome: Outcome,
        findings: Vec<Finding>,
        why: &str,
    ) -> Result<(), Halt> {
        let path = self.folder.taking(slot);
        taking::mark(&path, why)?;
        let sealed = self.folder.set_aside(slot)?;
        let kept = match of {
            Some(_) => None,
            None => read(&self.folder.root().join(&sealed.file))?,
        };
        let view = of.map(|(view, ..)| view).or(kept.as_ref());
        let figures = of.map_or_else(
            || view.map(|view| Figures::of(view, None)).unwrap_or_default(),
            |(_, figures, _)| figures,
        );
        let mut entry = take_entry(slot, view, outcome, sealed, figures, findings);
        if let Entry::Take(take) = &mut entry {
            take.wall_s = of.map(|(.., wall_s)| wall_s).filter(|wall_s| wall_s.is_finite());
            take.cut = (outcome == Outcome::Cut).then(|| why.to_owned());
        }
        self.note(entry)
    }

    /// One refusal more; after too many the scan is given up.
    fn count_refusal(&mut self, slot: Slot) -> Result<Next, Halt> {
        let refused = self.refused.entry(slot).or_default();
        *refused += 1;
        if *refused > self.plan.keys.collection.retakes {
            return self.give_up(slot);
        }
        Ok(Next::GoOn)
    }

    async fn ask_what_to_do(&mut self) -> Result<Action, Halt> {
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

    /// One line about a scan, and one about each finding.
    fn tell(&self, slot: Slot, figures: &Figures, findings: &[Finding]) {
        let percent = |share: Option<f64>| {
            share.map_or_else(|| "-".into(), |share| format!("{:.0} %", 100.0 * share))
        };
        self.watcher.say(&format!(
            "pose {} ({}), repeat {}: {} of {} beams, {} of the echo pairs agree",
            slot.pose,
            self.pose(slot.pose).label(),
            slot.repeat,
            figures.beams - figures.missing,
            figures.beams,
            percent(figures.agree_fraction),
        ));
        for finding in findings {
            let done = match finding.action {
                Action::Note => "noted",
                Action::Retake => "to be retaken",
                Action::Ask => "asking",
                Action::Stop => "stopping",
            };
            self.watcher.say(&format!("  {}: {done}", finding.detail));
        }
    }
}

/// Whether any beam has a reading of the ranger's.
fn is_measured(view: &ScanView) -> bool {
    view.pings.iter().any(|ping| ping.status != PingStatus::LinkLost)
}

/// Whether the ranger was given up before its last beam.
fn lacks_readings(view: &ScanView) -> bool {
    view.pings.iter().any(|ping| ping.status == PingStatus::LinkLost)
}

fn gone() -> Halt {
    Halt::failed(
        "the ranger was lost during the scan",
        "look at its cable and supply: `sonard doctor --port PORT` examines them",
    )
}

fn words(findings: &[Finding]) -> String {
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

/// The scan in a file, if it holds one.
fn read(path: &Path) -> Result<Option<ScanView>, Halt> {
    let loaded = load(path)?;
    Ok(ScanView::from_records(loaded.records).into_iter().next())
}
