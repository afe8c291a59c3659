//! Map that grows with every scan.

use thiserror::Error;

use super::{Assessor, ENOUGH_SCANS, MapSettings, bounds, union};
use crate::interpret::{
    Extents, Sweep,
    grid::{Grid, GridError, GridShape, ScanEvidence, Tiles},
    prediction::Assessment,
};
use sonard_model::geometry::DVec2;

/// Stored cells per reported cell: readings extend beyond the reported region, which later scans
/// may include.
const STORED_PER_CELL: usize = 4;

/// Maximum number of predicted features kept, some hundred bytes each.
const MAX_FEATURES: usize = 4096;

/// Map that grows scan by scan. After each scan it equals, cell for cell, the map that a
/// [`Mapper`](super::Mapper) builds from all scans so far around the detected region.
///
/// Memory is bounded by the extent, not by the number of scans: up to four cells of four bytes per
/// allowed cell, up to 4096 features, and the first five scans.
#[derive(Debug)]
pub struct GrowingMap {
    mapping: MapSettings,
    max_range_m: f64,
    assessor: Assessor,
    max_cells: usize,
    scans: usize,
    /// First scans, kept while the weight of each decreases with every further scan.
    first: Vec<(Sweep, Option<Vec<Assessment>>)>,
    /// Bounding box of the detected region.
    seen: Option<[DVec2; 2]>,
    tiles: Tiles,
}

/// Reason why a map stopped growing.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum GrowError {
    /// Invalid grid dimensions.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// Map larger than allowed.
    #[error("the map would have more than {max} cells")]
    TooManyCells {
        /// Maximum number of cells.
        max: usize,
    },
    /// More predicted walls than allowed.
    #[error("more than {MAX_FEATURES} walls are predicted around one place")]
    TooManyFeatures,
}

impl GrowingMap {
    /// Empty map for a sensor of these extents with a maximum number of cells; `of_array` for
    /// several fixed rangers. The region of the settings is ignored.
    #[must_use]
    pub fn new(mapping: MapSettings, extents: Extents, of_array: bool, max_cells: usize) -> Self {
        let mapping = MapSettings { region: None, ..mapping };
        Self {
            max_range_m: mapping.max_range_m(&extents),
            assessor: Assessor::new(&mapping, extents, of_array),
            max_cells,
            scans: 0,
            first: Vec::new(),
            seen: None,
            tiles: Tiles::new(mapping.resolution_m, STORED_PER_CELL * max_cells),
            mapping,
        }
    }

    /// Adds a scan and returns the map.
    ///
    /// # Errors
    /// Map larger than allowed, or a pose without a valid grid; the map is unusable from then on.
    pub fn add(&mut self, sweep: Sweep) -> Result<Grid, GrowError> {
        let seen = bounds(&sweep, self.max_range_m);
        let seen = self.seen.map_or(seen, |before| union(before, seen));
        let [low, high] = self.mapping.with_margin(seen);
        let shape = GridShape::covering(low, high, self.mapping.resolution_m)?;
        if shape.cells() > self.max_cells {
            return Err(GrowError::TooManyCells { max: self.max_cells });
        }
        self.seen = Some(seen);
        let assessments = self.assessor.assess(&sweep);
        self.scans += 1;
        let times = self.mapping.evidence(self.scans);
        if self.scans > ENOUGH_SCANS {
            self.add_weighted(&sweep, assessments.as_deref(), times)?;
        } else {
            self.first.push((sweep, assessments));
            self.rebuild_first(times)?;
        }
        Ok(self.tiles.part(shape))
    }

    /// Rebuilds the tiles from the first scans with a new weight.
    fn rebuild_first(&mut self, times: u8) -> Result<(), GrowError> {
        self.tiles.clear();
        let first = std::mem::take(&mut self.first);
        for (sweep, assessments) in &first {
            self.add_weighted(sweep, assessments.as_deref(), times)?;
        }
        if self.scans < ENOUGH_SCANS {
            self.first = first;
        }
        Ok(())
    }

    fn add_weighted(
        &mut self,
        sweep: &Sweep,
        assessments: Option<&[Assessment]>,
        times: u8,
    ) -> Result<(), GrowError> {
        let Assessor { model, trust, predictor } = &self.assessor;
        if predictor.as_ref().is_some_and(|predictor| predictor.local().len() > MAX_FEATURES) {
            return Err(GrowError::TooManyFeatures);
        }
        for _ in 0..times {
            if !self.tiles.add(ScanEvidence { sweep, assessments, model, trust }) {
                return Err(GrowError::TooManyCells { max: self.max_cells });
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
    use crate::interpret::{BeamOutcome, SweepBeam, mapping::Mapper};

    fn extents() -> Extents {
        let sensor = Sensor::preset("senscomp-6500").expect("a preset");
        Extents::new(&sensor, &Air::default(), false).expect("good figures")
    }

    /// Sweep in a round room by a moving ranger, with occasional missing or too near echoes.
    fn sweep(number: u32) -> Sweep {
        let along = f64::from(number);
        let beams = (0..100).map(|index| {
            let outcome = match (index + 7 * number) % 9 {
                0 => BeamOutcome::NoEcho,
                1 => BeamOutcome::BelowMinRange,
                _ => BeamOutcome::Echo(1.5 + 0.8 * (0.13 * f64::from(index) + 0.7 * along).sin()),
            };
            let mount = if index % 2 == 0 { DVec2::ZERO } else { DVec2::new(0.1, -0.03) };
            SweepBeam { azimuth_deg: 3.6 * f64::from(index), index, outcome, mount }
        });
        let (x_m, y_m) = (-3.0 + 0.61 * along, 0.4 * along.sin());
        let pose = Pose { x_m, y_m, heading_deg: 31.0 * along };
        Sweep { pose, step_deg: 3.6, beams: beams.collect(), closed: true }
    }

    fn all_at_once(mapping: &MapSettings, of_array: bool, sweeps: &[Sweep]) -> Grid {
        let shape = mapping.shape(sweeps, mapping.max_range_m(&extents())).expect("a grid");
        let mut mapper = Mapper::new(mapping, Grid::new(shape), extents(), of_array, sweeps.len());
        sweeps.iter().for_each(|sweep| drop(mapper.add(sweep)));
        mapper.finish()
    }

    #[test]
    fn each_step_equals_a_full_rebuild() {
        let coarse =
            MapSettings { resolution_m: 0.13, predicts_features: false, ..MapSettings::default() };
        for (mapping, of_array) in [(MapSettings::default(), false), (coarse, true)] {
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
    fn too_large_a_place_ends_it() {
        let mut growing = GrowingMap::new(MapSettings::default(), extents(), false, 10_000);
        let error = (0..).map(|number| growing.add(sweep(number))).find_map(Result::err);
        assert_eq!(error, Some(GrowError::TooManyCells { max: 10_000 }));
        assert!((1..=40_000).contains(&growing.tiles.kept()), "{}", growing.tiles.kept());
    }

    #[test]
    fn scattered_rangers_stay_in_bounds() {
        let beams = (0..4096).map(|index| {
            let mount = DVec2::new(f64::from(index), 0.0) * 20.0;
            SweepBeam { azimuth_deg: 1.0, index, outcome: BeamOutcome::NoEcho, mount }
        });
        let scattered = Sweep { beams: beams.collect(), ..sweep(0) };
        let mut growing = GrowingMap::new(MapSettings::default(), extents(), true, 100_000);
        assert!(matches!(growing.add(scattered), Err(GrowError::TooManyCells { .. })));
        assert!(growing.tiles.kept() <= 4 * 100_000);
    }

    #[test]
    fn invalid_poses_are_rejected() {
        let at = |x_m: f64| {
            let mut growing = GrowingMap::new(MapSettings::default(), extents(), false, 100_000);
            growing.add(Sweep { pose: Pose { x_m, ..sweep(0).pose }, ..sweep(0) })
        };
        for x_m in [1e300, f64::INFINITY, f64::NAN] {
            assert!(at(x_m).is_err(), "{x_m}");
        }
        // Where floating-point spacing exceeds a room, any result is acceptable.
        drop(at(1e17));
    }
}
