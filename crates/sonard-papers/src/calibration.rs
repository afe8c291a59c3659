//! Reliability of the probabilities of [`interpret`]: of the arcs that it calls an edge with
//! a probability of 0.9, are nine in ten edges?
//!
//! Made-up rooms are read by the model with the sensor's whole receiver, from a random place, and from
//! the place that the interpretation proposes next. The model knows by which path each sound came, and
//! so what each arc is of.

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
use sonard_interpret::interpret::{Extents, Feature, Probabilities, Settings, Sweep, interpret};

/// How many boxes and partitions the rooms have, one after the other.
const ROOMS: [(usize, usize); 4] = [(0, 0), (3, 0), (0, 1), (2, 2)];

/// How close to a wall a scan is taken, metres.
const CLEARANCE_M: f64 = 0.35;

/// Standard deviation of a range, metres.
const RANGE_SIGMA_M: f64 = 0.002;

/// A sound off two walls that is as long as the way to where they meet, to this, is of that corner,
/// metres.
const CORNER_M: f64 = 0.005;

/// The true cause of an arc.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Truth {
    /// A wall.
    Plane,
    /// A corner seen from inside.
    Corner,
    /// An edge.
    Edge,
    /// Anything else.
    Other,
}

/// An arc: what was said of it, and what it is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Judged {
    /// What was said.
    pub said: Probabilities,
    /// What it is.
    pub truth: Truth,
}

impl Judged {
    /// Each of the four probabilities, and whether it came true.
    fn claims(&self) -> [(f64, bool); 4] {
        let Probabilities { plane, corner, edge, other } = self.said;
        [
            (plane, self.truth == Truth::Plane),
            (corner, self.truth == Truth::Corner),
            (edge, self.truth == Truth::Edge),
            (other, self.truth == Truth::Other),
        ]
    }
}

/// Claims of about one probability.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Bin {
    /// How many.
    pub count: usize,
    /// Mean probability that was claimed.
    pub claimed: f64,
    /// Share that came true.
    pub came_true: f64,
}

/// A reliability diagram's figures.
#[derive(Debug, Clone, PartialEq)]
pub struct Reliability {
    /// Ten bins of equal width.
    pub bins: [Bin; 10],
    /// Expected calibration error: the mean distance of claim and share over all claims (Naeini,
    /// Cooper and Hauskrecht, AAAI 2015).
    pub expected_error: f64,
    /// Mean squared distance of a claim from what is (Brier), 0 to 1.
    pub brier: f64,
}

impl Reliability {
    /// Over every claim about every arc.
    #[must_use]
    pub fn of(judged: &[Judged]) -> Self {
        let mut bins = [Bin::default(); 10];
        let mut brier = 0.0;
        for (claimed, came_true) in judged.iter().flat_map(Judged::claims) {
            let truth = f64::from(u8::from(came_true));
            let bin = &mut bins[((10.0 * claimed) as usize).min(9)];
            bin.count += 1;
            bin.claimed += claimed;
            bin.came_true += truth;
            brier += (claimed - truth).powi(2);
        }
        let all = (4 * judged.len()).max(1) as f64;
        let mut expected_error = 0.0;
        for bin in bins.iter_mut().filter(|bin| bin.count > 0) {
            expected_error += (bin.claimed - bin.came_true).abs() / all;
            bin.claimed /= bin.count as f64;
            bin.came_true /= bin.count as f64;
        }
        Self { bins, expected_error, brier: brier / all }
    }
}

/// Interprets one made-up room, number `number` of those of a seed, as `sensor` reads it from one place
/// and, where a next one is proposed within the room, from that as well. Arcs by which nothing can be
/// told (covered, cut off, too near) are left out, and so are rooms with more paths than the model can find.
///
/// # Panics
/// Never: with a sensor whose data make no sense there is just nothing to judge.
#[must_use]
pub fn judge_room(seed: u64, number: u64, sensor: &Sensor, settings: &Settings) -> Vec<Judged> {
    let mut rng = Pcg64::seed_from_u64(seed.wrapping_mul(1_000_003) ^ number);
    let (boxes, partitions) = ROOMS[number as usize % ROOMS.len()];
    let scene = random_room("room", boxes, partitions, &mut rng);
    let place = wander(&scene, &mut rng);
    let (sensor, air) = (sensor.clone(), Air::default());
    let Ok(extents) = Extents::new(&sensor, &air, false) else { return Vec::new() };
    let Ok(simulator) = Simulator::new(Arc::new(scene), sensor, air, Options::default()) else {
        return Vec::new();
    };
    let Ok(scan) = take(&simulator, place, 1, &mut rng) else { return Vec::new() };
    let mut scans = vec![scan];
    let mut found = features(&scans, &extents, settings);
    let next = found.iter().find_map(|feature| feature.next).map(|n| DVec2::new(n.x_m, n.y_m));
    if let Some(next) = next.filter(|next| is_way(simulator.scene(), place, *next)) {
        let Ok(scan) = take(&simulator, next, 2, &mut rng) else { return Vec::new() };
        scans.push(scan);
        found = features(&scans, &extents, settings);
    }
    let truth = |feature: &Feature| {
        let scan = scans.iter().find(|scan| scan.scan == feature.scan)?;
        let truth = truth(feature, scan, simulator.scene())?;
        Some(Judged { said: feature.probabilities, truth })
    };
    let told = |feature: &&Feature| feature.probabilities != Probabilities::default();
    found.iter().filter(told).filter_map(truth).collect()
}

/// A place in the room: some strides from where it is known that nothing stands.
fn wander(scene: &Scene, rng: &mut impl Rng) -> DVec2 {
    let mut at = scene.poses.get("start").map_or(DVec2::ZERO, Pose::position);
    for _ in 0..20 {
        let stride = rng.random_range(0.3..3.0) * DVec2::from_angle(rng.random_range(0.0..TAU));
        if is_way(scene, at, at + stride) {
            at += stride;
        }
    }
    at
}

/// Whether a robot can go straight from one place to another and stand there.
fn is_way(scene: &Scene, from: DVec2, to: DVec2) -> bool {
    let crosses = |a: DVec2, b: DVec2| {
        let apart = |p: DVec2, q: DVec2, r: DVec2, s: DVec2| {
            (q - p).perp_dot(r - p) * (q - p).perp_dot(s - p) <= 0.0
        };
        apart(a, b, from, to) && apart(from, to, a, b)
    };
    scene.clearance_m(to) >= CLEARANCE_M && !scene.walls.iter().any(|wall| crosses(wall.a, wall.b))
}

fn take(
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

fn features(scans: &[ScanView], extents: &Extents, settings: &Settings) -> Vec<Feature> {
    let sweeps: Vec<_> =
        scans.iter().filter_map(|scan| Some((scan.scan, Sweep::of(scan).ok()?))).collect();
    interpret(&sweeps, extents, settings)
}

/// What most of an arc's echoes are of.
fn truth(feature: &Feature, scan: &ScanView, scene: &Scene) -> Option<Truth> {
    let [first, last] = feature.beams;
    let within = |index: u32| match first <= last {
        true => (first..=last).contains(&index),
        false => index >= first || index <= last,
    };
    let from = scan.start.as_ref()?.pose.position();
    let mut votes = [0_usize; 4];
    for ping in scan.pings.iter().filter(|ping| within(ping.index)) {
        if ping.status == PingStatus::Echo {
            votes[of_ping(ping, scene, from) as usize] += 1;
        }
    }
    [Truth::Plane, Truth::Corner, Truth::Edge, Truth::Other]
        .into_iter()
        .max_by_key(|truth| votes[*truth as usize])
}

fn of_ping(ping: &Ping, scene: &Scene, from: DVec2) -> Truth {
    let Some(path) = &ping.path else { return Truth::Other };
    let to_corner = || {
        let ends = scene.walls.iter().flat_map(|wall| [wall.a, wall.b]);
        ends.into_iter().any(|end| (end.distance(from) - path.length_m / 2.0).abs() < CORNER_M)
    };
    match (path.kind, path.order) {
        (PathKind::Specular, 1) => Truth::Plane,
        (PathKind::Diffracted, 0) => Truth::Edge,
        (PathKind::Specular, 2) if to_corner() => Truth::Corner,
        _ => Truth::Other,
    }
}

#[cfg(test)]
mod tests;
