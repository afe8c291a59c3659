//! What programs order, checked and carried out.

use std::{sync::Arc, time::Duration};

use sonard_api::{
    SensorOrder,
    config::{Mode, ScanningKeys},
};
use sonard_model::{acoustics::Sensor, geometry::Pose};
use sonard_records::ScanPlan;
use tokio::time::Instant;
use uuid::Uuid;

use super::{Control, Interrupt};
use crate::{
    agenda::Asked,
    limits::{check_device, check_plan, check_pose},
    refusal::{Refusal, RefusalKind},
    sensor::ordered_sensor,
    settings::Settings,
};

impl Control {
    pub(super) fn start(&mut self, asked: Asked) -> Result<(), Refusal> {
        if self.pressed {
            return Err(Refusal {
                kind: RefusalKind::Conflict,
                message: "the emergency stop is pressed".into(),
                help: "release it first".into(),
            });
        }
        asked.plan.map_or(Ok(()), |plan| self.check_plan(&plan))?;
        asked.pose.map_or(Ok(()), |pose| self.check_pose(&pose))?;
        if self.agenda.start(asked) {
            return Ok(());
        }
        Err(Refusal {
            kind: RefusalKind::Conflict,
            message: "too many requests wait already".into(),
            help: "wait until some are done, or POST /v1/stop".into(),
        })
    }

    pub(super) fn cancel(&mut self, request: Uuid) -> (Result<(), Refusal>, Option<Interrupt>) {
        let waiting = self.agenda.cancel(request);
        if self.serving == Some(request) {
            return (Ok(()), Some(Interrupt::Stop));
        }
        if waiting {
            return (Ok(()), Some(Interrupt::Agenda));
        }
        let message = format!("there is no request {request}");
        let help = "POST /v1/start gives it its id; it may be over".into();
        (Err(Refusal { kind: RefusalKind::Unknown, message, help }), None)
    }

    pub(super) fn set_mode(&mut self, mode: Mode, every_s: Option<f64>) -> Result<(), Refusal> {
        let every_s = every_s.unwrap_or(self.scanning.every_s);
        if !(1.0..=604_800.0).contains(&every_s) {
            return Err(Refusal {
                kind: RefusalKind::Wrong,
                message: format!("every_s is {every_s}"),
                help: "1 to 604800 seconds".into(),
            });
        }
        self.scanning = ScanningKeys { mode, every_s };
        self.agenda.set_mode(mode, Duration::from_secs_f64(every_s), self.now());
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

    /// Whether what is simulated, or the ranger, can stand there.
    pub(crate) fn check_pose(&self, pose: &Pose) -> Result<(), Refusal> {
        let Settings { scene, simulated, .. } = &self.settings;
        check_pose(pose, scene.as_deref(), simulated.as_ref().map(|simulated| &*simulated.array))
    }

    pub(super) fn set_sensor(&mut self, order: &SensorOrder) -> Result<(), Refusal> {
        let sound_speed_m_s = self.air.status(Instant::now()).sound_speed_m_s;
        let of_array = self.settings.simulated.is_some();
        let sensor = ordered_sensor(order, &self.setup, of_array, sound_speed_m_s)?;
        if let Some(identity) = &self.identity {
            check_device(&sensor, &self.settings.sensor, identity)?;
        }
        self.use_sensor(sensor);
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
