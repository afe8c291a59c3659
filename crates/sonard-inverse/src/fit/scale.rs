//! Estimation of the error model from residuals.

use super::Fitter;
use crate::{
    likelihood::ErrorModel,
    linear::{LinearizedModel, Residuals},
};

/// Standard deviation of the level per further reflection where walls are not known to a fraction
/// of a wavelength, decibels; maximizes the likelihood of twenty real sweeps (docs/reality.md).
const DB_PER_REFLECTION: f64 = 1.5;
/// Fractions of readings in the far tail that are tried.
const TAILS: [f64; 5] = [0.0, 0.03, 0.06, 0.1, 0.2];
/// Standard deviations of the threshold that are tried, decibels.
const SPREADS_DB: [f64; 11] = [0.1, 0.25, 0.35, 0.5, 0.7, 1.0, 1.5, 2.5, 4.0, 6.0, 9.0];

impl Fitter<'_> {
    /// Updates the error model at the current predictions: one step of expectation-maximization.
    pub(super) fn estimate_errors(
        &self,
        linear: &LinearizedModel,
        errors: &ErrorModel,
    ) -> ErrorModel {
        let residuals = linear.residuals(errors);
        let spread = of_clutter(&residuals, errors);
        let mut sizes: Vec<f64> = residuals
            .of_ranges
            .iter()
            .filter(|(_, share)| *share > 0.5)
            .map(|(residual_m, _)| residual_m.abs())
            .collect();
        sizes.sort_by(f64::total_cmp);
        let median_m = sizes.get(sizes.len() / 2).copied().unwrap_or(errors.sigma_m);
        let zero = self.problem.zero();
        let likeliest = |tried: &mut dyn Iterator<Item = ErrorModel>, otherwise: ErrorModel| {
            let likely = |spread: ErrorModel| (linear.log_likelihood(&zero, &spread), spread);
            let best = tried.map(likely).max_by(|a, b| a.0.total_cmp(&b.0));
            best.map_or(otherwise, |(_, spread)| spread)
        };
        // A spurious tail would make all readings seem late, a missing one would bias them.
        let of_tail = |&tail_share: &f64| {
            // The median of inliers depends little on the tail: 0.6745 of a normal distribution
            // alone, and 0.72 with a tail of 10 % and twice the length.
            let sigma_m = median_m / (0.6745 + 0.455 * tail_share);
            let sigma_m =
                sigma_m.min(self.problem.options.initial_sigma_m).max(self.problem.min_sigma_m());
            ErrorModel { sigma_m, tail_weight: tail_share, ..spread }
        };
        let spread = likeliest(&mut TAILS.iter().map(of_tail), spread);
        let sigma_db_per_reflection =
            if self.problem.is_beyond_phases(&spread) { DB_PER_REFLECTION } else { 0.0 };
        let spread = ErrorModel { sigma_db_per_reflection, ..spread };
        let of_threshold = |&sigma_db: &f64| ErrorModel { sigma_db, ..spread };
        let tried =
            SPREADS_DB.iter().filter(|sigma_db| **sigma_db >= self.problem.options.min_sigma_db);
        likeliest(&mut tried.map(of_threshold), spread)
    }
}

/// Prior pseudo-counts: number and length of outlier arcs.
const PRIOR_ARCS: (f64, f64) = (2.0, 8.0);
/// Prior pseudo-counts: number of unexplained readings, and the fraction without echo.
const PRIOR_SILENT: (f64, f64) = (5.0, 0.3);

/// Updates the outlier model: one Baum-Welch step.
fn of_clutter(residuals: &Residuals, errors: &ErrorModel) -> ErrorModel {
    let Residuals { unexplained, silent_unexplained, counts, .. } = *residuals;
    let (arcs, beams) = PRIOR_ARCS;
    let (prior, silent) = PRIOR_SILENT;
    let of_scene = (counts.all - counts.of_else).max(1.0);
    let clutter = (unexplained / of_scene).clamp(0.002, 0.5);
    if errors.outlier_arc_share == 0.0 {
        return ErrorModel { outlier_share: clutter, ..*errors };
    }
    let silences = counts.silent_of_else + silent_unexplained + prior * silent;
    ErrorModel {
        outlier_share: clutter,
        outlier_arc_share: (counts.of_else / counts.all.max(1.0)).clamp(0.002, 0.7),
        outlier_arc_beams: ((counts.staying + counts.leaving + arcs * beams)
            / (counts.leaving + arcs))
            .clamp(2.0, 60.0),
        outlier_no_echo_share: (silences / (counts.of_else + unexplained + prior)).clamp(0.05, 0.8),
        ..*errors
    }
}
