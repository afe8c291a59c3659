//! How likely a reading is, given what the receiver could have reported.

use std::f64::consts::{FRAC_1_SQRT_2, TAU};

use serde::{Deserialize, Serialize};

use crate::sweep::Outcome;

/// Readings that share what the model misses of an arc, and so count as one where explanations are weighed against each
/// other: taken for independent they would make sure of what they can't tell.
pub(crate) const READINGS_OF_ARC: f64 = 8.0;

/// The spread of readings about what is predicted.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ErrorModel {
    /// Standard deviation of the range of an echo, metres.
    pub sigma_m: f64,
    /// Share of echoes in the far tail, 0 to 1.
    pub tail_share: f64,
    /// Mean extra range of those, as a multiple of `sigma_m`.
    pub tail_ratio: f64,
    /// Standard deviation of the threshold from firing to firing, decibels; it also has to cover by how much the
    /// model misses strengths.
    pub sigma_db: f64,
    /// Standard deviation that each mirror reflection after the first adds to the strength of an echo, decibels, where no wall
    /// is quite flat or square to the next.
    #[serde(default)]
    pub sigma_db_per_reflection: f64,
    /// Share of single readings that nothing explains, of those that are not in arcs of something else.
    pub clutter: f64,
    /// Share of readings in arcs of what the scene lacks: people, furniture, the robot itself. None are looked for if it is 0.
    pub arcs: f64,
    /// How long such arcs are on average, in readings.
    pub arc_beams: f64,
    /// Share of all those that are silences.
    pub clutter_silent: f64,
    /// Where their echoes lie, metres: anywhere up to here.
    pub clutter_m: f64,
}

/// Share of the readings within an arc that are as the one before: silent too, or at nearly its range.
const ALIKE: f64 = 0.85;
/// How much the ranges of one differ, metres, on average; and by how many standard deviations of ranges that are told apart.
const ARC_M: f64 = 0.01;
const ARC_SIGMAS: f64 = 3.0;
/// Share of what is no silence that is nearer than the least range.
const NEAR: f64 = 0.1;

impl ErrorModel {
    /// Spread as of a first look: centimetres, some decibels, one reading in ten unexplained.
    #[must_use]
    pub const fn rough(sigma_m: f64, sigma_db: f64, reach_m: f64) -> Self {
        Self {
            sigma_m,
            tail_share: 0.1,
            tail_ratio: 2.0,
            sigma_db,
            sigma_db_per_reflection: 0.0,
            clutter: 0.1,
            arcs: 0.1,
            arc_beams: 8.0,
            clutter_silent: 0.3,
            clutter_m: reach_m,
        }
    }

    /// The same without arcs: single readings alone may be unexplained, and so they stay. Poses are weighed against each other
    /// so, each of which would have what it does not explain for arcs of something else.
    pub(crate) const fn without_arcs(self) -> Self {
        Self { arcs: 0.0, ..self }
    }

    /// The same with another standard deviation of ranges; the far tail keeps its length.
    pub(crate) fn with_range_spread(self, sigma_m: f64) -> Self {
        Self { sigma_m, tail_ratio: self.tail_ratio * self.sigma_m / sigma_m, ..self }
    }

    /// Density of the error of a range (measured less predicted, metres), and its derivative: normal, or later by an
    /// exponentially distributed excess (`TofNoise`), whose density is the convolution of both.
    pub(crate) fn range(&self, error_m: f64) -> [f64; 2] {
        let Self { sigma_m, tail_share, .. } = *self;
        let normal = (-0.5 * (error_m / sigma_m).powi(2)).exp() / (sigma_m * TAU.sqrt());
        let tail_m = self.tail_ratio * sigma_m;
        // The convolution solves f' = (normal - f) / tail.
        let tail = exponentially_modified(error_m, sigma_m, tail_m);
        let slope = -error_m / (sigma_m * sigma_m) * normal;
        [
            (1.0 - tail_share) * normal + tail_share * tail,
            (1.0 - tail_share) * slope + tail_share * (normal - tail) / tail_m,
        ]
    }

    /// The same for what readings say about parameters. Of a threshold that hardly varies only those tell that happen to lie
    /// there, which are too few to say how much others would: so it counts as one that varies.
    pub(crate) fn for_information(self) -> Self {
        const LEAST_DB: f64 = 0.5;
        Self { sigma_db: self.sigma_db.max(LEAST_DB), ..self }
    }

    /// What the range of an echo that is explained says about where it was expected, as Fisher's information: a little
    /// less than of normal errors alone.
    pub(crate) fn range_information(&self) -> f64 {
        const STEPS: i32 = 200;
        // From five standard deviations before to ten and more tails after.
        let step_m = self.sigma_m * (10.0 + 10.0 * self.tail_ratio) / f64::from(STEPS);
        let at = |step: i32| {
            let [density, slope] = self.range(f64::from(step) * step_m - 5.0 * self.sigma_m);
            if density > 0.0 { slope * slope / density } else { 0.0 }
        };
        (0..=STEPS).map(at).sum::<f64>() * step_m
    }

    /// Share of readings that the scene explains, 0 to 1.
    #[must_use]
    pub const fn explained(&self) -> f64 {
        (1.0 - self.arcs) * (1.0 - self.clutter)
    }

    /// Density of a reading that nothing explains: of a range in metres, or the probability of one without.
    pub(crate) fn of_clutter(&self, heard: Outcome) -> f64 {
        match heard {
            Outcome::Echo { .. } => (1.0 - self.clutter_silent) / self.clutter_m,
            Outcome::Silence => self.clutter_silent,
            Outcome::Near => (1.0 - self.clutter_silent) * NEAR,
        }
    }

    /// The same within an arc of something that the scene lacks, by the reading before if it was of that, too.
    pub(crate) fn of_else(&self, before: Option<Outcome>, heard: Outcome) -> f64 {
        let anywhere = self.of_clutter(heard);
        let alike = match (before, heard) {
            (None, _) => return anywhere,
            (Some(Outcome::Silence), Outcome::Silence) | (Some(Outcome::Near), Outcome::Near) => {
                1.0
            }
            (Some(Outcome::Echo { range_m: before_m }), Outcome::Echo { range_m: heard_m }) => {
                // Ranges that are not told apart yet can't be told to be alike: as long as predictions may be far off, what
                // they say is not outdone by what any arc says of itself.
                let width_m = ARC_M.hypot(ARC_SIGMAS * self.sigma_m);
                (-(heard_m - before_m).abs() / width_m).exp() / (2.0 * width_m)
            }
            _ => 0.0,
        };
        ALIKE * alike + (1.0 - ALIKE) * anywhere
    }

    /// Probabilities of the next reading's state, of the scene or of something else, after each of them.
    pub(crate) fn changes(&self) -> [[f64; 2]; 2] {
        let leaves = 1.0 / self.arc_beams;
        let enters = (leaves * self.arcs / (1.0 - self.arcs)).min(0.5);
        [[1.0 - enters, enters], [leaves, 1.0 - leaves]]
    }
}

fn exponentially_modified(error_m: f64, sigma_m: f64, tail_m: f64) -> f64 {
    let ratio = sigma_m / tail_m;
    let late = FRAC_1_SQRT_2 * (ratio - error_m / sigma_m);
    if late > 20.0 {
        // Below 1e-170 of the peak.
        return 0.0;
    }
    0.5 / tail_m * (0.5 * ratio * ratio - error_m / tail_m).exp() * libm::erfc(late)
}

/// The standard normal distribution: its integral up to a value.
pub(crate) fn normal_up_to(value: f64) -> f64 {
    0.5 * libm::erfc(-value * FRAC_1_SQRT_2)
}

/// Its density.
pub(crate) fn normal_density(value: f64) -> f64 {
    (-0.5 * value * value).exp() / TAU.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_density_of_errors_integrates_to_one_and_has_its_derivative() {
        let model = ErrorModel::rough(0.002, 2.0, 5.0);
        let step_m = 1e-5;
        let errors = (-4000..12_000).map(|at| f64::from(at) * step_m);
        let integral: f64 = errors.clone().map(|error_m| model.range(error_m)[0] * step_m).sum();
        assert!((integral - 1.0).abs() < 1e-9, "{integral}");
        for error_m in errors.step_by(97) {
            let [low, high] = [-1e-7, 1e-7].map(|by| model.range(error_m + by)[0]);
            let slope = model.range(error_m)[1];
            assert!((slope - (high - low) / 2e-7).abs() < 1e-2 * slope.abs().max(1.0), "{error_m}");
        }
        let normal = ErrorModel { tail_share: 0.0, ..model };
        let [with_tail, without] =
            [model, normal].map(|model| model.range_information() * model.sigma_m.powi(2));
        // Five standard deviations leave out 2e-5.
        assert!((without - 1.0).abs() < 1e-4, "{without}");
        assert!((0.7..0.95).contains(&with_tail), "{with_tail}");
        // Far before the predicted range it must neither overflow nor be no number.
        assert!(model.range(-5.0)[0] == 0.0 && model.range(5.0)[0].is_finite());
    }
}
