//! Engines, which find the echoes that arrive at the transducer's face.

use super::{cost::TooCostly, path::Path, paths::EchoSet};
use crate::{
    acoustics::{Image, Incidence, Incident, PulseArrival},
    geometry::{DVec2, wrap_pi},
    reading::PathKind,
};

/// An echo at the transducer's face.
#[derive(Debug, Clone, PartialEq)]
pub struct Arrival {
    /// Length of the path there and back, metres. For a post it is that of its pulse, which returns
    /// by the surface, while `path` runs to the axis.
    pub length_m: f64,
    /// Strength after gain compensation and the beam pattern on departure and arrival; a head-on,
    /// perfectly reflecting wall without absorption gives 1.
    pub amplitude: f64,
    /// Strength before the beam pattern.
    pub path_amplitude: f64,
    /// Phase of the carrier relative to that of the path's length, for `exp(+i omega t)`, radians;
    /// caused by edges. Mirror reflections add none.
    pub phase_rad: f64,
    /// World direction of departure, radians counter-clockwise from +x.
    pub departure_rad: f64,
    /// World direction of arrival, from the ranger towards the origin of the echo, radians.
    pub arrival_rad: f64,
    /// Interactions along the path, in order.
    pub path: Path,
}

/// Finds echo paths in a scene.
pub trait Engine: Send + Sync {
    /// Returns the arrivals at an observation point (world, metres), for a transducer that sends
    /// and receives there.
    ///
    /// # Errors
    /// When there are more paths than can be found within bounds of work and memory.
    fn arrivals_at<'a>(&'a self, position: DVec2) -> Result<Box<dyn Arrivals + 'a>, TooCostly>;

    /// Returns the arrivals for a separate transmitter and receiver. Engines limited to one point
    /// use the middle.
    ///
    /// # Errors
    /// As [`Self::arrivals_at`].
    fn arrivals_between<'a>(
        &'a self,
        transmitter: DVec2,
        receiver: DVec2,
    ) -> Result<Box<dyn Arrivals + 'a>, TooCostly> {
        self.arrivals_at(0.5 * (transmitter + receiver))
    }

    /// Returns the arrivals between transmitter and receiver up to a length there and back, in
    /// metres; `None` from engines that save nothing by it.
    ///
    /// # Errors
    /// As [`Self::arrivals_at`].
    fn arrivals_within<'a>(
        &'a self,
        _ends: [DVec2; 2],
        _max_path_m: f64,
    ) -> Result<Option<Box<dyn Arrivals + 'a>>, TooCostly> {
        Ok(None)
    }
}

/// Arrivals at an observation point, in all directions.
///
/// The paths depend on the point only, so they are found once and serve all directions.
pub trait Arrivals: Send + Sync {
    /// Replaces `arrivals` with those of a firing in world direction `direction_rad`, shortest path
    /// first, weighted with the beam pattern. Includes arrivals too weak to be detected, as far as
    /// the engine finds them.
    fn collect_arrivals(&self, direction_rad: f64, arrivals: &mut Vec<PulseArrival>);

    /// As [`collect_arrivals`](Self::collect_arrivals), limited to arrivals up to a length
    /// there and back, in metres.
    fn collect_arrivals_within(
        &self,
        direction_rad: f64,
        length_m: f64,
        arrivals: &mut Vec<PulseArrival>,
    ) {
        self.collect_arrivals(direction_rad, arrivals);
        arrivals.retain(|arrival| arrival.length_m <= length_m);
    }

    /// As [`arrival`](Self::arrival), for a result of
    /// [`collect_arrivals_within`](Self::collect_arrivals_within) with this length.
    fn arrival_within(
        &self,
        direction_rad: f64,
        _length_m: f64,
        arrival: &PulseArrival,
    ) -> Arrival {
        self.arrival(direction_rad, arrival)
    }

    /// As [`incident`](Self::incident), for a result of
    /// [`collect_arrivals_within`](Self::collect_arrivals_within) with this length.
    fn incident_within(
        &self,
        direction_rad: f64,
        _length_m: f64,
        arrival: &PulseArrival,
    ) -> Incident {
        self.incident(direction_rad, arrival)
    }

    /// Returns the full description of an arrival that
    /// [`collect_arrivals`](Self::collect_arrivals) returned for the same direction.
    fn arrival(&self, direction_rad: f64, arrival: &PulseArrival) -> Arrival;

    /// Returns the incidence of an arrival that [`collect_arrivals`](Self::collect_arrivals)
    /// returned for the same direction. The full response of the face needs it for each arrival of
    /// a firing.
    fn incident(&self, direction_rad: f64, arrival: &PulseArrival) -> Incident {
        let arrival = self.arrival(direction_rad, arrival);
        let image = match arrival.path.kind() {
            PathKind::Specular => mirrored(arrival.path.interactions.len()),
            PathKind::Diffracted | PathKind::Scattered => Image::PointScatterer,
        };
        let off_rad = |end_rad: f64| wrap_pi(end_rad - direction_rad);
        Incident {
            strength: arrival.path_amplitude,
            incidence: Incidence {
                leaving_rad: off_rad(arrival.departure_rad),
                arriving_rad: off_rad(arrival.arrival_rad),
                length_m: arrival.length_m,
                image,
            },
        }
    }

    /// Lists the echoes up to a length there and back, in metres, for comparison with those in
    /// another scene; `None` from engines without such a list.
    fn echo_set(&self, _length_m: f64) -> Option<EchoSet> {
        None
    }

    /// Returns all arrivals of a firing in full, shortest path first.
    fn arrivals(&self, direction_rad: f64) -> Vec<Arrival> {
        let mut arrivals = Vec::new();
        self.collect_arrivals(direction_rad, &mut arrivals);
        arrivals.iter().map(|arrival| self.arrival(direction_rad, arrival)).collect()
    }
}

/// Image of the transducer's face over a number of mirrors.
pub(super) const fn mirrored(count: usize) -> Image {
    if count.is_multiple_of(2) { Image::Upright } else { Image::Swapped }
}
