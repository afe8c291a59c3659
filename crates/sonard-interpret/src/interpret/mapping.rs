//! An occupancy grid of scans: which cells, what a reading says of them, and how often it counts.

mod growing;

pub use growing::{GrowError, GrowingMap};

use super::{
    Extents, Heard, Sweep,
    grid::{BeamModel, GaussianBeam, Grid, GridError, GridShape, PhysicalBeam, Trust},
    prediction::{Assessment, FeaturePrediction, PredictionSettings},
};
use sonard_model::geometry::DVec2;

/// Without a word on it, ranges beyond this are not mapped, metres.
pub const MAX_RANGE_M: f64 = 5.0;

/// Around what was seen, metres.
const MARGIN_M: f64 = 0.5;

/// From so many scans on each counts once.
const ENOUGH_SCANS: usize = 5;

/// Settings of a map; what is `None` follows from the scans.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mapping {
    /// Side of a cell, metres.
    pub resolution_m: f64,
    /// Lower left and upper right corner of what is mapped, metres; without it, around what was seen.
    pub region: Option<[DVec2; 2]>,
    /// Ranges beyond this are taken for silence, metres; without it the sensor's, at most [`MAX_RANGE_M`].
    pub silent_beyond_m: Option<f64>,
    /// Full beam width, degrees; without it that of a plane's arc, and of an array its usual one.
    pub beam_deg: Option<f64>,
    /// Exponent of the confidence with the distance of a feature.
    pub exponent: f64,
    /// How far walls are extended beyond their observed part, metres.
    pub extend_m: f64,
    /// Readings of less confidence are left out; 0.5 is full confidence.
    pub least_confidence: f64,
    /// How often each scan counts; without it, so often that few scans decide their cells.
    pub evidence: Option<u8>,
    /// Whether readings that contradict predicted features count less.
    pub predicts_features: bool,
    /// Whether a reading says of cells what the sensor's beam pattern and threshold do, and not a Gaussian.
    pub is_physical: bool,
}

impl Default for Mapping {
    /// What did best on made-up rooms.
    fn default() -> Self {
        Self {
            resolution_m: 0.05,
            region: None,
            silent_beyond_m: None,
            beam_deg: None,
            exponent: 2.0,
            extend_m: 2.0,
            least_confidence: 0.48,
            evidence: None,
            predicts_features: true,
            is_physical: false,
        }
    }
}

impl Mapping {
    /// Range up to which readings of a sensor are mapped, metres.
    #[must_use]
    pub fn max_range_m(&self, extents: &Extents) -> f64 {
        self.silent_beyond_m.unwrap_or_else(|| extents.max_range_m.min(MAX_RANGE_M))
    }

    /// The region asked for, else around poses and echoes within range.
    ///
    /// # Errors
    /// When that makes too many cells, or none.
    pub fn shape<'a>(
        &self,
        sweeps: impl IntoIterator<Item = &'a Sweep>,
        max_range_m: f64,
    ) -> Result<GridShape, GridError> {
        let [low, high] = self.region.unwrap_or_else(|| {
            let seen = sweeps.into_iter().map(|sweep| seen(sweep, max_range_m)).reduce(both);
            self.around(seen.unwrap_or([DVec2::ZERO, DVec2::ONE]))
        });
        GridShape::covering(low, high, self.resolution_m)
    }

    /// The region around what was seen, from corner to corner.
    fn around(&self, [low, high]: [DVec2; 2]) -> [DVec2; 2] {
        // Corners on whole cells, so that maps of one place lie on each other.
        let cell = self.resolution_m;
        let low = ((low - MARGIN_M) / cell).floor() * cell;
        [low, ((high + MARGIN_M) / cell).ceil() * cell]
    }

    /// How often each of so many scans counts. A reading's odds are set for maps of many scans: one
    /// scan brings a cell before it from 0.5 to about 0.41, four to 0.19, which `map_server` calls free.
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

/// Lower left and upper right corner of where a scan's ranger stood and where it heard something within range.
fn seen(sweep: &Sweep, max_range_m: f64) -> [DVec2; 2] {
    let echoes = sweep.beams.iter().filter_map(|beam| match beam.heard {
        Heard::Echo(m) if m <= max_range_m => Some(sweep.point(beam, m)),
        _ => None,
    });
    let stood = sweep.pose.position();
    echoes.map(|place| [place; 2]).fold([stood; 2], both)
}

/// The corners of two regions together.
fn both([low, high]: [DVec2; 2], other: [DVec2; 2]) -> [DVec2; 2] {
    [low.min(other[0]), high.max(other[1])]
}

/// A map in the making.
#[derive(Debug)]
pub struct Mapper {
    grid: Grid,
    appraiser: Appraiser,
    evidence: u8,
}

/// What readings of a sensor say, and how far each is believed.
#[derive(Debug)]
struct Appraiser {
    model: BeamModel,
    predictor: Option<FeaturePrediction>,
    trust: Trust,
}

/// The result of adding a scan to a map.
#[derive(Debug, Clone, PartialEq)]
pub struct Added {
    /// Of its beams, where features are predicted.
    pub assessments: Option<Vec<Assessment>>,
    /// Readings left out for want of confidence.
    pub left_out: usize,
}

impl Mapper {
    /// Onto a grid, with so many scans to come of a sensor's extents; `of_array` of several at fixed bearings.
    #[must_use]
    pub fn new(
        mapping: &Mapping,
        grid: Grid,
        extents: Extents,
        of_array: bool,
        scans: usize,
    ) -> Self {
        let appraiser = Appraiser::new(mapping, extents, of_array);
        Self { grid, appraiser, evidence: mapping.evidence(scans) }
    }

    /// Adds a scan.
    pub fn add(&mut self, sweep: &Sweep) -> Added {
        let assessments = self.appraiser.assess(sweep);
        let Appraiser { model, trust, .. } = &self.appraiser;
        let mut left_out = 0;
        for _ in 0..self.evidence {
            left_out = self.grid.add(sweep, assessments.as_deref(), model, trust);
        }
        Added { assessments, left_out }
    }

    /// The map.
    #[must_use]
    pub fn finish(self) -> Grid {
        self.grid
    }
}

impl Appraiser {
    fn new(mapping: &Mapping, extents: Extents, of_array: bool) -> Self {
        let max_range_m = mapping.max_range_m(&extents);
        let (model, prediction) = mapping.beam(extents, max_range_m, of_array);
        let predictor = mapping.predicts_features.then(|| FeaturePrediction::new(prediction));
        let trust = Trust { least_confidence: mapping.least_confidence, keep_clear: true };
        Self { model, predictor, trust }
    }

    /// How far the readings of the next scan are believed.
    fn assess(&mut self, sweep: &Sweep) -> Option<Vec<Assessment>> {
        self.predictor.as_mut().map(|predictor| predictor.assess(sweep))
    }
}
