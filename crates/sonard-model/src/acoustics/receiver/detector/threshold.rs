//! Effective threshold during a firing.

use std::cell::Cell;

use super::super::{characteristics::Receiver, gain::GainInterval};

/// Effective threshold as a function of time, with a factor, for queries of increasing time.
pub(super) struct EffectiveThreshold<'a> {
    pub(super) receiver: &'a Receiver,
    /// Factor applied to the receiver's threshold.
    pub(super) factor: f64,
    /// Gain step of the last query.
    step: Cell<GainInterval>,
    /// Minimum over the detection window, for factor 1.
    minimum: f64,
}

impl<'a> EffectiveThreshold<'a> {
    pub(super) fn new(receiver: &'a Receiver) -> Self {
        let step = Cell::new(receiver.sensitivity.step_at(0.0));
        Self { receiver, factor: 1.0, step, minimum: minimum(receiver) }
    }

    /// Threshold at a time after firing, microseconds.
    pub(super) fn at(&self, t_us: f64) -> f64 {
        let Receiver { sensitivity, threshold, .. } = self.receiver;
        if !self.step.get().holds(t_us) {
            self.step.set(sensitivity.step_at(t_us));
        }
        let range_m = self.receiver.range_m(t_us);
        self.factor * sensitivity.in_step(&self.step.get(), *threshold, range_m)
    }

    /// Lower bound after blanking.
    pub(super) fn minimum(&self) -> f64 {
        self.factor * self.minimum
    }

    /// Returns `true` if the last query's gain step neither begins nor ends between two times.
    pub(super) fn holds_all(&self, from_us: f64, to_us: f64) -> bool {
        self.step.get().holds_all(from_us, to_us)
    }
}

/// Lower bound of the effective threshold after blanking. Within a gain step the threshold rises
/// with range, so the minimum is at the start of a step. `threshold_rise_db_per_m` is neglected,
/// which keeps the bound valid.
fn minimum(receiver: &Receiver) -> f64 {
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
