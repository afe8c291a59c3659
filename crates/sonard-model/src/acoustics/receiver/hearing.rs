//! The sum of a firing's arrivals, and when its envelope passes the threshold.
//!
//! Time runs forward: arrivals enter when they begin and leave when they are over, and only those in
//! between are summed. Where their strengths together can't reach the threshold nothing is summed;
//! where one arrival is alone its rise is looked up in the table of the pulse.

mod ideal;
mod level;
mod rise;
mod summand;

use std::cell::Cell;

use num_complex::Complex64;

use self::summand::Summand;
use super::{Combining, Incident, PulseArrival, Receiver, gain::Step, noise::NoiseTrack};
use crate::acoustics::{EchoShape, Gain};

/// Arrivals that together add less than this share to another's amplitude leave it as it is.
const NEGLIGIBLE: f64 = 3e-3;

/// About one cycle of the carrier, microseconds.
const CYCLE_US: f64 = 20.0;

/// An echo from exactly the largest range still counts.
const WINDOW_SLACK_US: f64 = 1e-6;

pub(super) struct Hearing<'a> {
    receiver: &'a Receiver,
    pub(super) arrivals: &'a [PulseArrival],
    incident: &'a dyn Fn(&PulseArrival) -> Option<Incident>,
    noise: Option<&'a NoiseTrack>,
    /// From then on arrivals may begin that were not told.
    horizon_us: f64,
    /// The latest time that anything was asked about.
    asked_us: f64,
    /// The first arrivals, as far as they were ever asked about: what is known of them stays when time is turned back.
    summands: Vec<Summand>,
    /// How many of them have begun now, the first `over` of which are over.
    begun: usize,
    over: usize,
    /// Number of them that have their fields, of those that are not over.
    summed: usize,
    /// When the next arrival begins, or what is not known; infinite if nothing does.
    next_us: f64,
    /// When that one comes by its path.
    next_tof_us: f64,
    /// The arrivals that last, by [`Self::lasting`], when it was last found out that
    /// they have to be watched.
    watched: Option<(usize, usize)>,
    /// The bounds of what lasts, by [`Self::lasting`].
    bounds: Bounds,
    /// What the last rise was of, if it was of one arrival with which nothing else sounds, and the detector watches the
    /// envelope of pulses whose phase is the carrier's.
    lone: Option<Lone>,
    /// The step of the gain that was last asked about.
    step: Cell<Step>,
    /// Whether all arrivals have the pulse's shape, whose phase stays the carrier's, and the gain is steady, without noise.
    is_plain: bool,
    /// Power of the time by which the gain rises.
    exponent: f64,
    /// What the receiver's threshold is multiplied with.
    pub(super) threshold_factor: f64,
    least_threshold: f64,
    /// An arrival lasts from so long before its nominal time to so long after it.
    span_us: (f64, f64),
}

/// An arrival that passed a threshold, and with which nothing else sounds.
#[derive(Clone, Copy)]
struct Lone {
    place: usize,
    /// What the receiver's threshold was multiplied with, and from when on it listened.
    factor: f64,
    from_us: f64,
}

/// What arrivals that last can add up to at most.
#[derive(Clone, Copy, Default)]
struct Bounds {
    /// Which they are.
    of: (usize, usize),
    strength: f64,
    /// A microsecond.
    steepest: f64,
}

impl<'a> Hearing<'a> {
    pub(super) fn new(
        receiver: &'a Receiver,
        arrivals: &'a [PulseArrival],
        incident: &'a dyn Fn(&PulseArrival) -> Option<Incident>,
    ) -> Self {
        let longest = receiver.response.as_ref().map_or(0.0, |response| response.crossing_us());
        let shape = &receiver.shape;
        let span_us = (
            shape.first_us() - receiver.lead_us - longest,
            shape.last_us() - receiver.lead_us + longest,
        );
        let exponent = match receiver.gain {
            Gain::Compensating { exponent, .. } => exponent,
            Gain::Steps { .. } => 0.0,
        };
        let is_plain = receiver.combining != Combining::Ideal
            && receiver.response.is_none()
            && shape.is_real()
            && exponent == 0.0;
        let mut hearing = Self {
            receiver,
            arrivals,
            incident,
            noise: None,
            horizon_us: f64::INFINITY,
            asked_us: 0.0,
            summands: Vec::with_capacity(arrivals.len()),
            begun: 0,
            over: 0,
            summed: 0,
            next_us: f64::INFINITY,
            next_tof_us: f64::INFINITY,
            watched: None,
            bounds: Bounds::default(),
            lone: None,
            step: Cell::new(receiver.sensitivity.step_at(0.0)),
            is_plain,
            exponent,
            threshold_factor: 1.0,
            least_threshold: least_threshold(receiver),
            span_us,
        };
        hearing.expect();
        hearing
    }

    pub(super) fn in_noise(mut self, noise: &'a NoiseTrack) -> Self {
        (self.noise, self.is_plain) = (Some(noise), false);
        self
    }

    /// Only the arrivals up to a length, metres, are known.
    pub(super) fn hear_within(&mut self, length_m: f64) {
        let arrives_us = self.receiver.arrives_us(length_m);
        self.horizon_us = match self.receiver.combining {
            Combining::Coherent | Combining::Incoherent => arrives_us + self.span_us.0,
            Combining::Ideal => arrives_us,
        };
        self.expect();
    }

    /// Whether an answer so far might have been another one if arrivals beyond the horizon were
    /// known.
    pub(super) fn asked_beyond(&self) -> bool {
        self.asked_us >= self.horizon_us
    }

    /// Length of the longest paths, metres, whose arrivals could have made an answer so far another
    /// one.
    pub(super) fn needed_m(&self) -> f64 {
        let begins_us = match self.receiver.combining {
            Combining::Coherent | Combining::Incoherent => self.span_us.0,
            Combining::Ideal => 0.0,
        };
        (self.asked_us - begins_us) * 1e-6 * self.receiver.sound_speed_m_s
    }

    /// Back to the firing.
    pub(super) fn rewind(&mut self) {
        self.rewind_to(0.0);
    }

    /// Back to a time after firing: as if nothing later had been asked about.
    pub(super) fn rewind_to(&mut self, t_us: f64) {
        self.over = self.summands.partition_point(|summand| summand.lasts_us[1] < t_us);
        // What was over when it was first asked about is not known.
        let known =
            self.summands[self.over..].iter().take_while(|summand| !summand.is_gone()).count();
        self.summands.truncate(self.over + known);
        self.begun =
            self.summands.partition_point(|summand| summand.lasts_us[0] <= t_us).max(self.over);
        (self.summed, self.watched, self.bounds) = (0, None, Bounds::default());
        self.expect();
    }

    /// The least amplitude noticed at a time after firing.
    pub(super) fn threshold_at(&self, t_us: f64) -> f64 {
        let Receiver { sensitivity, threshold, .. } = self.receiver;
        if !self.step.get().holds(t_us) {
            self.step.set(sensitivity.step_at(t_us));
        }
        let range_m = self.receiver.range_m(t_us);
        self.threshold_factor * sensitivity.in_step(&self.step.get(), *threshold, range_m)
    }

    /// When ECHO next rises if the detector is ready from `ready_us` on: at once if the envelope is
    /// above the threshold then and stays there for the integration time.
    pub(super) fn next_rise(&mut self, ready_us: f64) -> Option<f64> {
        match self.receiver.combining {
            Combining::Coherent | Combining::Incoherent => self.next_rise_of_sum(ready_us),
            Combining::Ideal => self.next_rise_of_one(ready_us),
        }
    }

    /// The arrival that drives the envelope one carrier cycle after a time.
    pub(super) fn cause(&mut self, t_us: f64) -> Option<PulseArrival> {
        if self.receiver.combining == Combining::Ideal {
            return self.cause_of_one(t_us);
        }
        let t_us = t_us + CYCLE_US;
        self.advance(t_us);
        let size = |summand: &Summand| summand.size * self.modulus_at(summand, t_us);
        let (place, _) = self.summands[self.over..self.begun]
            .iter()
            .enumerate()
            .map(|(place, summand)| (place, size(summand)))
            .filter(|(_, size)| *size > 0.0)
            .max_by(|one, other| one.1.total_cmp(&other.1))?;
        self.arrivals.get(self.over + place).copied()
    }

    /// The most of the envelope while an arrival lasts that begins at `t_us`.
    pub(super) fn peak(&mut self, t_us: f64, arrival: Option<&PulseArrival>) -> f64 {
        const SAMPLES: u32 = 10;
        if self.receiver.combining == Combining::Ideal || self.is_alone(t_us, arrival) {
            return arrival.map_or(0.0, |arrival| arrival.amplitude);
        }
        let shape = &self.receiver.shape;
        let lasts_us = shape.first_us() + shape.last_us() - 2.0 * self.receiver.lead_us;
        (0..=SAMPLES)
            .map(|i| self.level(t_us + f64::from(i) / f64::from(SAMPLES) * lasts_us))
            .fold(0.0, f64::max)
    }

    /// Places of the arrivals that last now.
    pub(super) fn living(&self) -> std::ops::Range<usize> {
        self.over..self.begun
    }

    /// What an arrival adds to the envelope.
    pub(super) fn share(&self, place: usize, t_us: f64) -> f64 {
        self.summands.get(place).map_or(0.0, |summand| {
            summand.size * self.modulus_at(summand, t_us) * self.rise_of_gain(t_us)
        })
    }

    /// Whether nothing else sounds with `arrival` or within its length after it, and its strength is
    /// its amplitude.
    fn is_alone(&mut self, t_us: f64, arrival: Option<&PulseArrival>) -> bool {
        let Some(arrival) = arrival else { return false };
        if self.noise.is_some() || self.receiver.response.is_some() {
            return false;
        }
        self.enter(t_us + self.span_us.1, t_us);
        let first_us = t_us - self.span_us.1 + self.span_us.0;
        let others = self.arrivals[..self.begun]
            .iter()
            .rev()
            .take_while(|other| self.receiver.tof_us(other) > first_us);
        let rest: f64 = others.filter(|other| *other != arrival).map(|other| other.amplitude).sum();
        rest < NEGLIGIBLE * arrival.amplitude
    }

    #[inline]
    fn shape_at(&self, summand: &Summand, t_us: f64) -> Complex64 {
        self.shape(summand).at(t_us - summand.tof_us + self.receiver.lead_us)
    }

    /// The modulus of its shape.
    #[inline]
    fn modulus_at(&self, summand: &Summand, t_us: f64) -> f64 {
        if summand.shape.is_none() && self.receiver.shape.is_real() {
            let at_us = t_us - summand.tof_us + self.receiver.lead_us;
            return self.receiver.shape.real_at(at_us).abs();
        }
        modulus(self.shape_at(summand, t_us))
    }

    fn shape<'p>(&'p self, summand: &'p Summand) -> &'p EchoShape {
        summand.shape.as_deref().unwrap_or(&self.receiver.shape)
    }

    /// The growth by the gain while an echo sounds; the other half is in the fields.
    fn rise_of_gain(&self, t_us: f64) -> f64 {
        if self.exponent == 0.0 { 1.0 } else { t_us.max(1.0).powf(self.exponent) }
    }

    fn lasting(&self) -> (usize, usize) {
        (self.over, self.begun)
    }

    /// The most that what lasts can add up to.
    fn bounds(&mut self) -> Bounds {
        if self.bounds.of != self.lasting() {
            let live = &self.summands[self.over..self.begun];
            self.bounds = Bounds {
                of: self.lasting(),
                strength: live.iter().map(|summand| summand.strength).sum(),
                steepest: live.iter().map(|summand| summand.steepest).sum(),
            };
        }
        self.bounds
    }

    fn next_entry_us(&self) -> Option<f64> {
        self.next_us.is_finite().then_some(self.next_us)
    }

    /// Finds out when the next arrival begins.
    fn expect(&mut self) {
        (self.next_tof_us, self.next_us) =
            match (self.summands.get(self.begun), self.arrivals.get(self.begun)) {
                (Some(summand), _) => (summand.tof_us, summand.lasts_us[0]),
                (None, Some(arrival)) => {
                    let tof_us = self.receiver.tof_us(arrival);
                    (tof_us, tof_us + self.span_us.0)
                }
                (None, None) => (self.horizon_us, self.horizon_us),
            };
    }

    /// Lets arrivals enter and leave up to a time.
    #[inline]
    fn advance(&mut self, t_us: f64) {
        self.enter(t_us, t_us);
        if self.receiver.combining != Combining::Ideal {
            while self.over < self.begun && self.summands[self.over].lasts_us[1] < t_us {
                self.over += 1;
            }
        }
    }

    /// Lets arrivals enter that begin up to a time; what is over by `now_us` only keeps its place.
    #[inline]
    fn enter(&mut self, t_us: f64, now_us: f64) {
        self.asked_us = self.asked_us.max(t_us);
        // Invariant: `next_us` is when the first one begins that has not entered.
        while self.next_us <= t_us && self.begun < self.arrivals.len() {
            self.enter_next(now_us);
        }
    }

    fn enter_next(&mut self, now_us: f64) {
        if self.begun == self.summands.len() {
            let (arrival, tof_us) = (&self.arrivals[self.begun], self.next_tof_us);
            let lasts_us = [self.next_us, tof_us + self.span_us.1];
            let summand = match lasts_us[1] < now_us {
                true => Summand::gone(tof_us, lasts_us),
                false => self.summand_of(arrival, tof_us, lasts_us),
            };
            self.summands.push(summand);
        }
        self.begun += 1;
        self.expect();
    }

    fn summand_of(&self, arrival: &PulseArrival, tof_us: f64, lasts_us: [f64; 2]) -> Summand {
        let receiver = self.receiver;
        let at_face = receiver.response.as_ref().and_then(|response| {
            let Incident { strength, incidence } = (self.incident)(arrival)?;
            Some((strength, response.echo(&incidence)))
        });
        let (strength, shape) = match at_face {
            Some((strength, Some(shape))) => (strength, Some(Box::new(shape))),
            Some((_, None)) => (0.0, None),
            None => (arrival.amplitude, None),
        };
        let size = strength / self.rise_of_gain(tof_us);
        let phase_rad = arrival.phase_rad - receiver.omega * tof_us;
        // Nothing that sounds when it begins, or later, was over before the time that was last asked about.
        let others = self.summands[self.over..].iter().map(|summand| summand.strength).sum();
        Summand::new((tof_us, lasts_us), (size, phase_rad), shape, &receiver.shape, others)
    }
}

/// Without the care that [`Complex64::norm`] takes of numbers beyond 1e150, which costs as much as
/// all the rest of a sum.
fn modulus(number: Complex64) -> f64 {
    number.norm_sqr().sqrt()
}

/// Nothing below it is noticed after blanking, at any time: the threshold in force rises with the range within a
/// step of the gain, so it is least at the start of one. What it gains by its own rise is left out.
fn least_threshold(receiver: &Receiver) -> f64 {
    // As `Receiver::threshold_at` reckons.
    let least_us = 1e-3 / receiver.range_m(1.0);
    let (mut from_us, mut least) = (receiver.blanking_us, f64::INFINITY);
    for &(until_us, sensitivity) in &receiver.sensitivity.steps {
        if from_us < until_us {
            least = least.min(from_us.max(least_us) * sensitivity);
            from_us = until_us;
        }
    }
    if least.is_finite() {
        receiver.threshold * receiver.range_m(least)
    } else {
        receiver.threshold
    }
}
