//! Classification of regions as planes, corners and edges.

use uuid::Uuid;

use super::{
    Extents, Feature, FeatureKind, InterpretSettings, Probabilities, Reason, Sweep, UniformSum,
    arc::Arc,
    next_view::propose,
    posterior::{TurnLikelihood, probabilities},
    regions,
    sweep::merge_repeats,
};
use sonard_model::geometry::{DVec2, wrap_pi};

/// Standard deviations taken as certainty in the presence of noise.
const CERTAIN: f64 = 2.58;

/// Rounding of angles, degrees.
pub(super) const ROUNDING_DEG: f64 = 1e-9;

/// Interprets scans taken with one sensor from one place or more.
///
/// `scans` are the sweeps with the ids of their scans, in the order they were taken; `extents`
/// are those of the sensor. An element detected in several scans is one feature of the first;
/// repeated scans from one pose are merged into the first as well.
#[must_use]
pub fn interpret(
    scans: &[(Uuid, Sweep)],
    extents: &Extents,
    settings: &InterpretSettings,
) -> Vec<Feature> {
    let scans = &merge_repeats(scans);
    let arcs: Vec<Arc> = scans
        .iter()
        .enumerate()
        .flat_map(|(scan, (_, sweep))| {
            let found = regions(sweep, settings).into_iter();
            found.map(move |region| Arc::new(scan, sweep, region, extents, settings))
        })
        .collect();
    let places: Vec<DVec2> = scans.iter().map(|(_, sweep)| sweep.pose.position()).collect();
    let mut taken = vec![false; arcs.len()];
    let mut features = Vec::new();
    let mut sources = Vec::new();
    for at in 0..arcs.len() {
        if taken[at] {
            continue;
        }
        let class = ArcClass::classify(at, &arcs, &places, &mut taken, extents, settings);
        features.push(class.feature(&arcs[at], scans, extents, settings));
        sources.push(&arcs[at]);
    }
    propose(&sources, &mut features, extents, settings);
    features
}

/// Observation of an arc from a second position.
#[derive(Debug, Clone, Copy)]
struct Reobservation {
    arc: usize,
    scan: usize,
    beta_deg: f64,
    beta_corner_deg: f64,
    /// Likelihoods of beta for a plane, and for a corner or edge.
    likelihood: TurnLikelihood,
    /// Whether plane and corner are distinguishable from there (25).
    decides: bool,
}

/// Classification of an arc.
struct ArcClass {
    reason: Option<Reason>,
    probabilities: Probabilities,
    second: Option<Reobservation>,
}

impl ArcClass {
    /// Classifies an arc, and marks as taken the arcs of the same element in other scans.
    fn classify(
        at: usize,
        arcs: &[Arc],
        places: &[DVec2],
        taken: &mut [bool],
        extents: &Extents,
        settings: &InterpretSettings,
    ) -> Self {
        let arc = &arcs[at];
        if let Some(reason) = arc.fault() {
            return Self {
                reason: Some(reason),
                probabilities: Probabilities::default(),
                second: None,
            };
        }
        let (mut seconds, mut failure) = (Vec::new(), None);
        for (scan, &place) in places.iter().enumerate().filter(|(scan, _)| *scan != arc.scan) {
            let Some(expected) = ExpectedView::at(arc, place) else { continue };
            match expected.find(arc, scan, arcs, taken, extents, settings) {
                Ok(Some(second)) => seconds.push(second),
                Ok(None) => {}
                Err(reason) => failure = Some(reason),
            }
        }
        for second in &seconds {
            taken[second.arc] = true;
        }
        let hidden_by = arc.hidden_by(arcs, extents.min_range_m);
        let turns = seconds.iter().map(|second| second.likelihood);
        let probabilities = probabilities(&arc.extent_likelihood, hidden_by, turns);
        let second = seconds.iter().copied().max_by(|a, b| {
            (a.decides, a.beta_corner_deg)
                .partial_cmp(&(b.decides, b.beta_corner_deg))
                .unwrap_or(std::cmp::Ordering::Equal)
        });
        let is_reflection = hidden_by > 0 || arc.may_be_repeat();
        let reason = open_reason(&probabilities, is_reflection, second.as_ref(), failure, settings);
        Self { reason, probabilities, second }
    }

    fn feature(
        &self,
        arc: &Arc,
        scans: &[(Uuid, Sweep)],
        extents: &Extents,
        settings: &InterpretSettings,
    ) -> Feature {
        let range_m = arc.region.range_m;
        let (best, confidence) = self.probabilities.best();
        let point = arc.point();
        let second = self.second;
        Feature {
            kind: if self.reason.is_some() { FeatureKind::Unresolved } else { best },
            x_m: point.map(|point| point.x),
            y_m: point.map(|point| point.y),
            bearing_deg: arc.region.bearing_deg(),
            range_m,
            extent_deg: arc.region.extent_deg(),
            beta_deg: second.map(|second| second.beta_deg),
            confidence,
            beams: arc.region.beams,
            reason: self.reason,
            probabilities: self.probabilities,
            extent_plane_corner_deg: range_m.map(|r| extents.plane_corner_deg(r, 1.0)),
            extent_edge_deg: range_m.map(|r| extents.edge_deg(r, settings.sigma_e)),
            boundary_deg: range_m.map(|r| extents.boundary_deg(r, settings.sigma_e)),
            beta_corner_deg: second.map(|second| second.beta_corner_deg),
            next: None,
            scan: scans[arc.scan].0,
            second_scan: second.map(|second| scans[second.scan].0),
        }
    }
}

/// Expected observation of an element from another position.
pub(super) struct ExpectedView {
    /// Ranges of a plane, and of a corner or edge, metres.
    ranges_m: [f64; 2],
    /// Change of direction of a corner or edge, degrees, 0 or more (22a, for any direction of
    /// travel).
    pub(super) beta_corner_deg: f64,
    /// 1 if the direction of a corner turns clockwise, else -1.
    side: f64,
    /// Factor by which an error of the direction from the first position affects that of a corner
    /// from this one.
    gain: f64,
}

impl ExpectedView {
    pub(super) fn at(arc: &Arc, place: DVec2) -> Option<Self> {
        let (range_m, point) = (arc.region.range_m?, arc.point()?);
        let travel = place - arc.from;
        let to_point = point - place;
        let turn_rad = wrap_pi(arc.bearing_rad - to_point.to_angle());
        let plane_m = range_m - travel.dot(DVec2::from_angle(arc.bearing_rad));
        Some(Self {
            ranges_m: [plane_m, to_point.length()],
            beta_corner_deg: turn_rad.abs().to_degrees(),
            side: if turn_rad < 0.0 { -1.0 } else { 1.0 },
            gain: range_m * to_point.dot(DVec2::from_angle(arc.bearing_rad))
                / to_point.length_squared(),
        })
    }

    /// Finds the arc of the same element in another scan. `None` if that scan has no such arc
    /// because the element is out of range there.
    ///
    /// A plane is seen in the same direction from everywhere; corners and edges have a fixed
    /// position (figure 6). Arcs between the two predictions, extended by the possible errors, are
    /// candidates.
    fn find(
        &self,
        arc: &Arc,
        scan: usize,
        arcs: &[Arc],
        taken: &[bool],
        extents: &Extents,
        settings: &InterpretSettings,
    ) -> Result<Option<Reobservation>, Reason> {
        let mut fitting = Vec::new();
        let mut faulty = None;
        for (index, other) in arcs.iter().enumerate().filter(|(_, other)| other.scan == scan) {
            if taken[index] || !self.range_fits(other, settings.depth_tolerance_m) {
                continue;
            }
            let [as_plane, as_corner] = self.errors(
                arc,
                (other.region.gaps_deg, other.border_sigma_deg),
                settings.noise.heading_deg,
            );
            let beta_deg = self.beta_deg(arc, other);
            let corner_deg = self.beta_corner_deg;
            let min_deg = match arc.is_edge() {
                true => corner_deg - as_corner.reach(CERTAIN),
                false => -as_plane.reach(CERTAIN),
            };
            let max_deg = corner_deg + as_corner.reach(CERTAIN);
            if !(min_deg - ROUNDING_DEG..=max_deg + ROUNDING_DEG).contains(&beta_deg) {
                continue;
            }
            match other.fault() {
                Some(reason) => faulty = Some(reason),
                None if other.is_edge() == arc.is_edge() => fitting.push(Reobservation {
                    arc: index,
                    scan,
                    beta_deg,
                    beta_corner_deg: corner_deg,
                    likelihood: [
                        as_plane.density(beta_deg),
                        as_corner.density(beta_deg - corner_deg),
                    ],
                    decides: corner_deg >= apart(&as_plane, &as_corner) - ROUNDING_DEG,
                }),
                None => {}
            }
        }
        match (fitting.as_slice(), faulty) {
            ([second], _) => Ok(Some(*second)),
            ([], Some(reason)) => Err(reason),
            ([], None) if self.is_out_of_reach(extents) => Ok(None),
            ([], None) => Err(Reason::Lost),
            _ => Err(Reason::Ambiguous),
        }
    }

    /// Errors of `beta` for a plane, and for a corner or edge, given the gaps and the standard
    /// deviation of the borders in the second scan.
    ///
    /// The paper's density (23) serves both, since it takes the expected `beta` of a corner as
    /// given. That follows from the measured direction, whose error matters where the second
    /// position is much nearer.
    fn errors(
        &self,
        arc: &Arc,
        (gaps_deg, sigma_deg): ([f64; 2], f64),
        heading_deg: f64,
    ) -> [UniformSum; 2] {
        [1.0, self.gain.abs()].map(|gain| {
            let first_deg = arc.region.gaps_deg.map(|gap| gain * gap);
            let sigmas = [gain * arc.border_sigma_deg, sigma_deg];
            UniformSum::for_beta([first_deg, gaps_deg], sigmas, heading_deg)
        })
    }

    /// Minimum `beta` of a corner that separates it from a plane, if the second position sees the
    /// element as the first did, degrees: (25), and with noise the extension of section IX.
    pub(super) fn min_beta_deg(&self, arc: &Arc, settings: &InterpretSettings) -> f64 {
        let as_before = (arc.region.gaps_deg, arc.border_sigma_deg);
        let [as_plane, as_corner] = self.errors(arc, as_before, settings.noise.heading_deg);
        apart(&as_plane, &as_corner)
    }

    fn range_fits(&self, other: &Arc, tolerance_m: f64) -> bool {
        let [plane_m, point_m] = self.ranges_m;
        let expected = plane_m.min(point_m) - tolerance_m..=plane_m.max(point_m) + tolerance_m;
        other.region.range_m.is_some_and(|range_m| expected.contains(&range_m))
    }

    fn beta_deg(&self, arc: &Arc, other: &Arc) -> f64 {
        self.side * wrap_pi(arc.bearing_rad - other.bearing_rad).to_degrees()
    }

    pub(super) const fn ranges_m(&self) -> [f64; 2] {
        self.ranges_m
    }

    pub(super) fn is_out_of_reach(&self, extents: &Extents) -> bool {
        self.ranges_m.iter().any(|m| !(extents.min_range_m..=extents.max_range_m).contains(m))
    }
}

/// Distance between two values beyond which their errors never overlap.
fn apart(a: &UniformSum, b: &UniformSum) -> f64 {
    a.reach(CERTAIN) + b.reach(CERTAIN)
}

/// Reason why the class stays open, if it does.
fn open_reason(
    probabilities: &Probabilities,
    is_reflection: bool,
    second: Option<&Reobservation>,
    failure: Option<Reason>,
    settings: &InterpretSettings,
) -> Option<Reason> {
    let Probabilities { plane, corner, edge, other } = *probabilities;
    let min_confidence = settings.min_confidence;
    let odd = if is_reflection { Reason::Reflections } else { Reason::Extent };
    if edge >= min_confidence {
        return None;
    }
    match second {
        _ if other > 0.5 => Some(odd),
        _ if second.is_none() && plane + corner < min_confidence * (1.0 - other) => {
            Some(Reason::Extent)
        }
        None => Some(failure.unwrap_or(Reason::SecondPosition)),
        Some(second) if !second.decides => Some(Reason::Translation),
        Some(_) if plane.max(corner) >= min_confidence => None,
        Some(_) if other > 1.0 - min_confidence => Some(odd),
        Some(_) => Some(Reason::Ambiguous),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reason(probabilities: [f64; 4], is_reflection: bool) -> Option<Reason> {
        let [plane, corner, edge, other] = probabilities;
        let probabilities = Probabilities { plane, corner, edge, other };
        open_reason(&probabilities, is_reflection, None, None, &InterpretSettings::default())
    }

    #[test]
    fn open_classes_have_a_reason() {
        // Behind a nearer wall an arc is a multiple reflection; otherwise its extent is odd.
        assert_eq!(reason([0.2, 0.1, 0.0, 0.7], false), Some(Reason::Extent));
        assert_eq!(reason([0.2, 0.1, 0.0, 0.7], true), Some(Reason::Reflections));
        assert_eq!(reason([0.0, 0.0, 0.99, 0.01], true), None);
        // The extent separates an edge from the others; a second position separates the others.
        assert_eq!(reason([0.3, 0.2, 0.5, 0.0], true), Some(Reason::Extent));
        assert_eq!(reason([0.6, 0.39, 0.0, 0.01], false), Some(Reason::SecondPosition));
    }
}
