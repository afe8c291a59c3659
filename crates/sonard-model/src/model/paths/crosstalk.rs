//! Crosstalk: the path search between two transducers, weighted with the beam pattern of each about
//! its own axis.
//!
//! Includes the direct path between both ([`PathSettings::direct`](super::PathSettings::direct)),
//! which a ranger's own echoes do not have. Multiple reflections between the faces of an array are
//! omitted.

use super::{
    engine::PathEngine,
    found::{EchoPulse, FoundEchoes},
};
use crate::{
    acoustics::{Incident, PulseArrival},
    geometry::{DVec2, wrap_pi},
    model::{Arrival, TooCostly},
};

/// Pose of a transducer in the plan: position (world, metres) and axis direction, radians
/// counter-clockwise from +x.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct TransducerPose {
    pub(crate) place: DVec2,
    pub(crate) direction_rad: f64,
}

/// Paths from a transmitter to a receiver, both with a pose.
pub(crate) struct CrosstalkPaths<'a> {
    engine: &'a PathEngine,
    found: FoundEchoes,
    axes_rad: [f64; 2],
}

impl PathEngine {
    /// Finds the paths from one transducer to another. The maximum length, metres, is at most the
    /// one that the engine was made for; the amplitude floor is at least the engine's.
    pub(crate) fn aimed(
        &self,
        [transmitter, receiver]: [TransducerPose; 2],
        max_path_m: f64,
        floor: f64,
    ) -> Result<CrosstalkPaths<'_>, TooCostly> {
        let mut paths = self.within(max_path_m);
        paths.plan.settings.floor = floor;
        let found = FoundEchoes::between(paths, [transmitter.place, receiver.place], None)?;
        let axes_rad = [transmitter.direction_rad, receiver.direction_rad];
        Ok(CrosstalkPaths { engine: self, found, axes_rad })
    }
}

impl CrosstalkPaths<'_> {
    /// Arrivals at the receiver, shortest path first, as in
    /// [`Arrivals::collect_arrivals`](crate::model::Arrivals::collect_arrivals).
    pub(crate) fn arrivals(&self) -> impl Iterator<Item = PulseArrival> {
        let floor = self.found.paths.plan.settings.floor;
        self.found.echoes.iter().zip(0..).filter_map(move |(echo, index)| {
            let [out, back] = [
                wrap_pi(echo.departure.to_angle() - self.axes_rad[0]),
                wrap_pi(echo.arrival.to_angle() - self.axes_rad[1]),
            ];
            let rises_rad = echo.rise_rad;
            let ends =
                [self.engine.off_axis(out, rises_rad[0]), self.engine.off_axis(back, rises_rad[1])];
            let [leaving, arriving] = ends.map(|angle| self.engine.pattern.beam.one_way(angle));
            let EchoPulse { length_m, phase_rad, gain } = self.found.pulse(index);
            let amplitude = gain * echo.amplitude * leaving * arriving;
            let bound = self.engine.upper_bound(echo.amplitude, amplitude, &ends);
            (bound >= floor).then_some(PulseArrival { length_m, amplitude, phase_rad, index })
        })
    }

    /// Returns the full description of an arrival.
    pub(crate) fn arrival(&self, arrival: &PulseArrival) -> Arrival {
        self.found.arrival(arrival.index, arrival.amplitude)
    }

    /// Returns the incidence of an arrival on both faces.
    pub(crate) fn incident(&self, arrival: &PulseArrival) -> Incident {
        self.found.incident(arrival.index, self.axes_rad)
    }
}
