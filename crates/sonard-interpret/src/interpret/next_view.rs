//! Proposal of the next scan position that separates planes from corners.

use std::cmp::Reverse;

use super::{
    Extents, Feature, InterpretSettings, NextPosition, Reason,
    arc::Arc,
    classify::{ExpectedView, ROUNDING_DEG},
};
use sonard_model::geometry::{DVec2, wrap_360};

/// Number of directions of travel tried, in addition to those best for one element.
const DIRECTIONS: usize = 36;

/// Lengths of travel tried, relative to the longest one needed in an element's best direction.
const LENGTHS: [f64; 6] = [0.5, 0.7, 1.0, 1.4, 2.0, 2.8];

/// Clearance to detected elements beyond the minimum range, metres.
const CLEARANCE_M: f64 = 0.05;

/// Minimum translation that separates plane from corner with certainty at a range, metres (25);
/// `reach_deg` is the bound on the error of `beta`: one step without noise.
#[must_use]
pub fn min_translation_m(range_m: f64, reach_deg: f64) -> f64 {
    range_m * (2.0 * reach_deg).to_radians().sin()
}

/// Minimum width of a plane detected from both ends of a translation, metres (27).
#[must_use]
pub fn min_plane_m(range_m: f64, delta_m: f64, half_width_m: f64) -> f64 {
    let share = (delta_m / range_m).min(1.0);
    delta_m * (1.0 - share * share).sqrt() + 2.0 * half_width_m
}

/// Minimum length of each side of a corner that is resolved from its ends, metres (26), (28).
#[must_use]
pub fn min_corner_m(half_beam_deg: f64, half_width_m: f64) -> f64 {
    half_width_m / (2.0 * half_beam_deg).to_radians().sin()
}

/// Sets the next position of each feature that a further scan would decide.
///
/// Open features of the first scan are assigned greedily: first the position that decides most of
/// them, then the one that decides most of the rest, and so on. Ties go to the shortest travel.
pub(super) fn propose(
    arcs: &[&Arc],
    features: &mut [Feature],
    extents: &Extents,
    settings: &InterpretSettings,
) {
    let waits = |feature: &Feature| {
        matches!(feature.reason, Some(Reason::SecondPosition | Reason::Translation))
    };
    let Some(scan) = arcs.iter().zip(&*features).find(|(_, f)| waits(f)).map(|(arc, _)| arc.scan)
    else {
        return;
    };
    let mut open: Vec<usize> =
        (0..arcs.len()).filter(|&i| arcs[i].scan == scan && waits(&features[i])).collect();
    let planner = Planner { arcs, scan, extents, settings };
    let candidates = planner.candidates(&open);
    while let Some((place, decided)) = candidates
        .iter()
        .map(|place| (*place, planner.decided(*place, &open)))
        .filter(|(_, decided)| !decided.is_empty())
        .max_by_key(|(place, decided)| (decided.len(), Reverse(planner.travel_um(*place))))
    {
        for &index in &decided {
            features[index].next = planner.next(place, index, decided.len());
        }
        open.retain(|index| !decided.contains(index));
    }
}

struct Planner<'a> {
    arcs: &'a [&'a Arc],
    scan: usize,
    extents: &'a Extents,
    settings: &'a InterpretSettings,
}

impl Planner<'_> {
    /// Candidate positions: for each open element the two directions `theta_N +- arccos(Delta / r)`
    /// with the length that decides it, and a fan of positions all around.
    fn candidates(&self, open: &[usize]) -> Vec<DVec2> {
        let (mut places, mut lengths_m) = (Vec::new(), Vec::new());
        for &index in open {
            let arc = self.arcs[index];
            let Some(range_m) = arc.region.range_m else { continue };
            let Some(here) = ExpectedView::at(arc, arc.from) else { continue };
            let min_deg = here.min_beta_deg(arc, self.settings);
            let min_m = min_translation_m(range_m, min_deg / 2.0);
            let delta_m = self.settings.translation_margin * min_m;
            let gamma_rad = (delta_m / range_m).clamp(-1.0, 1.0).acos();
            for direction in [arc.bearing_rad + gamma_rad, arc.bearing_rad - gamma_rad] {
                places.push(arc.from + delta_m * DVec2::from_angle(direction));
            }
            lengths_m.push(delta_m);
        }
        let longest_m = lengths_m.iter().copied().fold(0.0, f64::max);
        if let Some(&index) = open.first() {
            let arc = self.arcs[index];
            for i in 0..DIRECTIONS {
                let turn_deg = 360.0 * i as f64 / DIRECTIONS as f64 + arc.heading_deg;
                let ahead = DVec2::from_angle(turn_deg.to_radians());
                places.extend(LENGTHS.iter().map(|part| arc.from + part * longest_m * ahead));
            }
        }
        places.retain(|place| self.is_free(*place));
        places
    }

    /// Returns `true` if no detected element is below the minimum range from the position.
    fn is_free(&self, place: DVec2) -> bool {
        let min_m = self.extents.min_range_m + CLEARANCE_M;
        self.arcs
            .iter()
            .filter(|arc| arc.scan == self.scan)
            .filter_map(|arc| ExpectedView::at(arc, place))
            .all(|expected| expected.ranges_m().iter().all(|range_m| *range_m >= min_m))
    }

    /// Open elements that a scan from the position decides.
    fn decided(&self, place: DVec2, open: &[usize]) -> Vec<usize> {
        let margin = self.settings.translation_margin;
        let decides = |index: &usize| {
            let arc = self.arcs[*index];
            ExpectedView::at(arc, place).is_some_and(|expected| {
                !expected.is_out_of_reach(self.extents)
                    && expected.beta_corner_deg
                        >= margin * expected.min_beta_deg(arc, self.settings) - ROUNDING_DEG
            })
        };
        open.iter().copied().filter(decides).collect()
    }

    fn travel_um(&self, place: DVec2) -> u64 {
        let from = self.arcs.iter().find(|arc| arc.scan == self.scan).map(|arc| arc.from);
        from.map_or(0, |from| (place.distance(from) * 1e6) as u64)
    }

    fn next(&self, place: DVec2, index: usize, decides: usize) -> Option<NextPosition> {
        let arc = self.arcs[index];
        let (range_m, travel) = (arc.region.range_m?, place - arc.from);
        let half_width_m = self.extents.half_width_m();
        Some(NextPosition {
            x_m: place.x,
            y_m: place.y,
            direction_deg: wrap_360(travel.to_angle().to_degrees() - arc.heading_deg),
            delta_m: travel.length(),
            decides,
            min_plane_m: min_plane_m(range_m, travel.length(), half_width_m),
            min_corner_m: min_corner_m(self.extents.half_beam_deg(), half_width_m),
        })
    }
}
