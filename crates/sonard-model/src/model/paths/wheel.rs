//! Echoes sorted by the direction in which they are heard.

use std::f64::consts::{PI, TAU};

use super::Echo;
use crate::{acoustics::BeamPattern, geometry::wrap_pi};

/// Steps of the envelope, half a degree.
const ENVELOPE_STEPS: usize = 360;

/// For each angle from the axis the strongest that a beam pattern still gets beyond it.
#[derive(Debug)]
pub(super) struct Envelope(Vec<f64>);

impl Envelope {
    pub(super) fn of(beam: &BeamPattern) -> Self {
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
    pub(super) fn beyond(&self, ends_rad: &[f64; 2]) -> f64 {
        let step = |end: f64| (wrap_pi(end).abs() / PI * ENVELOPE_STEPS as f64) as usize;
        ends_rad.iter().map(|&end| self.0[step(end).min(ENVELOPE_STEPS - 1)]).product()
    }

    /// The angle beyond which the pattern stays below `level`, rounded up to a step, radians.
    pub(super) fn reach_rad(&self, level: f64) -> f64 {
        // A thousandth more than sampled, for what lies between the samples.
        let steps = self.0.partition_point(|strongest| 1.001 * strongest >= level);
        PI * steps as f64 / ENVELOPE_STEPS as f64
    }
}

/// How strongly an echo can be heard at best that leaves and comes in directions some angle apart,
/// whatever the azimuth.
#[derive(Debug)]
pub(super) struct Both {
    /// By that angle in steps of the envelope.
    steps: Vec<f64>,
    /// Counts at least as much where it matters otherwise: where the face can turn it round.
    least: f64,
}

impl Both {
    pub(super) fn of(envelope: &Envelope, least: f64) -> Self {
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
    pub(super) fn heard(&self, apart_rad: f64) -> f64 {
        let step = (apart_rad / PI * ENVELOPE_STEPS as f64) as usize;
        self.steps[step.min(ENVELOPE_STEPS - 1)].max(self.least)
    }
}

/// Directions are sorted into this many bins.
const BINS: usize = 360;

/// Echoes by the direction in which they are heard best.
#[derive(Debug, Default)]
pub(super) struct Wheel {
    /// Bin by bin.
    spokes: Vec<Spoke>,
    /// Where each bin begins in `spokes`, and the end of the last.
    bins: Vec<u32>,
    /// The widest reach of its spokes.
    reach_rad: f64,
}

/// What an azimuth needs to know of an echo.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spoke {
    /// Half way between departure and arrival.
    pub(super) middle_rad: f64,
    /// Departure is this far on one side of the middle, arrival on the other.
    pub(super) half_rad: f64,
    pub(super) amplitude: f64,
    /// Farther off the middle it is too weak.
    pub(super) reach_rad: f64,
    pub(super) echo: u32,
}

impl Spoke {
    /// `None` if it is too weak in all directions.
    ///
    /// `y` off the middle, the axis is `|y| + h` off one end and at least `||y| - h|` off the
    /// other. The pattern's product reaches a level only if its smaller factor does, and its
    /// larger one reaches the root of it.
    pub(super) fn of(echo: &Echo, index: u32, envelope: &Envelope, floor: f64) -> Option<Self> {
        let half_rad = 0.5 * echo.departure.angle_to(echo.arrival);
        let level = floor / echo.amplitude;
        let wide = envelope.reach_rad(level) - half_rad.abs();
        if wide < 0.0 {
            return None;
        }
        let reach_rad = wide.min(envelope.reach_rad(level.sqrt()) + half_rad.abs());
        let middle_rad = wrap_pi(echo.departure.to_angle() + half_rad);
        Some(Self { middle_rad, half_rad, amplitude: echo.amplitude, reach_rad, echo: index })
    }
}

impl Wheel {
    pub(super) fn new(spokes: &[Spoke]) -> Self {
        let mut bins = vec![0_u32; BINS + 1];
        for spoke in spokes {
            bins[bin(spoke.middle_rad) + 1] += 1;
        }
        for i in 0..BINS {
            bins[i + 1] += bins[i];
        }
        let mut next = bins.clone();
        let mut sorted = spokes.to_vec();
        for spoke in spokes {
            let place = &mut next[bin(spoke.middle_rad)];
            sorted[*place as usize] = *spoke;
            *place += 1;
        }
        let reach_rad = spokes.iter().map(|spoke| spoke.reach_rad).fold(0.0, f64::max);
        Self { spokes: sorted, bins, reach_rad }
    }

    /// Tells the spokes within their reach of a direction in (-pi, pi], and how far off each is.
    pub(super) fn near<'a>(&'a self, direction_rad: f64, mut tell: impl FnMut(&'a Spoke, f64)) {
        if self.spokes.is_empty() {
            return;
        }
        let mut part = |from: i64, to: i64| {
            let at = |bin: i64| self.bins[bin.clamp(0, BINS as i64) as usize] as usize;
            for spoke in &self.spokes[at(from)..at(to).max(at(from))] {
                let off_rad = wrap_once(direction_rad - spoke.middle_rad);
                if off_rad.abs() <= spoke.reach_rad {
                    tell(spoke, off_rad);
                }
            }
        };
        let bins = BINS as i64;
        let middle = bin(direction_rad) as i64;
        let reach = (self.reach_rad / TAU * BINS as f64).ceil() as i64;
        if 2 * reach + 1 >= bins {
            return part(0, bins);
        }
        let (from, to) = (middle - reach, middle + reach + 1);
        part(from, to);
        // What leaves the circle on one side comes in on the other.
        part(from + bins, bins);
        part(0, to - bins);
    }
}

/// The bin of an angle in (-pi, pi].
fn bin(angle_rad: f64) -> usize {
    (((angle_rad + PI) / TAU * BINS as f64) as usize).min(BINS - 1)
}

/// The difference of two angles in (-pi, pi], brought into that range.
pub(super) fn wrap_once(angle_rad: f64) -> f64 {
    if angle_rad > PI {
        angle_rad - TAU
    } else if angle_rad < -PI {
        angle_rad + TAU
    } else {
        angle_rad
    }
}
