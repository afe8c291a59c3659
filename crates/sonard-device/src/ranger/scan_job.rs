//! Scan to execute, for a device of known identity.

use firmware_protocol::messages::Settings;
use sonard_model::geometry::Pose;
use sonard_records::{ScanAir, ScanPlan, SimRecord};
use uuid::Uuid;

/// Scan to execute, with its predictions.
#[derive(Debug, Clone)]
pub struct ScanJob {
    /// Pose of the ranger in the scene.
    pub pose: Pose,
    /// Azimuths and firings per stop.
    pub plan: ScanPlan,
    /// Motion and receiver settings of the device.
    pub settings: Settings,
    /// Speed of sound that converts times of flight to ranges, metres per second.
    pub sound_speed_m_s: f64,
    /// State of the air to record with the scan, if any.
    pub air: Option<ScanAir>,
    /// Id of the API request to record with the scan, if any.
    pub request: Option<Uuid>,
    /// End of the receiver's blanking, microseconds after firing.
    pub blanking_us: f64,
    /// Predicted reading for each stop of the plan; empty without a model.
    pub predictions: Vec<SimRecord>,
}
