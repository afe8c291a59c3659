//! An observation point, from which firings are predicted.

use std::cell::Cell;

use rand::Rng;

use super::{
    cost::TooCostly,
    crosstalk::{Medley, Others, Sorted},
    engine::{Arrival, Arrivals},
    lazy::LazyArrivals,
    prediction::Prediction,
    simulator::Simulator,
};
use crate::{
    acoustics::{
        Detection, EchoTrace, Incident, Latch, Listening, PulseArrival, Receiver, ReceiverNoise,
    },
    geometry::DVec2,
};

/// A point from which firings are predicted; [`Simulator::at`] makes it.
pub struct ObservationPoint<'a> {
    simulator: &'a Simulator,
    position: DVec2,
    /// Of a transducer on the axis, which stays where it is when it turns; one beside the axis is
    /// somewhere else at each azimuth.
    axis: Option<LazyArrivals<'a>>,
}

/// A firing that hears more has to make room for them.
const USUAL_ARRIVALS: usize = 64;

impl<'a> ObservationPoint<'a> {
    pub(super) fn new(simulator: &'a Simulator, position: DVec2) -> Self {
        let on_axis = simulator.sensor().mounting.is_on_axis();
        let axis = on_axis.then(|| simulator.arrivals_between([position; 2]));
        Self { simulator, position, axis }
    }

    /// The reading of a firing in a world direction, radians counter-clockwise from +x: the first
    /// echo, which latches ECHO.
    ///
    /// # Errors
    /// When there are more paths than can be found within bounds of work and memory, here and in all that follows.
    pub fn ping(&self, direction_rad: f64) -> Result<Prediction, TooCostly> {
        self.listen(self.simulator.receiver(), direction_rad, Latch::First)
    }

    /// Has a firing listened to by any receivers: the simulator's own with other thresholds, for what a firing is that
    /// was more or less sensitive than usual. Its arrivals are found once; `listen` may be called again with more of
    /// them, and its last result counts.
    ///
    /// # Errors
    /// As [`Self::ping`].
    pub fn hear<T>(
        &self,
        direction_rad: f64,
        listen: impl FnMut(&FiringArrivals) -> T,
    ) -> Result<T, TooCostly> {
        self.heard(direction_rad, listen).map(|(heard, _)| heard)
    }

    /// The same with the receiver made ready again after each echo, up to eight times.
    ///
    /// # Errors
    /// As [`Self::ping`].
    pub fn ping_rearmed(&self, direction_rad: f64) -> Result<Prediction, TooCostly> {
        self.listen(self.simulator.receiver(), direction_rad, Latch::Rearmed)
    }

    fn listen(
        &self,
        receiver: &Receiver,
        direction_rad: f64,
        latch: Latch,
    ) -> Result<Prediction, TooCostly> {
        self.listen_alone(receiver, direction_rad, latch).map(|(prediction, _)| prediction)
    }

    /// The same, and up to which length there and back arrivals matter to it, metres.
    fn listen_alone(
        &self,
        receiver: &Receiver,
        direction_rad: f64,
        latch: Latch,
    ) -> Result<(Prediction, f64), TooCostly> {
        self.heard(direction_rad, |firing| firing.prediction(firing.detect(receiver, latch, 0.0)))
    }

    /// What `listen` tells once it has enough of the arrivals, and up to which length there and back they matter,
    /// metres.
    fn heard<T>(
        &self,
        direction_rad: f64,
        mut listen: impl FnMut(&FiringArrivals) -> T,
    ) -> Result<(T, f64), TooCostly> {
        let mut arrivals = Vec::with_capacity(USUAL_ARRIVALS);
        self.at(direction_rad, |all| {
            let ((heard, needed_m), _) = all.nearest(|near| {
                near.listen(direction_rad, &mut arrivals);
                let firing = FiringArrivals {
                    firing: Firing { from: near, direction_rad },
                    arrivals: &arrivals,
                    reach_m: near.reach_m,
                    needed_m: Cell::new(Some(0.0)),
                };
                let heard = listen(&firing);
                let needed_m = firing.needed_m.get();
                ((heard, needed_m.unwrap_or(f64::INFINITY)), needed_m)
            })?;
            Ok((heard, needed_m))
        })
    }

    /// The same with the sound of other firings beside it.
    pub(super) fn ping_among(
        &self,
        direction_rad: f64,
        others: &Others,
    ) -> Result<Prediction, TooCostly> {
        let receiver = self.simulator.receiver();
        let (alone, needed_m) = self.listen_alone(receiver, direction_rad, Latch::First)?;
        if others.is_silent() {
            return Ok(alone);
        }
        others.settle(needed_m, |medley| self.listen_among(direction_rad, medley))
    }

    fn listen_among(
        &self,
        direction_rad: f64,
        medley: &Medley,
    ) -> Result<(Prediction, f64), TooCostly> {
        let (receiver, mut own) = (self.simulator.receiver(), Vec::new());
        self.at(direction_rad, |all| {
            let ((detection, sorted, needed_m), near) = all.nearest(|near| {
                near.listen(direction_rad, &mut own);
                let sorted = medley.sorted(&own);
                let firing = Firing { from: near, direction_rad };
                let incident = |arrival: &PulseArrival| {
                    Some(medley.incident(&sorted, arrival, |own| firing.incident(own)))
                };
                let known_m = near.reach_m.min(medley.known_m);
                let (detection, needed_m) =
                    receiver.detect_within(known_m, &sorted.arrivals, &incident, Latch::First, 0.0);
                ((detection, sorted, needed_m.unwrap_or(f64::INFINITY)), needed_m)
            })?;
            let firing = Firing { from: &near, direction_rad };
            Ok((firing.prediction_among(detection, medley, &sorted), needed_m))
        })
    }

    /// [`ping_in_noise`](Self::ping_in_noise) with the sound of other firings beside it.
    pub(super) fn ping_among_in_noise(
        &self,
        direction_rad: f64,
        others: &Others,
        noise: &ReceiverNoise,
        rng: &mut impl Rng,
    ) -> Result<Prediction, TooCostly> {
        let receiver = self.simulator.receiver();
        others.settle(f64::INFINITY, |medley| {
            let heard = self.firing(direction_rad, |firing| {
                let sorted = medley.sorted(&firing.arrivals());
                let incident = |arrival: &PulseArrival| {
                    Some(medley.incident(&sorted, arrival, |own| firing.incident(own)))
                };
                let detection = receiver.detect_in_noise(&sorted.arrivals, &incident, noise, rng);
                firing.prediction_among(detection, medley, &sorted)
            })?;
            Ok((heard, f64::INFINITY))
        })
    }

    /// The same by all echoes at once, however far they come from.
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

    /// [`ping_rearmed`](Self::ping_rearmed) in noise: the same generator in the same state gives
    /// the same reading.
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

    /// The trace of a firing as an oscilloscope would show it, up to a range in metres, in steps of so many
    /// microseconds; each [`EnvelopePeak`](crate::acoustics::EnvelopePeak) can be named with
    /// [`arrival`](Self::arrival).
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

    /// Every echo of a firing in a world direction, detected or not, shortest path first.
    ///
    /// # Errors
    /// As [`Self::ping`].
    pub fn arrivals(&self, direction_rad: f64) -> Result<Vec<Arrival>, TooCostly> {
        self.firing(direction_rad, |firing| firing.from.arrivals(direction_rad))
    }

    /// The full account of an arrival of a firing in the same direction.
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

    /// Fires with all echoes from where the transducer is when it looks into a direction.
    fn firing<T>(
        &self,
        direction_rad: f64,
        tell: impl FnOnce(&Firing) -> T,
    ) -> Result<T, TooCostly> {
        self.at(direction_rad, |all| Ok(tell(&Firing { from: all.whole()?, direction_rad })))
    }

    /// Goes where the transducer is when it looks into a direction.
    fn at<T>(&self, direction_rad: f64, tell: impl FnOnce(&LazyArrivals) -> T) -> T {
        if let Some(all) = &self.axis {
            return tell(all);
        }
        let mounting = &self.simulator.sensor().mounting;
        tell(&self.simulator.arrivals_between(mounting.places(self.position, direction_rad)))
    }
}

/// A firing's arrivals, for receivers to listen to.
pub struct FiringArrivals<'a> {
    firing: Firing<'a>,
    /// Shortest path first.
    arrivals: &'a [PulseArrival],
    /// Up to which length there and back they are known, metres.
    reach_m: f64,
    /// Up to which they matter to what was asked, if they are known so far.
    needed_m: Cell<Option<f64>>,
}

impl FiringArrivals<'_> {
    /// What a receiver detects that is ready from the end of blanking on, or from `ready_us` microseconds after firing
    /// if that is later: for one that is known not to have been raised before, because a more sensitive one was not.
    #[must_use]
    pub fn detect(&self, receiver: &Receiver, latch: Latch, ready_us: f64) -> Detection {
        let incident = |arrival: &PulseArrival| Some(self.firing.incident(arrival));
        let incident: &dyn Fn(&PulseArrival) -> Option<Incident> =
            if receiver.asks_incidents() { &incident } else { &|_| None };
        let (detection, needed_m) =
            receiver.detect_within(self.reach_m, self.arrivals, incident, latch, ready_us);
        self.needs(needed_m);
        detection
    }

    /// Listens with receivers that have a threshold of their own each, and are otherwise this one.
    pub fn listen<T>(&self, receiver: &Receiver, listen: impl FnOnce(&mut Listening) -> T) -> T {
        let incident = |arrival: &PulseArrival| Some(self.firing.incident(arrival));
        let incident: &dyn Fn(&PulseArrival) -> Option<Incident> =
            if receiver.asks_incidents() { &incident } else { &|_| None };
        let mut listening = receiver.listen(self.reach_m, self.arrivals, incident);
        let heard = listen(&mut listening);
        self.needs(listening.needed_m());
        heard
    }

    /// Takes down up to which length arrivals mattered to one more answer.
    fn needs(&self, needed_m: Option<f64>) {
        let both = self.needed_m.get().zip(needed_m);
        self.needed_m.set(both.map(|(one_m, other_m)| one_m.max(other_m)));
    }

    /// The full account of one of the arrivals.
    #[must_use]
    pub fn arrival(&self, arrival: &PulseArrival) -> Arrival {
        self.firing.from.arrival(self.firing.direction_rad, arrival)
    }

    /// A detection as a reading, with the path of its arrival.
    #[must_use]
    pub fn prediction(&self, detection: Detection) -> Prediction {
        self.firing.prediction(detection)
    }
}

/// The arrivals at a point in a direction.
struct Firing<'a> {
    from: &'a dyn Arrivals,
    direction_rad: f64,
}

impl Firing<'_> {
    fn arrivals(&self) -> Vec<PulseArrival> {
        let mut arrivals = Vec::new();
        self.from.listen(self.direction_rad, &mut arrivals);
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
        medley: &Medley,
        sorted: &Sorted,
    ) -> Prediction {
        let cause = detection.arrival.take();
        let (arrival, crosstalk) = cause
            .map(|arrival| medley.arrival(sorted, &arrival, (self.from, self.direction_rad)))
            .unzip();
        Prediction { arrival, crosstalk: crosstalk.flatten(), ..self.prediction(detection) }
    }
}
