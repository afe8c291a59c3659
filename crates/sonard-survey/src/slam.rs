//! Poses and virtual features from arcs (SLAM), without knowledge of the room.

use nalgebra::DMatrix;
use rayon::prelude::*;
use sonard_model::geometry::{DVec2, Pose, wrap_180, wrap_pi};

use crate::{
    arc::{Arc, blurred},
    bundle::{Bundle, SIGMA_M, SupportedFeature, fit_feature},
    feature::{FeatureKind, VirtualFeature},
    odometry::{Move, in_frame_of_first},
};

/// Maximum difference of an arc's range from that of its feature, metres, while poses are rough
/// and in the end.
const GATE_M: [f64; 2] = [0.03, 0.015];
/// Maximum difference of directions, degrees; more for a cut arc.
const GATE_DEG: f64 = 5.0;
const CUT_GATE: f64 = 1.8;
/// Standard deviations by the step between beams that the difference of directions includes.
const GATE_STEPS: f64 = 2.5;
/// Evidence of an arc that a feature explains, compared with chance, nats.
const EVIDENCE: f64 = 9.0;
/// Reach of the search for the next pose, standard deviations of odometry.
const SPAN_SIGMAS: f64 = 2.5;

/// Poses, features and covariance of a course.
#[derive(Debug, Clone)]
pub(crate) struct VirtualMap<'a> {
    /// Poses in the frame of the first.
    pub(crate) poses: Vec<Pose>,
    /// Features that several places support, each arc at the one that explains it better.
    pub(crate) features: Vec<SupportedFeature<'a>>,
    /// Covariance of all poses but the first: x and y in metres, heading in radians.
    pub(crate) covariance: Option<DMatrix<f64>>,
}

/// Estimates the poses of a course from its arcs, sweep by sweep, with odometry as prior.
///
/// Each arc suggests a line and a point. The next sweep is located where its arcs agree with the
/// features so far; then poses and all features are estimated together.
pub(crate) fn virtual_map<'a>(arcs: &'a [Vec<Arc>], start: Pose, moves: &[Move]) -> VirtualMap<'a> {
    let mut poses = vec![start];
    let mut features = Vec::new();
    let Some(first) = arcs.first() else {
        return VirtualMap { poses: Vec::new(), features, covariance: None };
    };
    features.extend(first.iter().flat_map(|arc| suggested(arc, &start)));
    for at in 0..arcs.len() - 1 {
        let next = &arcs[at + 1];
        poses.push(match moves.get(at) {
            Some(step) => {
                let spans = [SPAN_SIGMAS * step.sigma_m + 0.01, SPAN_SIGMAS * step.sigma_deg + 1.0];
                search_pose(&features, next, &step.from(&poses[at]), spans).0
            }
            None => search_everywhere(&features, next, &poses[at]),
        });
        let known: Vec<&Arc> = arcs[..at + 2].iter().flatten().collect();
        features = associate(&features, &known, &poses, GATE_M[0]);
        let mut owned = owned(&mut features, &poses);
        Bundle { poses: &mut poses, features: &mut owned, moves }.solve();
        features.iter_mut().for_each(|of| {
            fit_feature(of, &poses);
        });
    }
    let all: Vec<&Arc> = arcs.iter().flatten().collect();
    let (mut kept, mut covariance) = (Vec::new(), None);
    for _ in 0..3 {
        features = associate(&features, &all, &poses, GATE_M[1]);
        kept = owned(&mut features, &poses);
        covariance = Bundle { poses: &mut poses, features: &mut kept, moves }.solve();
        features.iter_mut().for_each(|of| {
            fit_feature(of, &poses);
        });
    }
    VirtualMap { poses, features: kept, covariance }
}

/// Estimates the poses of a course as [`virtual_map`], with the sweeps located in another order, the
/// first of which begins the map; the frame remains the pose of sweep 0. `moves` are those between
/// consecutive sweeps of the order, `own_moves` those of the course.
pub(crate) fn virtual_map_in_order<'a>(
    arcs: &'a [Vec<Arc>],
    start: Pose,
    order: &[usize],
    (moves, own_moves): (&[Move], &[Move]),
) -> VirtualMap<'a> {
    let renamed = |(sweep, &of): (usize, &usize)| {
        arcs[of].iter().map(|arc| Arc { sweep, ..arc.clone() }).collect()
    };
    let ordered: Vec<Vec<Arc>> = order.iter().enumerate().map(renamed).collect();
    let mut poses = vec![start; order.len()];
    for (pose, &of) in virtual_map(&ordered, start, moves).poses.into_iter().zip(order) {
        poses[of] = pose;
    }
    let poses = in_frame_of_first(&poses, &start);
    map_of_poses(arcs, poses, own_moves)
}

/// Orders in which the sweeps of a course are located if its own fails: backwards; without
/// odometry also from sweeps within it, alternately to both sides.
pub(crate) fn orders(count: usize, is_odometry_used: bool) -> Vec<Vec<usize>> {
    let mut found = vec![(0..count).rev().collect()];
    if !is_odometry_used {
        for first in [count / 2, count / 4, 3 * count / 4] {
            let mut order: Vec<usize> = (0..count).collect();
            order.sort_by_key(|at| (at.abs_diff(first), *at));
            found.push(order);
        }
    }
    found
}

/// Returns `true` if all poses of two courses are near each other.
pub(crate) fn are_same_course(a: &[Pose], b: &[Pose]) -> bool {
    const NEAR_M: f64 = 0.03;
    const NEAR_DEG: f64 = 2.0;
    let is_same = |(a, b): (&Pose, &Pose)| {
        a.position().distance(b.position()) < NEAR_M
            && wrap_180(a.heading_deg - b.heading_deg).abs() < NEAR_DEG
    };
    a.iter().zip(b).all(is_same)
}

/// Features of a course from rough poses, which are estimated together with them.
pub(crate) fn map_of_poses<'a>(
    arcs: &'a [Vec<Arc>],
    mut poses: Vec<Pose>,
    moves: &[Move],
) -> VirtualMap<'a> {
    let (mut features, mut covariance) = (Vec::new(), None);
    for _ in 0..3 {
        features = reassociated(&features, arcs, &poses);
        covariance = Bundle { poses: &mut poses, features: &mut features, moves }.solve();
    }
    VirtualMap { poses, features, covariance }
}

fn suggested<'a>(arc: &'a Arc, pose: &Pose) -> [SupportedFeature<'a>; 2] {
    VirtualFeature::of_arc(arc, pose).map(|feature| SupportedFeature { feature, arcs: vec![arc] })
}

/// Assigns all arcs to features for changed poses.
pub(crate) fn reassociated<'a>(
    features: &[SupportedFeature<'a>],
    arcs: &'a [Vec<Arc>],
    poses: &[Pose],
) -> Vec<SupportedFeature<'a>> {
    let all: Vec<&Arc> = arcs.iter().flatten().collect();
    owned(&mut associate(features, &all, poses, GATE_M[1]), poses)
}

/// Assigns each arc to the best feature of each kind, and begins new features with the others.
fn associate<'a>(
    features: &[SupportedFeature<'a>],
    arcs: &[&'a Arc],
    poses: &[Pose],
    gate_m: f64,
) -> Vec<SupportedFeature<'a>> {
    let mut found: Vec<SupportedFeature> = features
        .iter()
        .map(|of| SupportedFeature { feature: of.feature, arcs: Vec::new() })
        .collect();
    let mut order = arcs.to_vec();
    order.sort_by(|a, b| a.sweep.cmp(&b.sweep).then(b.beams.len().cmp(&a.beams.len())));
    for arc in order {
        let pose = &poses[arc.sweep];
        for (suggestion, kind) in
            suggested(arc, pose).into_iter().zip([FeatureKind::Line, FeatureKind::Point])
        {
            let best = found
                .iter()
                .enumerate()
                .filter(|(_, of)| of.feature.kind() == kind)
                .filter(|(_, of)| of.arcs.iter().all(|other| other.sweep != arc.sweep))
                .filter_map(|(at, of)| Some((at, mismatch(&of.feature, arc, pose, gate_m)?)))
                .min_by(|a, b| a.1.total_cmp(&b.1));
            match best {
                Some((at, _)) => found[at].arcs.push(arc),
                None => found.push(suggestion),
            }
        }
    }
    found.retain(|of| !of.arcs.is_empty());
    found
}

/// Squared distance of an arc from a feature, in standard deviations; `None` outside the gate.
fn mismatch(feature: &VirtualFeature, arc: &Arc, pose: &Pose, gate_m: f64) -> Option<f64> {
    let (range_m, bearing_rad) = feature.predict(arc.place(pose));
    let off_m = (range_m - arc.range_m).abs();
    let off_deg = wrap_pi(pose.direction_rad(arc.azimuth_deg) - bearing_rad).to_degrees().abs();
    let gate_m = arc.errors.gate_m(gate_m);
    let gate_deg = if arc.is_cut { CUT_GATE * GATE_DEG } else { GATE_DEG };
    let gate_deg = arc.errors.bearing_factor() * blurred(gate_deg, GATE_STEPS * arc.step_deg);
    let is_near = off_m < gate_m && off_deg < gate_deg;
    is_near.then(|| {
        (off_m / arc.errors.sigma_m(SIGMA_M)).powi(2) + (off_deg / arc.sigma_deg()).powi(2)
    })
}

/// Fits all features and returns those that keep two or more arcs after each arc went to the
/// feature that has more evidence.
fn owned<'a>(features: &mut [SupportedFeature<'a>], poses: &[Pose]) -> Vec<SupportedFeature<'a>> {
    let scores: Vec<f64> = features
        .iter_mut()
        .map(|of| EVIDENCE * of.arcs.len() as f64 - 2.0 * fit_feature(of, poses))
        .collect();
    let mut order: Vec<usize> = (0..features.len()).collect();
    order.sort_by(|a, b| scores[*b].total_cmp(&scores[*a]));
    let mut taken: Vec<*const Arc> = Vec::new();
    let mut kept = Vec::new();
    for at in order {
        let of = &features[at];
        let mut arcs = of.arcs.clone();
        arcs.retain(|arc| !taken.contains(&std::ptr::from_ref::<Arc>(arc)));
        taken.extend(arcs.iter().map(|arc| std::ptr::from_ref::<Arc>(arc)));
        if arcs.len() >= 2 {
            kept.push(SupportedFeature { feature: of.feature, arcs });
        }
    }
    kept
}

/// Number of steps of the grid over position and heading, by level.
const GRID: [(usize, usize); 3] = [(15, 17), (11, 11), (11, 11)];
/// Part of the spans, of position and heading, and range error in metres, by level.
const LEVELS: [(f64, f64, f64); 3] = [(1.0, 1.0, 0.02), (0.35, 0.3, 0.012), (0.12, 0.12, 0.006)];

/// Pose near a guess, within spans in metres and degrees, at which arcs agree best with features.
fn search_pose(
    features: &[SupportedFeature],
    arcs: &[Arc],
    guess: &Pose,
    [span_m, span_deg]: [f64; 2],
) -> (Pose, f64) {
    let (mut best, mut score) = (*guess, 0.0);
    if features.is_empty() || arcs.is_empty() {
        return (best, score);
    }
    for ((places, headings), (of_m, of_deg, sigma_m)) in GRID.into_iter().zip(LEVELS) {
        let offset = |at: usize, count: usize, span: f64| {
            span * (2.0 * at as f64 / (count - 1) as f64 - 1.0)
        };
        let center = best;
        let pose = |at: usize| {
            let (x, y, turn) = (at % places, at / places % places, at / (places * places));
            Pose {
                x_m: center.x_m + offset(x, places, of_m * span_m),
                y_m: center.y_m + offset(y, places, of_m * span_m),
                heading_deg: wrap_180(
                    center.heading_deg + offset(turn, headings, of_deg * span_deg),
                ),
            }
        };
        let scores: Vec<f64> = (0..places * places * headings)
            .into_par_iter()
            .map(|at| agreement(features, arcs, &pose(at), sigma_m))
            .collect();
        let found = (0..scores.len()).max_by(|a, b| scores[*a].total_cmp(&scores[*b]));
        (best, score) = found.map_or((best, score), |at| (pose(at), scores[at]));
    }
    (best, score)
}

/// Pose in any direction near a place at which arcs agree best with features, without odometry: a
/// grid of positions and headings, whose best places are searched finely.
fn search_everywhere(features: &[SupportedFeature], arcs: &[Arc], near: &Pose) -> Pose {
    /// Half width of the region, metres.
    const SPAN_M: f64 = 1.5;
    const STEP_M: f64 = 0.1;
    const STEP_DEG: f64 = 3.0;
    /// Range error in the grid, metres: half the diagonal of a cell.
    const SIGMA_M: f64 = 0.05;
    const FINE: usize = 24;
    let places = (2.0 * SPAN_M / STEP_M) as usize + 1;
    let headings = (360.0 / STEP_DEG) as usize;
    let pose = |at: usize| Pose {
        x_m: near.x_m - SPAN_M + STEP_M * (at % places) as f64,
        y_m: near.y_m - SPAN_M + STEP_M * (at / places % places) as f64,
        heading_deg: wrap_180(STEP_DEG * (at / (places * places)) as f64),
    };
    let scores: Vec<f64> = (0..places * places * headings)
        .into_par_iter()
        .map(|at| agreement(features, arcs, &pose(at), SIGMA_M))
        .collect();
    let mut order: Vec<usize> = (0..scores.len()).collect();
    order.sort_by(|a, b| scores[*b].total_cmp(&scores[*a]).then(a.cmp(b)));
    let mut tried: Vec<Pose> = Vec::new();
    let is_apart = |a: &Pose, b: &Pose| {
        a.position().distance(b.position()) > 1.5 * STEP_M
            || wrap_180(a.heading_deg - b.heading_deg).abs() > 2.5 * STEP_DEG
    };
    for at in order {
        let pose = pose(at);
        if tried.iter().all(|known| is_apart(known, &pose)) {
            tried.push(pose);
        }
        if tried.len() >= FINE {
            break;
        }
    }
    let fine = |pose: &Pose| search_pose(features, arcs, pose, [0.8 * STEP_M, STEP_DEG]);
    let found = tried.iter().map(fine).max_by(|a, b| a.1.total_cmp(&b.1));
    found.map_or(*near, |(pose, _)| pose)
}

/// Sum over arcs of the agreement with the best feature, 0 to 1 each, weighted by their beams and
/// by the support of the feature.
fn agreement(features: &[SupportedFeature], arcs: &[Arc], pose: &Pose, sigma_m: f64) -> f64 {
    /// Squared deviations beyond this are not evaluated.
    const FAR: f64 = 20.0;
    let predictions: Vec<(f64, f64, f64)> = features
        .iter()
        .map(|of| {
            let (range_m, bearing_rad) = of.feature.predict(pose.position());
            (range_m, bearing_rad, (of.arcs.len().min(4) as f64).sqrt())
        })
        .collect();
    let of_arc = |arc: &Arc| {
        let direction_rad = pose.direction_rad(arc.azimuth_deg);
        let sigma_rad = 1.5 * arc.sigma_deg().max(1.2).to_radians();
        let face = arc.face_of(pose);
        let best = predictions.iter().filter_map(|&(range_m, bearing_rad, weight)| {
            // To the first order of the transducer's offset from the axis.
            let range_m = match face == DVec2::ZERO {
                true => range_m,
                false => range_m - face.dot(DVec2::from_angle(bearing_rad)),
            };
            let off_m = ((range_m - arc.range_m) / sigma_m).powi(2);
            if off_m > FAR {
                return None;
            }
            let off_rad = (wrap_pi(direction_rad - bearing_rad) / sigma_rad).powi(2);
            (off_rad < FAR).then(|| weight * (-0.5 * (off_m + off_rad)).exp())
        });
        best.fold(0.0, f64::max) * (arc.beams.len().min(30) as f64).sqrt()
    };
    arcs.iter().map(of_arc).sum()
}
