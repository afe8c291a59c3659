//! Takes the scans of a plan, one after the other, until all are there.

mod begin;
mod judge;
mod measure;
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
    AfterRetakes, Conditions, Device, Entry, Folder, Halt, Journal, Manifest, NamedPose, Patience,
    Plan, Slot, Watcher,
    estimate::{Pace, disk_bytes},
    source::{Source, answered},
};

/// Choices of the operator for a run.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Choices {
    /// Continue although plan, scene or ranger have changed since the start.
    pub accept_changed_plan: bool,
    /// Retry the scans that were given up.
    pub retry_given_up: bool,
}

/// A collection under way.
struct Collector<D, W> {
    choices: Choices,
    plan: Plan,
    folder: Folder,
    journal: Journal,
    id: Uuid,
    interrupts: Interrupts,
    source: Source,
    /// Whether the source may have more poses.
    more: bool,
    thermometer: Option<Thermometer>,
    /// The air of the session.
    air: Air,
    /// What is to be measured at each pose in that air.
    prepared: HashMap<u32, Arc<PreparedScan>>,
    device: D,
    /// The pose at which the ranger stands, as far as people said so in this run.
    here: Option<u32>,
    /// The pose that the device was carried to.
    carried_to: Option<u32>,
    /// Waits while the ranger loses one scan after the other; `None` once it took a whole one.
    losses: Option<Patience>,
    /// Refused scans of this run.
    refused: BTreeMap<Slot, u32>,
    /// Noted at the start of this run.
    conditions: Conditions,
    pace: Pace,
    watcher: W,
}

/// What comes after a scan.
enum Next {
    GoOn,
    /// The person or the plan wants no more, and why.
    Stop(String),
}

/// Collects until every scan is there, something can't be mended, or somebody interrupts.
///
/// # Errors
/// Why not every scan is there; what was taken is kept, and a run by the same plan goes on.
pub async fn collect<D: Device, W: Watcher>(
    plan: Plan,
    choices: Choices,
    device: D,
    watcher: W,
    interrupts: Interrupts,
) -> Result<(), Halt> {
    let mut collector = Collector::begin(plan, choices, device, watcher, interrupts).await?;
    let outcome = match collector.start().await {
        Ok(()) => collector.work().await,
        Err(halt) => return Err(halt),
    };
    collector.watcher.rest();
    collector.give_back().await;
    // However it ended, the manifest says what is there.
    let closed = collector.close(outcome.is_ok());
    collector.device.close().await;
    outcome?;
    closed
}

impl<D: Device, W: Watcher> Collector<D, W> {
    async fn work(&mut self) -> Result<(), Halt> {
        let mut first = true;
        while let Some(slot) = self.next_slot().await? {
            if !std::mem::take(&mut first) {
                self.pause().await?;
            }
            self.stand_at(slot.pose).await?;
            self.follow_air().await?;
            self.carry_to(slot.pose)?;
            let taken = self.take(slot).await?;
            if let Next::Stop(why) = self.judge(slot, taken).await? {
                return Err(Halt::Stopped(format!(
                    "{why}\nstart it again with the same plan: it goes on where it stopped"
                )));
            }
        }
        Ok(())
    }

    /// The scan to take now; `None` when all are there.
    async fn next_slot(&mut self) -> Result<Option<Slot>, Halt> {
        loop {
            let accepted: HashSet<Slot> =
                self.journal.history().accepted().map(|take| take.slot).collect();
            let given_up = &self.journal.history().given_up;
            let open = |slot: &Slot| {
                let left = given_up.contains(slot) && !self.retries(*slot);
                !accepted.contains(slot) && !left
            };
            if let Some(slot) = self.journal.history().wanted().into_iter().find(open) {
                return Ok(Some(slot));
            }
            if !self.more || !self.another_pose().await? {
                return Ok(None);
            }
        }
    }

    /// Whether a scan that was given up is to be tried once more, in this run.
    fn retries(&self, slot: Slot) -> bool {
        let refused = self.refused.get(&slot).copied().unwrap_or(0);
        self.choices.retry_given_up && refused <= self.plan.keys.collection.retakes
    }

    /// Asks the source for a pose; whether there was one.
    async fn another_pose(&mut self) -> Result<bool, Halt> {
        let number = self.journal.history().poses.keys().last().copied().unwrap_or(0) + 1;
        let count = self.plan.keys.poses.count;
        self.more = (count == 0 || number <= count) && !matches!(self.source, Source::Listed);
        if !self.more {
            return Ok(false);
        }
        self.watcher.rest();
        let scene = Arc::clone(&self.plan.scene);
        let next = self.source.next(number, &scene, &mut self.watcher, &self.interrupts).await?;
        let Some(pose) = next else {
            self.more = false;
            return Ok(false);
        };
        self.note(Entry::Pose { number, pose })?;
        Ok(true)
    }

    async fn pause(&self) -> Result<(), Halt> {
        let pause = Duration::from_secs_f64(self.plan.keys.collection.pause_s);
        tokio::select! {
            () = tokio::time::sleep(pause) => Ok(()),
            () = self.interrupts.clone().wait() => {
                Err(Halt::on_request())
            }
        }
    }

    /// Waits until people say that the ranger stands at a pose, as far as that is wanted, and
    /// asks what is to be noted there.
    async fn stand_at(&mut self, number: u32) -> Result<(), Halt> {
        let pose = self.pose(number);
        if self.here != Some(number) && self.plan.keys.poses.confirm {
            self.watcher.rest();
            let question =
                format!("put the ranger at {}, pose {number}, and press Enter:", pose.label());
            if answered(&mut self.watcher, &question, &self.interrupts).await?.is_none() {
                return Err(Halt::wrong(
                    "nobody is there to say that the ranger stands at its pose",
                    "start it at a terminal, or without poses.confirm",
                ));
            }
        }
        self.here = Some(number);
        self.ask_at_pose(number, pose).await
    }

    /// Carries a ranger that is no real one.
    fn carry_to(&mut self, number: u32) -> Result<(), Halt> {
        if self.carried_to == Some(number) || !self.device.is_local() {
            return Ok(());
        }
        let prepared = self.prepared(number)?;
        self.carried_to = Some(number);
        self.device.carry_to(&prepared)
    }

    /// Asks what is to be noted at a pose, unless it is noted already.
    async fn ask_at_pose(&mut self, number: u32, mut pose: NamedPose) -> Result<(), Halt> {
        let questions = self.plan.keys.ask.at_pose.clone();
        let open: Vec<_> =
            questions.into_iter().filter(|key| !pose.conditions.contains_key(key)).collect();
        if open.is_empty() {
            return Ok(());
        }
        self.watcher.rest();
        for key in open {
            let question = format!("pose {number}, {}: {key}:", pose.label());
            let answer = answered(&mut self.watcher, &question, &self.interrupts).await?;
            pose.conditions.insert(key, answer.unwrap_or_default().into());
        }
        self.note(Entry::Pose { number, pose })
    }

    fn pose(&self, number: u32) -> NamedPose {
        // Slots are made of poses that the journal knows.
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

    fn note(&mut self, entry: Entry) -> Result<(), Halt> {
        Ok(self.journal.append(entry)?)
    }

    fn write_manifest(&self) -> Result<(), Halt> {
        let manifest = Manifest::of(&self.folder, self.journal.history())?;
        Ok(manifest.write(&self.folder)?)
    }

    /// Report and manifest, and in words how it went.
    fn close(&self, whole: bool) -> Result<(), Halt> {
        let history = self.journal.history();
        if whole {
            self.watcher.report(&self.folder, history)?;
        }
        self.write_manifest()?;
        let wanted = history.wanted();
        let done = history.accepted().count();
        let given_up = wanted.iter().filter(|slot| history.is_given_up(**slot)).count();
        let (estimated_s, measured_s) = self.pace.times_s();
        self.watcher.say(&format!(
            "{done} of {} scans in {}, {} set aside, {given_up} given up; this run: {measured_s:.1} s \
             of scanning, {estimated_s:.1} s estimated",
            wanted.len(),
            self.folder.root().display(),
            history.set_aside().count(),
        ));
        if whole && given_up > 0 {
            return Err(Halt::Stopped(format!(
                "{given_up} scans were given up: report.md says why; --retry-failed tries again"
            )));
        }
        Ok(())
    }

    /// What to do about a scan that can't be taken as it should be.
    fn give_up(&mut self, slot: Slot) -> Result<Next, Halt> {
        let retakes = self.plan.keys.collection.retakes;
        let why =
            format!("pose {}, repeat {}: {retakes} retakes did not help", slot.pose, slot.repeat);
        match self.plan.keys.collection.after_retakes {
            AfterRetakes::Stop => Ok(Next::Stop(why)),
            AfterRetakes::GoOn => {
                self.watcher.say(&format!("{why}: going on without it"));
                self.note(Entry::GivenUp { slot, time: jiff::Timestamp::now() })?;
                Ok(Next::GoOn)
            }
        }
    }
}

/// Bytes free where the collection goes.
fn free_bytes(folder: &Folder) -> Option<u64> {
    let disk = rustix::fs::statvfs(folder.root()).ok()?;
    Some(disk.f_bavail.saturating_mul(disk.f_frsize))
}

/// Says when the disk is too small for what is to come.
fn warn_of_disk(plan: &Plan, folder: &Folder, scans: u32, watcher: &impl Watcher) {
    let wanted = disk_bytes(plan, scans);
    if let Some(free) = free_bytes(folder).filter(|&free| wanted > free as f64) {
        watcher.say(&format!(
            "warning: the scans take some {:.0} MB, and {:.0} MB of disk are free",
            wanted / 1e6,
            free as f64 / 1e6
        ));
    }
}
