//! Envelope peaks of a predicted echo trace.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_model::{
    acoustics::{EchoTrace, EnvelopePeak},
    geometry::Pose,
    model::{ObservationPoint, Simulator, TooCostly},
};

use crate::{PathRecord, PlanPoint};

/// Minimum peak amplitude relative to the threshold.
const MIN_RELATIVE_PEAK: f64 = 0.1;
/// Maximum number of peaks, strongest first.
const MAX_PEAKS: usize = 24;

/// Envelope peak of a predicted echo trace.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PeakLine {
    /// Start of the rise, microseconds after firing.
    pub tof_us: f64,
    /// Half the path length, metres.
    pub range_m: f64,
    /// Peak amplitude relative to a head-on, perfectly reflecting wall.
    pub peak: f64,
    /// Peak level above the effective threshold, decibels.
    pub margin_db: f64,
    /// Propagation path of the arrival.
    pub path: PathRecord,
    /// Path in the plan: transmitter, interactions, receiver.
    pub polyline: Vec<PlanPoint>,
}

impl PeakLine {
    /// Peaks of a trace in order of time, without the weakest. The trace belongs to a firing from
    /// `point` along the transducer's `axis`.
    ///
    /// # Errors
    /// If there are more paths than the model can trace.
    pub fn from_trace(
        simulator: &Simulator,
        point: &ObservationPoint<'_>,
        axis: &Pose,
        trace: &EchoTrace,
    ) -> Result<Vec<Self>, TooCostly> {
        let direction_rad = axis.direction_rad(0.0);
        let ends = simulator.sensor().mounting.viewpoint(axis).transducer_positions();
        let receiver = simulator.receiver();
        let relative = |peak: &EnvelopePeak| peak.peak.0 / receiver.threshold_at(peak.tof_us);
        let mut strongest: Vec<&EnvelopePeak> =
            trace.peaks.iter().filter(|peak| relative(peak) > MIN_RELATIVE_PEAK).collect();
        strongest.sort_by(|a, b| relative(b).total_cmp(&relative(a)));
        strongest.truncate(MAX_PEAKS);
        strongest.sort_by(|a, b| a.tof_us.total_cmp(&b.tof_us));
        let line = |peak: &EnvelopePeak| {
            let arrival = point.arrival(direction_rad, &peak.arrival)?;
            let path = PathRecord::from_path(simulator.scene(), &arrival.path, arrival.length_m);
            let polyline = path.polyline(ends).into_iter().map(PlanPoint::from);
            Ok(Self {
                tof_us: peak.tof_us,
                range_m: arrival.length_m / 2.0,
                peak: peak.peak.0,
                margin_db: 20.0 * relative(peak).log10(),
                polyline: polyline.collect(),
                path,
            })
        };
        strongest.into_iter().map(line).collect()
    }
}
