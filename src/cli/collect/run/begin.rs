//! The beginning of a run: the journal, the plan it knows, what was left over, the device.

use std::{
    collections::{BTreeMap, HashMap},
    time::Duration,
};

use jiff::Timestamp;
use uuid::Uuid;

use super::{
    super::{
        Args,
        bar::Bar,
        changes,
        daemon::Daemon,
        device::{Device, Met},
        load::Loaded,
        load::Poses,
        own::Own,
        preview, refuse,
        source::Source,
        terminal::Terminal,
        thermometer::Thermometer,
    },
    Collector, warn_of_disk,
};
use crate::{
    cli::{Failure, Outcome, runtime::Interrupts},
    collect::{Conditions, Entry, Folder, INPUTS, Journal, PlanEntry, Started, numbers_of, sha256},
    scan::SceneRef,
};

impl<'a> Collector<'a> {
    pub(super) async fn begin(
        args: &'a Args,
        loaded: Loaded,
        mut daemon: Option<Daemon>,
        interrupts: Interrupts,
    ) -> Result<Self, Failure> {
        let thermometer = Thermometer::new(loaded.keys.air.file.as_deref());
        let measured_c = thermometer.read().await.map_err(|error| {
            Failure::device(
                format!("the thermometer can't be read: {error}"),
                "correct air.file in the plan, or leave it out",
            )
        })?;
        let told_c = match &daemon {
            Some(daemon) if !loaded.gives_air() => daemon.temperature_c().await,
            _ => measured_c,
        };
        let air = loaded.air(told_c.unwrap_or(loaded.keys.air.temperature_c))?;
        let folder = Folder::open(&loaded.folder).map_err(|error| refuse(&error))?;
        let journal = Journal::open(&folder.journal()).map_err(|error| refuse(&error))?;
        let id = journal.history().plans.last().map_or_else(Uuid::new_v4, |plan| plan.collection);
        let scan_s = preview::budget(&loaded)?.total_s();
        if let Some(daemon) = &mut daemon {
            let patience = Duration::from_secs_f64(loaded.keys.collection.patience_s);
            daemon.go_on(patience, journal.history().borrowed.clone());
        }
        let mut collector = Self {
            args,
            source: Source::of(&loaded.poses),
            more: true,
            thermometer,
            air,
            id,
            folder,
            journal,
            interrupts,
            terminal: Terminal::default(),
            setups: HashMap::new(),
            device: daemon.map(|daemon| Device::Daemon(Box::new(daemon))),
            here: None,
            carried_to: None,
            losses: None,
            refused: BTreeMap::new(),
            conditions: Conditions::new(),
            bar: Bar::new(scan_s, loaded.keys.collection.pause_s, loaded.plan.beams()),
            loaded,
        };
        collector.folder.remove_drafts().map_err(|error| refuse(&error))?;
        collector.adopt_plan()?;
        collector.take_in_left_overs()?;
        collector.write_manifest()?;
        collector.start_device().await?;
        Ok(collector)
    }

    /// Goes on with the plan that the journal knows, or begins with this one.
    fn adopt_plan(&mut self) -> Outcome {
        let sensor = serde_json::to_string_pretty(&self.loaded.sensor).unwrap_or_default();
        let sensor_sha256 = sha256(sensor.as_bytes());
        if !self.journal.history().plans.is_empty() {
            let changes = changes::since(self.journal.history(), &self.loaded, &sensor_sha256);
            if changes.is_empty() {
                return Ok(());
            }
            if !self.args.accept_changed_plan {
                return Err(Failure::input(
                    format!(
                        "{} holds a collection by another plan: {}",
                        self.folder.root().display(),
                        changes.join("; ")
                    ),
                    "give another --out, put the plan back, or go on with the new one by \
                     --accept-changed-plan: scans that are there stay, and the journal keeps both",
                ));
            }
        }
        // The files first: a plan that the journal knows is there to be read.
        for (name, text) in [
            ("plan.toml", &self.loaded.text),
            ("scene.json", &self.loaded.scene_text),
            ("sensor.json", &sensor),
        ] {
            let path = format!("{INPUTS}/{name}");
            self.folder.write(&path, text.as_bytes()).map_err(|error| refuse(&error))?;
        }
        let poses = self.number_poses()?;
        let scene = &self.loaded.scene;
        let plan = PlanEntry {
            time: Timestamp::now(),
            collection: self.id,
            sonard: env!("CARGO_PKG_VERSION").into(),
            keys: serde_json::to_value(&self.loaded.keys).unwrap_or_default(),
            scene: SceneRef::of(scene),
            sensor_sha256,
            poses,
        };
        self.note(Entry::Plan(Box::new(plan)))
    }

    /// Gives each listed pose that has none a number, and returns them all in order.
    fn number_poses(&mut self) -> Result<Option<Vec<u32>>, Failure> {
        let Poses::Listed(listed) = self.loaded.poses.clone() else { return Ok(None) };
        let known = &self.journal.history().poses;
        let mut last = known.keys().last().copied().unwrap_or(0);
        let mut numbers = Vec::new();
        for (pose, number) in listed.iter().zip(numbers_of(&listed, known)) {
            numbers.push(match number {
                Some(number) => number,
                None => {
                    last += 1;
                    self.note(Entry::Pose { number: last, pose: pose.clone() })?;
                    last
                }
            });
        }
        Ok(Some(numbers))
    }

    /// Meets the device, unless nothing is left to do.
    async fn start_device(&mut self) -> Outcome {
        let history = self.journal.history();
        let done: std::collections::HashSet<_> = history.accepted().map(|take| take.slot).collect();
        let wanted = history.wanted();
        let open: Vec<_> = wanted
            .iter()
            .filter(|slot| !done.contains(slot))
            .filter(|slot| self.args.retry_given_up || !history.is_given_up(**slot))
            .collect();
        let listed = matches!(self.loaded.poses, Poses::Listed(_));
        if open.is_empty() && listed {
            return Ok(());
        }
        let left = open.len() as u32;
        if listed {
            anstream::eprintln!(
                "{left} scans to take, about {}",
                preview::human(self.bar.left_s(left))
            );
            warn_of_disk(&self.loaded, &self.folder, left);
        }
        let first = match open.first() {
            Some(slot) => slot.pose,
            None => {
                // The first pose is asked for before the device, which may need to know it.
                if !self.another_pose().await? {
                    return Ok(());
                }
                self.journal.history().wanted().first().map_or(1, |slot| slot.pose)
            }
        };
        let mut device = match self.device.take() {
            Some(device) => device,
            None => {
                let setup = self.setup(first)?;
                self.carried_to = Some(first);
                let interrupts = self.interrupts.clone();
                Device::Own(Box::new(Own::new(self.args, &self.loaded, &setup, interrupts)?))
            }
        };
        let met = device.meet().await;
        self.device = Some(device);
        let Met { device, provenance } = met?;
        self.check_device(&device.serial)?;
        self.ask_at_start().await?;
        let time = Timestamp::now();
        let started = Started { time, device, provenance, conditions: self.conditions.clone() };
        self.note(Entry::Started(Box::new(started)))
    }

    /// Refuses another ranger than the plan or the journal knows.
    fn check_device(&self, serial: &str) -> Outcome {
        let wanted = self.loaded.keys.device.serial.as_deref();
        if let Some(wanted) = wanted.filter(|wanted| *wanted != serial) {
            return Err(Failure::device(
                format!("the ranger says it is {serial}, not {wanted}"),
                "connect that one, or change device.serial in the plan",
            ));
        }
        let before = self.journal.history().starts.last().map(|start| start.device.serial.as_str());
        match before {
            Some(before) if before != serial && !self.args.accept_changed_plan => {
                Err(Failure::device(
                    format!("the ranger says it is {serial}; so far {before} measured"),
                    "connect that one, or go on with this one by --accept-changed-plan",
                ))
            }
            _ => Ok(()),
        }
    }

    async fn ask_at_start(&mut self) -> Outcome {
        for key in self.loaded.keys.ask.at_start.clone() {
            let answer = self.terminal.ask(&format!("{key}:"), &self.interrupts).await?;
            self.conditions.insert(key, answer.unwrap_or_default().into());
        }
        Ok(())
    }
}
