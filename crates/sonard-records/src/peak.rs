//! What the model hears of a firing, peak by peak.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_model::{
    acoustics::{EchoTrace, EnvelopePeak},
    geometry::Pose,
    model::{ObservationPoint, Simulator, TooCostly},
};

use crate::{PathRecord, PlanPoint};

/// Peaks this far below the threshold are left out, as a factor of amplitude.
const FAINT: f64 = 0.1;
/// The strongest so many peaks are told.
const MOST_PEAKS: usize = 24;

/// An envelope peak of the echo trace that the model predicts.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PeakLine {
    /// When it begins to rise, microseconds after firing.
    pub tof_us: f64,
    /// Half its path's length, metres.
    pub range_m: f64,
    /// Its peak, relative to a head-on, perfectly reflecting wall.
    pub peak: f64,
    /// Its peak above the threshold in force then, decibels.
    pub margin_db: f64,
    /// The path the sound took.
    pub path: PathRecord,
    /// The same in the plan: the transmitter, each interaction, the receiver.
    pub polyline: Vec<PlanPoint>,
}

impl PeakLine {
    /// The peaks of a trace in order of time, without the faintest; the trace is of a firing from `point`
    /// along the transducer's `axis`.
    ///
    /// # Errors
    /// When there are more paths than the model can find.
    pub fn of_trace(
        simulator: &Simulator,
        point: &ObservationPoint<'_>,
        axis: &Pose,
        trace: &EchoTrace,
    ) -> Result<Vec<Self>, TooCostly> {
        let direction_rad = axis.direction_rad(0.0);
        let ends = simulator.sensor().mounting.viewpoint(axis).ends();
        let receiver = simulator.receiver();
        let over = |peak: &EnvelopePeak| peak.peak.0 / receiver.threshold_at(peak.tof_us);
        let mut loudest: Vec<&EnvelopePeak> =
            trace.peaks.iter().filter(|peak| over(peak) > FAINT).collect();
        loudest.sort_by(|one, other| over(other).total_cmp(&over(one)));
        loudest.truncate(MOST_PEAKS);
        loudest.sort_by(|one, other| one.tof_us.total_cmp(&other.tof_us));
        let line = |peak: &EnvelopePeak| {
            let arrival = point.arrival(direction_rad, &peak.arrival)?;
            let path = PathRecord::of(simulator.scene(), &arrival.path, arrival.length_m);
            let polyline = path.polyline(ends).into_iter().map(PlanPoint::from);
            Ok(Self {
                tof_us: peak.tof_us,
                range_m: arrival.length_m / 2.0,
                peak: peak.peak.0,
                margin_db: 20.0 * over(peak).log10(),
                polyline: polyline.collect(),
                path,
            })
        };
        loudest.into_iter().map(line).collect()
    }
}
