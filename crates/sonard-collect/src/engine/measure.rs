//! Recording of a scan, with the air temperature before and after it.

use std::sync::Arc;

use jiff::Timestamp;
use sonard_device::ranger::PreparedScan;
use sonard_records::{AirSource, ScanAir};

use super::{
    super::{
        AirAction, CollectError, JournalEntry, Observer, ScanDevice, ScanTask, Slot,
        record_scan::RecordedScan,
    },
    Collector,
};

impl<D: ScanDevice, W: Observer> Collector<D, W> {
    /// Reads the thermometer before a scan and applies `checks.on_temperature_drift` if the air
    /// drifted from the session's.
    pub(super) async fn update_air(&mut self) -> Result<(), CollectError> {
        let Some(now_c) = self.temperature().await else { return Ok(()) };
        let keys = &self.plan.keys.checks;
        let drift_c = now_c - self.air.temperature_c();
        if drift_c.abs() <= keys.max_temperature_drift_c {
            return Ok(());
        }
        let drift = format!("air temperature {now_c:.2} C, {drift_c:+.2} C from the session's");
        match keys.on_temperature_drift {
            AirAction::Note => self.watcher.message(&format!("warning: {drift}")),
            AirAction::Stop => return Err(CollectError::Stopped(format!("stopped: {drift}"))),
            AirAction::NewSession => {
                self.watcher.message(&format!(
                    "{drift}: predictions and ranges use the new temperature from now on"
                ));
                self.air = self.plan.air(now_c)?;
                self.prepared.clear();
                // Passes the new air to a mock, whose air follows the thermometer by default.
                self.device_pose = None;
            }
        }
        Ok(())
    }

    /// Takes a scan; returns it with the temperature change during it, degrees Celsius.
    pub(super) async fn take(
        &mut self,
        slot: Slot,
    ) -> Result<(RecordedScan, Option<f64>), CollectError> {
        let history = self.journal.history();
        let done = history.accepted().count() as u32;
        let total = history.requested().len() as u32;
        let label = self.pose(slot.pose).label();
        let doing = format!("{label}, scan {} of {total}", done + 1);
        self.watcher.scan_started(
            &doing,
            done,
            total,
            self.pace.left_s(total.saturating_sub(done)),
        );
        let before_c = self.temperature().await;
        // Without a valid temperature now, the last valid one is recorded with its age.
        let age_s = self.temperature_age_s().or(before_c.map(|_| 0.0));
        let air = age_s.map(|age_s| ScanAir {
            temperature_c: self.air.temperature_c(),
            sound_speed_m_s: self.air.sound_speed_m_s(),
            source: AirSource::File,
            age_s: Some(age_s),
        });
        self.apply_settings().await?;
        let prepared = match self.device.is_local() {
            true => Some(self.prepared(slot.pose)?),
            false => None,
        };
        let order = ScanTask {
            plan: self.plan.azimuths,
            pose: self.pose(slot.pose).pose,
            prepared: prepared.as_deref(),
            air,
            collection: self.collection_ref(slot),
            path: &self.folder.draft_path(slot),
        };
        let watcher = &self.watcher;
        let taken = self.device.record_scan(order, &|| watcher.beam_recorded()).await?;
        let after_c = self.temperature().await;
        let change_c = before_c.zip(after_c).map(|(before_c, after_c)| after_c - before_c);
        Ok((taken, change_c))
    }

    /// Applies the collection's settings to the device, after journaling the previous ones.
    async fn apply_settings(&mut self) -> Result<(), CollectError> {
        let air = self.plan.air_order(self.air.temperature_c());
        let before = self.device.settings_to_save(air.as_ref()).await?;
        if let Some(before) = &before {
            self.append(JournalEntry::SavedSettings(before.clone()))?;
        }
        self.device.apply_settings(before, air.as_ref()).await
    }

    /// Restores the device's previous settings.
    pub(super) async fn restore_settings(&mut self) {
        match self.device.restore_settings().await {
            Ok(false) | Err(CollectError::Stopped(_)) => {}
            // If this entry is lost, the next run restores the settings once more.
            Ok(true) => {
                drop(self.append(JournalEntry::RestoredSettings { time: Timestamp::now() }));
            }
            Err(halt) => self.watcher.message(&format!(
                "warning: the daemon still has the collection's settings: {halt}\n\
                 start the collection again, or set the daemon's mode with PUT /v1/scanning"
            )),
        }
    }

    /// Reads the current air temperature, degrees Celsius; `None` without a valid one.
    async fn temperature(&mut self) -> Option<f64> {
        if !self.device.is_local() && !self.plan.sets_air() {
            return self.device.temperature_c().await;
        }
        let thermometer = self.thermometer.as_mut()?;
        let read = thermometer.read().await;
        if let Some(remark) = thermometer.take_remark() {
            self.watcher.message(&format!("warning: {remark}"));
        }
        match read {
            Ok(temperature_c) => Some(temperature_c),
            Err(error) => {
                let last = thermometer.last_valid().map_or_else(String::new, |(last_c, age)| {
                    let age_s = age.as_secs_f64();
                    format!("; the last valid temperature, {last_c:.2} C, is {age_s:.0} s old")
                });
                self.watcher.message(&format!(
                    "warning: the thermometer has no valid temperature: {error}{last}"
                ));
                None
            }
        }
    }

    /// Age of the last valid temperature, seconds; `None` without a thermometer in the plan.
    fn temperature_age_s(&self) -> Option<f64> {
        if !self.device.is_local() && !self.plan.sets_air() {
            return None;
        }
        let (_, age) = self.thermometer.as_ref()?.last_valid()?;
        Some(age.as_secs_f64())
    }

    /// Returns the scan setup of a pose, with predictions in the air of the session.
    pub(super) fn prepared(&mut self, number: u32) -> Result<Arc<PreparedScan>, CollectError> {
        if let Some(prepared) = self.prepared.get(&number) {
            return Ok(Arc::clone(prepared));
        }
        let inputs = self.plan.inputs(&self.pose(number), self.air);
        let prepared = Arc::new(PreparedScan::new(inputs)?);
        self.prepared.insert(number, Arc::clone(&prepared));
        Ok(prepared)
    }
}
