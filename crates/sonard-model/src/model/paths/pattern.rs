//! Bounds by the beam pattern: the most that can be received of an echo, by angle.

use std::f64::consts::PI;

use crate::{acoustics::BeamPattern, geometry::wrap_pi};

/// Steps of the envelope, half a degree.
const ENVELOPE_STEPS: usize = 360;

/// Upper envelope of a beam pattern: for each angle from the axis the most that the pattern reaches there or
/// farther out. Falls with the angle, whatever the side lobes do.
#[derive(Debug)]
pub(crate) struct PatternEnvelope(Vec<f64>);

impl PatternEnvelope {
    pub(crate) fn of(beam: &BeamPattern) -> Self {
        // Ten samples a step: a tenth of a lobe's width even at twenty wavelengths across.
        let sample = |i: usize| beam.one_way(PI * i as f64 / (10 * ENVELOPE_STEPS) as f64);
        let mut strongest: f64 = 0.0;
        let mut steps: Vec<f64> = (0..ENVELOPE_STEPS)
            .rev()
            .map(|step| {
                let here = (10 * step..=10 * step + 10).map(sample).fold(0.0, f64::max);
                strongest = strongest.max(here);
                strongest
            })
            .collect();
        steps.reverse();
        Self(steps)
    }

    /// The strongest of an echo with both ends so far off the axis or farther, radians.
    pub(crate) fn beyond(&self, ends_rad: &[f64; 2]) -> f64 {
        let step = |end: f64| (wrap_pi(end).abs() / PI * ENVELOPE_STEPS as f64) as usize;
        ends_rad.iter().map(|&end| self.0[step(end).min(ENVELOPE_STEPS - 1)]).product()
    }

    /// The angle beyond which the pattern stays below `level`, rounded up to a step, radians.
    pub(crate) fn reach_rad(&self, level: f64) -> f64 {
        // A thousandth more than sampled, for what lies between the samples.
        let steps = self.0.partition_point(|strongest| 1.001 * strongest >= level);
        PI * steps as f64 / ENVELOPE_STEPS as f64
    }
}

/// The most that is received of an echo that leaves and arrives in directions some angle apart,
/// whatever the azimuth: the most of `p(a) p(b)` over `|a| + |b| = ` that angle, or more, of a pattern `p`.
#[derive(Debug)]
pub(crate) struct TwoWayBound {
    /// By that angle in steps of the envelope.
    steps: Vec<f64>,
    /// The least that it gives: an echo may also be needed as a part of one that the transducer's face
    /// reflects.
    least: f64,
}

impl TwoWayBound {
    pub(crate) fn of(envelope: &PatternEnvelope, least: f64) -> Self {
        let one_way = &envelope.0;
        // Off the axis by so many steps on one side, and by the rest (rounded down) on the other.
        let best = |apart: usize| {
            let halves = (0..=apart).map(|one| one_way[one] * one_way[(apart - one).max(1) - 1]);
            halves.fold(0.0, f64::max)
        };
        // Each factor a thousandth more than sampled, for what lies between the samples.
        Self { steps: (0..ENVELOPE_STEPS).map(|apart| 1.002 * best(apart)).collect(), least }
    }

    /// For directions `apart_rad` apart, from 0 to pi.
    pub(crate) fn at(&self, apart_rad: f64) -> f64 {
        let step = (apart_rad / PI * ENVELOPE_STEPS as f64) as usize;
        self.steps[step.min(ENVELOPE_STEPS - 1)].max(self.least)
    }
}
