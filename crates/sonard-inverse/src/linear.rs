//! Likelihood of all readings, linearized about a hypothesis.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use sonard_model::geometry::Pose;

use crate::{
    candidates::Phases,
    jacobian::JacobianBuilder,
    likelihood::ErrorModel,
    likelihood_terms::{LikelihoodTerms, ReadingModel, SparseRow},
    outlier_hmm::{self, Emission, OutlierCounts, StatePosterior},
    parameter::Parameter,
    sweep::{FitSweep, RangeOutcome},
    time_walk::TimeWalk,
    world::{SimulatorSet, World, WorldError},
};

/// Linearized model of all readings about a hypothesis.
#[derive(Debug, Clone)]
pub(crate) struct LinearizedModel {
    /// Readings by sweep, in order of direction.
    sweeps: Vec<Vec<ReadingModel>>,
    /// Number of parameters.
    count: usize,
    walk: TimeWalk,
}

/// Log-likelihood with its gradient and curvature.
#[derive(Debug, Clone)]
pub(crate) struct Derivatives {
    pub(crate) value: f64,
    pub(crate) gradient: DVector<f64>,
    /// Fisher information: Gauss-Newton for ranges, and expected information for thresholds. The
    /// observed information of single surprising readings would be overconfident.
    pub(crate) information: DMatrix<f64>,
    /// Derivative of the gradient by a threshold error in decibels, due to time walk.
    pub(crate) walk: DVector<f64>,
}

impl LinearizedModel {
    /// Predicts all sweeps from their poses, by simulators of the world of the Jacobian.
    ///
    /// A transducer off its axis has separate paths in each direction, some hundred times more
    /// work. If the simulators have it on the axis, paths are found once and corrected to first
    /// order: the error is a millimetre for an offset of 3 cm at half a metre from a wall.
    pub(crate) fn about(
        models: &SimulatorSet,
        rates: &JacobianBuilder,
        sweeps: &[FitSweep],
        poses: &[Pose],
    ) -> Result<Self, WorldError> {
        let of = |(number, (sweep, pose)): (usize, (&FitSweep, &Pose))| {
            models.at(pose, |simulator, point| {
                Ok(rates.sweep(simulator, point, number, sweep, pose)?)
            })
        };
        let (count, walk) = (rates.parameters(), rates.time_walk(models.receiver()));
        if let ([sweep], [pose]) = (sweeps, poses) {
            // Waking another thread takes longer than most sweeps.
            return Ok(Self { sweeps: vec![of((0, (sweep, pose)))?], count, walk });
        }
        let sweeps: Result<Vec<Vec<ReadingModel>>, WorldError> =
            sweeps.par_iter().zip(poses).enumerate().map(of).collect();
        Ok(Self { sweeps: sweeps?, count, walk })
    }

    /// Log-likelihoods of one sweep for combinations of rotations in degrees and threshold changes
    /// in decibels: rotation, threshold change, log-likelihood.
    pub(crate) fn turned(
        models: &SimulatorSet,
        world: &World,
        sweep: &FitSweep,
        pose: &Pose,
        turns_deg: &[f64],
        thresholds_db: &[f64],
        errors: &ErrorModel,
    ) -> Result<Vec<(f64, f64, f64)>, WorldError> {
        let parameters = [&Parameter::Threshold];
        let rates =
            JacobianBuilder::new(world, &parameters, world.air.sound_speed_m_s(), Phases::Unknown);
        let turned = models.at(pose, |simulator, point| {
            Ok(rates.turned(simulator, point, sweep, pose, turns_deg)?)
        })?;
        let walk = rates.time_walk(models.receiver());
        let likely = |(beams, &turn_deg): (Vec<ReadingModel>, &f64)| {
            let (sweeps, count) = (vec![beams], parameters.len());
            let linear = Self { sweeps, count, walk: walk.clone() };
            let at = |db: f64| linear.log_likelihood(&DVector::from_element(1, db), errors);
            thresholds_db.iter().map(|&db| (turn_deg, db, at(db))).collect::<Vec<_>>()
        };
        Ok(turned.into_iter().zip(turns_deg).flat_map(likely).collect())
    }

    /// Log-likelihood of all readings after a change of the parameters.
    pub(crate) fn log_likelihood(&self, change: &DVector<f64>, errors: &ErrorModel) -> f64 {
        let of = |sweep: &Vec<ReadingModel>| {
            let emission =
                |beam: &ReadingModel| emission(beam, &beam.terms(change, errors, &self.walk));
            outlier_hmm::log_likelihood(sweep.iter().map(emission), errors)
        };
        self.sweeps.iter().map(of).sum()
    }

    /// Log-likelihood after a change of the parameters, with gradient and information.
    pub(crate) fn curve(&self, change: &DVector<f64>, errors: &ErrorModel) -> Derivatives {
        let mut curve = Derivatives {
            value: 0.0,
            gradient: DVector::zeros(self.count),
            information: DMatrix::zeros(self.count, self.count),
            walk: DVector::zeros(self.count),
        };
        let of_range = errors.range_information();
        for sweep in &self.sweeps {
            let (terms, states) = self.with_states(sweep, change, errors);
            curve.value += states.log_likelihood;
            for ((beam, terms), of_scene) in sweep.iter().zip(&terms).zip(states.of_scene) {
                curve.add(beam, terms, of_scene, of_range, errors);
            }
        }
        curve
    }

    /// Statistics for the estimation of the error model.
    pub(crate) fn residuals(&self, errors: &ErrorModel) -> Residuals {
        let still = DVector::zeros(self.count);
        let mut found = Residuals::default();
        for sweep in &self.sweeps {
            let (terms, states) = self.with_states(sweep, &still, errors);
            found.counts += states.counts;
            for ((beam, terms), of_scene) in sweep.iter().zip(&terms).zip(states.of_scene) {
                let unexplained = of_scene * terms.unexplained;
                found.unexplained += unexplained;
                found.silent_unexplained +=
                    if beam.measured == RangeOutcome::NoEcho { unexplained } else { 0.0 };
                found.of_ranges.extend(beam.residual(terms, of_scene));
            }
        }
        found
    }

    /// Returns `true` if ranges are accurate enough for time walk to be in the Jacobian.
    pub(crate) fn is_walk_believed(&self, errors: &ErrorModel) -> bool {
        self.walk.is_believed(errors.sigma_m)
    }

    /// Number of readings.
    pub(crate) fn len(&self) -> usize {
        self.sweeps.iter().map(Vec::len).sum()
    }

    /// Likelihood terms of a sweep, and the posterior of its states.
    fn with_states(
        &self,
        sweep: &[ReadingModel],
        change: &DVector<f64>,
        errors: &ErrorModel,
    ) -> (Vec<LikelihoodTerms>, StatePosterior) {
        let terms: Vec<LikelihoodTerms> =
            sweep.iter().map(|beam| beam.terms(change, errors, &self.walk)).collect();
        let emissions: Vec<Emission> =
            sweep.iter().zip(&terms).map(|(beam, terms)| emission(beam, terms)).collect();
        (terms, outlier_hmm::states(&emissions, errors))
    }
}

/// Residuals and outlier statistics.
#[derive(Debug, Clone, Default)]
pub(crate) struct Residuals {
    /// Residuals of echoes from their likeliest candidate, with its posterior probability.
    pub(crate) of_ranges: Vec<(f64, f64)>,
    /// Expected number of single outliers.
    pub(crate) unexplained: f64,
    /// Expected number of single outliers without echo.
    pub(crate) silent_unexplained: f64,
    /// Expected numbers of readings in outlier arcs.
    pub(crate) counts: OutlierCounts,
}

impl Derivatives {
    /// Adds a reading with a probability of the scene state.
    fn add(
        &mut self,
        beam: &ReadingModel,
        terms: &LikelihoodTerms,
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

const fn emission(beam: &ReadingModel, terms: &LikelihoodTerms) -> Emission {
    Emission { measured: beam.measured, of_scene: terms.density }
}

fn add_outer(to: &mut DMatrix<f64>, rates: &SparseRow, weight: f64) {
    for &(row, by_row) in rates {
        for &(column, by_column) in rates {
            to[(row as usize, column as usize)] += weight * by_row * by_column;
        }
    }
}
