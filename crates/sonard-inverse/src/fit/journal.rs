//! What the searches of a fit came to, so that one that was stopped can go on.
//!
//! A fit is a sequence of searches, each of which follows from what those before it came to and from nothing else. Given
//! what the first ones came to, it leaves these out and ends where it would have ended anyway, to the last bit.

use nalgebra::DVector;
use serde::{Deserialize, Serialize};

use super::{FitError, State};
use crate::likelihood::ErrorModel;

/// What a search of a fit came to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "search", rename_all = "snake_case", deny_unknown_fields)]
pub enum Found {
    /// A spread of readings, on the way from wide ones to those that they have.
    Spread {
        /// Changes of the parameters since the start, each in its unit.
        values: Vec<f64>,
        /// How readings spread about it.
        errors: ErrorModel,
        /// Whether narrower spreads are left out.
        is_last: bool,
    },
    /// The end of such a way.
    End {
        /// Changes of the parameters since the start, each in its unit.
        values: Vec<f64>,
        /// How readings spread about it.
        errors: ErrorModel,
        /// Log-likelihood of all readings with the priors.
        log_posterior: f64,
    },
    /// A place beside the end.
    Place {
        /// Changes of the parameters since the start, each in its unit.
        values: Vec<f64>,
        /// Log-posterior with spreads by which places are told apart.
        log_posterior: f64,
    },
    /// Nothing: there was nothing to predict with, or readings did not hold the parameters.
    Nothing,
}

impl Found {
    fn values(&self) -> &[f64] {
        match self {
            Self::Spread { values, .. } | Self::End { values, .. } | Self::Place { values, .. } => {
                values
            }
            Self::Nothing => &[],
        }
    }
}

impl State<'_> {
    /// What the next search comes to, if that is not known yet.
    pub(super) fn found(
        &mut self,
        search: impl FnOnce(&mut Self) -> Result<Found, FitError>,
    ) -> Result<Found, FitError> {
        match self.known.next() {
            // It fails again as it did, and says why.
            Some(Found::Nothing) => search(self),
            Some(found) if found.values().len() == self.parameters.len() => Ok(found.clone()),
            Some(_) => Err(FitError::OtherFit),
            None => {
                let found = search(self);
                match &found {
                    Ok(found) => self.watch.found(found),
                    Err(error) if error.ends_all() => {}
                    Err(_) => self.watch.found(&Found::Nothing),
                }
                found
            }
        }
    }
}

/// As a search remembers them.
pub(super) fn listed(values: &DVector<f64>) -> Vec<f64> {
    values.iter().copied().collect()
}
