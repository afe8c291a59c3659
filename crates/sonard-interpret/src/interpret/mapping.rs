//! Occupancy grids of scans: extent, sensor model and evidence weight.

mod growing;

pub use growing::{GrowError, GrowingMap};

use super::{
    BeamOutcome, Extents, Sweep,
    grid::{BeamModel, GaussianBeam, Grid, GridError, GridShape, PhysicalBeam, Trust},
    prediction::{Assessment, FeaturePrediction, PredictionSettings},
};
use sonard_model::geometry::DVec2;

/// Default maximum range of mapped readings, metres.
pub const MAX_RANGE_M: f64 = 5.0;

/// Margin around the detected region, metres.
const MARGIN_M: f64 = 0.5;

/// Number of scans from which each has a weight of one.
const ENOUGH_SCANS: usize = 5;

/// Settings of a map; those that are `None` are derived from the scans.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MapSettings {
    /// Side of a cell, metres.
    pub resolution_m: f64,
    /// Lower left and upper right corner of the map, metres; defaults to the detected region.
    pub region: Option<[DVec2; 2]>,
    /// Ranges beyond this count as no echo, metres; defaults to the sensor's maximum range, at most
    /// [`MAX_RANGE_M`].
    pub range_limit_m: Option<f64>,
    /// Full beam width, degrees; defaults to a plane's extent, for an array to its nominal width.
    pub beam_deg: Option<f64>,
    /// Exponent of the confidence as a function of the distance of a feature.
    pub exponent: f64,
    /// Assumed extension of walls beyond their observed part, metres.
    pub extend_m: f64,
    /// Minimum confidence of a reading, at most 0.5 (full confidence); others are discarded.
    pub min_confidence: f64,
    /// Weight of each scan; defaults to a weight at which few scans decide their cells.
    pub evidence: Option<u8>,
    /// Whether readings that contradict predicted features have less weight.
    pub predicts_features: bool,
    /// Whether the inverse sensor model uses the beam pattern and threshold instead of a Gaussian.
    pub is_physical: bool,
}

impl Default for MapSettings {
    /// Best settings found on random rooms.
    fn default() -> Self {
        Self {
            resolution_m: 0.05,
            region: None,
            range_limit_m: None,
            beam_deg: None,
            exponent: 2.0,
            extend_m: 2.0,
            min_confidence: 0.48,
            evidence: None,
            predicts_features: true,
            is_physical: false,
        }
    }
}

impl MapSettings {
    /// Maximum range of mapped readings of a sensor, metres.
    #[must_use]
    pub fn max_range_m(&self, extents: &Extents) -> f64 {
        self.range_limit_m.unwrap_or_else(|| extents.max_range_m.min(MAX_RANGE_M))
    }

    /// Grid over the requested region, else around poses and echoes within range.
    ///
    /// # Errors
    /// Too many cells, or none.
    pub fn shape<'a>(
        &self,
        sweeps: impl IntoIterator<Item = &'a Sweep>,
        max_range_m: f64,
    ) -> Result<GridShape, GridError> {
        let [low, high] = self.region.unwrap_or_else(|| {
            let seen = sweeps.into_iter().map(|sweep| bounds(sweep, max_range_m)).reduce(union);
            self.with_margin(seen.unwrap_or([DVec2::ZERO, DVec2::ONE]))
        });
        GridShape::covering(low, high, self.resolution_m)
    }

    /// Region with its margin, from corner to corner.
    fn with_margin(&self, [low, high]: [DVec2; 2]) -> [DVec2; 2] {
        // Corners on whole cells, so that maps of one place are aligned.
        let cell = self.resolution_m;
        let low = ((low - MARGIN_M) / cell).floor() * cell;
        [low, ((high + MARGIN_M) / cell).ceil() * cell]
    }

    /// Weight of each of `scans` scans. The odds of a reading are set for maps of many scans: one
    /// scan brings a cell before it from 0.5 to about 0.41, four to 0.19, which `map_server`
    /// classifies as free.
    #[must_use]
    pub fn evidence(&self, scans: usize) -> u8 {
        self.evidence.unwrap_or(ENOUGH_SCANS.div_ceil(scans.clamp(1, ENOUGH_SCANS)) as u8)
    }

    fn beam(
        &self,
        extents: Extents,
        max_range_m: f64,
        of_array: bool,
    ) -> (BeamModel, PredictionSettings) {
        let ring = PredictionSettings::ring(max_range_m);
        let of_sensor =
            || if of_array { ring.beam_deg } else { extents.plane_corner_deg(1.0, 1.0) };
        let beam_deg = self.beam_deg.unwrap_or_else(of_sensor);
        let prediction = if of_array {
            PredictionSettings { beam_deg, omega_deg: beam_deg, ..ring }
        } else {
            PredictionSettings::stepper(beam_deg, max_range_m)
        };
        let (exponent, extend_m) = (self.exponent, self.extend_m);
        let model = if self.is_physical {
            BeamModel::Physical(Box::new(PhysicalBeam::new(extents, max_range_m)))
        } else {
            BeamModel::Gaussian(GaussianBeam::new(beam_deg, max_range_m))
        };
        (model, PredictionSettings { exponent, extend_m, ..prediction })
    }
}

/// Bounding box of the ranger position and the echoes within range, lower left and upper right.
fn bounds(sweep: &Sweep, max_range_m: f64) -> [DVec2; 2] {
    let echoes = sweep.beams.iter().filter_map(|beam| match beam.outcome {
        BeamOutcome::Echo(m) if m <= max_range_m => Some(sweep.point(beam, m)),
        _ => None,
    });
    let position = sweep.pose.position();
    echoes.map(|echo| [echo; 2]).fold([position; 2], union)
}

/// Bounding box of two boxes.
fn union([low, high]: [DVec2; 2], other: [DVec2; 2]) -> [DVec2; 2] {
    [low.min(other[0]), high.max(other[1])]
}

/// Incremental construction of a map.
#[derive(Debug)]
pub struct Mapper {
    grid: Grid,
    assessor: Assessor,
    evidence: u8,
}

/// Inverse sensor model and confidence assessment of a sensor.
#[derive(Debug)]
struct Assessor {
    model: BeamModel,
    predictor: Option<FeaturePrediction>,
    trust: Trust,
}

/// Result of adding a scan to a map.
#[derive(Debug, Clone, PartialEq)]
pub struct Added {
    /// Assessments of the beams, if features are predicted.
    pub assessments: Option<Vec<Assessment>>,
    /// Readings discarded for low confidence.
    pub discarded: usize,
}

impl Mapper {
    /// Mapper onto a grid, for an expected number of scans; `of_array` for several fixed rangers.
    #[must_use]
    pub fn new(
        mapping: &MapSettings,
        grid: Grid,
        extents: Extents,
        of_array: bool,
        scans: usize,
    ) -> Self {
        let assessor = Assessor::new(mapping, extents, of_array);
        Self { grid, assessor, evidence: mapping.evidence(scans) }
    }

    /// Adds a scan with its weight.
    pub fn add(&mut self, sweep: &Sweep) -> Added {
        let assessments = self.assessor.assess(sweep);
        let Assessor { model, trust, .. } = &self.assessor;
        let mut left_out = 0;
        for _ in 0..self.evidence {
            left_out = self.grid.add(sweep, assessments.as_deref(), model, trust);
        }
        Added { assessments, discarded: left_out }
    }

    /// Returns the finished map.
    #[must_use]
    pub fn finish(self) -> Grid {
        self.grid
    }
}

impl Assessor {
    fn new(mapping: &MapSettings, extents: Extents, of_array: bool) -> Self {
        let max_range_m = mapping.max_range_m(&extents);
        let (model, prediction) = mapping.beam(extents, max_range_m, of_array);
        let predictor = mapping.predicts_features.then(|| FeaturePrediction::new(prediction));
        let trust = Trust { min_confidence: mapping.min_confidence, keep_clear: true };
        Self { model, predictor, trust }
    }

    /// Assesses the readings of the next scan.
    fn assess(&mut self, sweep: &Sweep) -> Option<Vec<Assessment>> {
        self.predictor.as_mut().map(|predictor| predictor.assess(sweep))
    }
}
