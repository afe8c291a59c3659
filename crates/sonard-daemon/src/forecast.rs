//! What is known before a scan: settings for the device, and what the model predicts.

use std::sync::Arc;

use firmware_protocol::messages::Identity;
use jiff::Timestamp;
use sonard_device::ranger::{Listening, ScanJob, device_record, provenance};
use sonard_model::{
    acoustics::Air,
    geometry::Pose,
    model::{Simulator, TooCostly},
};
use sonard_records::{ModelRecord, ScanAir, ScanPlan, Session, SimRecord};

use super::settings::Settings;

/// What predictions depend on, besides scene and sensor.
pub(super) type ForecastKey = (Pose, ScanPlan, Air);

/// What the model says.
#[derive(Debug, Default)]
pub(super) struct Predicted {
    /// For each stop.
    predictions: Vec<SimRecord>,
    /// Which model that was.
    model: Option<ModelRecord>,
    /// Why it says nothing although it was asked.
    pub(super) refusal: Option<TooCostly>,
}

/// The predictions made last, kept for as long as nothing they depend on changes.
#[derive(Debug, Default)]
pub(super) struct Forecast {
    made_for: Option<ForecastKey>,
    predictions: Vec<SimRecord>,
    model: Option<ModelRecord>,
}

impl Forecast {
    /// Forgets everything, as after a change of scene or sensor.
    pub(super) fn forget(&mut self) {
        *self = Self::default();
    }

    /// Whether there are predictions for this.
    pub(super) fn knows(&self, what: ForecastKey) -> bool {
        self.made_for == Some(what)
    }

    /// Takes predictions in.
    pub(super) fn learn(&mut self, what: ForecastKey, predicted: Predicted) {
        let Predicted { predictions, model, .. } = predicted;
        *self = Self { made_for: Some(what), predictions, model };
    }

    /// The scan of a plan at a pose, with the predictions made last.
    pub(super) fn job(
        &self,
        settings: &Settings,
        (pose, plan, air): ForecastKey,
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

    /// The session's record for scans with this air.
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

/// What listening has to reach and where it begins.
pub(super) fn listening(settings: &Settings, air: &Air) -> Listening {
    Listening {
        max_range_m: settings.max_range_m(),
        sound_speed_m_s: air.sound_speed_m_s(),
        blanking_us: settings.sensor.blanking_us,
    }
}

/// Asks the model, beside everything else: it may take its time. Nothing without a scene, and where there are
/// too many paths.
///
/// # Errors
/// When the model refuses sensor or options, in words.
pub(super) fn predict(
    settings: &Settings,
    (pose, plan, air): ForecastKey,
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
            let told = match simulator.predict(&pose, &stops) {
                Ok(told) => told,
                Err(error) => {
                    return Ok(Predicted { refusal: Some(error), ..Predicted::default() });
                }
            };
            let predictions = told.iter().map(|one| SimRecord::of(&simulator, one)).collect();
            let model = Some(ModelRecord::from(simulator.options()));
            Ok(Predicted { predictions, model, refusal: None })
        });
        predicting.await.map_err(|error| format!("the model failed: {error}"))?
    }
}
