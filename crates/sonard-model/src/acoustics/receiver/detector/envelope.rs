//! Detector that compares the envelope of the summed pulses with the threshold.
//!
//! Nothing is summed while the total strength is below the threshold. The rise of an isolated
//! arrival is looked up in the pulse table.

use std::marker::PhantomData;

use num_complex::Complex64;

use super::{
    firing::{EchoDetector, Firing, WINDOW_SLACK_US},
    pulse::ActivePulse,
    pulse_track::PulseTrack,
    sum::Summation,
    threshold::EffectiveThreshold,
    timing::EchoTiming,
};
use crate::{acoustics::receiver::characteristics::PulseArrival, reading::PingStatus};

/// Maximum relative amplitude of neighbouring arrivals that are neglected.
const NEGLIGIBLE: f64 = 3e-3;

/// About one cycle of the carrier, microseconds.
const CYCLE_US: f64 = 20.0;

/// Threshold detector of the envelope with a rule for the sum of overlapping pulses.
pub(super) struct EnvelopeDetector<'a, S> {
    pub(super) track: PulseTrack<'a>,
    pub(super) threshold: EffectiveThreshold<'a>,
    timing: &'static dyn EchoTiming,
    /// Active range for which step-by-step evaluation was last found necessary.
    pub(super) watched: Option<(usize, usize)>,
    /// Source of the last rise, if it was an isolated pulse.
    isolated: Option<IsolatedPulse>,
    /// Start of the last rise that was searched without a limit of time.
    onset: Option<RiseOnset>,
    /// All arrivals have the shape and phase of the transmitted pulse, the gain is constant within
    /// a pulse, and there is no noise.
    pub(super) is_plain: bool,
    summation: PhantomData<S>,
}

/// Isolated arrival that crossed the threshold: no other arrival overlaps it.
#[derive(Clone, Copy)]
struct IsolatedPulse {
    index: usize,
    /// Threshold factor and start of the search that found the rise.
    factor: f64,
    from_us: f64,
}

/// Time at which the integration of a rise began.
#[derive(Clone, Copy)]
struct RiseOnset {
    /// Threshold factor and start of the search that found the rise.
    factor: f64,
    from_us: f64,
    /// Latest time at which nothing was integrated, microseconds. The time above a higher threshold
    /// is part of that above this one, so nothing is integrated then either.
    begins_us: f64,
}

impl<'a, S: Summation> EnvelopeDetector<'a, S> {
    pub(super) fn new(firing: Firing<'a>, timing: &'static dyn EchoTiming) -> Self {
        let track = PulseTrack::new(firing);
        Self {
            is_plain: track.is_uniform() && firing.noise.is_none(),
            track,
            threshold: EffectiveThreshold::new(firing.receiver),
            timing,
            watched: None,
            isolated: None,
            onset: None,
            summation: PhantomData,
        }
    }

    /// Returns `true` if ECHO follows the envelope, and pulses have the transmitted shape: the
    /// rise of an isolated pulse then follows from that shape at any threshold.
    pub(super) fn has_tabulated_rises(&self) -> bool {
        self.is_plain && self.timing.follows_envelope()
    }

    /// Latest time, at least `ready_us`, at which a search may start for the same result: an earlier
    /// search at a lower threshold integrated nothing until then.
    fn search_start_us(&self, ready_us: f64) -> f64 {
        let holds =
            |onset: &RiseOnset| onset.factor <= self.threshold.factor && onset.from_us <= ready_us;
        self.onset.filter(holds).map_or(ready_us, |onset| onset.begins_us.max(ready_us))
    }

    /// Envelope of some pulses at a time.
    #[inline]
    pub(super) fn sum(&self, pulses: &[ActivePulse], t_us: f64) -> f64 {
        let track = &self.track;
        if self.is_plain {
            // Fast path for most sensors.
            let receiver = track.firing.receiver;
            let fields = pulses.iter().map(|pulse| {
                pulse.field * receiver.shape.real_at(t_us - pulse.tof_us + receiver.lead_us)
            });
            return S::level(fields, 1.0, Complex64::ZERO);
        }
        let fields = pulses.iter().map(|pulse| pulse.field * track.shape_at(pulse, t_us));
        S::level(fields, track.gain_increase(t_us), track.firing.noise_at(t_us))
    }

    /// Returns `true` if no other arrival overlaps `arrival`, whose strength is its amplitude.
    fn is_alone(&mut self, t_us: f64, arrival: &PulseArrival) -> bool {
        let Firing { receiver, arrivals, noise, .. } = self.track.firing;
        if noise.is_some() || receiver.response.is_some() {
            return false;
        }
        let (before_us, after_us) = self.track.span_us;
        self.track.admit(t_us + after_us, t_us);
        let first_us = t_us - after_us + before_us;
        let others = arrivals[..self.track.begun()]
            .iter()
            .rev()
            .take_while(|other| receiver.tof_us(other) > first_us);
        let rest: f64 = others.filter(|other| *other != arrival).map(|other| other.amplitude).sum();
        rest < NEGLIGIBLE * arrival.amplitude
    }
}

impl<S: Summation> EchoDetector for EnvelopeDetector<'_, S> {
    /// The envelope exceeds the threshold for the integration time.
    fn next_rise(&mut self, ready_us: f64, until_us: f64) -> Option<f64> {
        self.isolated = None;
        let start_us = self.search_start_us(ready_us);
        let found = self.search_rise(start_us, until_us)?;
        self.isolated = found.isolated.map(|index| IsolatedPulse {
            index,
            factor: self.threshold.factor,
            from_us: ready_us,
        });
        if until_us == f64::INFINITY {
            let (factor, begins_us) = (self.threshold.factor, found.begins_us);
            self.onset = Some(RiseOnset { factor, from_us: ready_us, begins_us });
        }
        Some(found.rise_us)
    }

    fn delay_us(&mut self, rise_us: f64) -> f64 {
        let track = &mut self.track;
        let mut phase_rad = || {
            track.compute_fields(rise_us);
            let active = track.active().iter();
            let sum: Complex64 =
                active.map(|pulse| pulse.field * track.shape_at(pulse, rise_us)).sum();
            // Within a cycle the phase of the sum is that of its carrier.
            (sum * track.gain_increase(rise_us) + track.firing.noise_at(rise_us)).arg()
        };
        self.timing.delay_us(self.threshold.receiver, rise_us, &mut phase_rad)
    }

    /// Arrival with the largest contribution one carrier cycle after the rise.
    fn cause(&mut self, rise_us: f64) -> Option<PulseArrival> {
        self.track.advance(rise_us + CYCLE_US);
        let mut largest: Option<(usize, f64)> = None;
        self.track.visit_levels(rise_us + CYCLE_US, &mut |index, level| {
            if level > 0.0 && largest.is_none_or(|(_, known)| level.total_cmp(&known).is_ge()) {
                largest = Some((index, level));
            }
        });
        self.track.firing.arrivals.get(largest?.0).copied()
    }

    fn peak(&mut self, t_us: f64, arrival: Option<&PulseArrival>) -> f64 {
        const SAMPLES: u32 = 10;
        if let Some(arrival) = arrival
            && self.is_alone(t_us, arrival)
        {
            return arrival.amplitude;
        }
        let receiver = self.track.firing.receiver;
        let lasts_us =
            receiver.shape.first_us() + receiver.shape.last_us() - 2.0 * receiver.lead_us;
        (0..=SAMPLES)
            .map(|i| self.level(t_us + f64::from(i) / f64::from(SAMPLES) * lasts_us))
            .fold(0.0, f64::max)
    }

    fn level(&mut self, t_us: f64) -> f64 {
        self.track.compute_fields(t_us);
        self.sum(self.track.active(), t_us)
    }

    fn threshold_at(&self, t_us: f64) -> f64 {
        self.threshold.at(t_us)
    }

    fn set_threshold_factor(&mut self, factor: f64) {
        self.threshold.factor = factor;
    }

    fn rewind_to(&mut self, t_us: f64) {
        self.track.rewind_to(t_us);
        self.watched = None;
    }

    fn needed_m(&self) -> Option<f64> {
        self.track.needed_m()
    }

    fn visit_levels(&self, t_us: f64, visit: &mut dyn FnMut(usize, f64)) {
        self.track.visit_levels(t_us, visit);
    }

    fn next_isolated_rise(&mut self, from_us: f64) -> Option<(f64, PulseArrival)> {
        let IsolatedPulse { index, factor, from_us: search_from_us } = self.isolated?;
        if factor > self.threshold.factor || from_us < search_from_us {
            return None;
        }
        let Firing { receiver, arrivals, .. } = self.track.firing;
        let (rise_us, lasts) = self.isolated_rise(self.track.pulse(index), from_us)?;
        let is_in_window = rise_us <= receiver.window_us() + WINDOW_SLACK_US;
        if !lasts || !is_in_window || receiver.status_at(rise_us) != PingStatus::Echo {
            return None;
        }
        self.track.examine(rise_us + receiver.integration_us);
        Some((rise_us, arrivals[index]))
    }

    fn is_isolated(&self) -> bool {
        self.isolated.is_some()
    }
}
