//! Start of a run: opens the journal, compares the plan, recovers interrupted scans and identifies
//! the device.

use std::{
    collections::{BTreeMap, HashMap, HashSet},
    time::Duration,
};

use jiff::Timestamp;
use sonard_device::thermometer::Thermometer;
use sonard_records::SceneRef;
use sonard_runtime::interrupts::Interrupts;
use uuid::Uuid;

use super::{
    super::{
        CollectError, CollectionFolder, CollectionJournal, CollectionPlan, Conditions,
        ConnectedDevice, INPUTS, JournalEntry, Observer, PlanEntry, Poses, RunStart, ScanDevice,
        estimate::{Pace, budget},
        find_numbers,
        plan_changes::plan_changes,
        pose_source::{PoseSource, answered},
        sha256,
    },
    Collector, RunOptions, warn_of_disk,
};

impl<D: ScanDevice, W: Observer> Collector<D, W> {
    pub(super) async fn begin(
        plan: CollectionPlan,
        choices: RunOptions,
        mut device: D,
        watcher: W,
        interrupts: Interrupts,
    ) -> Result<Self, CollectError> {
        let mut thermometer = plan.keys.air.file.as_deref().map(Thermometer::new);
        let measured_c = match &mut thermometer {
            Some(thermometer) => Some(thermometer.read().await.map_err(|error| {
                CollectError::failed(
                    format!("the thermometer has no valid temperature: {error}"),
                    "correct air.file in the plan, or leave it out",
                )
            })?),
            None => None,
        };
        let air_c = match device.is_local() || plan.sets_air() {
            true => measured_c,
            false => device.temperature_c().await,
        };
        let air = plan.air(air_c.unwrap_or(plan.keys.air.temperature_c))?;
        let folder = CollectionFolder::open(&plan.folder)?;
        let journal = CollectionJournal::open(&folder.journal())?;
        let id = journal.history().plans.last().map_or_else(Uuid::new_v4, |plan| plan.collection);
        let scan_s = budget(&plan)?.total_s();
        let retry_limit = Duration::from_secs_f64(plan.keys.collection.retry_limit_s);
        device.resume(retry_limit, journal.history().saved_settings.clone());
        let mut collector = Self {
            choices,
            source: PoseSource::from(&plan.poses),
            has_more_poses: true,
            thermometer,
            air,
            id,
            folder,
            journal,
            interrupts,
            prepared: HashMap::new(),
            device,
            confirmed_pose: None,
            device_pose: None,
            losses: None,
            rejections: BTreeMap::new(),
            conditions: Conditions::new(),
            pace: Pace::new(scan_s, plan.keys.collection.pause_s),
            watcher,
            plan,
        };
        collector.folder.remove_drafts()?;
        collector.adopt_plan()?;
        collector.recover_scans()?;
        collector.write_manifest()?;
        Ok(collector)
    }

    /// Records the plan in the journal, or compares it with the recorded one.
    fn adopt_plan(&mut self) -> Result<(), CollectError> {
        let sensor = serde_json::to_string_pretty(&self.plan.sensor).unwrap_or_default();
        let sensor_sha256 = sha256(sensor.as_bytes());
        if !self.journal.history().plans.is_empty() {
            let changes = plan_changes(self.journal.history(), &self.plan, &sensor_sha256);
            if changes.is_empty() {
                return Ok(());
            }
            if !self.choices.accept_changed_plan {
                return Err(CollectError::invalid(
                    format!(
                        "{} holds a collection with a different plan: {}",
                        self.folder.root().display(),
                        changes.join("; ")
                    ),
                    "choose another --out, restore the plan, or continue with the new one by \
                     --accept-changed-plan: existing scans are kept, and the journal records both",
                ));
            }
        }
        // Files before the entry: a plan in the journal always has its input files.
        for (name, text) in [
            ("plan.toml", &self.plan.text),
            ("scene.json", &self.plan.scene_text),
            ("sensor.json", &sensor),
        ] {
            let path = format!("{INPUTS}/{name}");
            self.folder.write(&path, text.as_bytes())?;
        }
        let poses = self.number_poses()?;
        let scene = &self.plan.scene;
        let plan = PlanEntry {
            time: Timestamp::now(),
            collection: self.id,
            sonard: env!("CARGO_PKG_VERSION").into(),
            keys: serde_json::to_value(&self.plan.keys).unwrap_or_default(),
            scene: SceneRef::from_scene(scene),
            sensor_sha256,
            poses,
        };
        self.append(JournalEntry::Plan(Box::new(plan)))
    }

    /// Assigns numbers to new listed poses and returns the numbers of all in order.
    fn number_poses(&mut self) -> Result<Option<Vec<u32>>, CollectError> {
        let Poses::Listed(listed) = self.plan.poses.clone() else { return Ok(None) };
        let known = &self.journal.history().poses;
        let mut last = known.keys().last().copied().unwrap_or(0);
        let mut numbers = Vec::new();
        for (pose, number) in listed.iter().zip(find_numbers(&listed, known)) {
            numbers.push(match number {
                Some(number) => number,
                None => {
                    last += 1;
                    self.append(JournalEntry::Pose { number: last, pose: pose.clone() })?;
                    last
                }
            });
        }
        Ok(Some(numbers))
    }

    /// Connects to the device, unless no scan is left.
    pub(super) async fn start(&mut self) -> Result<(), CollectError> {
        let history = self.journal.history();
        let done: HashSet<_> = history.accepted().map(|take| take.slot).collect();
        let requested = history.requested();
        let open: Vec<_> = requested
            .iter()
            .filter(|slot| !done.contains(slot))
            .filter(|slot| self.choices.retry_given_up || !history.is_given_up(**slot))
            .collect();
        let listed = matches!(self.plan.poses, Poses::Listed(_));
        if open.is_empty() && listed {
            return Ok(());
        }
        let left = open.len() as u32;
        if listed {
            self.watcher.scans_planned(left, self.pace.left_s(left));
            warn_of_disk(&self.plan, &self.folder, left, &self.watcher);
        }
        let first = match open.first() {
            Some(slot) => slot.pose,
            None => {
                // The device may need the first pose for its setup.
                if !self.request_pose().await? {
                    return Ok(());
                }
                self.journal.history().requested().first().map_or(1, |slot| slot.pose)
            }
        };
        if self.device.is_local() {
            let prepared = self.prepared(first)?;
            self.device_pose = Some(first);
            self.device.prepare(&self.plan, &prepared)?;
        }
        let ConnectedDevice { device, provenance } = self.device.connect().await?;
        self.check_device(&device.serial)?;
        self.prompt_at_start().await?;
        let time = Timestamp::now();
        let started = RunStart { time, device, provenance, conditions: self.conditions.clone() };
        self.append(JournalEntry::Started(Box::new(started)))
    }

    /// Rejects a ranger whose serial number differs from the plan's or the journal's.
    fn check_device(&self, serial: &str) -> Result<(), CollectError> {
        let expected = self.plan.keys.device.serial.as_deref();
        if let Some(expected) = expected.filter(|expected| *expected != serial) {
            return Err(CollectError::failed(
                format!("the ranger's serial number is {serial}, not {expected}"),
                format!("connect {expected}, or change device.serial in the plan"),
            ));
        }
        let before = self.journal.history().starts.last().map(|start| start.device.serial.as_str());
        match before {
            Some(before) if before != serial && !self.choices.accept_changed_plan => {
                Err(CollectError::failed(
                    format!("the ranger's serial number is {serial}; previous scans used {before}"),
                    format!("connect {before}, or continue with {serial} by --accept-changed-plan"),
                ))
            }
            _ => Ok(()),
        }
    }

    async fn prompt_at_start(&mut self) -> Result<(), CollectError> {
        for key in self.plan.keys.ask.at_start.clone() {
            let answer = answered(&mut self.watcher, &format!("{key}:"), &self.interrupts).await?;
            self.conditions.insert(key, answer.unwrap_or_default().into());
        }
        Ok(())
    }
}
