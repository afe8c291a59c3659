//! Bounds by the beam pattern: maximum amplitude of an echo, by angle.

use std::{f64::consts::PI, sync::OnceLock};

use crate::{
    acoustics::{BeamPattern, Disc},
    geometry::wrap_pi,
};

/// Number of steps of the envelope, of half a degree.
const ENVELOPE_STEPS: usize = 360;

/// Ratio of the weakest multiple echo by the transducer's face to the weakest echo of the search,
/// which is 20 dB below the threshold: only multiple echoes that can be detected are listed. There
/// are a great many weaker ones.
pub(crate) const MULTIPLE_FLOOR_RATIO: f64 = 10.0;

/// Beam pattern of a ranger with its bounds, which are the same in every scene.
#[derive(Debug)]
pub(crate) struct BoundedPattern {
    pub(crate) beam: BeamPattern,
    pub(crate) envelope: PatternEnvelope,
    /// Smallest loss of a path that the face reflects into another.
    reflected: f64,
    /// Computed for the first scene with cylinders.
    two_way: OnceLock<TwoWayBound>,
}

impl BoundedPattern {
    /// Computes the bounds of a pattern for a transducer with a reflecting face, or none.
    pub(crate) fn new(beam: BeamPattern, face: Option<Disc>) -> Self {
        let reflected = face.map_or(0.0, |face| 2.0 * face.face.reflectance / MULTIPLE_FLOOR_RATIO);
        let envelope = PatternEnvelope::new(&beam);
        Self { beam, envelope, reflected, two_way: OnceLock::new() }
    }

    /// Returns the bound over all azimuths.
    pub(crate) fn two_way(&self) -> &TwoWayBound {
        self.two_way.get_or_init(|| TwoWayBound::new(&self.envelope, self.reflected))
    }
}

/// Upper envelope of a beam pattern: for each angle from the axis the maximum of the pattern there
/// or farther out. Decreases monotonically despite side lobes.
#[derive(Debug)]
pub(crate) struct PatternEnvelope(Vec<f64>);

impl PatternEnvelope {
    pub(crate) fn new(beam: &BeamPattern) -> Self {
        // Ten samples per step: a tenth of a lobe's width even at twenty wavelengths across.
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

    /// Upper bound for an echo with both ends at least this far off the axis, radians.
    pub(crate) fn beyond(&self, ends_rad: &[f64; 2]) -> f64 {
        let step = |end: f64| (wrap_pi(end).abs() / PI * ENVELOPE_STEPS as f64) as usize;
        ends_rad.iter().map(|&end| self.0[step(end).min(ENVELOPE_STEPS - 1)]).product()
    }

    /// Angle beyond which the pattern stays below `level`, rounded up to a step, radians.
    pub(crate) fn reach_rad(&self, level: f64) -> f64 {
        // A margin of a thousandth, for values between the samples.
        let steps = self.0.partition_point(|strongest| 1.001 * strongest >= level);
        PI * steps as f64 / ENVELOPE_STEPS as f64
    }
}

/// Maximum over all azimuths of an echo that leaves and arrives in directions some angle apart: the
/// maximum of `p(a) p(b)` over `|a| + |b|` of at least that angle, for a pattern `p`.
#[derive(Debug)]
pub(crate) struct TwoWayBound {
    /// Bounds by that angle in steps of the envelope.
    steps: Vec<f64>,
    /// Lower limit of the bound: an echo may also be needed as a part of a multiple echo by the
    /// transducer's face.
    minimum: f64,
}

impl TwoWayBound {
    pub(crate) fn new(envelope: &PatternEnvelope, minimum: f64) -> Self {
        let one_way = &envelope.0;
        // Off the axis by this many steps on one side, and by the rest (rounded down) on the other.
        let best = |apart: usize| {
            let halves =
                (0..=apart).map(|first| one_way[first] * one_way[(apart - first).max(1) - 1]);
            halves.fold(0.0, f64::max)
        };
        // A margin of a thousandth in each factor, for values between the samples.
        Self { steps: (0..ENVELOPE_STEPS).map(|apart| 1.002 * best(apart)).collect(), minimum }
    }

    /// Returns the bound for directions `apart_rad` apart, from 0 to pi.
    pub(crate) fn at(&self, apart_rad: f64) -> f64 {
        let step = (apart_rad / PI * ENVELOPE_STEPS as f64) as usize;
        self.steps[step.min(ENVELOPE_STEPS - 1)].max(self.minimum)
    }
}
