//! Random worlds of planes, corners and edges.

use std::{collections::BTreeMap, f64::consts::FRAC_PI_2, sync::Arc};

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::{features, scan, simulator};
use crate::interpret::{Extents, Feature, FeatureKind, InterpretSettings};
use sonard_model::{
    geometry::{DVec2, Pose, wrap_pi},
    model::Simulator,
    scene::{DEFAULT_SNAP_M, Material, Scene, Wall},
};
use sonard_records::{PathKind, PingStatus, ScanView};

/// Number of worlds in the paper's claim.
const WORLDS: usize = 1000;

/// Maximum range of edges with the model's `sigma_E`, metres (7).
const EDGE_RANGE_M: f64 = 1.14;

/// Twice the half beam angle, degrees: elements farther apart do not interfere (28).
const APART_DEG: f64 = 23.6;

/// Element of a world.
#[derive(Debug, Clone)]
struct Element {
    kind: FeatureKind,
    /// Foot of the perpendicular, apex or end.
    point: DVec2,
    /// Direction of a plane.
    along: DVec2,
    /// Extent of a plane on both sides of `point`, metres.
    reach_m: [f64; 2],
}

impl Element {
    fn at_point(kind: FeatureKind, point: DVec2) -> Self {
        Self { kind, point, along: DVec2::X, reach_m: [0.0; 2] }
    }

    /// Origin of its echo as received at `place`; `None` without an echo there.
    fn echo_point(&self, place: DVec2, half_width_m: f64) -> Option<DVec2> {
        if self.kind != FeatureKind::Plane {
            return Some(self.point);
        }
        let shift_m = (place - self.point).dot(self.along);
        let [back_m, ahead_m] = self.reach_m;
        (half_width_m - back_m..=ahead_m - half_width_m)
            .contains(&shift_m)
            .then_some(self.point + shift_m * self.along)
    }
}

/// Walls with the elements that they form.
#[derive(Debug, Default)]
struct World {
    walls: Vec<(DVec2, DVec2)>,
    elements: Vec<Element>,
}

impl World {
    /// Three elements in the thirds of a turn around the origin.
    fn random(rng: &mut Pcg64) -> Self {
        let mut world = Self::default();
        let turn = rng.random_range(0.0..360.0_f64);
        for third in 0..3 {
            let jitter = rng.random_range(-12.0..12.0);
            let bearing = (turn + 120.0 * f64::from(third) + jitter).to_radians();
            match rng.random_range(0..3) {
                0 => world.add_plane(rng, bearing),
                1 => world.add_corner(rng, bearing),
                _ => world.add_edge(rng, bearing),
            }
        }
        world
    }

    fn add_plane(&mut self, rng: &mut Pcg64, bearing: f64) {
        let range_m = rng.random_range(0.3..1.9);
        let ahead = DVec2::from_angle(bearing);
        let (foot, along) = (range_m * ahead, ahead.perp());
        // At least (27) for the longest translation that may be proposed.
        let least_m = 0.13 * range_m + 0.034;
        let reach_m = [0; 2].map(|_| rng.random_range(1.0..2.0) * least_m);
        let ends = [foot - reach_m[0] * along, foot + reach_m[1] * along];
        self.walls.push((ends[0], ends[1]));
        self.elements.push(Element { kind: FeatureKind::Plane, point: foot, along, reach_m });
        self.elements.extend(ends.map(|end| Element::at_point(FeatureKind::Edge, end)));
    }

    fn add_corner(&mut self, rng: &mut Pcg64, bearing: f64) {
        let range_m = rng.random_range(1.45..1.95);
        // Angle between the direction to the corner and a side: (28).
        let alpha = rng.random_range(24.0..66.0_f64).to_radians();
        let apex = range_m * DVec2::from_angle(bearing);
        let back = (-apex).normalize();
        let sides = [DVec2::from_angle(alpha), DVec2::from_angle(alpha - FRAC_PI_2)];
        for side in sides {
            // At least (26) and (28), but too short for the ends to be detected.
            let end = apex + rng.random_range(0.06..0.25) * back.rotate(side);
            self.walls.push((apex, end));
            self.elements.push(Element::at_point(FeatureKind::Edge, end));
        }
        self.elements.push(Element::at_point(FeatureKind::Corner, apex));
    }

    fn add_edge(&mut self, rng: &mut Pcg64, bearing: f64) {
        let range_m = rng.random_range(0.3..1.0);
        let apex = range_m * DVec2::from_angle(bearing);
        let ahead = apex.normalize();
        let tilt = rng.random_range(-15.0..15.0_f64).to_radians();
        let quarter = FRAC_PI_2 / 2.0;
        for side in [tilt + quarter, tilt - quarter] {
            let length_m = rng.random_range(1.0..1.2) * (1.25 - range_m) / side.cos();
            let end = apex + length_m * ahead.rotate(DVec2::from_angle(side));
            self.walls.push((apex, end));
            self.elements.push(Element::at_point(FeatureKind::Edge, end));
        }
        self.elements.push(Element::at_point(FeatureKind::Edge, apex));
    }

    fn simulator(&self) -> Simulator {
        let material = Material::smooth(0.98);
        let wall = |(i, &(a, b)): (usize, &(DVec2, DVec2))| Wall {
            id: format!("wall-{i}").into(),
            a,
            b,
            material,
            z_m: None,
        };
        simulator(Arc::new(Scene {
            name: "random".into(),
            source: None,
            approximate: Vec::new(),
            materials: BTreeMap::new(),
            walls: self.walls.iter().enumerate().map(wall).collect(),
            cylinders: Vec::new(),
            floor_z_m: None,
            ceiling_z_m: None,
            floor_material: Material::RIGID,
            ceiling_material: Material::RIGID,
            snap_m: DEFAULT_SNAP_M,
            poses: BTreeMap::new(),
            robot: None,
            sha256: String::new(),
            text: "".into(),
        }))
    }

    /// Elements visible from a position; `None` if elements interfere there.
    ///
    /// Elements whose arc lies within that of a nearer one are invisible. All others must be
    /// 2 theta_o apart from the visible ones, and the second position must see what the first does.
    fn seen_from(&self, place: DVec2, extents: &Extents) -> Option<Vec<&Element>> {
        let mut detected: Vec<(f64, f64, f64, &Element)> = Vec::new();
        for element in &self.elements {
            let point = element.echo_point(place, extents.half_width_m())?;
            let (range_m, bearing) = ((point - place).length(), (point - place).to_angle());
            let half_deg = match element.kind {
                FeatureKind::Edge if range_m > EDGE_RANGE_M => continue,
                FeatureKind::Edge => extents.edge_deg(range_m, 0.095) / 2.0,
                _ => extents.plane_corner_deg(range_m, 0.98) / 2.0,
            };
            detected.push((range_m, bearing, half_deg, element));
        }
        detected.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut seen: Vec<(f64, f64, &Element)> = Vec::new();
        for (_, bearing, half_deg, element) in detected {
            let off = |other: f64| wrap_pi(bearing - other).to_degrees().abs();
            let covered = |(other, other_half_deg, _): &(f64, f64, &Element)| {
                off(*other) + half_deg < other_half_deg - 1.0
            };
            if seen.iter().any(covered) {
                continue;
            }
            if seen.iter().any(|(other, ..)| off(*other) < APART_DEG) {
                return None;
            }
            seen.push((bearing, half_deg, element));
        }
        Some(seen.into_iter().map(|(.., element)| element).collect())
    }
}

/// Returns `true` if every echo came directly from a single element.
fn is_direct(scan: &ScanView) -> bool {
    scan.pings.iter().filter(|ping| ping.status == PingStatus::Echo).all(|ping| {
        ping.path.as_ref().is_some_and(|path| match (path.kind, path.order) {
            (PathKind::Specular, 1) | (PathKind::Diffracted, 0) => true,
            // Path via the two sides of a corner.
            (PathKind::Specular, 2) => {
                path.interactions.iter().all(|point| point.id.starts_with("wall-"))
            }
            _ => false,
        })
    })
}

/// Quantization and noise of the readings.
#[derive(Debug, Clone, Copy)]
struct Disturbance {
    range_step_m: f64,
    /// Maximum error of a beam's direction, degrees.
    azimuth_deg: f64,
}

/// Scan at a pose, with optional quantization of ranges and errors of the motor.
fn take(
    simulator: &Simulator,
    number: u128,
    pose: &Pose,
    spoil: Option<(&mut Pcg64, Disturbance)>,
) -> ScanView {
    let mut scan = scan(simulator, number, pose);
    let Some((rng, spoil)) = spoil else { return scan };
    let point = simulator.at(pose.position());
    for ping in &mut scan.pings {
        let off_deg = rng.random_range(-spoil.azimuth_deg..=spoil.azimuth_deg);
        let prediction =
            point.ping(pose.direction_rad(ping.azimuth_deg + off_deg)).expect("few paths");
        ping.status = prediction.status;
        let rounded = |m: f64| (m / spoil.range_step_m).round() * spoil.range_step_m;
        ping.range_m = prediction.range_m.map(rounded);
    }
    scan
}

/// Result for one world.
enum Trial {
    /// World that violates the constraints.
    Unfit,
    /// World within the constraints, with the correctness of all classifications.
    Fit { right: bool, what: String },
}

/// Scans a world from the origin and from each proposed position.
fn explore(rng: &mut Pcg64, spoil: Option<Disturbance>, settings: &InterpretSettings) -> Trial {
    let world = World::random(rng);
    let simulator = world.simulator();
    let extents = Extents::new(simulator.sensor(), simulator.air(), true).expect("figures");
    let Some(truth) = world.seen_from(DVec2::ZERO, &extents) else { return Trial::Unfit };
    let heading_deg = rng.random_range(0.0..360.0);
    let mut pose = Pose { x_m: 0.0, y_m: 0.0, heading_deg };
    let (mut scans, mut found): (Vec<ScanView>, Vec<Feature>) = (Vec::new(), Vec::new());
    for number in 1..=3 {
        let same = world.seen_from(pose.position(), &extents).is_some_and(|seen| {
            seen.len() == truth.len() && seen.iter().zip(&truth).all(|(a, b)| a.point == b.point)
        });
        scans.push(take(&simulator, number, &pose, spoil.map(|spoil| (&mut *rng, spoil))));
        let direct = scans.last().is_some_and(is_direct);
        if !same || (spoil.is_none() && !direct) {
            return Trial::Unfit;
        }
        found = features(&scans, settings);
        let Some(next) = found.iter().find_map(|feature| feature.next) else { break };
        // The robot turns as well, so that the motor's steps fall elsewhere.
        let turned_deg = rng.random_range(0.0..360.0);
        pose = Pose { x_m: next.x_m, y_m: next.y_m, heading_deg: turned_deg };
    }
    let right =
        found.len() == truth.len() && truth.iter().all(|element| is_classified(element, &found));
    let what = format!("{truth:#?}\n{found:#?}");
    Trial::Fit { right, what }
}

fn is_classified(element: &Element, found: &[Feature]) -> bool {
    found.iter().any(|feature| {
        let place = feature.x_m.zip(feature.y_m).map(DVec2::from);
        feature.kind == element.kind
            && place.is_some_and(|place| place.distance(element.point) < 0.04)
    })
}

/// Number of worlds within the constraints that are classified correctly, and the first failure.
fn count_right(
    seed: u64,
    spoil: Option<Disturbance>,
    settings: &InterpretSettings,
) -> (usize, String) {
    let mut rng = Pcg64::seed_from_u64(seed);
    let (mut right, mut fit, mut tried, mut first_wrong) = (0, 0, 0, String::new());
    while fit < WORLDS {
        tried += 1;
        if let Trial::Fit { right: is_right, what } = explore(&mut rng, spoil, settings) {
            fit += 1;
            right += usize::from(is_right);
            if !is_right && first_wrong.is_empty() {
                first_wrong = what;
            }
        }
        assert!(tried < 20 * WORLDS, "only {fit} of {tried} worlds satisfy the constraints");
    }
    (right, format!("{fit} of {tried} worlds fit, {right} right; first wrong: {first_wrong}"))
}

#[test]
fn noiseless_worlds_are_all_correct() {
    let (right, what) = count_right(1, None, &InterpretSettings::default());
    assert_eq!(right, WORLDS, "{what}");
}

#[test]
fn quantized_worlds_are_99_percent_correct() {
    let spoil = Disturbance { range_step_m: 0.001, azimuth_deg: 0.45 };
    let mut settings = InterpretSettings::default();
    settings.noise.azimuth_deg = 0.9 / 12_f64.sqrt();
    let (right, what) = count_right(2, Some(spoil), &settings);
    assert!(right * 100 >= 99 * WORLDS, "{what}");
}

/// Elements close enough in angle to interfere, from two positions that need not decide.
fn crowded(rng: &mut Pcg64) -> (World, [ScanView; 2], Vec<Feature>) {
    let mut world = World::default();
    let bearing = rng.random_range(0.0..std::f64::consts::TAU);
    let apart = rng.random_range(2.0..22.0_f64).to_radians();
    for bearing in [bearing, bearing + apart] {
        match rng.random_range(0..3) {
            0 => world.add_plane(rng, bearing),
            1 => world.add_corner(rng, bearing),
            _ => world.add_edge(rng, bearing),
        }
    }
    let simulator = world.simulator();
    let away = rng.random_range(0.0..0.12);
    let place = away * DVec2::from_angle(rng.random_range(0.0..std::f64::consts::TAU));
    let scans = [(1, DVec2::ZERO), (2, place)].map(|(number, at)| {
        let heading_deg = rng.random_range(0.0..360.0);
        take(&simulator, number, &Pose { x_m: at.x, y_m: at.y, heading_deg }, None)
    });
    let found = features(&scans, &InterpretSettings::default());
    (world, scans, found)
}

/// Returns `true` if the middle of a feature's arc came directly from an element.
fn came_straight(feature: &Feature, scans: &[ScanView]) -> bool {
    let middle = (feature.beams[0] + feature.beams[1]) / 2;
    let wraps = feature.beams[1] < feature.beams[0];
    scans.iter().filter(|scan| scan.scan == feature.scan).any(|scan| {
        let ping = &scan.pings[if wraps { feature.beams[1] as usize } else { middle as usize }];
        let straight = ScanView { pings: vec![ping.clone()], ..scan.clone() };
        is_direct(&straight)
    })
}

/// Returns `true` if an element of the feature's class is at the feature's position.
fn is_there(element: &Element, feature: &Feature) -> bool {
    let Some(at) = feature.x_m.zip(feature.y_m).map(DVec2::from) else { return false };
    let off = at - element.point;
    element.kind == feature.kind
        && match element.kind {
            // The foot of a plane depends on the position it is seen from.
            FeatureKind::Plane => off.perp_dot(element.along).abs() < 0.04 && off.length() < 0.5,
            _ => off.length() < 0.05,
        }
}

#[test]
fn violated_constraints_stay_open() {
    let mut rng = Pcg64::seed_from_u64(3);
    let (mut right, mut images, mut open, mut wrong) = (0, 0, 0, Vec::new());
    for _ in 0..WORLDS {
        let (world, scans, found) = crowded(&mut rng);
        for feature in found {
            if feature.kind == FeatureKind::Unresolved {
                open += 1;
            } else if world.elements.iter().any(|element| is_there(element, &feature)) {
                right += 1;
            } else if !came_straight(&feature, &scans) {
                // An element seen via a wall appears at its mirror image.
                images += 1;
            } else {
                wrong.push(format!("{:#?} {feature:#?}", world.elements));
            }
        }
    }
    let counts = format!("{right} right, {images} mirror images, {open} open, {}", wrong.len());
    println!("{counts}");
    assert!(wrong.is_empty(), "{counts} wrong: {}", wrong[0]);
}
