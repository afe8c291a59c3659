//! Collection engine: takes the scans of a plan in order until all are accepted.

mod evaluate;
mod measure;
mod startup;
#[cfg(test)]
mod tests;

use std::{
    collections::{BTreeMap, HashMap, HashSet},
    sync::Arc,
    time::Duration,
};

use sonard_device::{ranger::PreparedScan, thermometer::Thermometer};
use sonard_model::acoustics::Air;
use sonard_records::CollectionRef;
use sonard_runtime::interrupts::Interrupts;
use uuid::Uuid;

use super::{
    AfterRetakes, CollectError, CollectionFolder, CollectionJournal, CollectionManifest,
    CollectionPlan, Conditions, JournalEntry, NamedPose, Observer, RetrySchedule, ScanDevice, Slot,
    estimate::{Pace, disk_bytes},
    pose_source::{PoseSource, answered},
};

/// Operator's options for one run.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct RunOptions {
    /// Continue although plan, scene or ranger have changed since the start.
    pub accept_changed_plan: bool,
    /// Retry the scans that were given up.
    pub retry_given_up: bool,
}

/// State of a running collection.
struct Collector<D, W> {
    choices: RunOptions,
    plan: CollectionPlan,
    folder: CollectionFolder,
    journal: CollectionJournal,
    id: Uuid,
    interrupts: Interrupts,
    source: PoseSource,
    /// `true` while the source may supply further poses.
    has_more_poses: bool,
    thermometer: Option<Thermometer>,
    /// Air of the current session.
    air: Air,
    /// Scan setups with predictions in that air, by pose number.
    prepared: HashMap<u32, Arc<PreparedScan>>,
    device: D,
    /// Pose confirmed by the operator in this run.
    confirmed_pose: Option<u32>,
    /// Pose of the simulated ranger.
    device_pose: Option<u32>,
    /// Retry delays while scans are lost; `None` after a complete one.
    losses: Option<RetrySchedule>,
    /// Number of rejections in this run, by scan.
    rejections: BTreeMap<Slot, u32>,
    /// Conditions entered at the start of this run.
    conditions: Conditions,
    pace: Pace,
    watcher: W,
}

/// Decision after a scan.
enum Next {
    Continue,
    /// End of the collection by the operator or the plan, with the reason.
    Stop(String),
}

/// Takes scans until all are accepted, a failure is final, or the run is interrupted.
///
/// # Errors
/// Returns the reason why scans are missing. Recorded scans are kept, and a run with the same plan
/// resumes the collection.
pub async fn collect<D: ScanDevice, W: Observer>(
    plan: CollectionPlan,
    choices: RunOptions,
    device: D,
    watcher: W,
    interrupts: Interrupts,
) -> Result<(), CollectError> {
    let mut collector = Collector::begin(plan, choices, device, watcher, interrupts).await?;
    let outcome = match collector.start().await {
        Ok(()) => collector.work().await,
        Err(halt) => return Err(halt),
    };
    collector.watcher.measuring_paused();
    collector.restore_settings().await;
    // The manifest lists the scans after every outcome.
    let closed = collector.close(outcome.is_ok());
    collector.device.close().await;
    outcome?;
    closed
}

impl<D: ScanDevice, W: Observer> Collector<D, W> {
    async fn work(&mut self) -> Result<(), CollectError> {
        let mut first = true;
        while let Some(slot) = self.next_slot().await? {
            if !std::mem::take(&mut first) {
                self.pause().await?;
            }
            self.confirm_pose(slot.pose).await?;
            self.update_air().await?;
            self.carry_to(slot.pose)?;
            let taken = self.take(slot).await?;
            if let Next::Stop(reason) = self.evaluate(slot, taken).await? {
                return Err(CollectError::Stopped(format!(
                    "{reason}\nrun the same command to resume"
                )));
            }
        }
        Ok(())
    }

    /// Returns the next scan to take; `None` once all are accepted or given up.
    async fn next_slot(&mut self) -> Result<Option<Slot>, CollectError> {
        loop {
            let accepted: HashSet<Slot> =
                self.journal.history().accepted().map(|take| take.slot).collect();
            let given_up = &self.journal.history().given_up;
            let open = |slot: &Slot| {
                let skipped = given_up.contains(slot) && !self.retries(*slot);
                !accepted.contains(slot) && !skipped
            };
            if let Some(slot) = self.journal.history().requested().into_iter().find(open) {
                return Ok(Some(slot));
            }
            if !self.has_more_poses || !self.request_pose().await? {
                return Ok(None);
            }
        }
    }

    /// Returns `true` if a given-up scan is retried in this run.
    fn retries(&self, slot: Slot) -> bool {
        let rejections = self.rejections.get(&slot).copied().unwrap_or(0);
        self.choices.retry_given_up && rejections <= self.plan.keys.collection.retakes
    }

    /// Requests a pose from the source; returns `false` if there are no more.
    async fn request_pose(&mut self) -> Result<bool, CollectError> {
        let number = self.journal.history().poses.keys().last().copied().unwrap_or(0) + 1;
        let count = self.plan.keys.poses.count;
        let has_source = !matches!(self.source, PoseSource::Listed);
        self.has_more_poses = has_source && (count == 0 || number <= count);
        if !self.has_more_poses {
            return Ok(false);
        }
        self.watcher.measuring_paused();
        let scene = Arc::clone(&self.plan.scene);
        let next = self.source.next(number, &scene, &mut self.watcher, &self.interrupts).await?;
        let Some(pose) = next else {
            self.has_more_poses = false;
            return Ok(false);
        };
        self.append(JournalEntry::Pose { number, pose })?;
        Ok(true)
    }

    async fn pause(&self) -> Result<(), CollectError> {
        let pause = Duration::from_secs_f64(self.plan.keys.collection.pause_s);
        tokio::select! {
            () = tokio::time::sleep(pause) => Ok(()),
            () = self.interrupts.clone().wait() => {
                Err(CollectError::interrupted())
            }
        }
    }

    /// Waits for the operator to confirm the ranger's pose (`poses.confirm`) and prompts for the
    /// conditions there.
    async fn confirm_pose(&mut self, number: u32) -> Result<(), CollectError> {
        let pose = self.pose(number);
        if self.confirmed_pose != Some(number) && self.plan.keys.poses.confirm {
            self.watcher.measuring_paused();
            let question =
                format!("put the ranger at {}, pose {number}, and press Enter:", pose.label());
            if answered(&mut self.watcher, &question, &self.interrupts).await?.is_none() {
                return Err(CollectError::invalid(
                    "poses.confirm needs a terminal to confirm the ranger's pose",
                    "run the command in a terminal, or without poses.confirm",
                ));
            }
        }
        self.confirmed_pose = Some(number);
        self.prompt_at_pose(number, pose).await
    }

    /// Moves a simulated ranger to a pose.
    fn carry_to(&mut self, number: u32) -> Result<(), CollectError> {
        if self.device_pose == Some(number) || !self.device.is_local() {
            return Ok(());
        }
        let prepared = self.prepared(number)?;
        self.device_pose = Some(number);
        self.device.move_to(&prepared)
    }

    /// Prompts for the conditions of a pose that are not recorded yet.
    async fn prompt_at_pose(
        &mut self,
        number: u32,
        mut pose: NamedPose,
    ) -> Result<(), CollectError> {
        let questions = self.plan.keys.ask.at_pose.clone();
        let open: Vec<_> =
            questions.into_iter().filter(|key| !pose.conditions.contains_key(key)).collect();
        if open.is_empty() {
            return Ok(());
        }
        self.watcher.measuring_paused();
        for key in open {
            let question = format!("pose {number}, {}: {key}:", pose.label());
            let answer = answered(&mut self.watcher, &question, &self.interrupts).await?;
            pose.conditions.insert(key, answer.unwrap_or_default().into());
        }
        self.append(JournalEntry::Pose { number, pose })
    }

    fn pose(&self, number: u32) -> NamedPose {
        // Slots refer to poses in the journal; the default is never used.
        let origin = sonard_model::geometry::Pose { x_m: 0.0, y_m: 0.0, heading_deg: 0.0 };
        self.journal.history().poses.get(&number).cloned().unwrap_or(NamedPose {
            name: None,
            pose: origin,
            conditions: Conditions::new(),
        })
    }

    fn collection_ref(&self, slot: Slot) -> CollectionRef {
        let pose = self.pose(slot.pose);
        let mut conditions = self.plan.keys.conditions.clone();
        conditions.extend(self.conditions.clone());
        conditions.extend(pose.conditions);
        CollectionRef {
            id: self.id,
            name: self.plan.keys.collection.name.clone(),
            pose: slot.pose,
            pose_name: pose.name,
            repeat: slot.repeat,
            conditions,
        }
    }

    fn append(&mut self, entry: JournalEntry) -> Result<(), CollectError> {
        Ok(self.journal.append(entry)?)
    }

    fn write_manifest(&self) -> Result<(), CollectError> {
        let manifest = CollectionManifest::from_history(&self.folder, self.journal.history())?;
        Ok(manifest.write(&self.folder)?)
    }

    /// Writes the manifest and, for a complete collection, the report; logs a summary.
    fn close(&self, complete: bool) -> Result<(), CollectError> {
        let history = self.journal.history();
        if complete {
            self.watcher.write_report(&self.folder, history)?;
        }
        self.write_manifest()?;
        let requested = history.requested();
        let done = history.accepted().count();
        let given_up = requested.iter().filter(|slot| history.is_given_up(**slot)).count();
        let (estimated_s, measured_s) = self.pace.times_s();
        self.watcher.message(&format!(
            "{done} of {} scans in {}, {} rejected, {given_up} given up; this run: {measured_s:.1} s \
             of scanning, estimated {estimated_s:.1} s",
            requested.len(),
            self.folder.root().display(),
            history.set_aside().count(),
        ));
        if complete && given_up > 0 {
            return Err(CollectError::Stopped(format!(
                "{given_up} scans failed (reasons in report.md); --retry-failed retries them"
            )));
        }
        Ok(())
    }

    /// Applies `collection.after_retakes` to a scan whose retakes are used up.
    fn give_up(&mut self, slot: Slot) -> Result<Next, CollectError> {
        let retakes = self.plan.keys.collection.retakes;
        let Slot { pose, repeat } = slot;
        let reason = format!("pose {pose}, repeat {repeat}: {retakes} retakes failed");
        match self.plan.keys.collection.after_retakes {
            AfterRetakes::Stop => Ok(Next::Stop(reason)),
            AfterRetakes::Continue => {
                self.watcher.message(&format!("{reason}: continuing without this scan"));
                self.append(JournalEntry::GivenUp { slot, time: jiff::Timestamp::now() })?;
                Ok(Next::Continue)
            }
        }
    }
}

/// Free disk space at the collection's folder, bytes.
fn free_bytes(folder: &CollectionFolder) -> Option<u64> {
    let disk = rustix::fs::statvfs(folder.root()).ok()?;
    Some(disk.f_bavail.saturating_mul(disk.f_frsize))
}

/// Warns if the remaining scans are expected to exceed the free disk space.
fn warn_of_disk(
    plan: &CollectionPlan,
    folder: &CollectionFolder,
    scans: u32,
    watcher: &impl Observer,
) {
    let required = disk_bytes(plan, scans);
    if let Some(free) = free_bytes(folder).filter(|&free| required > free as f64) {
        watcher.message(&format!(
            "warning: the scans need about {:.0} MB; {:.0} MB of disk are free",
            required / 1e6,
            free as f64 / 1e6
        ));
    }
}
