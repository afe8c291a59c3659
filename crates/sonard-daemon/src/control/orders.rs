//! Validation and execution of orders.

use std::{sync::Arc, time::Duration};

use sonard_api::{
    SensorOrder, SettingsOrder,
    config::{Mode, ScanningKeys},
};
use sonard_model::{acoustics::Sensor, geometry::Pose};
use sonard_records::ScanPlan;
use tokio::time::Instant;
use uuid::Uuid;

use super::{Control, Interrupt};
use crate::{
    limits::{check_device, check_plan, check_pose},
    order_error::{Refusal, RefusalKind},
    schedule::Asked,
    sensor::ordered_sensor,
    settings::Settings,
};

impl Control {
    pub(super) fn start(&mut self, request: Asked) -> Result<(), Refusal> {
        if self.pressed {
            let message = "the emergency stop is pressed";
            return Err(Refusal::new(RefusalKind::Conflict, message, "release it first"));
        }
        request.plan.map_or(Ok(()), |plan| self.check_plan(&plan))?;
        request.pose.map_or(Ok(()), |pose| self.check_pose(&pose))?;
        if self.schedule.start(request) {
            return Ok(());
        }
        let help = "wait until some are complete, or clear the queue with POST /v1/stop";
        Err(Refusal::new(RefusalKind::Conflict, "too many requests are queued", help))
    }

    pub(super) fn cancel(&mut self, request: Uuid) -> (Result<(), Refusal>, Option<Interrupt>) {
        let was_queued = self.schedule.cancel(request);
        if self.serving == Some(request) {
            return (Ok(()), Some(Interrupt::Stop));
        }
        if was_queued {
            return (Ok(()), Some(Interrupt::ScheduleChanged));
        }
        let message = format!("there is no request {request}");
        let help = "use the id returned by POST /v1/start; the request may be complete";
        (Err(Refusal::new(RefusalKind::Unknown, message, help)), None)
    }

    pub(super) fn set_mode(&mut self, mode: Mode, every_s: Option<f64>) -> Result<(), Refusal> {
        let every_s = every_s.unwrap_or(self.scanning.every_s);
        if !(1.0..=604_800.0).contains(&every_s) {
            let message = format!("every_s is {every_s}");
            return Err(Refusal::new(RefusalKind::Wrong, message, "use 1 to 604800 seconds"));
        }
        self.scanning = ScanningKeys { mode, every_s };
        self.schedule.set_mode(mode, Duration::from_secs_f64(every_s), self.now());
        Ok(())
    }

    pub(super) fn set_plan(&mut self, plan: ScanPlan) -> Result<(), Refusal> {
        self.check_plan(&plan)?;
        self.plan = plan;
        Ok(())
    }

    fn check_plan(&self, plan: &ScanPlan) -> Result<(), Refusal> {
        check_plan(plan, self.settings.simulated.is_some(), self.identity.as_ref())
    }

    pub(super) fn set_pose(&mut self, pose: Pose) -> Result<(), Refusal> {
        self.check_pose(&pose)?;
        self.pose = pose;
        Ok(())
    }

    /// Checks that the ranger, or the simulated robot, can be at a pose of the current scene.
    pub(crate) fn check_pose(&self, pose: &Pose) -> Result<(), Refusal> {
        let Settings { scene, simulated, .. } = &self.settings;
        check_pose(pose, scene.as_deref(), simulated.as_ref().map(|simulated| &*simulated.array))
    }

    pub(super) fn set_sensor(&mut self, order: &SensorOrder) -> Result<(), Refusal> {
        let sound_speed_m_s = self.air.status(Instant::now()).sound_speed_m_s;
        let sensor = self.checked_sensor(order, sound_speed_m_s)?;
        self.use_sensor(sensor);
        Ok(())
    }

    fn checked_sensor(&self, order: &SensorOrder, sound_speed_m_s: f64) -> Result<Sensor, Refusal> {
        let of_array = self.settings.simulated.is_some();
        let sensor = ordered_sensor(order, &self.setup, of_array, sound_speed_m_s)?;
        if let Some(identity) = &self.identity {
            check_device(&sensor, &self.settings.sensor, identity)?;
        }
        Ok(sensor)
    }

    /// Changes several settings, or none if one of them is rejected.
    pub(super) fn set_settings(&mut self, order: SettingsOrder) -> Result<(), Refusal> {
        let SettingsOrder { pose, plan, air, sensor } = order;
        plan.map_or(Ok(()), |plan| self.check_plan(&plan))?;
        pose.map_or(Ok(()), |pose| self.check_pose(&pose))?;
        let now = Instant::now();
        let mut next_air = self.air.clone();
        air.map_or(Ok(()), |order| next_air.order(&order, now))?;
        let sound_speed_m_s = next_air.status(now).sound_speed_m_s;
        let sensor =
            sensor.map(|order| self.checked_sensor(&order, sound_speed_m_s)).transpose()?;
        // Nothing below can fail.
        self.plan = plan.unwrap_or(self.plan);
        self.pose = pose.unwrap_or(self.pose);
        self.air = next_air;
        if let Some(sensor) = sensor {
            self.use_sensor(sensor);
        }
        Ok(())
    }

    pub(super) fn use_sensor(&mut self, sensor: Sensor) {
        if sensor != self.settings.sensor {
            self.settings.sensor = sensor;
            self.setup = Arc::new(self.settings.setup());
            self.stale = true;
        }
    }
}
