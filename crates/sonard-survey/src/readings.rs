//! Readings of a sweep at the world's speed of sound, in order of azimuth.

use sonard_inverse::{FiringOutcome, FitSweep, World};
use sonard_model::geometry::{DVec2, Pose, wrap_360};

use crate::options::SurveyOptions;

/// Outcome of a beam, as measured or predicted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Outcome {
    /// Range of the first echo, metres.
    Echo(f64),
    /// No echo within the maximum range.
    NoEcho,
    /// Target below the minimum range.
    BelowMinRange,
}

/// Beam of a sweep.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Beam {
    /// Azimuth, degrees in [0, 360).
    pub(crate) azimuth_deg: f64,
    /// Position of the transducer in the frame of the pose, metres; zero on the axis.
    pub(crate) face: DVec2,
    pub(crate) outcome: Outcome,
}

/// Beams of a sweep in order of azimuth.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Readings {
    /// Pose by odometry.
    pub(crate) odometry: Pose,
    pub(crate) beams: Vec<Beam>,
    /// Median angle between neighbouring beams, degrees.
    pub(crate) step_deg: f64,
    /// Number of neighbouring beams whose errors are correlated because they share an arc.
    pub(crate) beams_per_arc: f64,
    /// Maximum range, metres: that of the model, less the largest distance of a transducer from the
    /// pose, so that the model follows all paths up to it.
    pub(crate) max_range_m: f64,
    /// Minimum number of beams of an arc.
    pub(crate) min_arc_beams: usize,
}

impl Readings {
    /// Readings of a sweep, with the positions of the transducers of an array in the order of its
    /// beams; an echo beyond the maximum range of the model counts as none.
    pub(crate) fn new(
        (sweep, faces): (&FitSweep, Option<&[DVec2]>),
        world: &World,
        max_range_m: f64,
        options: &SurveyOptions,
    ) -> Self {
        /// Maximum number of beams that count as one.
        const MAX_PER_ARC: f64 = 8.0;
        let faces_m = faces.unwrap_or_default().iter().map(|face| face.length());
        let max_range_m = max_range_m - faces_m.fold(0.0, f64::max);
        let sound_speed_m_s = world.air.sound_speed_m_s();
        let outcome = |outcome: FiringOutcome| match (outcome, outcome.range_m(sound_speed_m_s)) {
            (_, Some(range_m)) if range_m - world.delay_m <= max_range_m => {
                Outcome::Echo(range_m - world.delay_m)
            }
            (FiringOutcome::BelowMinRange, _) => Outcome::BelowMinRange,
            _ => Outcome::NoEcho,
        };
        let mut beams: Vec<Beam> = sweep
            .beams
            .iter()
            .enumerate()
            .map(|(at, beam)| Beam {
                face: faces.map_or(DVec2::ZERO, |faces| faces[at]),
                azimuth_deg: wrap_360(world.heading_zero_deg + world.gear * beam.azimuth_deg),
                outcome: outcome(beam.outcome),
            })
            .collect();
        beams.sort_by(|a, b| a.azimuth_deg.total_cmp(&b.azimuth_deg));
        let mut gaps: Vec<f64> =
            beams.windows(2).map(|pair| pair[1].azimuth_deg - pair[0].azimuth_deg).collect();
        gaps.retain(|gap| *gap > 1e-9);
        gaps.sort_by(f64::total_cmp);
        let step_deg = gaps.get(gaps.len() / 2).copied().unwrap_or(360.0);
        // Three beams of a fine sweep, one of a coarse one.
        let by_step = (5.4 / step_deg).ceil().clamp(1.0, 3.0) as usize;
        Self {
            odometry: sweep.pose,
            beams,
            step_deg,
            max_range_m,
            beams_per_arc: (options.arc_deg / step_deg).clamp(1.0, MAX_PER_ARC),
            min_arc_beams: options.min_arc_beams.unwrap_or(by_step),
        }
    }

    /// Angle from a beam to the following one, degrees; the first follows the last.
    pub(crate) fn gap_after_deg(&self, at: usize) -> f64 {
        let next = &self.beams[(at + 1) % self.beams.len()];
        let gap = wrap_360(next.azimuth_deg - self.beams[at].azimuth_deg);
        if self.beams.len() == 1 { 360.0 } else { gap }
    }
}
