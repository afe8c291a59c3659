//! Checkpoints: results of the searches of a fit, so that a stopped one can be resumed.
//!
//! A fit is a sequence of searches, each of which depends only on the results of those before it. A
//! resumed fit skips the recorded searches and reproduces the uninterrupted result bit by bit.

use nalgebra::DVector;
use serde::{Deserialize, Serialize};

use super::{FitError, Fitter};
use crate::likelihood::ErrorModel;

/// Result of one search of a fit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "search", rename_all = "snake_case", deny_unknown_fields)]
pub enum SearchResult {
    /// Stage of the continuation from a wide to the observed error model.
    Spread {
        /// Changes of the parameters since the start, each in its unit.
        values: Vec<f64>,
        /// Fitted error model.
        errors: ErrorModel,
        /// Whether narrower stages are skipped.
        is_last: bool,
    },
    /// Optimum at the end of a continuation.
    End {
        /// Changes of the parameters since the start, each in its unit.
        values: Vec<f64>,
        /// Fitted error model.
        errors: ErrorModel,
        /// Log-likelihood plus log-prior.
        log_posterior: f64,
    },
    /// Improved start near the optimum.
    Place {
        /// Changes of the parameters since the start, each in its unit.
        values: Vec<f64>,
        /// Log-posterior with the error model for comparison of starts.
        log_posterior: f64,
    },
    /// Failed search: nothing to predict with, or a singular information matrix.
    Nothing,
}

impl SearchResult {
    fn values(&self) -> &[f64] {
        match self {
            Self::Spread { values, .. } | Self::End { values, .. } | Self::Place { values, .. } => {
                values
            }
            Self::Nothing => &[],
        }
    }
}

impl Fitter<'_> {
    /// Runs the next search, or replays its recorded result.
    pub(super) fn run_or_replay(
        &self,
        search: impl FnOnce() -> Result<SearchResult, FitError>,
    ) -> Result<SearchResult, FitError> {
        let recorded = self.recorded.borrow_mut().next();
        match recorded {
            // A recorded failure is repeated to obtain its error.
            Some(SearchResult::Nothing) => search(),
            Some(found) if found.values().len() == self.problem.parameters.len() => {
                Ok(found.clone())
            }
            Some(_) => Err(FitError::OtherFit),
            None => {
                let found = search();
                match &found {
                    Ok(found) => self.observer.found(found),
                    Err(error) if error.ends_all() => {}
                    Err(_) => self.observer.found(&SearchResult::Nothing),
                }
                found
            }
        }
    }
}

/// Values as a serializable list.
pub(super) fn listed(values: &DVector<f64>) -> Vec<f64> {
    values.iter().copied().collect()
}
