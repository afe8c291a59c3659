//! A map that is looked at while it grows.

use thiserror::Error;

use super::{Appraiser, ENOUGH_SCANS, Mapping, both, seen};
use crate::interpret::{
    Extents, Sweep,
    grid::{Grid, GridError, GridShape, Tiles, Told},
    prediction::Assessment,
};
use sonard_model::geometry::DVec2;

/// Cells that are kept for each that may be told: readings reach beyond what is told, which later scans may need.
const KEPT_FOR_EACH: usize = 4;

/// Predicted features that are kept, at most: some hundred bytes each.
const MOST_FEATURES: usize = 4096;

/// A map that grows scan by scan: after each it is, cell for cell, what a [`Mapper`](super::Mapper) makes of all scans
/// so far around what was seen.
///
/// What it costs does not grow with the scans, but with the place: up to four cells of four bytes for each that it may
/// have, beside up to 4096 features and the first five scans.
#[derive(Debug)]
pub struct GrowingMap {
    mapping: Mapping,
    max_range_m: f64,
    appraiser: Appraiser,
    most_cells: usize,
    scans: usize,
    /// The first scans, as long as each counts less with every scan that comes.
    first: Vec<(Sweep, Option<Vec<Assessment>>)>,
    /// Corners of what was seen.
    seen: Option<[DVec2; 2]>,
    tiles: Tiles,
}

/// The reason why a map stopped growing.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum GrowError {
    /// There is no such grid.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// It is larger than it may be.
    #[error("it would have more than {most} cells")]
    TooManyCells {
        /// Cells that it may have.
        most: usize,
    },
    /// More walls are predicted than may be kept.
    #[error("more than {MOST_FEATURES} walls are predicted around one place")]
    TooManyFeatures,
}

impl GrowingMap {
    /// Of readings of a sensor of these extents, `of_array` of several at fixed bearings; with at most so many cells. Of
    /// the mapping's region it takes no notice.
    #[must_use]
    pub fn new(mapping: Mapping, extents: Extents, of_array: bool, most_cells: usize) -> Self {
        let mapping = Mapping { region: None, ..mapping };
        Self {
            max_range_m: mapping.max_range_m(&extents),
            appraiser: Appraiser::new(&mapping, extents, of_array),
            most_cells,
            scans: 0,
            first: Vec::new(),
            seen: None,
            tiles: Tiles::new(mapping.resolution_m, KEPT_FOR_EACH * most_cells),
            mapping,
        }
    }

    /// Adds a scan, and gives the map.
    ///
    /// # Errors
    /// When it gets larger than it may be, or the scan's place makes no grid; it is of no use from then on.
    pub fn add(&mut self, sweep: Sweep) -> Result<Grid, GrowError> {
        let seen = seen(&sweep, self.max_range_m);
        let seen = self.seen.map_or(seen, |before| both(before, seen));
        let [low, high] = self.mapping.around(seen);
        let shape = GridShape::covering(low, high, self.mapping.resolution_m)?;
        if shape.cells() > self.most_cells {
            return Err(GrowError::TooManyCells { most: self.most_cells });
        }
        self.seen = Some(seen);
        let assessments = self.appraiser.assess(&sweep);
        self.scans += 1;
        let times = self.mapping.evidence(self.scans);
        if self.scans > ENOUGH_SCANS {
            self.tell(&sweep, assessments.as_deref(), times)?;
        } else {
            self.first.push((sweep, assessments));
            self.tell_first(times)?;
        }
        Ok(self.tiles.part(shape))
    }

    /// Tells all first scans anew, each so many times.
    fn tell_first(&mut self, times: u8) -> Result<(), GrowError> {
        self.tiles.clear();
        let first = std::mem::take(&mut self.first);
        for (sweep, assessments) in &first {
            self.tell(sweep, assessments.as_deref(), times)?;
        }
        if self.scans < ENOUGH_SCANS {
            self.first = first;
        }
        Ok(())
    }

    fn tell(
        &mut self,
        sweep: &Sweep,
        assessments: Option<&[Assessment]>,
        times: u8,
    ) -> Result<(), GrowError> {
        let Appraiser { model, trust, predictor } = &self.appraiser;
        if predictor.as_ref().is_some_and(|predictor| predictor.local().len() > MOST_FEATURES) {
            return Err(GrowError::TooManyFeatures);
        }
        for _ in 0..times {
            if !self.tiles.add(Told { sweep, assessments, model, trust }) {
                return Err(GrowError::TooManyCells { most: self.most_cells });
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use sonard_model::{
        acoustics::{Air, Sensor},
        geometry::Pose,
    };

    use super::*;
    use crate::interpret::{Beam, Heard, mapping::Mapper};

    fn extents() -> Extents {
        let sensor = Sensor::preset("senscomp-6500").expect("a preset");
        Extents::new(&sensor, &Air::default(), false).expect("good figures")
    }

    /// A turn in a round room, of a ranger that moves on and hears nothing, or something near, now and then.
    fn sweep(number: u32) -> Sweep {
        let along = f64::from(number);
        let beams = (0..100).map(|index| {
            let heard = match (index + 7 * number) % 9 {
                0 => Heard::Silent,
                1 => Heard::Near,
                _ => Heard::Echo(1.5 + 0.8 * (0.13 * f64::from(index) + 0.7 * along).sin()),
            };
            let mount = if index % 2 == 0 { DVec2::ZERO } else { DVec2::new(0.1, -0.03) };
            Beam { azimuth_deg: 3.6 * f64::from(index), index, heard, mount }
        });
        let (x_m, y_m) = (-3.0 + 0.61 * along, 0.4 * along.sin());
        let pose = Pose { x_m, y_m, heading_deg: 31.0 * along };
        Sweep { pose, step_deg: 3.6, beams: beams.collect(), closed: true }
    }

    fn all_at_once(mapping: &Mapping, of_array: bool, sweeps: &[Sweep]) -> Grid {
        let shape = mapping.shape(sweeps, mapping.max_range_m(&extents())).expect("a grid");
        let mut mapper = Mapper::new(mapping, Grid::new(shape), extents(), of_array, sweeps.len());
        sweeps.iter().for_each(|sweep| drop(mapper.add(sweep)));
        mapper.finish()
    }

    #[test]
    fn after_each_scan_it_is_the_map_of_all_so_far() {
        let coarse = Mapping { resolution_m: 0.13, predicts_features: false, ..Mapping::default() };
        for (mapping, of_array) in [(Mapping::default(), false), (coarse, true)] {
            let mut growing = GrowingMap::new(mapping, extents(), of_array, 100_000);
            let mut sweeps = Vec::new();
            for number in 0..12 {
                sweeps.push(sweep(number));
                let grid = growing.add(sweep(number)).expect("small");
                let known = grid.probabilities().filter(|p| *p != 0.5).count();
                assert!(known > 500, "{known} cells are known");
                assert!(grid == all_at_once(&mapping, of_array, &sweeps), "scan {number}");
            }
        }
    }

    #[test]
    fn a_place_that_is_too_large_ends_it_with_what_is_kept_within_its_bound() {
        let mut growing = GrowingMap::new(Mapping::default(), extents(), false, 10_000);
        let came = (0..).map(|number| growing.add(sweep(number))).find_map(Result::err);
        assert_eq!(came, Some(GrowError::TooManyCells { most: 10_000 }));
        assert!((1..=40_000).contains(&growing.tiles.kept()), "{}", growing.tiles.kept());
    }

    #[test]
    fn rangers_that_were_all_over_the_place_in_one_scan_do_not_make_it_larger_than_it_may_be() {
        let beams = (0..4096).map(|index| {
            let mount = DVec2::new(f64::from(index), 0.0) * 20.0;
            Beam { azimuth_deg: 1.0, index, heard: Heard::Silent, mount }
        });
        let scattered = Sweep { beams: beams.collect(), ..sweep(0) };
        let mut growing = GrowingMap::new(Mapping::default(), extents(), true, 100_000);
        assert!(matches!(growing.add(scattered), Err(GrowError::TooManyCells { .. })));
        assert!(growing.tiles.kept() <= 4 * 100_000);
    }

    #[test]
    fn places_that_no_grid_has_are_refused() {
        let at = |x_m: f64| {
            let mut growing = GrowingMap::new(Mapping::default(), extents(), false, 100_000);
            growing.add(Sweep { pose: Pose { x_m, ..sweep(0).pose }, ..sweep(0) })
        };
        for x_m in [1e300, f64::INFINITY, f64::NAN] {
            assert!(at(x_m).is_err(), "{x_m}");
        }
        // Where numbers are coarser than rooms, whatever comes of it.
        drop(at(1e17));
    }
}
