//! Fitted parameters and their priors: `--fit` and `--prior`.

use std::str::FromStr;

use super::Failure;
use crate::inverse::{GroupError, ParameterGroup, Prior, World, priors};

/// Value of `--prior`: `NAME=SIGMA`.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PriorSigma(pub(super) (String, f64));

impl FromStr for PriorSigma {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (name, sigma) = text.split_once('=').ok_or("give NAME=SIGMA, as in x_m=0.05")?;
        let sigma: f64 = sigma.trim().parse().map_err(|_| format!("`{sigma}` is not a number"))?;
        if !(sigma.is_finite() && sigma > 0.0) {
            return Err(format!("{sigma} must be greater than 0"));
        }
        Ok(Self((name.trim().to_owned(), sigma)))
    }
}

/// Returns the parameters selected by `--fit`, with the prior deviations of `--prior`.
pub(super) fn parameters(
    fit: &[ParameterGroup],
    prior: &[PriorSigma],
    world: &World,
    sweeps: usize,
) -> Result<Vec<Prior>, Failure> {
    let given: Vec<(String, f64)> = prior.iter().map(|PriorSigma(pair)| pair.clone()).collect();
    priors(fit, &given, world, sweeps).map_err(|error| {
        let option = match error {
            GroupError::NoHeight | GroupError::NoSkirts { .. } => "--fit ",
            GroupError::NotFitted { .. } | GroupError::Sigma { .. } => "--prior: ",
        };
        Failure::input(format!("{option}{error}"), error.help())
    })
}
