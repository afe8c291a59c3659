//! Calibration of the probabilities of [`interpret`].
//!
//! Probabilities are calibrated if nine in ten of the arcs classified as an edge with probability
//! 0.9 are edges. The model simulates scans of random rooms with the sensor's complete receiver,
//! from a random position and from the next position that the interpretation proposes. The path of
//! each predicted echo gives the true cause of each arc.

use std::{f64::consts::TAU, sync::Arc};

use jiff::Timestamp;
use rand::{Rng, RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use sonard_model::{
    acoustics::{Air, Sensor},
    geometry::{DVec2, Pose},
    model::{Options, Simulator, TooCostly},
    scene::Scene,
};
use sonard_records::{PathKind, Ping, PingStatus, ScanPlan, ScanView};
use uuid::Uuid;

use crate::trial::random_room;
use sonard_interpret::interpret::{
    Extents, Feature, InterpretSettings, Probabilities, Sweep, interpret,
};

/// Boxes and partitions of successive rooms.
const ROOMS: [(usize, usize); 4] = [(0, 0), (3, 0), (0, 1), (2, 2)];

/// Minimum distance of a scan position from walls, metres: less than the sensor's minimum range, as
/// on a small robot.
const CLEARANCE_M: f64 = 0.08;

/// Standard deviation of a range, metres.
const RANGE_SIGMA_M: f64 = 0.002;

/// Tolerance of the path length by which a second-order reflection is attributed to a corner,
/// metres.
const CORNER_M: f64 = 0.005;

/// True cause of an arc.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ArcCause {
    /// Reflection from a wall.
    Plane,
    /// Reflection from a concave corner.
    Corner,
    /// Diffraction at a convex edge.
    Edge,
    /// Any other path, or no path.
    Other,
}

/// Arc with its class probabilities and its true cause.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClassifiedArc {
    /// Class probabilities that the interpretation assigned.
    pub probabilities: Probabilities,
    /// True cause from the predicted paths.
    pub truth: ArcCause,
}

impl ClassifiedArc {
    /// Predicted probability of each class, and its occurrence.
    fn claims(&self) -> [(f64, bool); 4] {
        let Probabilities { plane, corner, edge, other } = self.probabilities;
        [
            (plane, self.truth == ArcCause::Plane),
            (corner, self.truth == ArcCause::Corner),
            (edge, self.truth == ArcCause::Edge),
            (other, self.truth == ArcCause::Other),
        ]
    }
}

/// Predictions whose probabilities lie in one interval.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ReliabilityBin {
    /// Number of predictions in the bin.
    pub count: usize,
    /// Mean predicted probability in the bin.
    pub mean_predicted: f64,
    /// Observed frequency of the predicted classes.
    pub observed: f64,
}

/// Statistics of a reliability diagram.
#[derive(Debug, Clone, PartialEq)]
pub struct Reliability {
    /// Ten bins of width 0.1 in the predicted probability.
    pub bins: [ReliabilityBin; 10],
    /// Expected calibration error: mean absolute difference of mean predicted probability and
    /// observed frequency, weighted by the bins' counts (Naeini, Cooper and Hauskrecht, AAAI 2015).
    pub expected_error: f64,
    /// Brier score: mean squared difference of predicted probability and outcome, 0 to 1.
    pub brier: f64,
}

impl Reliability {
    /// Statistics of all four class probabilities of all arcs.
    #[must_use]
    pub fn from_arcs(arcs: &[ClassifiedArc]) -> Self {
        let mut bins = [ReliabilityBin::default(); 10];
        let mut brier = 0.0;
        for (claimed, came_true) in arcs.iter().flat_map(ClassifiedArc::claims) {
            let truth = f64::from(u8::from(came_true));
            let bin = &mut bins[((10.0 * claimed) as usize).min(9)];
            bin.count += 1;
            bin.mean_predicted += claimed;
            bin.observed += truth;
            brier += (claimed - truth).powi(2);
        }
        let all = (4 * arcs.len()).max(1) as f64;
        let mut expected_error = 0.0;
        for bin in bins.iter_mut().filter(|bin| bin.count > 0) {
            expected_error += (bin.mean_predicted - bin.observed).abs() / all;
            bin.mean_predicted /= bin.count as f64;
            bin.observed /= bin.count as f64;
        }
        Self { bins, expected_error, brier: brier / all }
    }
}

/// Classifies the arcs of one random room and pairs them with their true causes.
///
/// The room is number `number` of those of a seed. `sensor` scans it from a random position and, if
/// the interpretation proposes a next position within the room, from there too. Arcs without class
/// probabilities (masked, truncated, too close) are omitted. The result is empty for an invalid
/// sensor and for a room with more paths than the model can find.
#[must_use]
pub fn classify_room(
    seed: u64,
    number: u64,
    sensor: &Sensor,
    settings: &InterpretSettings,
) -> Vec<ClassifiedArc> {
    let mut rng = Pcg64::seed_from_u64(seed.wrapping_mul(1_000_003) ^ number);
    let (boxes, partitions) = ROOMS[number as usize % ROOMS.len()];
    let scene = random_room("room", boxes, partitions, &mut rng);
    let place = wander(&scene, &mut rng);
    let (sensor, air) = (sensor.clone(), Air::default());
    let Ok(extents) = Extents::new(&sensor, &air, false) else { return Vec::new() };
    let Ok(simulator) = Simulator::new(Arc::new(scene), sensor, air, Options::default()) else {
        return Vec::new();
    };
    let Ok(scan) = simulate_scan(&simulator, place, 1, &mut rng) else { return Vec::new() };
    let mut scans = vec![scan];
    let mut found = features(&scans, &extents, settings);
    let next = found.iter().find_map(|feature| feature.next).map(|n| DVec2::new(n.x_m, n.y_m));
    if let Some(next) = next.filter(|next| is_free_segment(simulator.scene(), place, *next)) {
        let Ok(scan) = simulate_scan(&simulator, next, 2, &mut rng) else { return Vec::new() };
        scans.push(scan);
        found = features(&scans, &extents, settings);
    }
    let truth = |feature: &Feature| {
        let scan = scans.iter().find(|scan| scan.scan == feature.scan)?;
        let truth = truth(feature, scan, simulator.scene())?;
        Some(ClassifiedArc { probabilities: feature.probabilities, truth })
    };
    let is_classified = |feature: &&Feature| feature.probabilities != Probabilities::default();
    found.iter().filter(is_classified).filter_map(truth).collect()
}

/// Position in the room after a random walk from its free start pose.
fn wander(scene: &Scene, rng: &mut impl Rng) -> DVec2 {
    let mut at = scene.poses.get("start").map_or(DVec2::ZERO, Pose::position);
    for _ in 0..20 {
        let stride = rng.random_range(0.3..3.0) * DVec2::from_angle(rng.random_range(0.0..TAU));
        if is_free_segment(scene, at, at + stride) {
            at += stride;
        }
    }
    at
}

/// Checks that the straight segment crosses no wall and ends at [`CLEARANCE_M`] from all of them.
fn is_free_segment(scene: &Scene, from: DVec2, to: DVec2) -> bool {
    let crosses = |a: DVec2, b: DVec2| {
        let separates = |p: DVec2, q: DVec2, r: DVec2, s: DVec2| {
            (q - p).perp_dot(r - p) * (q - p).perp_dot(s - p) <= 0.0
        };
        separates(a, b, from, to) && separates(from, to, a, b)
    };
    scene.clearance_m(to) >= CLEARANCE_M && !scene.walls.iter().any(|wall| crosses(wall.a, wall.b))
}

fn simulate_scan(
    simulator: &Simulator,
    at: DVec2,
    number: u128,
    rng: &mut impl Rng,
) -> Result<ScanView, TooCostly> {
    let pose = Pose { x_m: at.x, y_m: at.y, heading_deg: rng.random_range(0.0..360.0) };
    let (id, plan) = (Uuid::from_u128(number), ScanPlan::default());
    let mut scan = ScanView::simulated(simulator, id, &pose, &plan, Timestamp::UNIX_EPOCH)?;
    for ping in &mut scan.pings {
        let unit: f64 = StandardNormal.sample(rng);
        ping.range_m = ping.range_m.map(|range_m| range_m + RANGE_SIGMA_M * unit);
    }
    Ok(scan)
}

fn features(scans: &[ScanView], extents: &Extents, settings: &InterpretSettings) -> Vec<Feature> {
    let sweeps: Vec<_> =
        scans.iter().filter_map(|scan| Some((scan.scan, Sweep::from_scan(scan).ok()?))).collect();
    interpret(&sweeps, extents, settings)
}

/// Most frequent cause of the echoes of an arc.
fn truth(feature: &Feature, scan: &ScanView, scene: &Scene) -> Option<ArcCause> {
    let [first, last] = feature.beams;
    let within = |index: u32| match first <= last {
        true => (first..=last).contains(&index),
        false => index >= first || index <= last,
    };
    let from = scan.start.as_ref()?.pose.position();
    let mut votes = [0_usize; 4];
    for ping in scan.pings.iter().filter(|ping| within(ping.index)) {
        if ping.status == PingStatus::Echo {
            votes[ping_truth(ping, scene, from) as usize] += 1;
        }
    }
    [ArcCause::Plane, ArcCause::Corner, ArcCause::Edge, ArcCause::Other]
        .into_iter()
        .max_by_key(|truth| votes[*truth as usize])
}

fn ping_truth(ping: &Ping, scene: &Scene, from: DVec2) -> ArcCause {
    let Some(path) = &ping.path else { return ArcCause::Other };
    let to_corner = || {
        let ends = scene.walls.iter().flat_map(|wall| [wall.a, wall.b]);
        ends.into_iter().any(|end| (end.distance(from) - path.length_m / 2.0).abs() < CORNER_M)
    };
    match (path.kind, path.order) {
        (PathKind::Specular, 1) => ArcCause::Plane,
        (PathKind::Diffracted, 0) => ArcCause::Edge,
        (PathKind::Specular, 2) if to_corner() => ArcCause::Corner,
        _ => ArcCause::Other,
    }
}

#[cfg(test)]
mod tests;
