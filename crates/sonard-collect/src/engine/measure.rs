//! A scan, and the air that it is taken in.

use std::sync::Arc;

use jiff::Timestamp;
use sonard_device::ranger::PreparedScan;
use sonard_records::{AirSource, ScanAir};

use super::{
    super::{AirAction, Device, Entry, Halt, ScanOrder, Slot, Watcher, taking::Taken},
    Collector,
};

impl<D: Device, W: Watcher> Collector<D, W> {
    /// Looks at the thermometer before a scan, and does what the plan wants when the air is no
    /// longer that of the session.
    pub(super) async fn follow_air(&mut self) -> Result<(), Halt> {
        let Some(now_c) = self.temperature().await else { return Ok(()) };
        let keys = &self.plan.keys.checks;
        let drift_c = now_c - self.air.temperature_c();
        if drift_c.abs() <= keys.max_temperature_drift_c {
            return Ok(());
        }
        let said = format!("the air is {now_c:.2} C, {drift_c:+.2} C from the session's");
        match keys.on_temperature_drift {
            AirAction::Note => self.watcher.say(&format!("warning: {said}")),
            AirAction::Stop => return Err(Halt::Stopped(format!("stopped: {said}"))),
            AirAction::NewSession => {
                self.watcher
                    .say(&format!("{said}: from here on it is predicted and ranged with that"));
                self.air = self.plan.air(now_c)?;
                self.prepared.clear();
                // A mock's air is what the thermometer says, unless it has a truth of its own.
                self.carried_to = None;
            }
        }
        Ok(())
    }

    /// Takes a scan; beside it, by how much the air changed meanwhile.
    pub(super) async fn take(&mut self, slot: Slot) -> Result<(Taken, Option<f64>), Halt> {
        let history = self.journal.history();
        let (done, of) = (history.accepted().count() as u32, history.wanted().len() as u32);
        let label = self.pose(slot.pose).label();
        let doing = format!("{label}, scan {} of {of}", done + 1);
        self.watcher.begin(&doing, done, of, self.pace.left_s(of.saturating_sub(done)));
        let before_c = self.temperature().await;
        // A thermometer that gives no valid value now leaves the last one, with its age.
        let age_s = self.temperature_age_s().or(before_c.map(|_| 0.0));
        let air = age_s.map(|age_s| ScanAir {
            temperature_c: self.air.temperature_c(),
            sound_speed_m_s: self.air.sound_speed_m_s(),
            source: AirSource::File,
            age_s: Some(age_s),
        });
        self.borrow().await?;
        let prepared = match self.device.is_local() {
            true => Some(self.prepared(slot.pose)?),
            false => None,
        };
        let order = ScanOrder {
            plan: self.plan.azimuths,
            pose: self.pose(slot.pose).pose,
            prepared: prepared.as_deref(),
            air,
            of: self.collection_ref(slot),
            path: &self.folder.taking(slot),
        };
        let watcher = &self.watcher;
        let taken = self.device.take(order, &|| watcher.beam()).await?;
        let after_c = self.temperature().await;
        let change_c = before_c.zip(after_c).map(|(before_c, after_c)| after_c - before_c);
        Ok((taken, change_c))
    }

    /// Lets the collection decide what the device otherwise does by itself; noted before it is done.
    async fn borrow(&mut self) -> Result<(), Halt> {
        let air = self.plan.air_order(self.air.temperature_c());
        let before = self.device.to_borrow(air.as_ref()).await?;
        if let Some(before) = &before {
            self.note(Entry::Borrowed(before.clone()))?;
        }
        self.device.borrow(before, air.as_ref()).await
    }

    /// Leaves the device as it was found.
    pub(super) async fn give_back(&mut self) {
        match self.device.give_back().await {
            Ok(false) | Err(Halt::Stopped(_)) => {}
            // Not noted, it is only given back once more.
            Ok(true) => drop(self.note(Entry::GivenBack { time: Timestamp::now() })),
            Err(halt) => self.watcher.say(&format!(
                "warning: the daemon still does what the collection wanted: {halt}\n\
                 start the collection again, or set its mode with PUT /v1/scanning"
            )),
        }
    }

    /// The temperature now, if there is a thermometer with a valid value.
    async fn temperature(&mut self) -> Option<f64> {
        if !self.device.is_local() && !self.plan.gives_air() {
            return self.device.temperature_c().await;
        }
        let thermometer = self.thermometer.as_mut()?;
        let read = thermometer.read().await;
        if let Some(remark) = thermometer.take_remark() {
            self.watcher.say(&format!("warning: {remark}"));
        }
        match read {
            Ok(temperature_c) => Some(temperature_c),
            Err(error) => {
                let last = thermometer.last_valid().map_or_else(String::new, |(last_c, age)| {
                    let age_s = age.as_secs_f64();
                    format!("; the last valid temperature, {last_c:.2} C, is {age_s:.0} s old")
                });
                self.watcher.say(&format!(
                    "warning: the thermometer has no valid temperature: {error}{last}"
                ));
                None
            }
        }
    }

    /// Age of the last valid temperature, seconds; `None` without a thermometer of its own.
    fn temperature_age_s(&self) -> Option<f64> {
        if !self.device.is_local() && !self.plan.gives_air() {
            return None;
        }
        let (_, age) = self.thermometer.as_ref()?.last_valid()?;
        Some(age.as_secs_f64())
    }

    /// What is to be measured at a pose, with the model's predictions in the air of the session.
    pub(super) fn prepared(&mut self, number: u32) -> Result<Arc<PreparedScan>, Halt> {
        if let Some(prepared) = self.prepared.get(&number) {
            return Ok(Arc::clone(prepared));
        }
        let inputs = self.plan.inputs(&self.pose(number), self.air);
        let prepared = Arc::new(PreparedScan::of(inputs)?);
        self.prepared.insert(number, Arc::clone(&prepared));
        Ok(prepared)
    }
}
