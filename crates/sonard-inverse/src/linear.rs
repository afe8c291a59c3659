//! All readings beside what could have been reported, to first order about a hypothesis.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use sonard_model::geometry::Pose;

use crate::{
    candidates::Phases,
    judged::{Judged, Rates},
    likelihood::ErrorModel,
    parameter::Parameter,
    rates::RateFinder,
    sweep::Sweep,
    world::{Models, World, WorldError},
};

/// All readings, about one hypothesis.
#[derive(Debug, Clone)]
pub(crate) struct Linear {
    beams: Vec<Judged>,
    /// How many parameters there are.
    count: usize,
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
        let count = rates.parameters();
        if let ([sweep], [pose]) = (sweeps, poses) {
            // Another thread would take longer to wake up than most sweeps take.
            return Ok(Self { beams: of((0, (sweep, pose)))?, count });
        }
        let beams: Result<Vec<Vec<Judged>>, WorldError> =
            sweeps.par_iter().zip(poses).enumerate().map(of).collect();
        Ok(Self { beams: beams?.into_iter().flatten().collect(), count })
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
        let likely = |(beams, &turn_deg): (Vec<Judged>, &f64)| {
            let linear = Self { beams, count: parameters.len() };
            let at = |db: f64| linear.log_likelihood(&DVector::from_element(1, db), errors);
            thresholds_db.iter().map(|&db| (turn_deg, db, at(db))).collect::<Vec<_>>()
        };
        Ok(turned.into_iter().zip(turns_deg).flat_map(likely).collect())
    }

    /// Log-likelihood of all readings after a change of the parameters.
    pub(crate) fn log_likelihood(&self, change: &DVector<f64>, errors: &ErrorModel) -> f64 {
        self.beams.iter().map(|beam| beam.terms(change, errors).density.ln()).sum()
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
        for beam in &self.beams {
            let terms = beam.terms(change, errors);
            curve.value += terms.density.ln();
            for (possible, term) in beam.possible.iter().zip(&terms.of) {
                let of_range = of_range * possible.certainty(errors);
                let weight = term.share * of_range;
                for &(at, rate) in &possible.range_rates {
                    curve.gradient[at as usize] += term.by_range * rate;
                    curve.walk[at as usize] += weight * rate * possible.walk_m_per_db;
                }
                for &(at, rate) in &possible.until_rates {
                    curve.gradient[at as usize] += term.by_until * rate;
                }
                add_outer(&mut curve.information, &possible.range_rates, weight);
                add_outer(&mut curve.information, &possible.until_rates, term.expected_of_until);
            }
        }
        curve
    }

    /// Ranges of echoes that are explained, as differences from the likeliest explanation, with the probability that
    /// it is the right one; and the share of readings that nothing explains.
    pub(crate) fn residuals(&self, errors: &ErrorModel) -> (Vec<(f64, f64)>, f64) {
        let still = DVector::zeros(self.count);
        let mut unexplained = 0.0;
        let residuals = self.beams.iter().filter_map(|beam| {
            let terms = beam.terms(&still, errors);
            unexplained += terms.unexplained;
            let best = (0..beam.possible.len())
                .max_by(|&one, &other| terms.of[one].share.total_cmp(&terms.of[other].share))?;
            Some((beam.heard_m? - beam.possible[best].range_m?, terms.of[best].share))
        });
        let residuals = residuals.collect();
        (residuals, unexplained / self.beams.len().max(1) as f64)
    }

    /// How many readings there are.
    pub(crate) const fn len(&self) -> usize {
        self.beams.len()
    }
}

fn add_outer(to: &mut DMatrix<f64>, rates: &Rates, weight: f64) {
    for &(one, by) in rates {
        for &(other, beside) in rates {
            to[(one as usize, other as usize)] += weight * by * beside;
        }
    }
}
