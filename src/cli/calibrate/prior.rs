//! Doubts that are given with `--prior`.

use std::str::FromStr;

/// `NAME=SIGMA`.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PriorSigma(pub(super) (String, f64));

impl FromStr for PriorSigma {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (name, sigma) = text.split_once('=').ok_or("write NAME=SIGMA, as in x_m=0.05")?;
        let sigma: f64 = sigma.trim().parse().map_err(|_| format!("`{sigma}` is not a number"))?;
        if !(sigma.is_finite() && sigma > 0.0) {
            return Err(format!("{sigma} must be greater than 0"));
        }
        Ok(Self((name.trim().to_owned(), sigma)))
    }
}
