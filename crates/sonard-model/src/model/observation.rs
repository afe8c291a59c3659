//! An observation point, from which firings are predicted.

use std::cell::Cell;

use rand::Rng;

use super::{
    cost::TooCostly,
    crosstalk::{MergedArrivals, MixedArrivals, OtherFirings},
    engine::{Arrival, Arrivals},
    lazy::LazyArrivals,
    paths::EchoSet,
    prediction::Prediction,
    simulator::Simulator,
};
use crate::{
    acoustics::{
        Detection, DetectorBank, EchoTrace, Incidence, Incident, Latch, PulseArrival, Receiver,
        ReceiverNoise,
    },
    geometry::DVec2,
};

/// A point from which firings are predicted; created by [`Simulator::at`].
pub struct ObservationPoint<'a> {
    simulator: &'a Simulator,
    position: DVec2,
    /// Arrivals of a transducer on the axis, whose position is independent of the azimuth. `None`
    /// for one off the axis, which is at a different point at each azimuth.
    axis: Option<LazyArrivals<'a>>,
}

/// Initial capacity; a firing with more arrivals reallocates.
const USUAL_ARRIVALS: usize = 64;

impl<'a> ObservationPoint<'a> {
    pub(super) fn new(simulator: &'a Simulator, position: DVec2) -> Self {
        let on_axis = simulator.sensor().mounting.is_on_axis();
        let axis = on_axis.then(|| simulator.arrivals_between([position; 2]));
        Self { simulator, position, axis }
    }

    /// Predicts the reading of a firing in a world direction, radians counter-clockwise from +x:
    /// the first echo, which latches ECHO.
    ///
    /// # Errors
    /// When there are more paths than can be found within bounds of work and memory, here and in
    /// all methods below.
    pub fn ping(&self, direction_rad: f64) -> Result<Prediction, TooCostly> {
        self.predict(self.simulator.receiver(), direction_rad, Latch::First)
    }

    /// Evaluates a firing with any receivers: the simulator's own with other thresholds, for a
    /// firing of higher or lower sensitivity than usual. The arrivals are found once. `detect` may
    /// be called again with more arrivals, and its last result counts.
    ///
    /// # Errors
    /// As [`Self::ping`].
    pub fn evaluate<T>(
        &self,
        direction_rad: f64,
        detect: impl FnMut(&FiringArrivals) -> T,
    ) -> Result<T, TooCostly> {
        self.evaluate_needed(direction_rad, detect).map(|(result, _)| result)
    }

    /// Predicts the reading of a firing by a transducer at an offset (world, metres) from this point,
    /// to the first order of the offset: its echo paths are those from this point, each shorter by
    /// the part of the offset along its ends.
    ///
    /// That is exact for an echo that returns the way it came from plane walls, as long as they are
    /// visible from both places, except for the absorption along the offset. Of other echoes, such as
    /// those of corners, the angle from the axis of the beam is that at this point. The path of the
    /// prediction's arrival begins at this point.
    ///
    /// # Errors
    /// As [`Self::ping`].
    pub fn ping_beside(&self, direction_rad: f64, offset: DVec2) -> Result<Prediction, TooCostly> {
        self.predict_beside(direction_rad, offset).map(|(prediction, _)| prediction)
    }

    /// Predicts the reading of a firing as [`ping_beside`](Self::ping_beside), exactly for an offset
    /// of zero, and returns the radius around this point, metres, outside of which no change of the
    /// scene affects it: any echo from there, or path blocked there, would be longer than those that
    /// decide the reading. Infinite if all paths affect it.
    ///
    /// # Errors
    /// As [`Self::ping`].
    pub fn ping_with_radius(
        &self,
        direction_rad: f64,
        offset: DVec2,
    ) -> Result<(Prediction, f64), TooCostly> {
        let receiver = self.simulator.receiver();
        let (prediction, needed_m) = match offset == DVec2::ZERO {
            true => self.predict_alone(receiver, direction_rad, Latch::First)?,
            false => self.predict_beside(direction_rad, offset)?,
        };
        let mounting = &self.simulator.sensor().mounting;
        let transducers = mounting.transducer_positions(self.position, direction_rad);
        let offsets_m = transducers.map(|transducer| transducer.distance(self.position));
        Ok((prediction, 0.5 * (needed_m + offsets_m[0] + offsets_m[1])))
    }

    /// Lists the echoes from places within a radius around this point, metres, for comparison with
    /// those in another scene. `None` for a transducer off the axis, and from engines without such a
    /// list.
    ///
    /// # Errors
    /// As [`Self::ping`].
    pub fn echo_set(&self, radius_m: f64) -> Result<Option<EchoSet>, TooCostly> {
        self.axis.as_ref().map_or(Ok(None), |all| all.echo_set(2.0 * radius_m))
    }

    fn predict_beside(
        &self,
        direction_rad: f64,
        offset: DVec2,
    ) -> Result<(Prediction, f64), TooCostly> {
        let receiver = self.simulator.receiver();
        let max_shift_m = 2.0 * offset.length();
        let mut arrivals = Vec::with_capacity(USUAL_ARRIVALS);
        self.at(direction_rad, |all| {
            let ((prediction, needed_m), _) = all.nearest(|near| {
                near.collect_arrivals(direction_rad, &mut arrivals);
                let firing = DirectedArrivals { from: near, direction_rad };
                for arrival in &mut arrivals {
                    let Incidence { leaving_rad, arriving_rad, .. } =
                        firing.incident(arrival).incidence;
                    let ends = [leaving_rad, arriving_rad]
                        .map(|end_rad| DVec2::from_angle(direction_rad + end_rad));
                    let length_m = arrival.length_m - offset.dot(ends[0] + ends[1]);
                    arrival.length_m = length_m.max(0.0);
                }
                arrivals.sort_by(|a, b| a.length_m.total_cmp(&b.length_m));
                let incident = |arrival: &PulseArrival| {
                    let mut incident = firing.incident(arrival);
                    incident.incidence.length_m = arrival.length_m;
                    Some(incident)
                };
                let known_m = near.reach_m - max_shift_m;
                let (detection, needed_m) =
                    receiver.detect_within(known_m, &arrivals, &incident, Latch::First, 0.0);
                let needed_m = needed_m.map(|length_m| length_m + max_shift_m);
                let prediction = firing.prediction(detection);
                ((prediction, needed_m.unwrap_or(f64::INFINITY)), needed_m)
            })?;
            Ok((prediction, needed_m))
        })
    }

    /// Predicts the reading of a firing whose receiver is re-armed after each echo, up to eight
    /// times.
    ///
    /// # Errors
    /// As [`Self::ping`].
    pub fn ping_rearmed(&self, direction_rad: f64) -> Result<Prediction, TooCostly> {
        self.predict(self.simulator.receiver(), direction_rad, Latch::Rearmed)
    }

    fn predict(
        &self,
        receiver: &Receiver,
        direction_rad: f64,
        latch: Latch,
    ) -> Result<Prediction, TooCostly> {
        self.predict_alone(receiver, direction_rad, latch).map(|(prediction, _)| prediction)
    }

    /// Predicts a reading, and returns the length there and back up to which arrivals affect it,
    /// metres.
    fn predict_alone(
        &self,
        receiver: &Receiver,
        direction_rad: f64,
        latch: Latch,
    ) -> Result<(Prediction, f64), TooCostly> {
        self.evaluate_needed(direction_rad, |firing| {
            firing.prediction(firing.detect(receiver, latch, 0.0))
        })
    }

    /// Returns the result of `detect` once enough arrivals are known, and the length there and back
    /// up to which they affect it, metres.
    fn evaluate_needed<T>(
        &self,
        direction_rad: f64,
        mut detect: impl FnMut(&FiringArrivals) -> T,
    ) -> Result<(T, f64), TooCostly> {
        let mut arrivals = Vec::with_capacity(USUAL_ARRIVALS);
        self.at(direction_rad, |all| {
            let ((result, needed_m), _) = all.nearest(|near| {
                near.collect_arrivals(direction_rad, &mut arrivals);
                let firing = FiringArrivals {
                    firing: DirectedArrivals { from: near, direction_rad },
                    arrivals: &arrivals,
                    reach_m: near.reach_m,
                    needed_m: Cell::new(Some(0.0)),
                };
                let result = detect(&firing);
                let needed_m = firing.needed_m.get();
                ((result, needed_m.unwrap_or(f64::INFINITY)), needed_m)
            })?;
            Ok((result, needed_m))
        })
    }

    /// Predicts the reading of a firing with crosstalk from other firings.
    pub(super) fn ping_among(
        &self,
        direction_rad: f64,
        others: &OtherFirings,
    ) -> Result<Prediction, TooCostly> {
        let receiver = self.simulator.receiver();
        let (alone, needed_m) = self.predict_alone(receiver, direction_rad, Latch::First)?;
        if others.is_empty() {
            return Ok(alone);
        }
        others.resolve(needed_m, |mixed| self.predict_among(direction_rad, mixed))
    }

    fn predict_among(
        &self,
        direction_rad: f64,
        mixed: &MixedArrivals,
    ) -> Result<(Prediction, f64), TooCostly> {
        let (receiver, mut own) = (self.simulator.receiver(), Vec::new());
        self.at(direction_rad, |all| {
            let ((detection, sorted, needed_m), near) = all.nearest(|near| {
                near.collect_arrivals(direction_rad, &mut own);
                let sorted = mixed.sorted(&own);
                let firing = DirectedArrivals { from: near, direction_rad };
                let incident = |arrival: &PulseArrival| {
                    Some(mixed.incident(&sorted, arrival, |own| firing.incident(own)))
                };
                let known_m = near.reach_m.min(mixed.known_m);
                let (detection, needed_m) =
                    receiver.detect_within(known_m, &sorted.arrivals, &incident, Latch::First, 0.0);
                ((detection, sorted, needed_m.unwrap_or(f64::INFINITY)), needed_m)
            })?;
            let firing = DirectedArrivals { from: &near, direction_rad };
            Ok((firing.prediction_among(detection, mixed, &sorted), needed_m))
        })
    }

    /// As [`ping_in_noise`](Self::ping_in_noise), with crosstalk from other firings.
    pub(super) fn ping_among_in_noise(
        &self,
        direction_rad: f64,
        others: &OtherFirings,
        noise: &ReceiverNoise,
        rng: &mut impl Rng,
    ) -> Result<Prediction, TooCostly> {
        let receiver = self.simulator.receiver();
        others.resolve(f64::INFINITY, |mixed| {
            let result = self.firing(direction_rad, |firing| {
                let sorted = mixed.sorted(&firing.arrivals());
                let incident = |arrival: &PulseArrival| {
                    Some(mixed.incident(&sorted, arrival, |own| firing.incident(own)))
                };
                let detection = receiver.detect_in_noise(&sorted.arrivals, &incident, noise, rng);
                firing.prediction_among(detection, mixed, &sorted)
            })?;
            Ok((result, f64::INFINITY))
        })
    }

    /// Predicts a reading from all echoes at once, regardless of their length.
    #[cfg(test)]
    pub(super) fn ping_by_all(
        &self,
        direction_rad: f64,
        latch: Latch,
    ) -> Result<Prediction, TooCostly> {
        self.firing(direction_rad, |firing| {
            let incident = |arrival: &PulseArrival| Some(firing.incident(arrival));
            let receiver = self.simulator.receiver();
            firing.prediction(receiver.detect_at_face(&firing.arrivals(), &incident, latch))
        })
    }

    /// [`ping_rearmed`](Self::ping_rearmed) with receiver noise: the same generator in the same
    /// state gives the same reading.
    ///
    /// # Errors
    /// As [`Self::ping`].
    pub fn ping_in_noise(
        &self,
        direction_rad: f64,
        noise: &ReceiverNoise,
        rng: &mut impl Rng,
    ) -> Result<Prediction, TooCostly> {
        self.firing(direction_rad, |firing| {
            let incident = |arrival: &PulseArrival| Some(firing.incident(arrival));
            let receiver = self.simulator.receiver();
            firing.prediction(receiver.detect_in_noise(&firing.arrivals(), &incident, noise, rng))
        })
    }

    /// Computes the trace of a firing as on an oscilloscope, up to a range in metres, in steps of
    /// `step_us` microseconds. Each [`EnvelopePeak`](crate::acoustics::EnvelopePeak) can be
    /// identified with [`arrival`](Self::arrival).
    ///
    /// # Errors
    /// As [`Self::ping`].
    pub fn trace(
        &self,
        direction_rad: f64,
        until_m: f64,
        step_us: f64,
    ) -> Result<EchoTrace, TooCostly> {
        self.firing(direction_rad, |firing| {
            let receiver = self.simulator.receiver();
            let until_us = 2e6 * until_m / receiver.sound_speed_m_s;
            let incident = |arrival: &PulseArrival| Some(firing.incident(arrival));
            receiver.trace(&firing.arrivals(), &incident, until_us, step_us)
        })
    }

    /// Returns every echo of a firing in a world direction, detected or not, shortest path first.
    ///
    /// # Errors
    /// As [`Self::ping`].
    pub fn arrivals(&self, direction_rad: f64) -> Result<Vec<Arrival>, TooCostly> {
        self.firing(direction_rad, |firing| firing.from.arrivals(direction_rad))
    }

    /// Returns the full description of an arrival of a firing in the same direction.
    ///
    /// # Errors
    /// As [`Self::ping`].
    pub fn arrival(
        &self,
        direction_rad: f64,
        arrival: &PulseArrival,
    ) -> Result<Arrival, TooCostly> {
        self.firing(direction_rad, |firing| firing.from.arrival(direction_rad, arrival))
    }

    /// Calls `visit` with all arrivals at the transducer's position for a direction.
    fn firing<T>(
        &self,
        direction_rad: f64,
        visit: impl FnOnce(&DirectedArrivals) -> T,
    ) -> Result<T, TooCostly> {
        self.at(direction_rad, |all| {
            Ok(visit(&DirectedArrivals { from: all.whole()?, direction_rad }))
        })
    }

    /// Calls `visit` with the arrivals at the transducer's position for a direction.
    fn at<T>(&self, direction_rad: f64, visit: impl FnOnce(&LazyArrivals) -> T) -> T {
        if let Some(all) = &self.axis {
            return visit(all);
        }
        let mounting = &self.simulator.sensor().mounting;
        visit(
            &self
                .simulator
                .arrivals_between(mounting.transducer_positions(self.position, direction_rad)),
        )
    }
}

/// Arrivals of a firing, as input for receivers.
pub struct FiringArrivals<'a> {
    firing: DirectedArrivals<'a>,
    /// Arrivals, shortest path first.
    arrivals: &'a [PulseArrival],
    /// Length there and back up to which the arrivals are known, metres.
    reach_m: f64,
    /// Length up to which they affect the results so far; `None` if that exceeds the known length.
    needed_m: Cell<Option<f64>>,
}

impl FiringArrivals<'_> {
    /// Returns the detection of a receiver that is ready from the end of blanking on, or from
    /// `ready_us` microseconds after firing if that is later. The latter is for a receiver that
    /// cannot have triggered before, because a more sensitive one did not.
    #[must_use]
    pub fn detect(&self, receiver: &Receiver, latch: Latch, ready_us: f64) -> Detection {
        let incident = |arrival: &PulseArrival| Some(self.firing.incident(arrival));
        let incident: &dyn Fn(&PulseArrival) -> Option<Incident> =
            if receiver.needs_incidents() { &incident } else { &|_| None };
        let (detection, needed_m) =
            receiver.detect_within(self.reach_m, self.arrivals, incident, latch, ready_us);
        self.needs(needed_m);
        detection
    }

    /// Evaluates receivers that differ from `receiver` in their thresholds only.
    pub fn evaluate_thresholds<T>(
        &self,
        receiver: &Receiver,
        detect: impl FnOnce(&mut DetectorBank) -> T,
    ) -> T {
        let incident = |arrival: &PulseArrival| Some(self.firing.incident(arrival));
        let incident: &dyn Fn(&PulseArrival) -> Option<Incident> =
            if receiver.needs_incidents() { &incident } else { &|_| None };
        let mut listening = receiver.detector_bank(self.reach_m, self.arrivals, incident);
        let result = detect(&mut listening);
        self.needs(listening.max_relevant_length_m());
        result
    }

    /// Records the length up to which arrivals affected one more result.
    fn needs(&self, needed_m: Option<f64>) {
        let both = self.needed_m.get().zip(needed_m);
        self.needed_m.set(both.map(|(one_m, other_m)| one_m.max(other_m)));
    }

    /// Returns the full description of one of the arrivals.
    #[must_use]
    pub fn arrival(&self, arrival: &PulseArrival) -> Arrival {
        self.firing.from.arrival(self.firing.direction_rad, arrival)
    }

    /// Converts a detection to a reading, with the path of its arrival.
    #[must_use]
    pub fn prediction(&self, detection: Detection) -> Prediction {
        self.firing.prediction(detection)
    }
}

/// Arrivals at a point in a direction.
struct DirectedArrivals<'a> {
    from: &'a dyn Arrivals,
    direction_rad: f64,
}

impl DirectedArrivals<'_> {
    fn arrivals(&self) -> Vec<PulseArrival> {
        let mut arrivals = Vec::new();
        self.from.collect_arrivals(self.direction_rad, &mut arrivals);
        arrivals
    }

    fn incident(&self, arrival: &PulseArrival) -> Incident {
        self.from.incident(self.direction_rad, arrival)
    }

    fn prediction(&self, detection: Detection) -> Prediction {
        let arrival = |arrival| self.from.arrival(self.direction_rad, &arrival);
        Prediction {
            status: detection.status,
            range_m: detection.range_m,
            arrival: detection.arrival.map(arrival),
            amplitude: detection.amplitude,
            margin_db: detection.margin_db,
            echoes_us: detection.echoes_us,
            crosstalk: None,
        }
    }

    fn prediction_among(
        &self,
        mut detection: Detection,
        mixed: &MixedArrivals,
        sorted: &MergedArrivals,
    ) -> Prediction {
        let cause = detection.arrival.take();
        let (arrival, crosstalk) = cause
            .map(|arrival| mixed.arrival(sorted, &arrival, (self.from, self.direction_rad)))
            .unzip();
        Prediction { arrival, crosstalk: crosstalk.flatten(), ..self.prediction(detection) }
    }
}
