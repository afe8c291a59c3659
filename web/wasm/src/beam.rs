//! One beam: its echo trace, and the paths of all that the model hears.

use serde::Serialize;
use sonard_interpret::compare::JudgedPing;
use sonard_model::{
    geometry::Pose,
    model::{ObservationPoint, Simulator, TooCostly},
};
use sonard_records::{PeakLine, PlanPoint, TraceLine};

use crate::{Refusal, sweep::Sweep};

/// The trace goes so far beyond what was heard or predicted, metres.
const BEYOND_M: f64 = 0.5;
/// Spacing of the trace's points, microseconds: a period of the carrier.
const STEP_US: f64 = 20.0;

/// A beam with all that the model knows about it.
#[derive(Debug, Serialize)]
pub(crate) struct Beam {
    /// The reading, and what explains it.
    reading: JudgedPing,
    /// The path of its sound in the plan: the transmitter, each interaction, the receiver.
    polyline: Option<Vec<PlanPoint>>,
    /// What the model hears, in order of time, faint sounds included.
    peaks: Vec<PeakLine>,
    trace: TraceLine,
}

impl Beam {
    /// A beam of a sweep.
    pub(crate) fn of(sweep: &mut Sweep, index: u32) -> Result<Self, Refusal> {
        let place = sweep.place_of(index)?;
        let reading = sweep.judged(place)?;
        let ping = &reading.ping;
        let heard_m = [ping.range_m, ping.sim.as_ref().and_then(|sim| sim.range_m)];
        let heard_m = heard_m.into_iter().flatten().fold(0.0, f64::max);
        let listen = |simulator: &Simulator, point: &ObservationPoint<'_>, axis: &Pose| {
            let most_m = simulator.receiver().max_range_m;
            let until_m = if heard_m > 0.0 { most_m.min(heard_m + BEYOND_M) } else { most_m };
            let trace = point.trace(axis.direction_rad(0.0), until_m, STEP_US)?;
            let peaks = PeakLine::of_trace(simulator, point, axis, &trace)?;
            Ok::<_, TooCostly>((peaks, TraceLine::of(simulator, &trace, STEP_US)))
        };
        let (peaks, trace) = sweep.look(ping, listen)?.transpose()?.unwrap_or_default();
        let viewpoint = reading.beside.viewpoint;
        let line = reading.ping.sound_path().zip(viewpoint);
        let line = line.map(|(path, viewpoint)| path.polyline(viewpoint.ends()));
        let polyline = line.map(|points| points.into_iter().map(PlanPoint::from).collect());
        Ok(Self { reading, polyline, peaks, trace })
    }
}
