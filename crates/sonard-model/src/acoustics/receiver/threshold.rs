//! The least that is noticed at a time after firing.

use smallvec::SmallVec;

use super::Receiver;
use crate::acoustics::{Gain, GainStep};

impl Receiver {
    /// The least amplitude noticed at a time after firing, microseconds.
    #[must_use]
    pub fn threshold_at(&self, t_us: f64) -> f64 {
        let step = self.sensitivity.iter().find(|step| t_us < step.0).or(self.sensitivity.last());
        let threshold = step
            .map_or(self.threshold, |step| self.threshold * self.range_m(t_us).max(1e-3) * step.1);
        if self.threshold_rise_db_per_m == 0.0 {
            return threshold;
        }
        threshold * 10f64.powf(self.threshold_rise_db_per_m * self.range_m(t_us) / 20.0)
    }

    /// Gain at a time after firing, decibels above what makes up for the spreading from a wall
    /// at 1 m.
    #[must_use]
    pub fn gain_db(&self, t_us: f64) -> f64 {
        match &self.gain {
            Gain::Compensating { .. } => 20.0 * self.range_m(t_us).max(1e-3).log10(),
            Gain::Steps { steps } => steps
                .iter()
                .find(|step| step.until_us.is_none_or(|until_us| t_us < until_us))
                .or(steps.last())
                .map_or(0.0, |step| step.gain_db),
        }
    }
}

/// The ends of the gain's steps, microseconds, and the reciprocals of their gains.
pub(super) fn sensitivity(gain: &Gain) -> SmallVec<[(f64, f64); 12]> {
    let Gain::Steps { steps } = gain else { return SmallVec::new() };
    let end_us = |step: &GainStep| step.until_us.unwrap_or(f64::INFINITY);
    steps.iter().map(|step| (end_us(step), 10f64.powf(-step.gain_db / 20.0))).collect()
}
