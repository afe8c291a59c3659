//! Steps of a fit: trial rotations, and Levenberg-Marquardt steps.

use nalgebra::{Cholesky, DVector};

use super::{FitError, Fitter, Point, Problem};
use crate::{
    likelihood::ErrorModel,
    linear::{Derivatives, LinearizedModel},
    parameter::Parameter,
};

/// Threshold change tried per degree of rotation, decibels: the slope of two-way beams near the
/// ends of arcs.
const THRESHOLD_OF_TURN: f64 = 1.5;
/// Maximum number of steps on one linearization.
const STEPS: usize = 12;
/// Stiffness of a held combination relative to the stiffest parameter.
const STIFF: f64 = 1e3;

/// Point after some steps, and the largest step relative to the validity of the linearization.
pub(super) struct Improved {
    pub(super) point: Point,
    pub(super) largest: f64,
}

impl Fitter<'_> {
    /// Rotates each sweep with a fitted heading to its best value in discrete steps on either side.
    /// A heading changes no path of an on-axis transducer, only the ends of arcs, which carry
    /// little information from afar. For a single sweep the threshold, which shifts all ends, is
    /// varied as well. Returns the changes.
    pub(super) fn turn(
        &self,
        point: &Point,
        errors: &ErrorModel,
        step_deg: f64,
        steps: i32,
    ) -> Result<DVector<f64>, FitError> {
        let problem = &self.problem;
        let (world, poses) = (self.move_world(&point.values)?, problem.poses(&point.values));
        let threshold =
            problem.index_of(&Parameter::Threshold).filter(|_| problem.sweeps.len() == 1);
        let step_db = THRESHOLD_OF_TURN * step_deg;
        let thresholds_db: Vec<f64> = match threshold {
            Some(_) => (-2..=2).map(|step| f64::from(step) * step_db).collect(),
            None => vec![0.0],
        };
        let mut changes = problem.zero();
        for (at, parameter) in problem.parameters.iter().enumerate() {
            let Parameter::Heading(sweep) = **parameter else { continue };
            let turns: Vec<f64> = (-steps..=steps).map(|step| f64::from(step) * step_deg).collect();
            let tried = LinearizedModel::turned(
                &self.simulators.borrow(),
                &world,
                &problem.sweeps[sweep],
                &poses[sweep],
                &turns,
                &thresholds_db,
                errors,
            )?;
            let cost =
                |at: usize, by: f64| 0.5 * problem.precision(at) * (point.values[at] + by).powi(2);
            let value = |&(by, db, likely): &(f64, f64, f64)| {
                likely - cost(at, by) - threshold.map_or(0.0, |threshold| cost(threshold, db))
            };
            let best = tried.iter().max_by(|a, b| value(a).total_cmp(&value(b)));
            if let Some(&(by, db, _)) = best {
                changes[at] += by;
                if let Some(threshold) = threshold {
                    changes[threshold] += db;
                }
            }
        }
        Ok(changes)
    }

    /// Optimizes on the linearization about a point within its limits, by Levenberg-Marquardt
    /// steps. `held` is a linear combination of the parameters to keep constant.
    pub(super) fn improve(
        &self,
        linear: &LinearizedModel,
        point: &Point,
        errors: &ErrorModel,
        held: Option<&DVector<f64>>,
    ) -> Result<Improved, FitError> {
        let problem = &self.problem;
        let mut change = problem.zero();
        let mut damping = 1e-3;
        let mut curve = linear.curve(&change, errors);
        let mut value = curve.value + problem.log_prior(&point.values);
        for _ in 0..STEPS {
            let step = problem
                .lm_step(&curve, &point.values, &change, damping, held)
                .ok_or(FitError::Degenerate)?;
            let next = problem.bounded(&point.values, &(&change + step));
            let next_value =
                linear.log_likelihood(&next, errors) + problem.log_prior(&(&point.values + &next));
            if next_value > value {
                let is_done = next_value - value < 1e-4;
                (change, value) = (next, next_value);
                if is_done {
                    break;
                }
                curve = linear.curve(&change, errors);
                damping = (damping * 0.3).max(1e-6);
            } else {
                damping *= 8.0;
                if damping > 1e6 {
                    break;
                }
            }
        }
        let largest = problem.largest_share(&change);
        Ok(Improved { point: point.moved_to(&point.values + change), largest })
    }
}

impl Problem<'_> {
    /// Largest component of a change, relative to the maximum step of its parameter.
    pub(super) fn largest_share(&self, change: &DVector<f64>) -> f64 {
        let shares = change.iter().zip(&self.parameters).map(|(by, of)| by.abs() / of.step());
        shares.fold(0.0, f64::max)
    }

    /// Solves the damped normal equations with active bound constraints.
    fn lm_step(
        &self,
        curve: &Derivatives,
        values: &DVector<f64>,
        change: &DVector<f64>,
        damping: f64,
        held: Option<&DVector<f64>>,
    ) -> Option<DVector<f64>> {
        let mut normal = curve.information.clone();
        let mut right = curve.gradient.clone();
        for at in 0..right.len() {
            normal[(at, at)] *= 1.0 + damping;
            normal[(at, at)] += self.precision(at) * (1.0 + damping);
            right[at] -= self.precision(at) * (values[at] + change[at]);
        }
        if let Some(held) = held {
            let sigmas = self.prior_sigmas();
            let stiffest = normal.diagonal().component_mul(&sigmas).component_mul(&sigmas).max();
            normal += STIFF * stiffest * held * held.transpose();
            right -= STIFF * stiffest * held.dot(change) * held;
        }
        for at in 0..right.len() {
            let (min, max) = self.limits_of_change(values, at);
            let is_held =
                (change[at] <= min && right[at] < 0.0) || (change[at] >= max && right[at] > 0.0);
            if is_held {
                normal.row_mut(at).fill(0.0);
                normal.column_mut(at).fill(0.0);
                (normal[(at, at)], right[at]) = (1.0, 0.0);
            }
        }
        Some(Cholesky::new(normal)?.solve(&right))
    }

    /// Clamps a change to the validity of the linearization and to the bounds.
    fn bounded(&self, values: &DVector<f64>, change: &DVector<f64>) -> DVector<f64> {
        let bounded = change.iter().enumerate().map(|(at, by)| {
            let step = self.parameters[at].step();
            let (min, max) = self.limits_of_change(values, at);
            by.clamp(min.max(-step), max.min(step))
        });
        DVector::from_iterator(change.len(), bounded)
    }
}
