//! How readings spread about predictions.

use super::State;
use crate::{
    likelihood::ErrorModel,
    linear::{Linear, Residuals},
};

/// How doubtful each reflection after the first makes strengths where walls are not known to a part of a wavelength, decibels:
/// with this twenty real sweeps are likeliest (docs/reality.md).
const DB_PER_REFLECTION: f64 = 1.5;
/// Shares of readings in the far tail that are tried.
const TAILS: [f64; 5] = [0.0, 0.03, 0.06, 0.1, 0.2];
/// Spreads of the threshold that are tried, decibels.
const SPREADS_DB: [f64; 11] = [0.1, 0.25, 0.35, 0.5, 0.7, 1.0, 1.5, 2.5, 4.0, 6.0, 9.0];

impl State<'_> {
    /// The spread of readings about the present predictions: one step of expectation-maximisation.
    pub(super) fn spread(&self, linear: &Linear, errors: &ErrorModel) -> ErrorModel {
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
        let still = self.still();
        let likeliest = |tried: &mut dyn Iterator<Item = ErrorModel>, otherwise: ErrorModel| {
            let likely = |spread: ErrorModel| (linear.log_likelihood(&still, &spread), spread);
            let best = tried.map(likely).max_by(|one, other| one.0.total_cmp(&other.0));
            best.map_or(otherwise, |(_, spread)| spread)
        };
        // A tail that is not there would make all readings seem late, and one that is not believed the same.
        let of_tail = |&tail_share: &f64| {
            // The median of what is explained, which a tail moves little: 0.6745 of a normal one alone, and 0.72 with a
            // tail of a tenth, twice as long.
            let sigma_m = median_m / (0.6745 + 0.455 * tail_share);
            let sigma_m = sigma_m.min(self.fit.widest_m).max(self.least_sigma_m());
            ErrorModel { sigma_m, tail_share, ..spread }
        };
        let spread = likeliest(&mut TAILS.iter().map(of_tail), spread);
        let sigma_db_per_reflection =
            if self.is_beyond_phases(&spread) { DB_PER_REFLECTION } else { 0.0 };
        let spread = ErrorModel { sigma_db_per_reflection, ..spread };
        let of_threshold = |&sigma_db: &f64| ErrorModel { sigma_db, ..spread };
        let believed = SPREADS_DB.iter().filter(|sigma_db| **sigma_db >= self.fit.least_sigma_db);
        likeliest(&mut believed.map(of_threshold), spread)
    }
}

/// Readings that are believed beforehand: how many in arcs of what the scene lacks and how long these are, and how many
/// that nothing explains, with the share of silences.
const BELIEVED_ARCS: (f64, f64) = (2.0, 8.0);
const BELIEVED_SILENT: (f64, f64) = (5.0, 0.3);

/// The same with the shares of what the scene does not explain: one step of Baum's and Welch's.
fn of_clutter(residuals: &Residuals, errors: &ErrorModel) -> ErrorModel {
    let Residuals { unexplained, silent_unexplained, counts, .. } = *residuals;
    let (arcs, beams) = BELIEVED_ARCS;
    let (believed, silent) = BELIEVED_SILENT;
    let of_scene = (counts.all - counts.of_else).max(1.0);
    let clutter = (unexplained / of_scene).clamp(0.002, 0.5);
    if errors.arcs == 0.0 {
        return ErrorModel { clutter, ..*errors };
    }
    let silences = counts.silent_of_else + silent_unexplained + believed * silent;
    ErrorModel {
        clutter,
        arcs: (counts.of_else / counts.all.max(1.0)).clamp(0.002, 0.7),
        arc_beams: ((counts.staying + counts.leaving + arcs * beams) / (counts.leaving + arcs))
            .clamp(2.0, 60.0),
        clutter_silent: (silences / (counts.of_else + unexplained + believed)).clamp(0.05, 0.8),
        ..*errors
    }
}
