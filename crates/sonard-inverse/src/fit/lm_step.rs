//! Steps of a fit: trial rotations, and Levenberg-Marquardt steps.

use nalgebra::{Cholesky, DVector};

use super::{FitError, Fitter};
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

impl Fitter<'_> {
    /// Rotates each sweep with a fitted heading to its best value in discrete steps on either side.
    /// A heading changes no path of an on-axis transducer, only the ends of arcs, which carry
    /// little information from afar. For a single sweep the threshold, which shifts all ends, is
    /// varied as well.
    pub(super) fn turn(
        &mut self,
        errors: &ErrorModel,
        step_deg: f64,
        steps: i32,
    ) -> Result<bool, FitError> {
        let (world, poses) = (self.moved_world()?, self.poses());
        let index =
            |parameter: &Parameter| self.parameters.iter().position(|of| **of == *parameter);
        let threshold = index(&Parameter::Threshold).filter(|_| self.sweeps.len() == 1);
        let step_db = THRESHOLD_OF_TURN * step_deg;
        let thresholds_db: Vec<f64> = match threshold {
            Some(_) => (-2..=2).map(|step| f64::from(step) * step_db).collect(),
            None => vec![0.0],
        };
        let mut changes: Vec<(usize, f64)> = Vec::new();
        for at in 0..self.parameters.len() {
            let Parameter::Heading(sweep) = *self.parameters[at] else { continue };
            let turns: Vec<f64> = (-steps..=steps).map(|step| f64::from(step) * step_deg).collect();
            let (sweep, pose) = (&self.sweeps[sweep], &poses[sweep]);
            let tried = LinearizedModel::turned(
                &self.models,
                &world,
                sweep,
                pose,
                &turns,
                &thresholds_db,
                errors,
            )?;
            let cost =
                |at: usize, by: f64| 0.5 * self.precision(at) * (self.values[at] + by).powi(2);
            let value = |&(by, db, likely): &(f64, f64, f64)| {
                likely - cost(at, by) - threshold.map_or(0.0, |threshold| cost(threshold, db))
            };
            let best = tried.iter().max_by(|a, b| value(a).total_cmp(&value(b)));
            if let Some(&(by, db, _)) = best {
                changes.push((at, by));
                changes.extend(threshold.map(|threshold| (threshold, db)));
            }
        }
        changes.iter().for_each(|&(at, by)| self.values[at] += by);
        Ok(changes.iter().any(|(_, by)| *by != 0.0))
    }

    /// Optimizes on the linearization within its limits; returns the largest step relative to them.
    pub(super) fn improve(
        &mut self,
        linear: &LinearizedModel,
        errors: &ErrorModel,
    ) -> Result<f64, FitError> {
        let mut change = self.still();
        let mut damping = 1e-3;
        let mut curve = linear.curve(&change, errors);
        let mut value = curve.value + self.log_prior(&self.values);
        for _ in 0..STEPS {
            let step = self.step(&curve, &change, damping).ok_or(FitError::Degenerate)?;
            let next = self.bounded(&(&change + step));
            let next_value =
                linear.log_likelihood(&next, errors) + self.log_prior(&(&self.values + &next));
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
        let largest = self.largest_share(&change);
        self.values += change;
        Ok(largest)
    }

    /// Largest component of a change, relative to the maximum step of its parameter.
    pub(super) fn largest_share(&self, change: &DVector<f64>) -> f64 {
        let shares = change.iter().zip(&self.parameters).map(|(by, of)| by.abs() / of.step());
        shares.fold(0.0, f64::max)
    }

    /// Solves the damped normal equations with active bound constraints.
    fn step(
        &self,
        curve: &Derivatives,
        change: &DVector<f64>,
        damping: f64,
    ) -> Option<DVector<f64>> {
        let mut normal = curve.information.clone();
        let mut right = curve.gradient.clone();
        for at in 0..right.len() {
            normal[(at, at)] *= 1.0 + damping;
            normal[(at, at)] += self.precision(at) * (1.0 + damping);
            right[at] -= self.precision(at) * (self.values[at] + change[at]);
        }
        if let Some(held) = &self.held {
            let sigmas = self.prior_sigmas();
            let stiffest = normal.diagonal().component_mul(&sigmas).component_mul(&sigmas).max();
            normal += STIFF * stiffest * held * held.transpose();
            right -= STIFF * stiffest * held.dot(change) * held;
        }
        for at in 0..right.len() {
            let (min, max) = self.limits_of_change(at);
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
    fn bounded(&self, change: &DVector<f64>) -> DVector<f64> {
        let bounded = change.iter().enumerate().map(|(at, by)| {
            let (step, (min, max)) = (self.parameters[at].step(), self.limits_of_change(at));
            by.clamp(min.max(-step), max.min(step))
        });
        DVector::from_iterator(change.len(), bounded)
    }

    /// Bounds on the change of a parameter from its current value.
    fn limits_of_change(&self, at: usize) -> (f64, f64) {
        let (min, max) = self.start.limits(self.parameters[at]);
        (min - self.values[at], max - self.values[at])
    }
}
