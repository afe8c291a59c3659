//! Feature Prediction: a confidence for every reading.
//!
//! After S. O'Sullivan and others' Feature Prediction: readings of a smooth wall far from its
//! perpendicular are too long or missing. Where walls are is predicted from the readings that
//! are right, and readings that such a wall contradicts lose confidence. It works on a ring of
//! sonars as on a stepper's scan. Where the paper's scan lost a formula, this follows the text
//! around it: the intervals given, and 0.5 as what changes nothing in a Bayesian update.

mod confidence;
mod line;
mod obstacle;

#[cfg(test)]
mod tests;

pub use confidence::{combine, of_angle, of_distance};
pub use line::Line;

use self::obstacle::Obstacle;
use crate::interpret::{Heard, Sweep};
use sonard_model::geometry::{DVec2, wrap_pi};

/// Settings of Feature Prediction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PredictionSettings {
    /// Full width of a beam, degrees: how wide a feature a reading makes.
    pub beam_deg: f64,
    /// `omega`: a feature whose normal is within this of a beam's axis should be heard, degrees.
    pub omega_deg: f64,
    /// Exponent of the confidence with regard to distance: 2, or 1 for the text's "directly
    /// proportional".
    pub exponent: f64,
    /// Range that a silent beam stands for, metres.
    pub max_range_m: f64,
    /// Features closer than this along their normal may be one, metres.
    pub near_m: f64,
    /// And with a gap of at most this along them, metres.
    pub gap_m: f64,
    /// A feature of one reading that is less confident than this is dropped.
    pub least_confidence: f64,
    /// `T_d`: features last seen farther than this from the robot are forgotten, metres.
    pub forget_m: f64,
    /// `T_L`: features shorter than this are dropped after a split, metres.
    pub least_length_m: f64,
    /// A feature of several readings is taken to go on beyond its ends by this for beams that
    /// could not hear it there, metres, unless it was split there ([`Self::end_m`]). The paper has no such thing (0):
    /// its ring of wide beams sees more of a wall at once than a narrow one.
    pub extend_m: f64,
    /// By how much both parts are shortened at a split, metres.
    pub shorten_m: f64,
    /// A feature whose normal is within this of a beam's axis is heard for certain: where it is not,
    /// it is split, degrees. The paper takes `omega`; but at the edge of its arc a wall is as often
    /// silent as heard, so that every wall would be split on both sides of its perpendicular.
    pub heard_deg: f64,
    /// How far a feature may still go on where it was split, metres. The less, the more right readings are
    /// trusted on a long course; the more, the fewer false paths a map has: 0.2, 0.5 and 1 m give 87, 84 and
    /// 78 % of them in the last fifty of 500 scans of an L-shaped room, and 43, 38 and 37 % false paths.
    pub end_m: f64,
}

impl PredictionSettings {
    /// The paper's, for a ring of sonars with 25 degrees of aperture.
    #[must_use]
    pub const fn ring(max_range_m: f64) -> Self {
        Self {
            beam_deg: 25.0,
            omega_deg: 25.0,
            exponent: 2.0,
            max_range_m,
            near_m: 0.10,
            gap_m: 0.30,
            least_confidence: 0.40,
            forget_m: 4.0,
            least_length_m: 0.15,
            extend_m: 0.0,
            shorten_m: 0.05,
            heard_deg: 5.0,
            end_m: 0.5,
        }
    }

    /// For a stepper's scan by a sensor that gives planes arcs of this extent, degrees: a beam
    /// hears a plane that is within half of it from its perpendicular.
    #[must_use]
    pub fn stepper(plane_extent_deg: f64, max_range_m: f64) -> Self {
        let half_deg = plane_extent_deg / 2.0 + 1.0;
        Self { beam_deg: 2.0 * half_deg, omega_deg: half_deg, ..Self::ring(max_range_m) }
    }
}

/// Trust in a reading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Assessment {
    /// 0 (not to be believed) to 0.5 (nothing speaks against it).
    pub confidence: f64,
    /// Distance to the nearest predicted feature that it did not report, metres: up to there the
    /// reading is right in any case.
    pub clear_m: Option<f64>,
}

/// So many readings make a feature that may go on beyond what was seen of it.
const EXTENDED_SUPPORT: f64 = 3.0;

/// A reading that nothing speaks against.
const NEUTRAL: Assessment = Assessment { confidence: 0.5, clear_m: None };

/// Feature Prediction over the sets of readings of one robot.
#[derive(Debug, Clone)]
pub struct FeaturePrediction {
    settings: PredictionSettings,
    /// The local map `L`.
    local: Vec<Line>,
}

impl FeaturePrediction {
    /// With an empty local map.
    #[must_use]
    pub const fn new(settings: PredictionSettings) -> Self {
        Self { settings, local: Vec::new() }
    }

    /// The features near the robot.
    #[must_use]
    pub fn local(&self) -> &[Line] {
        &self.local
    }

    /// The assessment of each reading of a set, in the order of its beams: steps 1 to 6. The set's
    /// features go into the local map.
    pub fn assess(&mut self, sweep: &Sweep) -> Vec<Assessment> {
        let beams = self.beams(sweep);
        let robot = sweep.pose.position();
        let mut seen = self.predict(&beams);
        self.drop_doubtful(&beams, &mut seen);
        for line in &mut self.local {
            line.readings.clear();
        }
        for line in seen {
            self.keep(line, robot);
        }
        self.local.retain(|line| line.seen_from.distance(robot) <= self.settings.forget_m);
        let local = self.obstacles(&self.local);
        let assessments = beams.iter().map(|beam| self.assessment(beam, &local)).collect();
        self.split_unseen(&beams);
        assessments
    }

    fn beams(&self, sweep: &Sweep) -> Vec<Ray> {
        let half_rad = (self.settings.beam_deg / 2.0).to_radians();
        let sides = |axis_rad: f64| {
            [axis_rad, axis_rad - half_rad, axis_rad + half_rad].map(DVec2::from_angle)
        };
        let ray = |(index, beam): (usize, &super::Beam)| {
            let axis_rad = sweep.pose.direction_rad(beam.azimuth_deg);
            let (range_m, echo) = match beam.heard {
                Heard::Echo(range_m) => (range_m.min(self.settings.max_range_m), true),
                Heard::Silent => (self.settings.max_range_m, false),
                // Something is there already: such a reading says nothing of what lies beyond.
                Heard::Near => (0.0, false),
            };
            let echo = echo && range_m < self.settings.max_range_m;
            let from = sweep.place(beam);
            Ray { index: index as u32, from, axis_rad, sides: sides(axis_rad), range_m, echo }
        };
        sweep.beams.iter().enumerate().map(ray).collect()
    }

    /// Steps 1 and 2: the sonar map `S`.
    fn predict(&self, beams: &[Ray]) -> Vec<Line> {
        let half_rad = (self.settings.beam_deg / 2.0).to_radians();
        let omega_rad = self.settings.omega_deg.to_radians();
        let mut seen: Vec<Line> = Vec::new();
        for beam in beams.iter().filter(|beam| beam.echo) {
            let reading = (beam.index, beam.from, beam.axis_rad, beam.range_m);
            let line = Line::of_reading(reading, half_rad, omega_rad);
            // Neighbouring beams see the same wall, so the last features are the likely ones.
            match seen.iter_mut().rev().find(|other| self.similar(other, &line)) {
                Some(other) => other.merge(&line),
                None => seen.push(line),
            }
        }
        let mut merged: Vec<Line> = Vec::with_capacity(seen.len());
        for line in seen {
            match merged.iter_mut().find(|other| self.similar(other, &line)) {
                Some(other) => other.merge(&line),
                None => merged.push(line),
            }
        }
        merged
    }

    fn similar(&self, one: &Line, other: &Line) -> bool {
        one.is_similar(other, self.settings.near_m, self.settings.gap_m)
    }

    /// Step 3: what one beam alone saw, and what others speak against, goes.
    fn drop_doubtful(&self, beams: &[Ray], seen: &mut Vec<Line>) {
        let maps = [self.obstacles(seen), self.obstacles(&self.local)];
        let doubtful: Vec<bool> = seen
            .iter()
            .map(|line| {
                let [only] = line.readings.as_slice() else { return false };
                let beam = &beams[*only as usize];
                maps.iter().any(|map| {
                    self.assessment(beam, map).confidence < self.settings.least_confidence
                })
            })
            .collect();
        let mut doubts = doubtful.into_iter();
        seen.retain(|_| !doubts.next().unwrap_or(false));
    }

    /// Step 4: a feature refines those of the local map that it may be one with, or joins it.
    ///
    /// It may bring several together, such as the parts of one that was split between: left
    /// side by side they would speak against a reading twice, and become more with every set.
    fn keep(&mut self, mut line: Line, robot: DVec2) {
        line.settle(robot);
        let Self { settings, local } = self;
        let (near_m, gap_m) = (settings.near_m, settings.gap_m);
        while let Some(at) = local.iter().position(|old| old.is_similar(&line, near_m, gap_m)) {
            let mut old = local.swap_remove(at);
            old.merge(&line);
            old.settle(robot);
            line = old;
        }
        local.push(line);
    }

    fn obstacles<'a>(&self, map: &'a [Line]) -> Vec<Obstacle<'a>> {
        Obstacle::all(map, self.settings.extend_m)
    }

    /// What a map's features make of a reading.
    fn assessment(&self, beam: &Ray, map: &[Obstacle]) -> Assessment {
        let omega_rad = self.settings.omega_deg.to_radians();
        let (cos_omega, far_m) = (omega_rad.cos(), beam.range_m - self.settings.near_m);
        let mut assessment = NEUTRAL;
        for obstacle in map {
            let cos_theta = obstacle.cos_to(beam.axis());
            let hidden = cos_theta < cos_omega;
            let extended = hidden && obstacle.line.support >= EXTENDED_SUPPORT;
            let Some(crossing_m) = obstacle.crossing_m(beam, far_m, extended) else { continue };
            if obstacle.line.explains(beam.index) {
                continue;
            }
            let confidence = if hidden {
                of_distance(crossing_m / beam.range_m, self.settings.exponent)
            } else {
                of_angle(cos_theta.acos() / omega_rad)
            };
            assessment.confidence = combine(assessment.confidence, confidence);
            assessment.clear_m =
                Some(assessment.clear_m.map_or(crossing_m, |clear| clear.min(crossing_m)));
        }
        assessment
    }

    /// Step 6: features that should have been heard and were not are split there.
    fn split_unseen(&mut self, beams: &[Ray]) {
        let unsplit = std::mem::take(&mut self.local);
        for line in unsplit {
            self.split_from(beams, line);
        }
    }

    /// Splits a feature at the first of the beams that should have heard it, and its parts at
    /// those after that; what is left goes into the local map.
    fn split_from(&mut self, beams: &[Ray], line: Line) {
        let cos_heard = self.settings.heard_deg.to_radians().cos();
        let obstacle = Obstacle::new(&line, 0.0);
        let unheard = |beam: &Ray| {
            let far_m = beam.range_m - self.settings.near_m;
            let crossing_m = obstacle.crossing_of_axis_m(beam, far_m)?;
            let certain = obstacle.cos_to(beam.axis()) >= cos_heard;
            (certain && !line.explains(beam.index)).then(|| beam.from + crossing_m * beam.axis())
        };
        let split = (1..).zip(beams).find_map(|(next, beam)| Some((next, unheard(beam)?)));
        let Some((next, at)) = split else {
            self.local.push(line);
            return;
        };
        let PredictionSettings { shorten_m, end_m, .. } = self.settings;
        for part in line.split(at, shorten_m, end_m) {
            if part.length_m() >= self.settings.least_length_m {
                self.split_from(&beams[next..], part);
            }
        }
    }
}

/// A beam in the world.
#[derive(Debug, Clone)]
struct Ray {
    index: u32,
    from: DVec2,
    axis_rad: f64,
    /// The axis and both sides.
    sides: [DVec2; 3],
    range_m: f64,
    echo: bool,
}

impl Ray {
    const fn axis(&self) -> DVec2 {
        self.sides[0]
    }
}

/// The smaller angle between two directions, radians.
pub(super) fn between_rad(one: f64, other: f64) -> f64 {
    wrap_pi(one - other).abs()
}
