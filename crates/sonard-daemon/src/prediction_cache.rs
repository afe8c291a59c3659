//! Predictions of the next scan, cached, with the scan and session built from them.

use std::sync::Arc;

use firmware_protocol::messages::Identity;
use jiff::Timestamp;
use sonard_device::ranger::{ReceiverTiming, ScanJob, device_record, provenance};
use sonard_model::{
    acoustics::Air,
    geometry::Pose,
    model::{Simulator, TooCostly},
};
use sonard_records::{ModelRecord, ScanAir, ScanPlan, Session, SimRecord};

use super::settings::Settings;

/// Cache key: inputs of the predictions other than scene and sensor.
pub(super) type PredictionKey = (Pose, ScanPlan, Air);

/// Result of the model for a scan.
#[derive(Debug, Default)]
pub(super) struct Predicted {
    /// Prediction for each stop.
    predictions: Vec<SimRecord>,
    /// Options of the model.
    model: Option<ModelRecord>,
    /// Reason why the model has no predictions for this scene.
    pub(super) refusal: Option<TooCostly>,
}

/// Cache of the last predictions, valid until one of their inputs changes.
#[derive(Debug, Default)]
pub(super) struct PredictionCache {
    key: Option<PredictionKey>,
    predictions: Vec<SimRecord>,
    model: Option<ModelRecord>,
}

impl PredictionCache {
    /// Clears the cache, as needed after a change of scene or sensor.
    pub(super) fn clear(&mut self) {
        *self = Self::default();
    }

    /// Returns `true` if the cached predictions are those of `key`.
    pub(super) fn contains(&self, key: PredictionKey) -> bool {
        self.key == Some(key)
    }

    /// Replaces the cached predictions.
    pub(super) fn store(&mut self, key: PredictionKey, predicted: Predicted) {
        let Predicted { predictions, model, .. } = predicted;
        *self = Self { key: Some(key), predictions, model };
    }

    /// Builds the scan of a plan at a pose, with the cached predictions.
    pub(super) fn job(
        &self,
        settings: &Settings,
        (pose, plan, air): PredictionKey,
        scan_air: ScanAir,
        identity: &Identity,
    ) -> ScanJob {
        ScanJob {
            pose,
            plan,
            settings: settings.motion().settings(&listening(settings, &air), identity),
            sound_speed_m_s: air.sound_speed_m_s(),
            air: Some(scan_air),
            request: None,
            blanking_us: settings.sensor.blanking_us,
            predictions: self.predictions.clone(),
        }
    }

    /// Builds the session record of scans in this air.
    pub(super) fn session(&self, settings: &Settings, air: &Air, identity: &Identity) -> Session {
        let sensor = settings.sensor.clone();
        let mut session = Session::new(Timestamp::now(), provenance(identity), sensor, air);
        if let Some(scene) = &settings.scene {
            session.set_scene(scene);
        }
        session.device = Some(device_record(identity));
        session.model.clone_from(&self.model);
        session
    }
}

/// Receive window: maximum range and blanking.
pub(super) fn listening(settings: &Settings, air: &Air) -> ReceiverTiming {
    ReceiverTiming {
        max_range_m: settings.max_range_m(),
        sound_speed_m_s: air.sound_speed_m_s(),
        blanking_us: settings.sensor.blanking_us,
    }
}

/// Computes predictions in a thread of their own, since they may take long. The result is empty
/// without a scene, and if the scene has too many paths.
///
/// # Errors
/// When the model rejects sensor or options, with a description.
pub(super) fn predict(
    settings: &Settings,
    (pose, plan, air): PredictionKey,
) -> impl Future<Output = Result<Predicted, String>> + use<> {
    let (scene, sensor) = (settings.scene.clone(), settings.sensor.clone());
    let options = settings.options();
    async move {
        let Some(scene) = scene else { return Ok(Predicted::default()) };
        let predicting = tokio::task::spawn_blocking(move || {
            let scene = Arc::new(scene.with_robot_at(&pose));
            let simulator =
                Simulator::new(scene, sensor, air, options).map_err(|error| error.to_string())?;
            // All firings at a stop have the same prediction.
            let stops = ScanPlan { pings_per_stop: 1, ..plan };
            let found = match simulator.predict(&pose, &stops) {
                Ok(found) => found,
                Err(error) => {
                    return Ok(Predicted { refusal: Some(error), ..Predicted::default() });
                }
            };
            let predictions = found
                .iter()
                .map(|prediction| SimRecord::from_prediction(&simulator, prediction))
                .collect();
            let model = Some(ModelRecord::from(simulator.options()));
            Ok(Predicted { predictions, model, refusal: None })
        });
        predicting.await.map_err(|error| format!("the model failed: {error}"))?
    }
}
