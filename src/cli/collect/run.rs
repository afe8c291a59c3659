//! Takes the scans of a plan, one after the other, until all are there.

mod begin;
mod judge;

use std::{
    collections::{BTreeMap, HashMap},
    sync::Arc,
    time::Duration,
};

use super::{
    Args,
    bar::Bar,
    device::Device,
    load::Loaded,
    preview, refuse, report,
    source::Source,
    taking::{self, Taken},
    terminal::Terminal,
    thermometer::Thermometer,
};
use crate::{
    acoustics::Air,
    cli::{Failure, Outcome, runtime::Interrupts, scan::setup::Setup},
    collect::{
        AfterRetakes, AirAction, Conditions, Entry, Folder, Journal, Manifest, NamedPose, Slot,
    },
    ranger::ScanJob,
    scan::{AirSource, CollectionRef, ScanAir, Session},
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
pub(super) async fn collect(args: &Args, loaded: Loaded, interrupts: Interrupts) -> Outcome {
    let mut collector = Collector::begin(args, loaded, interrupts).await?;
    let outcome = collector.work().await;
    collector.bar.finish();
    if let Some(device) = collector.device.take() {
        device.close().await;
    }
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
                Err(Failure::Found(Some("stopped on request".into())))
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
        if self.carried_to == Some(number) {
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

    /// Looks at the thermometer before a scan, and does what the plan wants when the air is no
    /// longer that of the session.
    async fn follow_air(&mut self) -> Outcome {
        let Some(now_c) = self.temperature().await else { return Ok(()) };
        let keys = &self.loaded.keys.checks;
        let drift_c = now_c - self.air.temperature_c();
        if drift_c.abs() <= keys.max_temperature_drift_c {
            return Ok(());
        }
        let said = format!("the air is {now_c:.2} C, {drift_c:+.2} C from the session's");
        match keys.on_temperature_drift {
            AirAction::Note => self.bar.say(&format!("warning: {said}")),
            AirAction::Stop => return Err(Failure::Found(Some(format!("stopped: {said}")))),
            AirAction::NewSession => {
                self.bar.say(&format!("{said}: from here on it is predicted and ranged with that"));
                self.air = self.loaded.air(now_c)?;
                self.setups.clear();
                // A mock's air is what the thermometer says, unless it has a truth of its own.
                self.carried_to = None;
            }
        }
        Ok(())
    }

    /// Takes a scan; beside it, by how much the air changed meanwhile.
    async fn take(&mut self, slot: Slot) -> Result<(Taken, Option<f64>), Failure> {
        let setup = self.setup(slot.pose)?;
        let history = self.journal.history();
        let (done, of) = (history.accepted().count() as u32, history.wanted().len() as u32);
        let label = self.pose(slot.pose).label();
        self.bar.begin(&format!("{label}, scan {} of {of}", done + 1), done, of);
        let before_c = self.temperature().await;
        let air = before_c.map(|_| ScanAir {
            temperature_c: self.air.temperature_c(),
            sound_speed_m_s: self.air.sound_speed_m_s(),
            source: AirSource::File,
            age_s: Some(0.0),
        });
        let of = self.collection_ref(slot);
        let patience = Duration::from_secs_f64(self.loaded.keys.collection.patience_s);
        let Some(device) = &mut self.device else {
            return Err(Failure::device("there is no device", "this is a fault of the program"));
        };
        let ranger = device.find(patience).await?;
        let identity = *ranger.identity();
        let job = ScanJob { air, ..setup.job(&identity)? };
        let session = Session { collection: Some(Box::new(of)), ..setup.session(&identity) };
        let path = self.folder.taking(slot);
        let taken =
            taking::take(ranger, (&job, session), &path, &self.bar, &self.interrupts).await?;
        if taken.lost.is_some() {
            device.lose();
        }
        let after_c = self.temperature().await;
        let change_c = before_c.zip(after_c).map(|(before_c, after_c)| after_c - before_c);
        Ok((taken, change_c))
    }

    /// The temperature now, if there is a thermometer that can be read.
    async fn temperature(&self) -> Option<f64> {
        match self.thermometer.read().await {
            Ok(temperature_c) => temperature_c,
            Err(error) => {
                self.bar.say(&format!("warning: the thermometer can't be read: {error}"));
                None
            }
        }
    }

    /// What is to be measured at a pose, with the model's predictions in the air of the session.
    fn setup(&mut self, number: u32) -> Result<Arc<Setup>, Failure> {
        if let Some(setup) = self.setups.get(&number) {
            return Ok(Arc::clone(setup));
        }
        let setup = Arc::new(Setup::of(self.loaded.wish(&self.pose(number), self.air))?);
        self.setups.insert(number, Arc::clone(&setup));
        Ok(setup)
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
