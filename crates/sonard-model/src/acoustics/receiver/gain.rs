//! Detection threshold as a function of time after firing.

use smallvec::SmallVec;

use crate::acoustics::{Gain, GainStep, Sensor};

/// Time dependence of the threshold.
#[derive(Debug, Clone)]
pub(super) struct Sensitivity {
    /// End of each gain step, microseconds, and reciprocal of its gain; empty for gain that
    /// compensates spreading.
    pub(super) steps: SmallVec<[(f64, f64); 12]>,
    rise_db_per_m: f64,
}

impl Sensitivity {
    pub(super) fn for_sensor(sensor: &Sensor) -> Self {
        let rise_db_per_m = sensor.threshold_rise_db_per_m;
        let Gain::Steps { steps } = &sensor.gain else {
            return Self { steps: SmallVec::new(), rise_db_per_m };
        };
        let end_us = |step: &GainStep| step.until_us.unwrap_or(f64::INFINITY);
        let reciprocal = |step: &GainStep| 10f64.powf(-step.gain_db / 20.0);
        let steps = steps.iter().map(|step| (end_us(step), reciprocal(step))).collect();
        Self { steps, rise_db_per_m }
    }

    /// Effective threshold at a time after firing and the range of that time.
    #[inline]
    pub(super) fn threshold(&self, nominal: f64, t_us: f64, range_m: f64) -> f64 {
        self.in_step(&self.step_at(t_us), nominal, range_m)
    }

    /// Effective threshold within a step of the gain.
    #[inline]
    pub(super) fn in_step(&self, step: &GainInterval, nominal: f64, range_m: f64) -> f64 {
        let reciprocal = step.reciprocal;
        let threshold = reciprocal.map_or(nominal, |by| nominal * range_m.max(1e-3) * by);
        if self.rise_db_per_m == 0.0 {
            return threshold;
        }
        threshold * 10f64.powf(self.rise_db_per_m * range_m / 20.0)
    }

    /// Gain step at a time after firing.
    pub(super) fn step_at(&self, t_us: f64) -> GainInterval {
        let mut from_us = f64::NEG_INFINITY;
        for &(until_us, reciprocal) in &self.steps {
            if t_us < until_us {
                return GainInterval { from_us, until_us, reciprocal: Some(reciprocal) };
            }
            from_us = from_us.max(until_us);
        }
        // The last step has no end.
        let reciprocal = self.steps.last().map(|step| step.1);
        GainInterval { from_us, until_us: f64::INFINITY, reciprocal }
    }
}

/// A step of the gain.
#[derive(Debug, Clone, Copy)]
pub(super) struct GainInterval {
    from_us: f64,
    until_us: f64,
    /// Reciprocal of the gain; `None` for gain that compensates spreading.
    reciprocal: Option<f64>,
}

impl GainInterval {
    #[inline]
    pub(super) fn holds(&self, t_us: f64) -> bool {
        self.from_us <= t_us && t_us < self.until_us
    }

    /// Returns `true` if the step neither begins nor ends between two times.
    #[inline]
    pub(super) fn holds_all(&self, from_us: f64, to_us: f64) -> bool {
        self.from_us < from_us && to_us <= self.until_us
    }
}

/// Gain at a time after firing, decibels re the gain that compensates the spreading from a wall at
/// 1 m.
pub(super) fn gain_db(gain: &Gain, t_us: f64, range_m: f64) -> f64 {
    match gain {
        Gain::Compensating { .. } => 20.0 * range_m.max(1e-3).log10(),
        Gain::Steps { steps } => steps
            .iter()
            .find(|step| step.until_us.is_none_or(|until_us| t_us < until_us))
            .or(steps.last())
            .map_or(0.0, |step| step.gain_db),
    }
}
