//! What one reading says about the space before the ranger.

use crate::interpret::Extents;
use sonard_model::acoustics::BeamPattern;

/// A model of one reading: which directions off its axis, and which distances, it speaks for.
#[derive(Debug, Clone)]
pub enum BeamModel {
    /// Gaussian in direction and in distance.
    Gaussian(GaussianBeam),
    /// From the ranger's beam pattern and threshold.
    Physical(Box<PhysicalBeam>),
}

/// A 2-D Gaussian sonar model: what is nearer than the reading is free, what is there is
/// occupied, both less so off the axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GaussianBeam {
    /// Full width of the beam, degrees; its edge is at two standard deviations.
    pub beam_deg: f64,
    /// Standard deviation of a range, metres.
    pub range_sigma_m: f64,
    /// Logarithm of the odds of a cell before the reading on the axis, less than 0.
    pub free: f64,
    /// Logarithm of the odds of a cell at the reading on the axis, greater than 0.
    pub occupied: f64,
    /// Range that silence stands for, metres.
    pub max_range_m: f64,
}

impl GaussianBeam {
    /// For a beam of this width that listens so far.
    #[must_use]
    pub const fn new(beam_deg: f64, max_range_m: f64) -> Self {
        Self { beam_deg, range_sigma_m: 0.03, free: -0.6, occupied: 1.2, max_range_m }
    }
}

/// What would the ranger have said if this cell were a wall?
///
/// A wall through a cell nearer than the reading would have been heard if the foot of its
/// perpendicular lay where the beam hears planes; of all the directions that it may have, that
/// is a share of twice the half extent over half a turn. At the reading one of the cells
/// on the arc sent the echo, each the more likely the better the beam hears in its direction.
#[derive(Debug, Clone)]
pub struct PhysicalBeam {
    extents: Extents,
    beam: BeamPattern,
    /// Share of cells that are wall before anything is known.
    pub prior: f64,
    /// Probability that a wall reaches to the foot of its perpendicular.
    pub reaches: f64,
    /// Standard deviation of a range, metres.
    pub range_sigma_m: f64,
    /// Range that silence stands for, metres.
    pub max_range_m: f64,
}

impl PhysicalBeam {
    /// For a sensor's extents and beam pattern, listening so far.
    #[must_use]
    pub fn new(extents: Extents, max_range_m: f64) -> Self {
        let beam = extents.beam().clone();
        Self { extents, beam, prior: 0.1, reaches: 0.8, range_sigma_m: 0.02, max_range_m }
    }

    fn half_heard_rad(&self, range_m: f64) -> f64 {
        (self.extents.plane_corner_deg(range_m, 1.0) / 2.0).to_radians()
    }
}

/// What a reading says, as products of a direction's and a distance's share.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Said {
    /// Logarithm of the odds of what is nearer, on the axis.
    pub(super) free: f64,
    /// Logarithm of the odds of what is at the reading, on the axis.
    pub(super) occupied: f64,
    /// Standard deviation of the range, metres.
    pub(super) range_sigma_m: f64,
    /// Half the width of directions it speaks for, radians.
    pub(super) half_rad: f64,
}

impl BeamModel {
    /// Range that silence stands for, metres.
    #[must_use]
    pub const fn max_range_m(&self) -> f64 {
        match self {
            Self::Gaussian(beam) => beam.max_range_m,
            Self::Physical(beam) => beam.max_range_m,
        }
    }

    /// Full width of the directions that a reading speaks for, degrees.
    #[must_use]
    pub fn width_deg(&self) -> f64 {
        match self {
            Self::Gaussian(beam) => beam.beam_deg,
            Self::Physical(beam) => {
                2.0 * beam.half_heard_rad(beam.extents.min_range_m).to_degrees()
            }
        }
    }

    /// What a reading at a range says, in cells of this size.
    pub(super) fn say(&self, range_m: f64, cell_m: f64) -> Said {
        match self {
            Self::Gaussian(beam) => Said {
                free: beam.free,
                occupied: beam.occupied,
                range_sigma_m: beam.range_sigma_m,
                half_rad: (beam.beam_deg / 2.0).to_radians(),
            },
            Self::Physical(beam) => {
                let half_rad = beam.half_heard_rad(range_m);
                let heard = (2.0 * half_rad / std::f64::consts::PI * beam.reaches).min(0.99);
                // Half the arc's cells, for the beam hears so much less at its edge.
                let arc_cells = (half_rad * range_m / cell_m).max(1.0);
                let thick = (2.0 * beam.range_sigma_m / cell_m).max(1.0);
                let here = beam.prior + (1.0 - beam.prior) / (arc_cells * thick);
                let logit = |p: f64| (p / (1.0 - p)).ln();
                Said {
                    free: (1.0 - heard).ln(),
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
