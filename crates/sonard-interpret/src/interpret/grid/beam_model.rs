//! Inverse sensor models: evidence of one reading about the space before the ranger.

use crate::interpret::Extents;
use sonard_model::acoustics::BeamPattern;

/// Inverse sensor model of a reading.
#[derive(Debug, Clone)]
pub enum BeamModel {
    /// Gaussian in direction and distance.
    Gaussian(GaussianBeam),
    /// Derived from the ranger's beam pattern and threshold.
    Physical(Box<PhysicalBeam>),
}

/// 2-D Gaussian sonar model: space before the reading is free, the reading itself is occupied,
/// both weighted by the angle off the axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GaussianBeam {
    /// Full width of the beam, degrees; its edge is at two standard deviations.
    pub beam_deg: f64,
    /// Standard deviation of a range, metres.
    pub range_sigma_m: f64,
    /// Log-odds of a cell before the reading on the axis, less than 0.
    pub free: f64,
    /// Log-odds of a cell at the reading on the axis, greater than 0.
    pub occupied: f64,
    /// Assumed range of a beam without echo, metres.
    pub max_range_m: f64,
}

impl GaussianBeam {
    /// Model of a beam of the given width and maximum range.
    #[must_use]
    pub const fn new(beam_deg: f64, max_range_m: f64) -> Self {
        Self { beam_deg, range_sigma_m: 0.03, free: -0.6, occupied: 1.2, max_range_m }
    }
}

/// Inverse sensor model from the beam pattern: the likelihood of the reading if a cell were wall.
///
/// A wall through a cell nearer than the reading would have been detected if the foot of its
/// perpendicular lay within the extent of a plane; over all orientations that is a fraction of
/// twice the half extent over half a turn. At the reading one of the cells on the arc produced the
/// echo, with a probability that follows the beam pattern.
#[derive(Debug, Clone)]
pub struct PhysicalBeam {
    extents: Extents,
    beam: BeamPattern,
    /// Prior probability of a cell being wall.
    pub prior: f64,
    /// Probability that a wall extends to the foot of its perpendicular.
    pub reaches: f64,
    /// Standard deviation of a range, metres.
    pub range_sigma_m: f64,
    /// Assumed range of a beam without echo, metres.
    pub max_range_m: f64,
}

impl PhysicalBeam {
    /// Model of a sensor's extents and beam pattern with the given maximum range.
    #[must_use]
    pub fn new(extents: Extents, max_range_m: f64) -> Self {
        let beam = extents.beam().clone();
        Self { extents, beam, prior: 0.1, reaches: 0.8, range_sigma_m: 0.02, max_range_m }
    }

    fn half_extent_rad(&self, range_m: f64) -> f64 {
        (self.extents.plane_corner_deg(range_m, 1.0) / 2.0).to_radians()
    }
}

/// Log-odds of a reading, as products of a factor of direction and one of distance.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct LogOddsProfile {
    /// Log-odds of nearer space, on the axis.
    pub(super) free: f64,
    /// Log-odds at the reading, on the axis.
    pub(super) occupied: f64,
    /// Standard deviation of the range, metres.
    pub(super) range_sigma_m: f64,
    /// Half width of the affected directions, radians.
    pub(super) half_rad: f64,
}

impl BeamModel {
    /// Assumed range of a beam without echo, metres.
    #[must_use]
    pub const fn max_range_m(&self) -> f64 {
        match self {
            Self::Gaussian(beam) => beam.max_range_m,
            Self::Physical(beam) => beam.max_range_m,
        }
    }

    /// Full width of the directions affected by a reading, degrees.
    #[must_use]
    pub fn width_deg(&self) -> f64 {
        match self {
            Self::Gaussian(beam) => beam.beam_deg,
            Self::Physical(beam) => {
                2.0 * beam.half_extent_rad(beam.extents.min_range_m).to_degrees()
            }
        }
    }

    /// Log-odds profile of a reading at a range, for cells of the given size.
    pub(super) fn profile(&self, range_m: f64, cell_m: f64) -> LogOddsProfile {
        match self {
            Self::Gaussian(beam) => LogOddsProfile {
                free: beam.free,
                occupied: beam.occupied,
                range_sigma_m: beam.range_sigma_m,
                half_rad: (beam.beam_deg / 2.0).to_radians(),
            },
            Self::Physical(beam) => {
                let half_rad = beam.half_extent_rad(range_m);
                let detected = (2.0 * half_rad / std::f64::consts::PI * beam.reaches).min(0.99);
                // Half the cells of the arc, because sensitivity drops towards the edge of the
                // beam.
                let arc_cells = (half_rad * range_m / cell_m).max(1.0);
                let thick = (2.0 * beam.range_sigma_m / cell_m).max(1.0);
                let here = beam.prior + (1.0 - beam.prior) / (arc_cells * thick);
                let logit = |p: f64| (p / (1.0 - p)).ln();
                LogOddsProfile {
                    free: (1.0 - detected).ln(),
                    occupied: logit(here.min(0.99)) - logit(beam.prior),
                    range_sigma_m: beam.range_sigma_m,
                    half_rad,
                }
            }
        }
    }

    /// Weights of free and of occupied space at an angle off the axis.
    pub(super) fn off_axis(&self, off_rad: f64, half_rad: f64) -> [f64; 2] {
        match self {
            Self::Gaussian(_) => [(-2.0 * (off_rad / half_rad).powi(2)).exp(); 2],
            Self::Physical(beam) => {
                let level = beam.beam.one_way(off_rad).powi(2);
                [1.0, level]
            }
        }
    }
}
