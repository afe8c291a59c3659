//! Takes the scans of a plan, one after the other, until all are there.

mod begin;
mod judge;
mod measure;

use std::{
    collections::{BTreeMap, HashMap},
    sync::Arc,
    time::Duration,
};

use super::{
    Args, bar::Bar, daemon::Daemon, device::Device, load::Loaded, patience::Patience, preview,
    refuse, report, source::Source, terminal::Terminal, thermometer::Thermometer,
};
use crate::{
    acoustics::Air,
    cli::{Failure, Outcome, runtime::Interrupts, scan::setup::Setup},
    collect::{AfterRetakes, Conditions, Entry, Folder, Journal, Manifest, NamedPose, Slot},
    scan::CollectionRef,
};
use uuid::Uuid;

/// A collection under way.
struct Collector<'a> {
    args: &'a Args,
    loaded: Loaded,
    folder: Folder,
    journal: Journal,
    id: Uuid,
    interrupts: Interrupts,
    terminal: Terminal,
    source: Source,
    /// Whether the source may have more poses.
    more: bool,
    thermometer: Thermometer,
    /// The air of the session.
    air: Air,
    /// What is to be measured at each pose in that air.
    setups: HashMap<u32, Arc<Setup>>,
    device: Option<Device>,
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
    bar: Bar,
}

/// What comes after a scan.
enum Next {
    GoOn,
    /// The person or the plan wants no more, and why.
    Stop(String),
}

/// Collects until every scan is there, something can't be mended, or somebody interrupts.
pub(super) async fn collect(
    args: &Args,
    loaded: Loaded,
    daemon: Option<Daemon>,
    interrupts: Interrupts,
) -> Outcome {
    let mut collector = Collector::begin(args, loaded, daemon, interrupts).await?;
    let outcome = collector.work().await;
    collector.bar.hide();
    collector.leave_device().await;
    // However it ended, the manifest says what is there.
    let closed = collector.close(outcome.is_ok());
    outcome?;
    closed
}

impl Collector<'_> {
    async fn work(&mut self) -> Outcome {
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
                return Err(Failure::Found(Some(format!(
                    "{why}\nstart it again with the same plan: it goes on where it stopped"
                ))));
            }
        }
        Ok(())
    }

    /// The scan to take now; `None` when all are there.
    async fn next_slot(&mut self) -> Result<Option<Slot>, Failure> {
        loop {
            let accepted: std::collections::HashSet<Slot> =
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
        self.args.retry_given_up && refused <= self.loaded.keys.collection.retakes
    }

    /// Asks the source for a pose; whether there was one.
    async fn another_pose(&mut self) -> Result<bool, Failure> {
        let number = self.journal.history().poses.keys().last().copied().unwrap_or(0) + 1;
        let count = self.loaded.keys.poses.count;
        self.more = (count == 0 || number <= count) && !matches!(self.source, Source::Listed);
        if !self.more {
            return Ok(false);
        }
        self.bar.hide();
        let scene = Arc::clone(&self.loaded.scene);
        let next = self.source.next(number, &scene, &mut self.terminal, &self.interrupts).await?;
        let Some(pose) = next else {
            self.more = false;
            return Ok(false);
        };
        self.note(Entry::Pose { number, pose })?;
        Ok(true)
    }

    async fn pause(&self) -> Outcome {
        let pause = Duration::from_secs_f64(self.loaded.keys.collection.pause_s);
        tokio::select! {
            () = tokio::time::sleep(pause) => Ok(()),
            () = self.interrupts.clone().wait() => {
                Err(Failure::stopped())
            }
        }
    }

    /// Waits until people say that the ranger stands at a pose, as far as that is wanted, and
    /// asks what is to be noted there.
    async fn stand_at(&mut self, number: u32) -> Outcome {
        let pose = self.pose(number);
        if self.here != Some(number) && self.loaded.keys.poses.confirm {
            self.bar.hide();
            let question =
                format!("put the ranger at {}, pose {number}, and press Enter:", pose.label());
            if self.terminal.ask(&question, &self.interrupts).await?.is_none() {
                return Err(Failure::input(
                    "nobody is there to say that the ranger stands at its pose",
                    "start it at a terminal, or without poses.confirm",
                ));
            }
        }
        self.here = Some(number);
        self.ask_at_pose(number, pose).await
    }

    /// Carries a ranger that is no real one.
    fn carry_to(&mut self, number: u32) -> Outcome {
        if self.carried_to == Some(number) || matches!(self.device, Some(Device::Daemon(_))) {
            return Ok(());
        }
        let setup = self.setup(number)?;
        self.carried_to = Some(number);
        self.device.as_mut().map_or(Ok(()), |device| device.carry_to(&setup))
    }

    /// Asks what is to be noted at a pose, unless it is noted already.
    async fn ask_at_pose(&mut self, number: u32, mut pose: NamedPose) -> Outcome {
        let questions = self.loaded.keys.ask.at_pose.clone();
        let open: Vec<_> =
            questions.into_iter().filter(|key| !pose.conditions.contains_key(key)).collect();
        if open.is_empty() {
            return Ok(());
        }
        self.bar.hide();
        for key in open {
            let question = format!("pose {number}, {}: {key}:", pose.label());
            let answer = self.terminal.ask(&question, &self.interrupts).await?;
            pose.conditions.insert(key, answer.unwrap_or_default().into());
        }
        self.note(Entry::Pose { number, pose })
    }

    fn pose(&self, number: u32) -> NamedPose {
        // Slots are made of poses that the journal knows.
        let origin = crate::geometry::Pose { x_m: 0.0, y_m: 0.0, heading_deg: 0.0 };
        self.journal.history().poses.get(&number).cloned().unwrap_or(NamedPose {
            name: None,
            pose: origin,
            conditions: Conditions::new(),
        })
    }

    fn collection_ref(&self, slot: Slot) -> CollectionRef {
        let pose = self.pose(slot.pose);
        let mut conditions = self.loaded.keys.conditions.clone();
        conditions.extend(self.conditions.clone());
        conditions.extend(pose.conditions);
        CollectionRef {
            id: self.id,
            name: self.loaded.keys.collection.name.clone(),
            pose: slot.pose,
            pose_name: pose.name,
            repeat: slot.repeat,
            conditions,
        }
    }

    fn note(&mut self, entry: Entry) -> Outcome {
        self.journal.append(entry).map_err(|error| refuse(&error))
    }

    fn write_manifest(&self) -> Outcome {
        Manifest::of(&self.folder, self.journal.history())
            .and_then(|manifest| manifest.write(&self.folder))
            .map_err(|error| refuse(&error))
    }

    /// Report and manifest, and in words how it went.
    fn close(&self, whole: bool) -> Outcome {
        let history = self.journal.history();
        if whole {
            report::write(&self.folder, history)?;
        }
        self.write_manifest()?;
        let wanted = history.wanted();
        let done = history.accepted().count();
        let given_up = wanted.iter().filter(|slot| history.is_given_up(**slot)).count();
        let (estimated_s, measured_s) = self.bar.times_s();
        anstream::eprintln!(
            "{done} of {} scans in {}, {} set aside, {given_up} given up; this run: {measured_s:.1} s \
             of scanning, {estimated_s:.1} s estimated",
            wanted.len(),
            self.folder.root().display(),
            history.set_aside().count(),
        );
        if whole && given_up > 0 {
            return Err(Failure::Found(Some(format!(
                "{given_up} scans were given up: report.md says why; --retry-given-up tries again"
            ))));
        }
        Ok(())
    }

    /// What to do about a scan that can't be taken as it should be.
    fn give_up(&mut self, slot: Slot) -> Result<Next, Failure> {
        let retakes = self.loaded.keys.collection.retakes;
        let why =
            format!("pose {}, repeat {}: {retakes} retakes did not help", slot.pose, slot.repeat);
        match self.loaded.keys.collection.after_retakes {
            AfterRetakes::Stop => Ok(Next::Stop(why)),
            AfterRetakes::GoOn => {
                self.bar.say(&format!("{why}: going on without it"));
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
fn warn_of_disk(loaded: &Loaded, folder: &Folder, scans: u32) {
    let wanted = preview::disk_bytes(loaded, scans);
    if let Some(free) = free_bytes(folder).filter(|&free| wanted > free as f64) {
        anstream::eprintln!(
            "warning: the scans take some {:.0} MB, and {:.0} MB of disk are free",
            wanted / 1e6,
            free as f64 / 1e6
        );
    }
}
