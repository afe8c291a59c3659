//! Occupancy grids.
//!
//! A grid holds for each cell the logarithm of the odds that it is occupied, 0 where nothing is
//! known (H. P. Moravec and A. Elfes, "High resolution maps from wide angle sonar", ICRA 1985).
//! Readings are added per scan: the beams fill a table by direction and distance from the
//! ranger, and each cell within range receives its entry.

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
pub use trace::{TraceSettings, TracedLine, trace};

use thiserror::Error;

use super::{Sweep, prediction::Assessment};
use sonard_model::geometry::DVec2;

/// Maximum number of cells of a grid: 256 MB.
const MAX_CELLS: u64 = 1 << 26;

/// Clamp of the log-odds, 1 : 1000 to 1000 : 1, so that later evidence can still change a cell.
const MAX_LOG_ODDS: f32 = 6.9;

/// Position and resolution of a grid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GridShape {
    /// World position of the lower left corner, metres.
    pub origin: DVec2,
    /// Side of a cell, metres.
    pub resolution_m: f64,
    /// Number of columns.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
}

/// Invalid grid dimensions.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum GridError {
    /// Resolution that is not a positive length.
    #[error("invalid resolution of {0} m: it must be a finite length greater than 0")]
    Resolution(f64),
    /// Region without area.
    #[error("the region from ({}, {}) to ({}, {}) m has no area", low[0], low[1], high[0], high[1])]
    Empty {
        /// Lower left corner, metres.
        low: [f64; 2],
        /// Upper right corner, metres.
        high: [f64; 2],
    },
    /// Grid beyond the memory limit.
    #[error(
                "{} cells are too many (at most {MAX_CELLS}): choose a coarser resolution or a smaller \
                 region", format_count(*cells)
            )]
    TooLarge {
        /// Number of cells; infinite if not representable.
        cells: f64,
    },
}

/// Number of cells as text, bounded in length.
fn format_count(cells: f64) -> String {
    if cells < 1e12 { format!("{cells:.0}") } else { "more than 10^12".into() }
}

impl GridShape {
    /// Grid of the given resolution that covers a region.
    ///
    /// # Errors
    /// Region or resolution not finite and positive, or too many cells.
    pub fn covering(low: DVec2, high: DVec2, resolution_m: f64) -> Result<Self, GridError> {
        if !(resolution_m.is_finite() && resolution_m > 0.0) {
            return Err(GridError::Resolution(resolution_m));
        }
        let size = (high - low) / resolution_m;
        if !(high - low).is_finite() || (high - low).min_element() <= 0.0 {
            return Err(GridError::Empty { low: low.into(), high: high.into() });
        }
        // Rounding must not add a cell to a region of a whole number of cells.
        let count = |cells: f64| (cells - 1e-6).ceil().max(1.0);
        let cells = count(size.x) * count(size.y);
        if cells > MAX_CELLS as f64 {
            return Err(GridError::TooLarge { cells });
        }
        let (width, height) = (count(size.x) as usize, count(size.y) as usize);
        Ok(Self { origin: low, resolution_m, width, height })
    }

    /// Number of cells.
    #[must_use]
    pub const fn cells(&self) -> usize {
        self.width * self.height
    }

    /// World position of the middle of a cell, metres.
    #[must_use]
    pub fn center(&self, column: usize, row: usize) -> DVec2 {
        self.origin + self.resolution_m * DVec2::new(column as f64 + 0.5, row as f64 + 0.5)
    }

    /// Lower left corner in cells from the world's origin: whole cells, and the remaining fraction.
    fn corner_in_cells(&self) -> (DVec2, DVec2) {
        /// Fractions below this are rounding errors.
        const ROUNDING: f64 = 1e-6;
        let corner = self.origin / self.resolution_m;
        let whole = corner.round();
        let rest = corner - whole;
        (whole, DVec2::select(rest.abs().cmplt(DVec2::splat(ROUNDING)), DVec2::ZERO, rest))
    }

    /// Index of the cell that contains a point; `None` outside the grid.
    #[must_use]
    pub fn index_at(&self, point: DVec2) -> Option<usize> {
        let place = (point - self.origin) / self.resolution_m;
        let inside = place.min_element() >= 0.0
            && place.x < self.width as f64
            && place.y < self.height as f64;
        inside.then(|| place.y as usize * self.width + place.x as usize)
    }
}

/// Map of occupancy probabilities.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    shape: GridShape,
    /// Log-odds row by row from the lower left corner.
    log_odds: Vec<f32>,
}

/// Use of readings with low confidence (step 7 of Feature Prediction).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trust {
    /// Readings below this confidence are discarded.
    pub min_confidence: f64,
    /// Whether the space before the feature that contradicts a reading gets full weight.
    pub keep_clear: bool,
}

impl Default for Trust {
    fn default() -> Self {
        Self { min_confidence: 0.0, keep_clear: true }
    }
}

/// Readings of one scan with their confidences and inverse sensor model.
#[derive(Clone, Copy)]
pub(super) struct ScanEvidence<'a> {
    pub(super) sweep: &'a Sweep,
    /// Assessments of the beams; without them all readings have full confidence.
    pub(super) assessments: Option<&'a [Assessment]>,
    pub(super) model: &'a BeamModel,
    pub(super) trust: &'a Trust,
}

impl<'a> ScanEvidence<'a> {
    /// Polar log-odds tables of the readings, one for each ranger position: the rangers of an array
    /// measure from different places.
    fn tables(self, cell_m: f64) -> impl Iterator<Item = (DVec2, polar::PolarTable)> + 'a {
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
            (from, polar::PolarTable::new(self, mount, cell_m))
        })
    }
}

impl Grid {
    /// Map of unknown cells.
    #[must_use]
    pub fn new(shape: GridShape) -> Self {
        Self { shape, log_odds: vec![0.0; shape.cells()] }
    }

    /// Map of given probabilities, row by row from the lower left; missing ones are unknown.
    #[must_use]
    pub fn from_probabilities(shape: GridShape, probabilities: &[f64]) -> Self {
        let log_odds = |p: &f64| {
            let p = p.clamp(1e-9, 1.0 - 1e-9);
            ((p / (1.0 - p)).ln() as f32).clamp(-MAX_LOG_ODDS, MAX_LOG_ODDS)
        };
        let mut grid = Self::new(shape);
        for (cell, p) in grid.log_odds.iter_mut().zip(probabilities) {
            *cell = log_odds(p);
        }
        grid
    }

    /// Position, size and resolution.
    #[must_use]
    pub const fn shape(&self) -> &GridShape {
        &self.shape
    }

    /// Occupancy probability of a cell by index; 0.5 if unknown.
    #[must_use]
    pub fn probability(&self, index: usize) -> f64 {
        1.0 / (1.0 + f64::from(-self.log_odds[index]).exp())
    }

    /// Occupancy probabilities of all cells, row by row from the lower left.
    pub fn probabilities(&self) -> impl Iterator<Item = f64> {
        (0..self.log_odds.len()).map(|index| self.probability(index))
    }

    /// Adds the readings of a scan and returns the number discarded for low confidence.
    ///
    /// Without `assessments` all readings have full confidence.
    pub fn add(
        &mut self,
        sweep: &Sweep,
        assessments: Option<&[Assessment]>,
        model: &BeamModel,
        trust: &Trust,
    ) -> usize {
        let evidence = ScanEvidence { sweep, assessments, model, trust };
        let tables = evidence.tables(self.shape.resolution_m);
        tables.fold(0, |discarded, (from, table)| {
            table.add_to(&self.shape, from, &mut self.log_odds);
            discarded + table.discarded
        })
    }
}
