//! Envelope of a firing's summed arrivals and its threshold crossings.
//!
//! Time runs forward: arrivals are admitted when they begin and dropped when they end, and only
//! those in between are summed. Nothing is summed while the total strength is below the threshold.
//! The rise of an isolated arrival is looked up in the pulse table.

mod ideal;
mod level;
mod pulse;
mod rise;

use std::cell::Cell;

use num_complex::Complex64;

use self::pulse::ActivePulse;
use super::{Combining, Incident, PulseArrival, Receiver, gain::GainInterval, noise::NoiseTrack};
use crate::acoustics::{EchoShape, Gain};

/// Maximum relative amplitude of neighbouring arrivals that are neglected.
const NEGLIGIBLE: f64 = 3e-3;

/// About one cycle of the carrier, microseconds.
const CYCLE_US: f64 = 20.0;

/// Tolerance for an echo at exactly the maximum range.
const WINDOW_SLACK_US: f64 = 1e-6;

pub(super) struct EnvelopeSum<'a> {
    receiver: &'a Receiver,
    pub(super) arrivals: &'a [PulseArrival],
    incident: &'a dyn Fn(&PulseArrival) -> Option<Incident>,
    noise: Option<&'a NoiseTrack>,
    /// Earliest time at which arrivals missing from `arrivals` may begin.
    horizon_us: f64,
    /// Latest time examined so far.
    examined_us: f64,
    /// Pulses of the first arrivals, up to the latest time examined; kept across a rewind.
    pulses: Vec<ActivePulse>,
    /// Number of pulses that have begun, and number of those that have ended.
    begun: usize,
    over: usize,
    /// Number of begun pulses whose fields are up to date.
    summed: usize,
    /// Start of the next arrival, or the horizon; infinite if there is neither.
    next_us: f64,
    /// Nominal time of flight of the next arrival.
    next_tof_us: f64,
    /// Value of [`Self::active_range`] for which step-by-step evaluation was last found necessary.
    watched: Option<(usize, usize)>,
    /// Upper bounds for the active pulses, keyed by [`Self::active_range`].
    bounds: ActiveBounds,
    /// Source of the last rise, if it was an isolated pulse with the carrier's phase and the
    /// detector uses the envelope.
    isolated: Option<IsolatedPulse>,
    /// Gain step of the last query.
    step: Cell<GainInterval>,
    /// All arrivals have the shape and phase of the transmitted pulse, the gain is constant within
    /// a pulse, and there is no noise.
    is_plain: bool,
    /// Exponent of the gain's rise with time.
    exponent: f64,
    /// Factor applied to the receiver's threshold.
    pub(super) threshold_factor: f64,
    min_threshold: f64,
    /// Start and end of an arrival relative to its nominal time.
    span_us: (f64, f64),
}

/// Isolated arrival that crossed the threshold: no other arrival overlaps it.
#[derive(Clone, Copy)]
struct IsolatedPulse {
    place: usize,
    /// Threshold factor and start of the search that found the rise.
    factor: f64,
    from_us: f64,
}

/// Upper bounds for the sum of the active pulses.
#[derive(Clone, Copy, Default)]
struct ActiveBounds {
    /// Active range that the bounds belong to.
    range: (usize, usize),
    strength: f64,
    /// Slope of the envelope, per microsecond.
    steepest: f64,
}

impl<'a> EnvelopeSum<'a> {
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
        let mut envelope = Self {
            receiver,
            arrivals,
            incident,
            noise: None,
            horizon_us: f64::INFINITY,
            examined_us: 0.0,
            pulses: Vec::with_capacity(arrivals.len()),
            begun: 0,
            over: 0,
            summed: 0,
            next_us: f64::INFINITY,
            next_tof_us: f64::INFINITY,
            watched: None,
            bounds: ActiveBounds::default(),
            isolated: None,
            step: Cell::new(receiver.sensitivity.step_at(0.0)),
            is_plain,
            exponent,
            threshold_factor: 1.0,
            min_threshold: min_threshold(receiver),
            span_us,
        };
        envelope.peek_next();
        envelope
    }

    pub(super) fn in_noise(mut self, noise: &'a NoiseTrack) -> Self {
        (self.noise, self.is_plain) = (Some(noise), false);
        self
    }

    /// Restricts the known arrivals to a round-trip length, metres.
    pub(super) fn limit_known_length(&mut self, length_m: f64) {
        let arrives_us = self.receiver.arrives_us(length_m);
        self.horizon_us = match self.receiver.combining {
            Combining::Coherent | Combining::Incoherent => arrives_us + self.span_us.0,
            Combining::Ideal => arrives_us,
        };
        self.peek_next();
    }

    /// Returns `true` if unknown arrivals beyond the horizon could have changed a result so far.
    pub(super) fn exceeds_horizon(&self) -> bool {
        self.examined_us >= self.horizon_us
    }

    /// Maximum round-trip length, metres, of arrivals that can influence the results so far.
    pub(super) fn needed_m(&self) -> f64 {
        let begins_us = match self.receiver.combining {
            Combining::Coherent | Combining::Incoherent => self.span_us.0,
            Combining::Ideal => 0.0,
        };
        (self.examined_us - begins_us) * 1e-6 * self.receiver.sound_speed_m_s
    }

    /// Rewinds to the firing.
    pub(super) fn rewind(&mut self) {
        self.rewind_to(0.0);
    }

    /// Rewinds to a time after firing and discards the state of later times.
    pub(super) fn rewind_to(&mut self, t_us: f64) {
        self.over = self.pulses.partition_point(|pulse| pulse.lasts_us[1] < t_us);
        // Pulses that had ended when first examined were not evaluated.
        let known =
            self.pulses[self.over..].iter().take_while(|pulse| !pulse.is_placeholder()).count();
        self.pulses.truncate(self.over + known);
        self.begun = self.pulses.partition_point(|pulse| pulse.lasts_us[0] <= t_us).max(self.over);
        (self.summed, self.watched, self.bounds) = (0, None, ActiveBounds::default());
        self.peek_next();
    }

    /// Effective threshold at a time after firing.
    pub(super) fn threshold_at(&self, t_us: f64) -> f64 {
        let Receiver { sensitivity, threshold, .. } = self.receiver;
        if !self.step.get().holds(t_us) {
            self.step.set(sensitivity.step_at(t_us));
        }
        let range_m = self.receiver.range_m(t_us);
        self.threshold_factor * sensitivity.in_step(&self.step.get(), *threshold, range_m)
    }

    /// Next rise of ECHO for a detector that is ready from `ready_us` on. The rise is immediate if
    /// the envelope is already above the threshold and stays there for the integration time.
    pub(super) fn next_rise(&mut self, ready_us: f64) -> Option<f64> {
        match self.receiver.combining {
            Combining::Coherent | Combining::Incoherent => self.next_rise_of_sum(ready_us),
            Combining::Ideal => self.next_rise_separate(ready_us),
        }
    }

    /// Arrival with the largest contribution one carrier cycle after a time.
    pub(super) fn cause(&mut self, t_us: f64) -> Option<PulseArrival> {
        if self.receiver.combining == Combining::Ideal {
            return self.cause_separate(t_us);
        }
        let t_us = t_us + CYCLE_US;
        self.advance(t_us);
        let size = |pulse: &ActivePulse| pulse.size * self.modulus_at(pulse, t_us);
        let (place, _) = self.pulses[self.over..self.begun]
            .iter()
            .enumerate()
            .map(|(place, pulse)| (place, size(pulse)))
            .filter(|(_, size)| *size > 0.0)
            .max_by(|a, b| a.1.total_cmp(&b.1))?;
        self.arrivals.get(self.over + place).copied()
    }

    /// Peak of the envelope during an arrival that begins at `t_us`.
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

    /// Indices of the active arrivals.
    pub(super) fn active_indices(&self) -> std::ops::Range<usize> {
        self.over..self.begun
    }

    /// Contribution of an arrival to the envelope.
    pub(super) fn share(&self, place: usize, t_us: f64) -> f64 {
        self.pulses.get(place).map_or(0.0, |pulse| {
            pulse.size * self.modulus_at(pulse, t_us) * self.gain_increase(t_us)
        })
    }

    /// Returns `true` if no other arrival overlaps `arrival`, whose strength is its amplitude.
    fn is_alone(&mut self, t_us: f64, arrival: Option<&PulseArrival>) -> bool {
        let Some(arrival) = arrival else { return false };
        if self.noise.is_some() || self.receiver.response.is_some() {
            return false;
        }
        self.admit(t_us + self.span_us.1, t_us);
        let first_us = t_us - self.span_us.1 + self.span_us.0;
        let others = self.arrivals[..self.begun]
            .iter()
            .rev()
            .take_while(|other| self.receiver.tof_us(other) > first_us);
        let rest: f64 = others.filter(|other| *other != arrival).map(|other| other.amplitude).sum();
        rest < NEGLIGIBLE * arrival.amplitude
    }

    #[inline]
    fn shape_at(&self, pulse: &ActivePulse, t_us: f64) -> Complex64 {
        self.shape(pulse).at(t_us - pulse.tof_us + self.receiver.lead_us)
    }

    /// Modulus of the pulse shape.
    #[inline]
    fn modulus_at(&self, pulse: &ActivePulse, t_us: f64) -> f64 {
        if pulse.shape.is_none() && self.receiver.shape.is_real() {
            let at_us = t_us - pulse.tof_us + self.receiver.lead_us;
            return self.receiver.shape.real_at(at_us).abs();
        }
        modulus(self.shape_at(pulse, t_us))
    }

    fn shape<'p>(&'p self, pulse: &'p ActivePulse) -> &'p EchoShape {
        pulse.shape.as_deref().unwrap_or(&self.receiver.shape)
    }

    /// Gain increase since firing; its value at the arrival's nominal time is divided out of
    /// `size`.
    fn gain_increase(&self, t_us: f64) -> f64 {
        if self.exponent == 0.0 { 1.0 } else { t_us.max(1.0).powf(self.exponent) }
    }

    fn active_range(&self) -> (usize, usize) {
        (self.over, self.begun)
    }

    /// Upper bounds for the sum of the active pulses.
    fn bounds(&mut self) -> ActiveBounds {
        if self.bounds.range != self.active_range() {
            let live = &self.pulses[self.over..self.begun];
            self.bounds = ActiveBounds {
                range: self.active_range(),
                strength: live.iter().map(|pulse| pulse.strength).sum(),
                steepest: live.iter().map(|pulse| pulse.steepest).sum(),
            };
        }
        self.bounds
    }

    fn next_start_us(&self) -> Option<f64> {
        self.next_us.is_finite().then_some(self.next_us)
    }

    /// Updates the start of the next arrival.
    fn peek_next(&mut self) {
        (self.next_tof_us, self.next_us) =
            match (self.pulses.get(self.begun), self.arrivals.get(self.begun)) {
                (Some(pulse), _) => (pulse.tof_us, pulse.lasts_us[0]),
                (None, Some(arrival)) => {
                    let tof_us = self.receiver.tof_us(arrival);
                    (tof_us, tof_us + self.span_us.0)
                }
                (None, None) => (self.horizon_us, self.horizon_us),
            };
    }

    /// Admits and drops arrivals up to a time.
    #[inline]
    fn advance(&mut self, t_us: f64) {
        self.admit(t_us, t_us);
        if self.receiver.combining != Combining::Ideal {
            while self.over < self.begun && self.pulses[self.over].lasts_us[1] < t_us {
                self.over += 1;
            }
        }
    }

    /// Admits the arrivals that begin up to a time; those that end before `now_us` become
    /// placeholders.
    #[inline]
    fn admit(&mut self, t_us: f64, now_us: f64) {
        self.examined_us = self.examined_us.max(t_us);
        // Invariant: `next_us` is the start of the first arrival that is not admitted.
        while self.next_us <= t_us && self.begun < self.arrivals.len() {
            self.admit_next(now_us);
        }
    }

    fn admit_next(&mut self, now_us: f64) {
        if self.begun == self.pulses.len() {
            let (arrival, tof_us) = (&self.arrivals[self.begun], self.next_tof_us);
            let lasts_us = [self.next_us, tof_us + self.span_us.1];
            let pulse = match lasts_us[1] < now_us {
                true => ActivePulse::placeholder(tof_us, lasts_us),
                false => self.new_pulse(arrival, tof_us, lasts_us),
            };
            self.pulses.push(pulse);
        }
        self.begun += 1;
        self.peek_next();
    }

    fn new_pulse(&self, arrival: &PulseArrival, tof_us: f64, lasts_us: [f64; 2]) -> ActivePulse {
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
        let size = strength / self.gain_increase(tof_us);
        let phase_rad = arrival.phase_rad - receiver.omega * tof_us;
        // Pulses that overlap the new one had not ended at the last time examined.
        let others = self.pulses[self.over..].iter().map(|pulse| pulse.strength).sum();
        ActivePulse::new((tof_us, lasts_us), (size, phase_rad), shape, &receiver.shape, others)
    }
}

/// Modulus without the overflow protection of [`Complex64::norm`], which costs as much as the rest
/// of the summation.
fn modulus(number: Complex64) -> f64 {
    number.norm_sqr().sqrt()
}

/// Lower bound of the effective threshold after blanking. Within a gain step the threshold rises
/// with range, so the minimum is at the start of a step. `threshold_rise_db_per_m` is neglected,
/// which keeps the bound valid.
fn min_threshold(receiver: &Receiver) -> f64 {
    // Same range clamp as in `Receiver::threshold_at`.
    let min_us = 1e-3 / receiver.range_m(1.0);
    let (mut from_us, mut minimum) = (receiver.blanking_us, f64::INFINITY);
    for &(until_us, sensitivity) in &receiver.sensitivity.steps {
        if from_us < until_us {
            minimum = minimum.min(from_us.max(min_us) * sensitivity);
            from_us = until_us;
        }
    }
    if minimum.is_finite() {
        receiver.threshold * receiver.range_m(minimum)
    } else {
        receiver.threshold
    }
}
