//! Details of one beam: echo trace, and the propagation paths of its predicted arrivals.

use serde::Serialize;
use sonard_interpret::compare::AnnotatedPing;
use sonard_model::{
    geometry::Pose,
    model::{ObservationPoint, Simulator, TooCostly},
};
use sonard_records::{PeakLine, PlanPoint, TraceLine};

use crate::{RequestError, sweep::Sweep};

/// Length of the trace beyond the measured or predicted range.
const TRACE_MARGIN_M: f64 = 0.5;
/// Spacing of the trace's samples: about one period of the carrier.
const STEP_US: f64 = 20.0;

/// Reading of a beam with its prediction.
#[derive(Debug, Serialize)]
pub(crate) struct Beam {
    /// Reading with its annotations.
    reading: AnnotatedPing,
    /// Propagation path of the reading: transmitter, interactions, receiver.
    polyline: Option<Vec<PlanPoint>>,
    /// Predicted arrivals in order of time, including those below the threshold.
    peaks: Vec<PeakLine>,
    trace: TraceLine,
}

impl Beam {
    /// Computes the details of a beam of a sweep.
    pub(crate) fn new(sweep: &mut Sweep, index: u32) -> Result<Self, RequestError> {
        let position = sweep.position_of(index)?;
        let reading = sweep.annotated(position)?;
        let ping = &reading.ping;
        let ranges_m = [ping.range_m, ping.sim.as_ref().and_then(|sim| sim.range_m)];
        let farthest_m = ranges_m.into_iter().flatten().fold(0.0, f64::max);
        let compute = |simulator: &Simulator, point: &ObservationPoint<'_>, axis: &Pose| {
            let max_m = simulator.receiver().max_range_m;
            let until_m =
                if farthest_m > 0.0 { max_m.min(farthest_m + TRACE_MARGIN_M) } else { max_m };
            let trace = point.trace(axis.direction_rad(0.0), until_m, STEP_US)?;
            let peaks = PeakLine::from_trace(simulator, point, axis, &trace)?;
            Ok::<_, TooCostly>((peaks, TraceLine::from_trace(simulator, &trace, STEP_US)))
        };
        let (peaks, trace) = sweep.observe(ping, compute)?.transpose()?.unwrap_or_default();
        let viewpoint = reading.annotations.viewpoint;
        let line = reading.ping.sound_path().zip(viewpoint);
        let line = line.map(|(path, viewpoint)| path.polyline(viewpoint.transducer_positions()));
        let polyline = line.map(|points| points.into_iter().map(PlanPoint::from).collect());
        Ok(Self { reading, polyline, peaks, trace })
    }
}
