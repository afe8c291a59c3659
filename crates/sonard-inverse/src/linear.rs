//! All readings beside what could have been reported, to first order about a hypothesis.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use sonard_model::geometry::Pose;

use crate::{
    arcs::{self, Counts, Emission, States},
    candidates::Phases,
    judged::{Judged, Rates, Terms},
    likelihood::ErrorModel,
    parameter::Parameter,
    rates::RateFinder,
    sweep::{Outcome, Sweep},
    walk::TimeWalk,
    world::{Models, World, WorldError},
};

/// All readings, about one hypothesis.
#[derive(Debug, Clone)]
pub(crate) struct Linear {
    /// By sweep, in the order of its directions.
    sweeps: Vec<Vec<Judged>>,
    /// How many parameters there are.
    count: usize,
    walk: TimeWalk,
}

/// Log-likelihood with its gradient and curvature.
#[derive(Debug, Clone)]
pub(crate) struct Curve {
    pub(crate) value: f64,
    pub(crate) gradient: DVector<f64>,
    /// Fisher's information: of ranges as Gauss and Newton have it, of thresholds what a reading is expected to say. What
    /// single surprising readings seem to say would make far too sure.
    pub(crate) information: DMatrix<f64>,
    /// What the gradient would gain by each decibel that the threshold is wrong, because of time walk.
    pub(crate) walk: DVector<f64>,
}

impl Linear {
    /// Predicts all sweeps, each from its pose, by models of the world that the rates are found in.
    ///
    /// A transducer beside its axis has paths of its own in each direction, some hundred times more work. If the models
    /// have it on the axis, the paths are found once, from there, and made longer to first order: a millimetre off for
    /// one that is 3 cm beside it and half a metre before a wall.
    pub(crate) fn about(
        models: &Models,
        rates: &RateFinder,
        sweeps: &[Sweep],
        poses: &[Pose],
    ) -> Result<Self, WorldError> {
        let of = |(number, (sweep, pose)): (usize, (&Sweep, &Pose))| {
            models.at(pose, |simulator, point| {
                Ok(rates.sweep(simulator, point, number, sweep, pose)?)
            })
        };
        let (count, walk) = (rates.parameters(), rates.time_walk(models.receiver()));
        if let ([sweep], [pose]) = (sweeps, poses) {
            // Another thread would take longer to wake up than most sweeps take.
            return Ok(Self { sweeps: vec![of((0, (sweep, pose)))?], count, walk });
        }
        let sweeps: Result<Vec<Vec<Judged>>, WorldError> =
            sweeps.par_iter().zip(poses).enumerate().map(of).collect();
        Ok(Self { sweeps: sweeps?, count, walk })
    }

    /// Log-likelihoods of one sweep from a pose turned by so many degrees each and at thresholds higher by so many
    /// decibels each: the turn, the threshold, and how likely that is.
    pub(crate) fn turned(
        models: &Models,
        world: &World,
        sweep: &Sweep,
        pose: &Pose,
        turns_deg: &[f64],
        thresholds_db: &[f64],
        errors: &ErrorModel,
    ) -> Result<Vec<(f64, f64, f64)>, WorldError> {
        let parameters = [&Parameter::Threshold];
        let rates =
            RateFinder::new(world, &parameters, world.air.sound_speed_m_s(), Phases::Unknown);
        let turned = models.at(pose, |simulator, point| {
            Ok(rates.turned(simulator, point, sweep, pose, turns_deg)?)
        })?;
        let walk = rates.time_walk(models.receiver());
        let likely = |(beams, &turn_deg): (Vec<Judged>, &f64)| {
            let (sweeps, count) = (vec![beams], parameters.len());
            let linear = Self { sweeps, count, walk: walk.clone() };
            let at = |db: f64| linear.log_likelihood(&DVector::from_element(1, db), errors);
            thresholds_db.iter().map(|&db| (turn_deg, db, at(db))).collect::<Vec<_>>()
        };
        Ok(turned.into_iter().zip(turns_deg).flat_map(likely).collect())
    }

    /// Log-likelihood of all readings after a change of the parameters.
    pub(crate) fn log_likelihood(&self, change: &DVector<f64>, errors: &ErrorModel) -> f64 {
        let of = |sweep: &Vec<Judged>| {
            let emission = |beam: &Judged| emission(beam, &beam.terms(change, errors, &self.walk));
            arcs::log_likelihood(sweep.iter().map(emission), errors)
        };
        self.sweeps.iter().map(of).sum()
    }

    /// The same with what it takes to improve it.
    pub(crate) fn curve(&self, change: &DVector<f64>, errors: &ErrorModel) -> Curve {
        let mut curve = Curve {
            value: 0.0,
            gradient: DVector::zeros(self.count),
            information: DMatrix::zeros(self.count, self.count),
            walk: DVector::zeros(self.count),
        };
        let of_range = errors.range_information();
        for sweep in &self.sweeps {
            let (terms, states) = self.beside_else(sweep, change, errors);
            curve.value += states.log_likelihood;
            for ((beam, terms), of_scene) in sweep.iter().zip(&terms).zip(states.of_scene) {
                curve.add(beam, terms, of_scene, of_range, errors);
            }
        }
        curve
    }

    /// What there is to estimate the spread of readings from.
    pub(crate) fn residuals(&self, errors: &ErrorModel) -> Residuals {
        let still = DVector::zeros(self.count);
        let mut found = Residuals::default();
        for sweep in &self.sweeps {
            let (terms, states) = self.beside_else(sweep, &still, errors);
            found.counts += states.counts;
            for ((beam, terms), of_scene) in sweep.iter().zip(&terms).zip(states.of_scene) {
                let unexplained = of_scene * terms.unexplained;
                found.unexplained += unexplained;
                found.silent_unexplained +=
                    if beam.heard == Outcome::Silence { unexplained } else { 0.0 };
                found.of_ranges.extend(beam.residual(terms, of_scene));
            }
        }
        found
    }

    /// Whether ranges are known so well that their time walk is in the rates.
    pub(crate) fn is_walk_believed(&self, errors: &ErrorModel) -> bool {
        self.walk.is_believed(errors.sigma_m)
    }

    /// How many readings there are.
    pub(crate) fn len(&self) -> usize {
        self.sweeps.iter().map(Vec::len).sum()
    }

    /// The readings of a sweep if they are of the scene, and whether they are.
    fn beside_else(
        &self,
        sweep: &[Judged],
        change: &DVector<f64>,
        errors: &ErrorModel,
    ) -> (Vec<Terms>, States) {
        let terms: Vec<Terms> =
            sweep.iter().map(|beam| beam.terms(change, errors, &self.walk)).collect();
        let emissions: Vec<Emission> =
            sweep.iter().zip(&terms).map(|(beam, terms)| emission(beam, terms)).collect();
        (terms, arcs::states(&emissions, errors))
    }
}

/// What the readings are off by, and how many are not of the scene.
#[derive(Debug, Clone, Default)]
pub(crate) struct Residuals {
    /// Ranges of echoes, as differences from the likeliest explanation, with the probability that it is the right one.
    pub(crate) of_ranges: Vec<(f64, f64)>,
    /// Expected number of single readings that nothing explains, and of those that are silences.
    pub(crate) unexplained: f64,
    pub(crate) silent_unexplained: f64,
    /// Expected numbers of readings in arcs of something else.
    pub(crate) counts: Counts,
}

impl Curve {
    /// What a reading adds that is of the scene with some probability.
    fn add(
        &mut self,
        beam: &Judged,
        terms: &Terms,
        of_scene: f64,
        of_range: f64,
        errors: &ErrorModel,
    ) {
        for (possible, term) in beam.possible.iter().zip(&terms.of) {
            for &(at, rate) in &possible.until_rates {
                self.gradient[at as usize] += of_scene * term.by_until * rate;
            }
            let of_until = of_scene * term.expected_of_until;
            add_outer(&mut self.information, &possible.until_rates, of_until);
            let Some(expected) = &term.expected else { continue };
            let weight = of_scene * term.share * of_range * expected.certainty(errors);
            let rates = possible.rates_with_walk(expected);
            for &(at, rate) in &rates {
                self.gradient[at as usize] += of_scene * term.by_range * rate;
                self.walk[at as usize] -= weight * rate * expected.by_until_m;
            }
            add_outer(&mut self.information, &rates, weight);
        }
    }
}

const fn emission(beam: &Judged, terms: &Terms) -> Emission {
    Emission { heard: beam.heard, of_scene: terms.density }
}

fn add_outer(to: &mut DMatrix<f64>, rates: &Rates, weight: f64) {
    for &(one, by) in rates {
        for &(other, beside) in rates {
            to[(one as usize, other as usize)] += weight * by * beside;
        }
    }
}
