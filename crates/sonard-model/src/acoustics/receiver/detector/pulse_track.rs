//! Pulses of a firing in the order of their arrival, of which those in progress are summed.
//!
//! Time runs forward: pulses are admitted when they begin and dropped when they end.

use num_complex::Complex64;

use super::{
    firing::Firing,
    pulse::{ActivePulse, PulseSize},
    sum::modulus,
};
use crate::acoustics::{EchoShape, Gain, receiver::characteristics::Incident};

/// Arrivals of a firing as pulses, with the set of those in progress.
pub(super) struct PulseTrack<'a> {
    pub(super) firing: Firing<'a>,
    /// Earliest time at which arrivals that are not known may begin.
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
    /// Time before which no pulse begins and none of those in progress ends.
    unchanged_until_us: f64,
    /// Upper bounds for the active pulses.
    bounds: ActiveBounds,
    /// Exponent of the gain's rise with time.
    exponent: f64,
    /// Start and end of an arrival relative to its nominal time, microseconds.
    pub(super) span_us: (f64, f64),
}

/// Upper bounds for the sum of the active pulses.
#[derive(Clone, Copy, Default)]
pub(super) struct ActiveBounds {
    /// [`PulseTrack::active_range`] that the bounds belong to.
    range: (usize, usize),
    pub(super) strength: f64,
    /// Slope of the envelope, per microsecond.
    pub(super) steepest: f64,
}

impl<'a> PulseTrack<'a> {
    pub(super) fn new(firing: Firing<'a>) -> Self {
        let receiver = firing.receiver;
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
        let mut track = Self {
            firing,
            horizon_us: receiver.arrives_us(firing.known_m) + span_us.0,
            examined_us: 0.0,
            pulses: Vec::with_capacity(firing.arrivals.len()),
            begun: 0,
            over: 0,
            summed: 0,
            next_us: f64::INFINITY,
            next_tof_us: f64::INFINITY,
            unchanged_until_us: f64::NEG_INFINITY,
            bounds: ActiveBounds::default(),
            exponent,
            span_us,
        };
        track.peek_next();
        track
    }

    /// Returns `true` if all pulses have the real shape of the transmitted one, and the gain is
    /// constant within a pulse.
    pub(super) fn is_uniform(&self) -> bool {
        let receiver = self.firing.receiver;
        receiver.response.is_none() && receiver.shape.is_real() && self.exponent == 0.0
    }

    /// Returns `true` if arrivals beyond the known length could have changed a result so far.
    pub(super) fn exceeds_horizon(&self) -> bool {
        self.examined_us >= self.horizon_us
    }

    /// Maximum round-trip length, metres, of arrivals that can influence the results so far; `None`
    /// if unknown ones could.
    pub(super) fn needed_m(&self) -> Option<f64> {
        let needed_us = self.examined_us - self.span_us.0;
        let needed_m = needed_us * 1e-6 * self.firing.receiver.sound_speed_m_s;
        (!self.exceeds_horizon()).then_some(needed_m)
    }

    /// Records that a result depends on the arrivals up to a time.
    pub(super) const fn examine(&mut self, t_us: f64) {
        self.examined_us = self.examined_us.max(t_us);
    }

    /// Rewinds to a time after firing and discards the state of later times.
    pub(super) fn rewind_to(&mut self, t_us: f64) {
        self.over = self.pulses.partition_point(|pulse| pulse.lasts_us[1] < t_us);
        // Pulses that had ended when first examined were not evaluated.
        let known =
            self.pulses[self.over..].iter().take_while(|pulse| !pulse.is_placeholder()).count();
        self.pulses.truncate(self.over + known);
        self.begun = self.pulses.partition_point(|pulse| pulse.lasts_us[0] <= t_us).max(self.over);
        (self.summed, self.bounds) = (0, ActiveBounds::default());
        self.unchanged_until_us = f64::NEG_INFINITY;
        self.peek_next();
    }

    /// Pulses in progress.
    #[inline]
    pub(super) fn active(&self) -> &[ActivePulse] {
        &self.pulses[self.over..self.begun]
    }

    /// Range of the indices of the pulses in progress.
    pub(super) const fn active_range(&self) -> (usize, usize) {
        (self.over, self.begun)
    }

    /// Pulses in progress, and those that ended last: a time a little in the past needs them.
    #[inline]
    pub(super) fn recently_active(&self) -> &[ActivePulse] {
        &self.pulses[self.over.saturating_sub(8)..self.begun]
    }

    /// Pulses that have ended.
    pub(super) fn ended(&self) -> &[ActivePulse] {
        &self.pulses[..self.over]
    }

    pub(super) fn pulse(&self, index: usize) -> &ActivePulse {
        &self.pulses[index]
    }

    /// Number of arrivals that have begun.
    pub(super) const fn begun(&self) -> usize {
        self.begun
    }

    /// Upper bounds for the sum of the active pulses.
    pub(super) fn bounds(&mut self) -> ActiveBounds {
        if self.bounds.range != self.active_range() {
            let active = self.active();
            self.bounds = ActiveBounds {
                range: self.active_range(),
                strength: active.iter().map(|pulse| pulse.strength).sum(),
                steepest: active.iter().map(|pulse| pulse.steepest).sum(),
            };
        }
        self.bounds
    }

    /// Start of the next arrival, or of unknown ones, microseconds.
    pub(super) fn next_start_us(&self) -> Option<f64> {
        self.next_us.is_finite().then_some(self.next_us)
    }

    /// Admits and drops arrivals up to a time.
    #[inline]
    pub(super) fn advance(&mut self, t_us: f64) {
        if t_us < self.unchanged_until_us {
            self.examine(t_us);
        } else {
            self.change_active(t_us);
        }
    }

    /// Admits and drops arrivals up to a time at which some may begin or end.
    fn change_active(&mut self, t_us: f64) {
        self.admit(t_us, t_us);
        while self.over < self.begun && self.pulses[self.over].lasts_us[1] < t_us {
            self.over += 1;
        }
        let first_end_us = self.active().first().map_or(f64::INFINITY, |pulse| pulse.lasts_us[1]);
        self.unchanged_until_us = self.next_us.min(first_end_us);
    }

    /// Admits the arrivals that begin up to a time; those that end before `now_us` become
    /// placeholders.
    #[inline]
    pub(super) fn admit(&mut self, t_us: f64, now_us: f64) {
        self.examine(t_us);
        // Invariant: `next_us` is the start of the first arrival that is not admitted.
        while self.next_us <= t_us && self.begun < self.firing.arrivals.len() {
            self.admit_next(now_us);
        }
    }

    /// Advances to a time and computes the fields of the pulses in progress.
    #[inline]
    pub(super) fn compute_fields(&mut self, t_us: f64) {
        self.advance(t_us);
        if self.summed < self.begun {
            for pulse in &mut self.pulses[self.summed.max(self.over)..self.begun] {
                pulse.compute_field();
            }
            self.summed = self.begun;
        }
    }

    /// Complex shape of a pulse at a time.
    #[inline]
    pub(super) fn shape_at(&self, pulse: &ActivePulse, t_us: f64) -> Complex64 {
        self.shape(pulse).at(t_us - pulse.tof_us + self.firing.receiver.lead_us)
    }

    /// Modulus of the pulse shape.
    #[inline]
    pub(super) fn modulus_at(&self, pulse: &ActivePulse, t_us: f64) -> f64 {
        let receiver = self.firing.receiver;
        if pulse.shape.is_none() && receiver.shape.is_real() {
            return receiver.shape.real_at(t_us - pulse.tof_us + receiver.lead_us).abs();
        }
        modulus(self.shape_at(pulse, t_us))
    }

    /// Shape of a pulse.
    pub(super) fn shape<'p>(&'p self, pulse: &'p ActivePulse) -> &'p EchoShape {
        pulse.shape.as_deref().unwrap_or(&self.firing.receiver.shape)
    }

    /// Gain increase since firing; its value at the arrival's nominal time is divided out of
    /// the pulse's size.
    pub(super) fn gain_increase(&self, t_us: f64) -> f64 {
        if self.exponent == 0.0 { 1.0 } else { t_us.max(1.0).powf(self.exponent) }
    }

    /// Calls `visit` with the index of each pulse in progress and its own level at a time.
    pub(super) fn visit_levels(&self, t_us: f64, visit: &mut dyn FnMut(usize, f64)) {
        let gain = self.gain_increase(t_us);
        for (index, pulse) in (self.over..).zip(self.active()) {
            visit(index, pulse.size * self.modulus_at(pulse, t_us) * gain);
        }
    }

    /// Updates the start of the next arrival.
    fn peek_next(&mut self) {
        (self.next_tof_us, self.next_us) =
            match (self.pulses.get(self.begun), self.firing.arrivals.get(self.begun)) {
                (Some(pulse), _) => (pulse.tof_us, pulse.lasts_us[0]),
                (None, Some(arrival)) => {
                    let tof_us = self.firing.receiver.tof_us(arrival);
                    (tof_us, tof_us + self.span_us.0)
                }
                (None, None) => (self.horizon_us, self.horizon_us),
            };
    }

    fn admit_next(&mut self, now_us: f64) {
        if self.begun == self.pulses.len() {
            let tof_us = self.next_tof_us;
            let lasts_us = [self.next_us, tof_us + self.span_us.1];
            let pulse = match lasts_us[1] < now_us {
                true => ActivePulse::placeholder(tof_us, lasts_us),
                false => self.new_pulse(tof_us, lasts_us),
            };
            self.pulses.push(pulse);
        }
        self.begun += 1;
        self.peek_next();
    }

    fn new_pulse(&self, tof_us: f64, lasts_us: [f64; 2]) -> ActivePulse {
        let (receiver, arrival) = (self.firing.receiver, &self.firing.arrivals[self.begun]);
        let at_face = receiver.response.as_ref().and_then(|response| {
            let Incident { strength, incidence } = (self.firing.incident)(arrival)?;
            Some((strength, response.echo(&incidence)))
        });
        let (strength, shape) = match at_face {
            Some((strength, Some(shape))) => (strength, Some(Box::new(shape))),
            Some((_, None)) => (0.0, None),
            None => (arrival.amplitude, None),
        };
        let size = PulseSize {
            size: strength / self.gain_increase(tof_us),
            phase_rad: arrival.phase_rad - receiver.omega * tof_us,
        };
        // Pulses that overlap the new one had not ended at the last time examined.
        let others = self.pulses[self.over..].iter().map(|pulse| pulse.strength).sum();
        ActivePulse::new((tof_us, lasts_us), size, shape, &receiver.shape, others)
    }
}
