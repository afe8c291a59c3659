//! Echoes of an observation point, compared with those of the same point in another scene.

use std::{cmp::Ordering, f64::consts::PI};

use super::{
    direction_index::{DirectionEntry, wrap_once},
    found::{EchoPulse, FoundEchoes},
    pattern::PatternEnvelope,
    transducer::FaceEchoes,
};
use crate::geometry::wrap_pi;

/// Resolution in which echoes are compared, metres, amplitudes and radians. Where a wall only ends
/// elsewhere, lengths of its echoes differ by rounding.
const RESOLUTION: f64 = 1e-9;

/// Echo paths of an observation point up to a length, as far as readings depend on them.
///
/// Created by [`ObservationPoint::echo_set`](crate::model::ObservationPoint::echo_set).
#[derive(Debug, Clone)]
pub struct EchoSet {
    /// Length there and back up to which all echoes are known, metres.
    reach_m: f64,
    /// Sorted by key.
    echoes: Vec<ListedEcho>,
}

/// Echo with the directions in which readings depend on it.
#[derive(Debug, Clone, Copy)]
struct ListedEcho {
    /// Kind, then length, amplitude, phase and directions of departure and arrival in steps of
    /// [`RESOLUTION`].
    key: [i64; 8],
    /// Directions of the axis in which the beam contains the echo.
    direct: Directions,
    /// Directions in which an echo by way of the transducer's face begins with this one.
    by_face: Option<Directions>,
}

/// Directions in which readings depend on an echo.
#[derive(Debug, Clone, Copy)]
struct Directions {
    /// Minimum length of an arrival, there and back, metres.
    from_m: f64,
    middle_rad: f64,
    /// Offset from the middle beyond which arrivals are too weak, radians.
    reach_rad: f64,
}

/// Difference of the echoes of a point in two scenes.
#[derive(Debug)]
pub struct EchoChange {
    /// Length there and back up to which echoes are compared, metres.
    reach_m: f64,
    directions: Vec<Directions>,
}

impl EchoSet {
    /// Lists the echoes that a search up to a length, metres, found.
    pub(super) fn new(
        found: &FoundEchoes,
        face_echoes: Option<&FaceEchoes>,
        envelope: &PatternEnvelope,
        reach_m: f64,
    ) -> Self {
        let settings = &found.paths.plan.settings;
        let listed = |(echo, index)| {
            let mut entry = DirectionEntry::new(echo, index, envelope, settings.floor)?;
            if settings.tilt_rad != 0.0 {
                // A tilted axis may be nearer to a rising path than its azimuth is.
                entry.reach_rad = PI;
            }
            let EchoPulse { length_m, phase_rad, gain } = found.pulse(index);
            let [departure, arrival] = [echo.departure, echo.arrival];
            let in_steps = [
                length_m,
                gain * echo.amplitude,
                phase_rad,
                departure.x,
                departure.y,
                arrival.x,
                arrival.y,
            ];
            let mut key = [echo.via.kind() as i64; 8];
            for (key, value) in key[1..].iter_mut().zip(in_steps) {
                *key = (value / RESOLUTION).round() as i64;
            }
            let direct = Directions {
                from_m: length_m,
                middle_rad: entry.middle_rad,
                reach_rad: entry.reach_rad,
            };
            let by_face = face_echoes.and_then(|of| {
                let reach_rad = of.departure_reach_rad(echo, envelope, settings.floor)?;
                let from_m = length_m + of.shortest_m();
                Some(Directions { from_m, middle_rad: departure.to_angle(), reach_rad })
            });
            Some(ListedEcho { key, direct, by_face })
        };
        let mut echoes: Vec<ListedEcho> = found.echoes.iter().zip(0..).filter_map(listed).collect();
        echoes.sort_unstable_by_key(|echo| echo.key);
        Self { reach_m, echoes }
    }

    /// Compares with the echoes of the same point in another scene, by the same ranger.
    #[must_use]
    pub fn change_to(&self, other: &Self) -> EchoChange {
        let mut directions = Vec::new();
        let mut add = |echo: &ListedEcho| {
            directions.push(echo.direct);
            directions.extend(echo.by_face);
        };
        let (mut own, mut others) = (self.echoes.iter().peekable(), other.echoes.iter().peekable());
        loop {
            let order = match (own.peek(), others.peek()) {
                (Some(own), Some(other)) => own.key.cmp(&other.key),
                (Some(_), None) => Ordering::Less,
                (None, Some(_)) => Ordering::Greater,
                (None, None) => break,
            };
            if order.is_le() {
                own.next().filter(|_| order.is_lt()).into_iter().for_each(&mut add);
            }
            if order.is_ge() {
                others.next().filter(|_| order.is_gt()).into_iter().for_each(&mut add);
            }
        }
        EchoChange { reach_m: self.reach_m.min(other.reach_m), directions }
    }
}

impl EchoChange {
    /// Returns `true` unless a firing in a world direction, radians, has the same reading in both
    /// scenes; `radius_m` is that of the reading in either
    /// ([`ObservationPoint::ping_with_radius`](crate::model::ObservationPoint::ping_with_radius)).
    #[must_use]
    pub fn affects(&self, direction_rad: f64, radius_m: f64) -> bool {
        let length_m = 2.0 * radius_m + RESOLUTION;
        let direction_rad = wrap_pi(direction_rad);
        let is_in = |of: &Directions| {
            of.from_m <= length_m
                && wrap_once(direction_rad - of.middle_rad).abs() <= of.reach_rad + RESOLUTION
        };
        length_m > self.reach_m || self.directions.iter().any(is_in)
    }
}
