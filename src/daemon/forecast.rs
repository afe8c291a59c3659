//! What is known before a scan: settings for the device, and what the model predicts.

use std::sync::Arc;

use firmware_protocol::messages::Identity;
use jiff::Timestamp;

use super::settings::Settings;
use crate::{
    acoustics::Air,
    geometry::Pose,
    model::Simulator,
    ranger::{Listening, ScanJob, device_record, provenance},
    scan::{LOG_FORMAT, ModelRecord, ScanAir, ScanPlan, SceneRef, Session, SimRecord},
};

/// The predictions made last, kept for as long as nothing they depend on changes.
#[derive(Debug, Default)]
pub(super) struct Forecast {
    made_for: Option<(Pose, ScanPlan, Air)>,
    predictions: Vec<SimRecord>,
    model: Option<ModelRecord>,
}

impl Forecast {
    /// Forgets everything, as after a change of scene or sensor.
    pub(super) fn forget(&mut self) {
        *self = Self::default();
    }

    /// The scan of a plan at a pose. Predicting takes its time, beside everything else.
    ///
    /// # Errors
    /// When the model refuses, in words.
    pub(super) async fn job(
        &mut self,
        settings: &Settings,
        (pose, plan, air): (Pose, ScanPlan, Air),
        scan_air: ScanAir,
        identity: &Identity,
    ) -> Result<ScanJob, String> {
        if self.made_for != Some((pose, plan, air)) {
            self.made_for = None;
            (self.predictions, self.model) = predict(settings, pose, plan, air).await?;
            self.made_for = Some((pose, plan, air));
        }
        Ok(ScanJob {
            pose,
            plan,
            settings: settings.motion().settings(&listening(settings, &air), identity),
            sound_speed_m_s: air.sound_speed_m_s(),
            air: Some(scan_air),
            blanking_us: settings.sensor.blanking_us,
            predictions: self.predictions.clone(),
        })
    }

    /// The session's record for scans with this air.
    pub(super) fn session(&self, settings: &Settings, air: &Air, identity: &Identity) -> Session {
        Session {
            format: LOG_FORMAT,
            started: Timestamp::now(),
            sonard: env!("CARGO_PKG_VERSION").into(),
            provenance: provenance(identity),
            device: Some(device_record(identity)),
            sensor: settings.sensor.clone(),
            air: air.to_record(),
            scene: settings
                .scene
                .as_ref()
                .map(|scene| SceneRef { name: scene.name.clone(), sha256: scene.sha256.clone() }),
            model: self.model.clone(),
        }
    }
}

/// What listening has to reach and where it begins.
pub(super) fn listening(settings: &Settings, air: &Air) -> Listening {
    Listening {
        max_range_m: settings.max_range_m(),
        sound_speed_m_s: air.sound_speed_m_s(),
        blanking_us: settings.sensor.blanking_us,
    }
}

async fn predict(
    settings: &Settings,
    pose: Pose,
    plan: ScanPlan,
    air: Air,
) -> Result<(Vec<SimRecord>, Option<ModelRecord>), String> {
    let Some(scene) = settings.scene.clone() else { return Ok((Vec::new(), None)) };
    let (sensor, options) = (settings.sensor.clone(), settings.options());
    let predicting = tokio::task::spawn_blocking(move || {
        let scene = Arc::new(scene.with_robot_at(&pose));
        let simulator =
            Simulator::new(scene, sensor, air, options).map_err(|error| error.to_string())?;
        // All firings at a stop have the same prediction.
        let stops = ScanPlan { pings_per_stop: 1, ..plan };
        let predictions = simulator.predict(&pose, &stops);
        let records = predictions.iter().map(|one| simulator.record(one)).collect();
        Ok((records, Some(simulator.model_record())))
    });
    predicting.await.map_err(|error| format!("the model failed: {error}"))?
}
