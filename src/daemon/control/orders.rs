//! What programs order, checked and carried out.

use std::{sync::Arc, time::Duration};

use tokio::time::Instant;
use uuid::Uuid;

use super::{Control, Interrupt};
use crate::{
    acoustics::Sensor,
    api::SensorOrder,
    config::{Mode, ScanningKeys},
    daemon::{
        agenda::Asked,
        refusal::{Refusal, RefusalKind},
        sensor::{check_device, ordered_sensor},
        settings::Settings,
    },
    geometry::Pose,
    scan::{PlanError, ScanPlan},
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
        asked.pose.map_or(Ok(()), |pose| check_pose(&self.settings, &pose))?;
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
        if self.settings.simulated.is_some() {
            return Err(Refusal {
                kind: RefusalKind::Conflict,
                message: "an array has no plan: its rangers are fixed".into(),
                help: "another array is simulate.array in the configuration".into(),
            });
        }
        let refuse = |error: PlanError| Refusal {
            kind: match error {
                PlanError::OffMotorGrid { .. } => RefusalKind::Conflict,
                _ => RefusalKind::Wrong,
            },
            message: error.to_string(),
            help: "a full turn is from_deg 0, to_deg 360, step_deg 0.9, pings_per_stop 1".into(),
        };
        plan.check().map_err(refuse)?;
        if let Some(identity) = &self.identity {
            plan.motor_steps(identity.steps_per_revolution.into()).map_err(refuse)?;
        }
        Ok(())
    }

    pub(super) fn set_pose(&mut self, pose: Pose) -> Result<(), Refusal> {
        check_pose(&self.settings, &pose)?;
        self.pose = pose;
        Ok(())
    }

    /// Whether what is simulated, or the ranger, can stand there.
    pub(in crate::daemon) fn check_pose(&self, pose: &Pose) -> Result<(), Refusal> {
        check_pose(&self.settings, pose)
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

/// Whether a ranger can stand there; without a scene it can stand anywhere.
fn check_pose(settings: &Settings, pose: &Pose) -> Result<(), Refusal> {
    let finite = [pose.x_m, pose.y_m, pose.heading_deg].iter().all(|figure| figure.is_finite());
    if !finite {
        return Err(Refusal {
            kind: RefusalKind::Wrong,
            message: "a figure of the pose is not finite".into(),
            help: "metres and degrees".into(),
        });
    }
    let Some(scene) = &settings.scene else { return Ok(()) };
    if let Some(simulated) = &settings.simulated {
        return simulated
            .array
            .check_pose(scene, pose)
            .map_err(|error| in_the_way(&error, error.help()));
    }
    scene.check_pose(pose).map_err(|error| in_the_way(&error, error.help()))
}

/// A pose that is right elsewhere.
fn in_the_way(error: &impl std::fmt::Display, help: String) -> Refusal {
    Refusal { kind: RefusalKind::Conflict, message: error.to_string(), help }
}
