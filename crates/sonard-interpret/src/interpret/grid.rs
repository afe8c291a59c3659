//! Occupancy grids.
//!
//! A grid holds for each cell the logarithm of the odds that it is occupied, 0 where nothing is
//! known (H. P. Moravec and A. Elfes, "High resolution maps from wide angle sonar", ICRA 1985).
//! A set of readings is added as one: its beams fill a table by direction and distance from the
//! ranger, and each cell in reach takes its entry.

mod beam_model;
mod ideal;
mod image;
mod polar;
mod rows;
mod score;
mod tiles;
mod trace;

#[cfg(test)]
mod tests;

pub use beam_model::{BeamModel, GaussianBeam, PhysicalBeam};
pub use ideal::ideal;
pub use image::{ImageError, MapMode, MapYaml, from_pgm, from_pixels, to_pgm};
pub use score::{MapScore, PathSettings, ScoreError, score};
pub(super) use tiles::Tiles;
pub use trace::{TraceSettings, WallLine, trace};

use thiserror::Error;

use super::{Sweep, prediction::Assessment};
use sonard_model::geometry::DVec2;

/// Most cells of a grid: 256 MB.
const MOST_CELLS: u64 = 1 << 26;

/// Odds don't leave 1 : 1000 to 1000 : 1, so that a cell can still change its mind.
const MOST_LOG_ODDS: f32 = 6.9;

/// Position and resolution of a grid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GridShape {
    /// World place of the lower left corner, metres.
    pub origin: DVec2,
    /// Side of a cell, metres.
    pub resolution_m: f64,
    /// Cells in x.
    pub width: usize,
    /// Cells in y.
    pub height: usize,
}

/// A grid that cannot be made.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum GridError {
    /// Cells without size.
    #[error("a resolution of {0} m makes no grid: it must be a finite length greater than 0")]
    Resolution(f64),
    /// Nothing to cover.
    #[error("the region from ({}, {}) to ({}, {}) m has no area", low[0], low[1], high[0], high[1])]
    Empty {
        /// Lower left corner, metres.
        low: [f64; 2],
        /// Upper right corner, metres.
        high: [f64; 2],
    },
    /// More than memory should be spent on.
    #[error(
        "{} cells are too many (at most {MOST_CELLS}): choose a coarser resolution or a smaller \
         region", in_words(*cells)
    )]
    TooLarge {
        /// How many it would have; infinite where a number does not hold them.
        cells: f64,
    },
}

/// A number of cells; nobody reads one of twenty digits.
fn in_words(cells: f64) -> String {
    if cells < 1e12 { format!("{cells:.0}") } else { "more than 10^12".into() }
}

impl GridShape {
    /// The grid of this resolution over a region.
    ///
    /// # Errors
    /// When the region or the resolution is not finite and positive, or cells are too many.
    pub fn covering(low: DVec2, high: DVec2, resolution_m: f64) -> Result<Self, GridError> {
        if !(resolution_m.is_finite() && resolution_m > 0.0) {
            return Err(GridError::Resolution(resolution_m));
        }
        let size = (high - low) / resolution_m;
        if !(high - low).is_finite() || (high - low).min_element() <= 0.0 {
            return Err(GridError::Empty { low: low.into(), high: high.into() });
        }
        // A region that is a whole number of cells must not get one more by rounding.
        let count = |cells: f64| (cells - 1e-6).ceil().max(1.0);
        let cells = count(size.x) * count(size.y);
        if cells > MOST_CELLS as f64 {
            return Err(GridError::TooLarge { cells });
        }
        let (width, height) = (count(size.x) as usize, count(size.y) as usize);
        Ok(Self { origin: low, resolution_m, width, height })
    }

    /// How many cells it has.
    #[must_use]
    pub const fn cells(&self) -> usize {
        self.width * self.height
    }

    /// Middle of a cell, world, metres.
    #[must_use]
    pub fn center(&self, column: usize, row: usize) -> DVec2 {
        self.origin + self.resolution_m * DVec2::new(column as f64 + 0.5, row as f64 + 0.5)
    }

    /// The lower left corner in cells from the world's origin: whole ones, and what is left of one.
    fn corner_in_cells(&self) -> (DVec2, DVec2) {
        /// What rounding leaves.
        const NOTHING: f64 = 1e-6;
        let corner = self.origin / self.resolution_m;
        let whole = corner.round();
        let rest = corner - whole;
        (whole, DVec2::select(rest.abs().cmplt(DVec2::splat(NOTHING)), DVec2::ZERO, rest))
    }

    /// Index of the cell that holds a point.
    #[must_use]
    pub fn index_at(&self, point: DVec2) -> Option<usize> {
        let place = (point - self.origin) / self.resolution_m;
        let inside = place.min_element() >= 0.0
            && place.x < self.width as f64
            && place.y < self.height as f64;
        inside.then(|| place.y as usize * self.width + place.x as usize)
    }
}

/// A map: for each cell how likely it is occupied.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    shape: GridShape,
    /// Row by row from the lower left corner.
    log_odds: Vec<f32>,
}

/// How readings of little confidence are used (step 7 of Feature Prediction).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trust {
    /// Readings below this confidence are left out.
    pub least_confidence: f64,
    /// Whether what lies before the feature that contradicts a reading is taken at full weight.
    pub keep_clear: bool,
}

impl Default for Trust {
    fn default() -> Self {
        Self { least_confidence: 0.0, keep_clear: true }
    }
}

/// A set of readings, and how far they are believed.
#[derive(Clone, Copy)]
pub(super) struct Told<'a> {
    pub(super) sweep: &'a Sweep,
    /// Of its beams; without them all are believed.
    pub(super) assessments: Option<&'a [Assessment]>,
    pub(super) model: &'a BeamModel,
    pub(super) trust: &'a Trust,
}

impl<'a> Told<'a> {
    /// What the readings say around each place that they were taken at, one after the other. Rangers of an array hear
    /// from where they are: a table for each place.
    fn tables(self, cell_m: f64) -> impl Iterator<Item = (DVec2, polar::Table)> + 'a {
        let mut mounts: Vec<DVec2> = Vec::new();
        for beam in &self.sweep.beams {
            if !mounts.contains(&beam.mount) {
                mounts.push(beam.mount);
            }
        }
        let pose = self.sweep.pose;
        let turn = DVec2::from_angle(pose.direction_rad(0.0));
        mounts.into_iter().map(move |mount| {
            let from = pose.position() + turn.rotate(mount);
            (from, polar::Table::of(self, mount, cell_m))
        })
    }
}

impl Grid {
    /// A map in which nothing is known.
    #[must_use]
    pub fn new(shape: GridShape) -> Self {
        Self { shape, log_odds: vec![0.0; shape.cells()] }
    }

    /// A map of given probabilities, row by row from the lower left; too few are followed by
    /// unknown cells.
    #[must_use]
    pub fn of_probabilities(shape: GridShape, probabilities: &[f64]) -> Self {
        let log_odds = |p: &f64| {
            let p = p.clamp(1e-9, 1.0 - 1e-9);
            ((p / (1.0 - p)).ln() as f32).clamp(-MOST_LOG_ODDS, MOST_LOG_ODDS)
        };
        let mut grid = Self::new(shape);
        for (cell, p) in grid.log_odds.iter_mut().zip(probabilities) {
            *cell = log_odds(p);
        }
        grid
    }

    /// Where it lies and how fine it is.
    #[must_use]
    pub const fn shape(&self) -> &GridShape {
        &self.shape
    }

    /// Probability that a cell is occupied, by its index; 0.5 where nothing is known.
    #[must_use]
    pub fn probability(&self, index: usize) -> f64 {
        1.0 / (1.0 + f64::from(-self.log_odds[index]).exp())
    }

    /// Probabilities of all cells, row by row from the lower left.
    pub fn probabilities(&self) -> impl Iterator<Item = f64> {
        (0..self.log_odds.len()).map(|index| self.probability(index))
    }

    /// Adds a set of readings; `assessments` are theirs, without which all are believed. Returns how
    /// many readings were left out for want of confidence.
    pub fn add(
        &mut self,
        sweep: &Sweep,
        assessments: Option<&[Assessment]>,
        model: &BeamModel,
        trust: &Trust,
    ) -> usize {
        let told = Told { sweep, assessments, model, trust };
        let tables = told.tables(self.shape.resolution_m);
        tables.fold(0, |left_out, (from, table)| {
            table.add_to(&self.shape, from, &mut self.log_odds);
            left_out + table.left_out
        })
    }
}
