//! Normal equations of sparse robust least squares.

use nalgebra::{Cholesky, DMatrix, DVector};
use sonard_inverse::LogLikelihood;
use sonard_model::geometry::{Pose, wrap_180};

/// Normal equations of residuals whose rows have few entries.
#[derive(Debug, Clone)]
pub(crate) struct NormalEquations {
    information: DMatrix<f64>,
    gradient: DVector<f64>,
    /// Sum of the robust losses, nats.
    loss: f64,
}

impl NormalEquations {
    pub(crate) fn new(count: usize) -> Self {
        Self {
            information: DMatrix::zeros(count, count),
            gradient: DVector::zeros(count),
            loss: 0.0,
        }
    }

    /// Adds a residual (measured minus predicted) with the derivatives of the prediction, all in
    /// the unit of `sigma`. Residuals beyond `robust` standard deviations count linearly
    /// (pseudo-Huber loss).
    pub(crate) fn add(
        &mut self,
        derivatives: &[(usize, f64)],
        residual: f64,
        sigma: f64,
        robust: f64,
    ) {
        let scaled = residual / (sigma * robust);
        let root = (1.0 + scaled * scaled).sqrt();
        self.loss += robust * robust * (root - 1.0);
        let weight = 1.0 / (sigma * sigma * root);
        for &(row, by_row) in derivatives {
            self.gradient[row] += weight * by_row * residual;
            for &(column, by_column) in derivatives {
                self.information[(row, column)] += weight * by_row * by_column;
            }
        }
    }

    /// Adds a prior that holds a parameter where it is.
    pub(crate) fn hold(&mut self, at: usize, sigma: f64) {
        self.information[(at, at)] += 1.0 / (sigma * sigma);
    }

    /// Adds a log-likelihood whose parameters depend linearly on columns: for each parameter, the
    /// columns with its derivatives by them.
    pub(crate) fn add_likelihood(&mut self, map: &[Vec<(usize, f64)>], of: &LogLikelihood) {
        for (at, columns) in map.iter().enumerate() {
            for &(row, unit) in columns {
                self.gradient[row] += unit * of.gradient[at];
                for (other, by) in map.iter().enumerate() {
                    for &(column, by) in by {
                        self.information[(row, column)] += unit * by * of.information[(at, other)];
                    }
                }
            }
        }
    }

    /// Sum of the robust losses, nats.
    pub(crate) const fn loss(&self) -> f64 {
        self.loss
    }

    /// Change of the parameters with Levenberg's damping, a factor on the diagonal; `None` if the
    /// equations are singular.
    pub(crate) fn step(&self, damping: f64) -> Option<DVector<f64>> {
        let mut information = self.information.clone();
        for at in 0..information.nrows() {
            information[(at, at)] *= 1.0 + damping;
            information[(at, at)] += 1e-12;
        }
        Some(Cholesky::new(information)?.solve(&self.gradient))
    }

    /// Gain of a step that the equations expect, nats.
    pub(crate) fn expected_gain(&self, step: &DVector<f64>) -> f64 {
        self.gradient.dot(step) - 0.5 * step.dot(&(&self.information * step))
    }

    /// Covariance of the parameters; `None` if they are not determined.
    pub(crate) fn covariance(&self) -> Option<DMatrix<f64>> {
        Some(Cholesky::new(self.information.clone())?.inverse())
    }
}

/// Column of the x of a pose, followed by y and heading in radians; `None` for the first pose,
/// which is the frame.
pub(crate) const fn pose_column(pose: usize) -> Option<usize> {
    match pose.checked_sub(1) {
        Some(free) => Some(3 * free),
        None => None,
    }
}

/// Moves a pose by metres and radians.
pub(crate) fn move_pose(pose: &mut Pose, [x_m, y_m, turned_rad]: [f64; 3]) {
    pose.x_m += x_m;
    pose.y_m += y_m;
    pose.heading_deg = wrap_180(pose.heading_deg + turned_rad.to_degrees());
}
