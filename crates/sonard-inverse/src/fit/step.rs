//! Where a fit goes next: turns that are tried out, and steps of Levenberg and Marquardt.

use nalgebra::{Cholesky, DVector};

use super::{FitError, State};
use crate::{
    likelihood::ErrorModel,
    linear::{Curve, Linear},
    parameter::Parameter,
};

/// Decibels of the threshold that are tried for each degree of turn: what two-way beams fall by near the ends of arcs.
const THRESHOLD_OF_TURN: f64 = 1.5;
/// Steps on one linearisation.
const STEPS: usize = 12;
/// How much stiffer a combination is that is held than anything else.
const STIFF: f64 = 1e3;

impl State<'_> {
    /// Turns each sweep whose heading is in doubt to where it fits best as a whole, in so many steps to both sides:
    /// headings move no path of a transducer on the axis, only the ends of arcs, which say little from afar. Of a
    /// single sweep the threshold, which moves all ends of arcs too, is tried with it.
    pub(super) fn turn(
        &mut self,
        errors: &ErrorModel,
        step_deg: f64,
        steps: i32,
    ) -> Result<bool, FitError> {
        let (world, poses) = (self.moved_world()?, self.poses());
        let place = |wanted: &Parameter| self.parameters.iter().position(|of| **of == *wanted);
        let threshold = place(&Parameter::Threshold).filter(|_| self.sweeps.len() == 1);
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
            let tried =
                Linear::turned(&self.models, &world, sweep, pose, &turns, &thresholds_db, errors)?;
            let cost =
                |at: usize, by: f64| 0.5 * self.precision(at) * (self.values[at] + by).powi(2);
            let value = |&(by, db, likely): &(f64, f64, f64)| {
                likely - cost(at, by) - threshold.map_or(0.0, |threshold| cost(threshold, db))
            };
            let best = tried.iter().max_by(|one, other| value(one).total_cmp(&value(other)));
            if let Some(&(by, db, _)) = best {
                changes.push((at, by));
                changes.extend(threshold.map(|threshold| (threshold, db)));
            }
        }
        changes.iter().for_each(|&(at, by)| self.values[at] += by);
        Ok(changes.iter().any(|(_, by)| *by != 0.0))
    }

    /// Goes where the linearisation is best, within what it holds for. Gives the largest step, as a share of that.
    pub(super) fn improve(
        &mut self,
        linear: &Linear,
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

    /// The largest part of a change, as a share of what its parameter may be moved at a time.
    pub(super) fn largest_share(&self, change: &DVector<f64>) -> f64 {
        let shares = change.iter().zip(&self.parameters).map(|(by, of)| by.abs() / of.step());
        shares.fold(0.0, f64::max)
    }

    /// Solves the damped normal equations; what stands at its limit and would go past it is held.
    fn step(&self, curve: &Curve, change: &DVector<f64>, damping: f64) -> Option<DVector<f64>> {
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
            let (least, most) = self.limits_of_change(at);
            let is_held =
                (change[at] <= least && right[at] < 0.0) || (change[at] >= most && right[at] > 0.0);
            if is_held {
                normal.row_mut(at).fill(0.0);
                normal.column_mut(at).fill(0.0);
                (normal[(at, at)], right[at]) = (1.0, 0.0);
            }
        }
        Some(Cholesky::new(normal)?.solve(&right))
    }

    /// No further than linearisation and limits allow.
    fn bounded(&self, change: &DVector<f64>) -> DVector<f64> {
        let bounded = change.iter().enumerate().map(|(at, by)| {
            let (step, (least, most)) = (self.parameters[at].step(), self.limits_of_change(at));
            by.clamp(least.max(-step), most.min(step))
        });
        DVector::from_iterator(change.len(), bounded)
    }

    /// How far a parameter can go from where it stands.
    fn limits_of_change(&self, at: usize) -> (f64, f64) {
        let (least, most) = self.start.limits(self.parameters[at]);
        (least - self.values[at], most - self.values[at])
    }
}
