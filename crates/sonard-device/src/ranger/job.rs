//! What is to be scanned.

use firmware_protocol::messages::Settings;
use sonard_model::geometry::Pose;
use sonard_records::{ScanAir, ScanPlan, SimRecord};
use uuid::Uuid;

/// A scan to take, with its predictions.
#[derive(Debug, Clone)]
pub struct ScanJob {
    /// Where the ranger stands.
    pub pose: Pose,
    /// Which azimuths.
    pub plan: ScanPlan,
    /// How the device moves and listens.
    pub settings: Settings,
    /// For ranges, metres a second.
    pub sound_speed_m_s: f64,
    /// The air as it was known, if that is to stand with the scan.
    pub air: Option<ScanAir>,
    /// The request that it is taken for, if that is to stand with the scan.
    pub request: Option<Uuid>,
    /// When the receiver opens, microseconds after firing.
    pub blanking_us: f64,
    /// For each stop of the plan, what the model predicts; empty without a model.
    pub predictions: Vec<SimRecord>,
}
