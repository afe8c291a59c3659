//! A scan, and the air that it is taken in.

use std::{sync::Arc, time::Duration};

use jiff::Timestamp;

use super::{
    super::{
        device::Device,
        taking::{self, Taken},
    },
    Collector,
};
use crate::{
    api::ScanRequest,
    cli::{Failure, Outcome, scan::setup::Setup},
    collect::{AirAction, Entry, Slot},
    ranger::ScanJob,
    scan::{AirSource, ScanAir, Session},
};

impl Collector<'_> {
    /// Looks at the thermometer before a scan, and does what the plan wants when the air is no
    /// longer that of the session.
    pub(super) async fn follow_air(&mut self) -> Outcome {
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
    pub(super) async fn take(&mut self, slot: Slot) -> Result<(Taken, Option<f64>), Failure> {
        let history = self.journal.history();
        let (done, of) = (history.accepted().count() as u32, history.wanted().len() as u32);
        let label = self.pose(slot.pose).label();
        self.bar.begin(&format!("{label}, scan {} of {of}", done + 1), done, of);
        let before_c = self.temperature().await;
        let taken = match &self.device {
            Some(Device::Own(_)) => self.take_own(slot, before_c.is_some()).await?,
            Some(Device::Daemon(_)) => self.take_by_daemon(slot).await?,
            None => return Err(no_device()),
        };
        let after_c = self.temperature().await;
        let change_c = before_c.zip(after_c).map(|(before_c, after_c)| after_c - before_c);
        Ok((taken, change_c))
    }

    /// With the collection's own ranger, in air that a thermometer tells or the plan.
    async fn take_own(&mut self, slot: Slot, measured: bool) -> Result<Taken, Failure> {
        let setup = self.setup(slot.pose)?;
        let air = measured.then(|| ScanAir {
            temperature_c: self.air.temperature_c(),
            sound_speed_m_s: self.air.sound_speed_m_s(),
            source: AirSource::File,
            age_s: Some(0.0),
        });
        let of = self.collection_ref(slot);
        let path = self.folder.taking(slot);
        let patience = Duration::from_secs_f64(self.loaded.keys.collection.patience_s);
        let Some(Device::Own(own)) = &mut self.device else { return Err(no_device()) };
        let ranger = own.find(patience).await?;
        let identity = *ranger.identity();
        let job = ScanJob { air, ..setup.job(&identity)? };
        let session = Session { collection: Some(Box::new(of)), ..setup.session(&identity) };
        let taken =
            taking::take(ranger, (&job, session), &path, &self.bar, &self.interrupts).await?;
        if taken.gone {
            own.lose();
        }
        Ok(taken)
    }

    /// By the daemon, which predicts by itself.
    async fn take_by_daemon(&mut self, slot: Slot) -> Result<Taken, Failure> {
        let air = self.loaded.air_order(self.air.temperature_c());
        let Some(Device::Daemon(daemon)) = &mut self.device else { return Err(no_device()) };
        let before = daemon.to_borrow(air.as_ref()).await?;
        if let Some(before) = &before {
            self.note(Entry::Borrowed(before.clone()))?;
        }
        let (plan, pose) = (Some(self.loaded.plan), Some(self.pose(slot.pose).pose));
        let wish = ScanRequest { scans: Some(1), plan, pose };
        let of = self.collection_ref(slot);
        let path = self.folder.taking(slot);
        let Some(Device::Daemon(daemon)) = &mut self.device else { return Err(no_device()) };
        daemon.borrow(before, air.as_ref()).await?;
        daemon.take((&wish, of), &path, &self.bar).await
    }

    /// Lets go of whoever took the scans.
    pub(super) async fn leave_device(&mut self) {
        match self.device.take() {
            Some(Device::Own(own)) => own.close().await,
            Some(Device::Daemon(mut daemon)) => match daemon.give_back().await {
                Ok(false) => {}
                // Not noted, it is only given back once more.
                Ok(true) => drop(self.note(Entry::GivenBack { time: Timestamp::now() })),
                Err(Failure::Device(report) | Failure::Input(report)) => anstream::eprintln!(
                    "warning: the daemon still does what the collection wanted: {report}\n\
                     start the collection again, or set its mode with PUT /v1/scanning"
                ),
                Err(Failure::Found(_)) => {}
            },
            None => {}
        }
    }

    /// The temperature now, if there is a thermometer that can be read.
    async fn temperature(&self) -> Option<f64> {
        if let Some(Device::Daemon(daemon)) = &self.device
            && !self.loaded.gives_air()
        {
            return daemon.temperature_c().await;
        }
        match self.thermometer.read().await {
            Ok(temperature_c) => temperature_c,
            Err(error) => {
                self.bar.say(&format!("warning: the thermometer can't be read: {error}"));
                None
            }
        }
    }

    /// What is to be measured at a pose, with the model's predictions in the air of the session.
    pub(super) fn setup(&mut self, number: u32) -> Result<Arc<Setup>, Failure> {
        if let Some(setup) = self.setups.get(&number) {
            return Ok(Arc::clone(setup));
        }
        let setup = Arc::new(Setup::of(self.loaded.wish(&self.pose(number), self.air))?);
        self.setups.insert(number, Arc::clone(&setup));
        Ok(setup)
    }
}

fn no_device() -> Failure {
    Failure::device("there is no device", "this is a fault of the program")
}
