//! Sound from one transducer in another's ear: the same search between two places, weighed with the beam
//! pattern of each about its own axis.
//!
//! With the straight path between both ([`Settings::direct`](super::Settings::direct)), which no echo of a ranger's
//! own has. What the faces of an array send
//! back to and fro is left out.

use super::{
    engine::PathEngine,
    found::{Found, Heard},
};
use crate::{
    acoustics::{Incident, PulseArrival},
    geometry::{DVec2, wrap_pi},
    model::{Arrival, TooCostly},
};

/// A transducer in the plan: where it is (world, metres), and where it points, radians counter-clockwise from +x.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Aimed {
    pub(crate) place: DVec2,
    pub(crate) direction_rad: f64,
}

/// The paths from a transmitter to a receiver, both aimed.
pub(crate) struct AimedPaths<'a> {
    engine: &'a PathEngine,
    found: Found,
    axes_rad: [f64; 2],
}

impl PathEngine {
    /// The paths from one aimed transducer to another up to a length, metres, which is at most the one that
    /// the engine was made for, and down to an amplitude, which is at least its floor.
    pub(crate) fn aimed(
        &self,
        [transmitter, receiver]: [Aimed; 2],
        max_path_m: f64,
        floor: f64,
    ) -> Result<AimedPaths<'_>, TooCostly> {
        let mut paths = self.within(max_path_m);
        paths.plan.settings.floor = floor;
        let found = Found::between(paths, [transmitter.place, receiver.place], None)?;
        let axes_rad = [transmitter.direction_rad, receiver.direction_rad];
        Ok(AimedPaths { engine: self, found, axes_rad })
    }
}

impl AimedPaths<'_> {
    /// What arrives, shortest path first, as [`Arrivals::listen`](crate::model::Arrivals::listen) gives it.
    pub(crate) fn listen(&self) -> impl Iterator<Item = PulseArrival> {
        let floor = self.found.paths.plan.settings.floor;
        self.found.echoes.iter().zip(0..).filter_map(move |(echo, index)| {
            let [out, back] = [
                wrap_pi(echo.departure.to_angle() - self.axes_rad[0]),
                wrap_pi(echo.arrival.to_angle() - self.axes_rad[1]),
            ];
            let rises_rad = echo.rise_rad;
            let ends =
                [self.engine.off_axis(out, rises_rad[0]), self.engine.off_axis(back, rises_rad[1])];
            let [leaving, arriving] = ends.map(|angle| self.engine.beam.one_way(angle));
            let Heard { length_m, phase_rad, gain } = self.found.heard(index);
            let amplitude = gain * echo.amplitude * leaving * arriving;
            let most = self.engine.most(echo.amplitude, amplitude, &ends);
            (most >= floor).then_some(PulseArrival { length_m, amplitude, phase_rad, index })
        })
    }

    /// The full account of one of them.
    pub(crate) fn arrival(&self, arrival: &PulseArrival) -> Arrival {
        self.found.arrival(arrival.index, arrival.amplitude)
    }

    /// Its incidence on both faces.
    pub(crate) fn incident(&self, arrival: &PulseArrival) -> Incident {
        self.found.incident(arrival.index, self.axes_rad)
    }
}
