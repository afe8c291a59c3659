//! Paths as their interactions: each is straight from point to point, has the stated length, and
//! changes its direction by the law of each interaction.

use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::*;
use crate::{
    acoustics::edge::EdgeLaw,
    geometry::{DVec2, Mirror, distance_to_segment, wrap_pi},
    model::{
        Edge, Interaction, Mechanism,
        paths::{EchoPath, PathSettings, Paths},
    },
};

/// Length below which a leg has no reliable direction, metres.
const SHORT_M: f64 = 1e-4;

/// Points of a path in space; all at the same height in a scene without heights.
fn points(path: &Path, ends: [DVec2; 2], z_m: Option<f64>) -> Vec<DVec3> {
    let end = |at: DVec2| at.extend(z_m.unwrap_or(0.0));
    let point = |at: &Interaction| at.point.extend(at.z_m.unwrap_or(0.0));
    let between = path.interactions.iter().map(point);
    [end(ends[0])].into_iter().chain(between).chain([end(ends[1])]).collect()
}

fn length_m(points: &[DVec3]) -> f64 {
    points.windows(2).map(|pair| pair[0].distance(pair[1])).sum()
}

fn is_round(path: &Path) -> bool {
    path.reflectors().any(|reflector| matches!(reflector, Reflector::Cylinder(_)))
}

/// A scene with the walls that the engine uses, whose nearly square corners are exactly square.
struct Room {
    scene: Scene,
    z_m: Option<f64>,
}

impl Room {
    fn new(scene: &Scene, z_m: Option<f64>) -> Self {
        Self { scene: scene.floor_plan().planned_scene(scene), z_m }
    }

    /// Checks that a path obeys the laws; `length_off_m` is the tolerance of its length.
    fn check(&self, path: &Path, ends: [DVec2; 2], stated_m: f64, length_off_m: f64) {
        let points = points(path, ends, self.z_m);
        let off_m = length_m(&points) - stated_m;
        assert!(off_m.abs() < length_off_m, "{off_m} of {stated_m}: {path:?} {points:?}");
        for (at, interaction) in path.interactions.iter().enumerate() {
            assert_eq!(interaction.z_m.is_some(), self.z_m.is_some(), "{path:?}");
            let legs = [points[at + 1] - points[at], points[at + 2] - points[at + 1]];
            let bound = if is_round(path) { 1e-5 } else { 1e-7 };
            let bound = bound / legs[0].length().min(legs[1].length()).min(1.0);
            let units = legs.map(DVec3::normalize_or_zero);
            let is_listed = legs.iter().all(|leg| leg.length() > SHORT_M);
            let is_lawful = self.off_law(interaction, units) < if is_listed { bound } else { 3.0 };
            assert!(is_lawful, "{at}: {} {path:?}", self.off_law(interaction, units));
            assert!(self.off_place_m(interaction, ends) < 1e-8, "{at}: {path:?}");
        }
    }

    /// Deviation of the directions before and after a point from the law of the interaction.
    fn off_law(&self, interaction: &Interaction, [before, after]: [DVec3; 2]) -> f64 {
        let mirrored =
            |normal: DVec3| (before - 2.0 * before.dot(normal) * normal - after).length();
        // Keller's cone: as steep to the edge after as before.
        let diffracted = |along: DVec3| (before.dot(along) - after.dot(along)).abs();
        match interaction.mechanism {
            Mechanism::Reflection(Reflector::Wall(wall)) => {
                mirrored(self.mirror(wall).normal.extend(0.0))
            }
            Mechanism::Reflection(Reflector::Cylinder(index)) => {
                let out = interaction.point - self.scene.cylinders[index as usize].center;
                assert!(before.dot(out.extend(0.0)) < 1e-6, "from inside");
                mirrored(out.normalize().extend(0.0))
            }
            Mechanism::Reflection(Reflector::Floor | Reflector::Ceiling) => mirrored(DVec3::Z),
            Mechanism::Diffraction(Diffractor::Upright(_) | Diffractor::Post { .. }) => {
                diffracted(DVec3::Z)
            }
            Mechanism::Diffraction(Diffractor::Level { wall, .. }) => {
                diffracted(self.mirror(wall).normal.perp().extend(0.0))
            }
            Mechanism::Scattering { .. } | Mechanism::Transducer => 0.0,
        }
    }

    /// Distance of a point from its wall, cylinder or edge, metres.
    fn off_place_m(&self, interaction: &Interaction, ends: [DVec2; 2]) -> f64 {
        let Interaction { mechanism, point, z_m } = *interaction;
        let off_wall_m = |index: u32| {
            let wall = &self.scene.walls[index as usize];
            let (low, high) = wall.z_m.map_or((f64::MIN, f64::MAX), |[from, to]| (from, to));
            let off_height_m = z_m.map_or(0.0, |z_m| (low - z_m).max(z_m - high).max(0.0));
            // Beyond its end, its neighbour in the plan may have been snapped to it.
            let beyond_m = distance_to_segment(point, wall.a, wall.b);
            assert!(beyond_m < 1e-4, "{interaction:?} {beyond_m}");
            self.mirror(index).signed_distance_m(point).abs().max(off_height_m)
        };
        let off_z_m = |wanted_m: Option<f64>| {
            z_m.zip(wanted_m).map_or(f64::INFINITY, |(is, should)| (is - should).abs())
        };
        match mechanism {
            Mechanism::Reflection(Reflector::Wall(wall)) | Mechanism::Scattering { wall } => {
                off_wall_m(wall)
            }
            Mechanism::Diffraction(Diffractor::Post { cylinder }) => {
                point.distance(self.scene.cylinders[cylinder as usize].center)
            }
            Mechanism::Reflection(Reflector::Cylinder(index)) => {
                let cylinder = &self.scene.cylinders[index as usize];
                (point.distance(cylinder.center) - cylinder.radius_m).abs()
            }
            Mechanism::Reflection(Reflector::Floor) => off_z_m(self.scene.floor_z_m),
            Mechanism::Reflection(Reflector::Ceiling) => off_z_m(self.scene.ceiling_z_m),
            Mechanism::Diffraction(Diffractor::Upright(Edge { wall, at_b })) => {
                let wall = &self.scene.walls[wall as usize];
                // Where walls cross, the edge is named by the nearer end of one.
                let (near, far) = if at_b { (wall.b, wall.a) } else { (wall.a, wall.b) };
                assert!(point.distance(near) <= point.distance(far), "{interaction:?}");
                distance_to_segment(point, wall.a, wall.b)
            }
            Mechanism::Diffraction(Diffractor::Level { wall, is_upper }) => {
                let limits = self.scene.walls[wall as usize].z_m.expect("a wall with limits");
                off_wall_m(wall).max(off_z_m(Some(limits[usize::from(is_upper)])))
            }
            Mechanism::Transducer => point.distance(ends[0]),
        }
    }

    /// Returns `true` if a point is not beyond the ends of its wall.
    fn is_on_wall(&self, interaction: &Interaction) -> bool {
        let Some(Reflector::Wall(wall)) = interaction.mechanism.surface() else { return true };
        let wall = &self.scene.walls[wall as usize];
        distance_to_segment(interaction.point, wall.a, wall.b) < 1e-9
    }

    fn mirror(&self, wall: u32) -> Mirror {
        let wall = &self.scene.walls[wall as usize];
        Mirror::through(wall.a, wall.b)
    }
}

/// Checks a path of the exact engine, whose departure and arrival must also agree.
fn check_echo(room: &Room, echo: &EchoPath, ends: [DVec2; 2]) {
    let length_off_m = if is_round(&echo.path) { 1e-7 } else { 1e-9 };
    room.check(&echo.path, ends, echo.length_m, length_off_m);
    let points = points(&echo.path, ends, room.z_m);
    let last = points.len() - 1;
    let legs = [points[1] - points[0], points[last - 1] - points[last]];
    let stated = [echo.departure_rad, echo.arrival_rad].into_iter().zip(echo.rise_rad);
    for (leg, (plan_rad, rise_rad)) in legs.into_iter().zip(stated) {
        let run = leg.truncate();
        if run.length() > SHORT_M {
            let bound = 1e-6 / run.length().min(1.0);
            assert!(wrap_pi(run.to_angle() - plan_rad).abs() < bound, "{leg} {echo:?}");
            assert!((leg.z.atan2(run.length()) - rise_rad).abs() < bound, "{leg} {echo:?}");
        }
    }
}

/// A scene of a few walls and round bodies, some rough, some low or hanging, with and without
/// heights.
fn random_scene(rng: &mut Pcg64) -> Scene {
    let mut place =
        |size: f64| DVec2::new(rng.random::<f64>() - 0.5, rng.random::<f64>() - 0.5) * size;
    let ends: Vec<[DVec2; 2]> = (0..6).map(|_| [place(3.0), place(3.0)]).collect();
    let centers = [place(2.0), place(2.0)];
    let walls = ends.iter().zip(0..).map(|([a, b], i)| {
        let mut wall =
            wall(&format!("w{i}"), (a.x, a.y), (b.x, b.y), 0.8 + 0.2 * rng.random::<f64>());
        wall.material.roughness = if rng.random_bool(0.2) { 0.3 } else { 0.0 };
        wall
    });
    let mut scene = scene(walls.collect());
    let mut round = |at: &DVec2| cylinder((at.x, at.y), 0.05 + 0.2 * rng.random::<f64>());
    scene.cylinders = centers.iter().map(&mut round).collect();
    let apart_m = centers[0].distance(centers[1]);
    let sum_m: f64 = scene.cylinders.iter().map(|round| round.radius_m).sum();
    scene.cylinders.truncate(if apart_m > sum_m + 0.02 { 2 } else { 1 });
    if rng.random_bool(0.3) {
        scene.cylinders.clear();
    }
    if rng.random_bool(0.6) {
        scene.floor_z_m = rng.random_bool(0.8).then_some(0.0);
        scene.ceiling_z_m = (scene.floor_z_m.is_none() || rng.random_bool(0.6)).then_some(1.3);
        for wall in scene.walls.iter_mut().step_by(2) {
            let low = rng.random_bool(0.5);
            let at = 0.2 + 0.8 * rng.random::<f64>();
            wall.z_m = Some(if low { [0.0, at] } else { [at, 1.3] });
        }
    }
    scene
}

#[test]
fn random_scenes_obey_the_laws() {
    let mut rng = Pcg64::seed_from_u64(19);
    let (mut found, mut refused) = (Counts::default(), 0);
    for case in 0..100 {
        let scene = random_scene(&mut rng);
        let mut place = || loop {
            let at = DVec2::new(rng.random::<f64>() - 0.5, rng.random::<f64>() - 0.5) * 2.5;
            if scene.clearance_m(at) > 0.03 {
                return at;
            }
        };
        let from = place();
        let to = if case % 2 == 0 { from } else { place() };
        let settings = PathSettings {
            max_path_m: 3.0,
            floor: 6e-3,
            edge_law: Some(EdgeLaw::Utd),
            double_diffraction: case % 3 == 0,
            sensor_z_m: Some(0.55),
            scatter_height_rad: 0.2,
            ..crate::model::paths::tests::LOSSLESS
        };
        let paths = Paths::new(&scene, settings);
        let room = Room::new(&scene, paths.sensor_z_m());
        // Mirrors that cross one another, low and high, between floor and ceiling: with double
        // diffraction a scene can have more paths than the limit, and is rejected.
        let Ok(echoes) = paths.enumerate_between(from, to) else {
            assert!(case % 3 == 0, "{case}");
            refused += 1;
            continue;
        };
        for echo in echoes {
            check_echo(&room, &echo, [from, to]);
            found.add(&echo.path);
        }
    }
    assert!(refused <= 2, "{refused} of 100 scenes are refused");
    found.assert_at_least(50);
}

/// Number of paths by mechanism.
#[derive(Debug, Default)]
struct Counts {
    mirrored: usize,
    round: usize,
    floor: usize,
    scattered: usize,
    upright: usize,
    level: usize,
    level_by_floor: usize,
    twice: usize,
}

impl Counts {
    fn add(&mut self, path: &Path) {
        let of_floor = |reflector| matches!(reflector, Reflector::Floor | Reflector::Ceiling);
        let floor = path.reflectors().any(of_floor);
        let diffractors = diffractors(path);
        let level =
            diffractors.iter().any(|diffractor| matches!(diffractor, Diffractor::Level { .. }));
        let mirrors = path.interactions.len() == path.order() && !floor && !is_round(path);
        self.mirrored += usize::from(mirrors);
        self.round += usize::from(is_round(path));
        self.floor += usize::from(floor);
        self.scattered += usize::from(path.kind() == PathKind::Scattered);
        self.upright += usize::from(!diffractors.is_empty() && !level);
        self.level += usize::from(level);
        self.level_by_floor += usize::from(level && floor);
        self.twice += usize::from(diffractors.len() == 2);
    }

    fn assert_at_least(&self, count: usize) {
        let Self { mirrored, round, floor, scattered, upright, level, level_by_floor, twice } =
            *self;
        let all = [mirrored, round, floor, scattered, upright, level, level_by_floor, twice];
        assert!(all.into_iter().all(|found| found >= count), "{self:?}");
    }
}

/// Every arrival of every engine in every shipped scene, in a few directions, multiple echoes by
/// the transducer's face included.
#[test]
fn shipped_scenes_obey_the_laws() {
    let [mut multiple, mut checked] = [0; 2];
    let mut fan_rounds = FanRounds::default();
    for name in shipped::names() {
        let shipped = shipped_scene(name);
        for pose in shipped.poses.values() {
            let paths = PathOptions { double_diffraction: true, ..PathOptions::default() };
            let fan = FanOptions { ray_spacing_deg: 0.5, ..FanOptions::default() };
            let cone = ConeOptions::default();
            for engine in [EngineOptions::Paths(paths), fan.into(), cone.into()] {
                let options = Options { max_range_m: Some(2.0), ..engine.into() };
                let simulator = simulator(shipped.with_robot_at(pose), options);
                let point = simulator.at(pose.position());
                for direction in 0..63 {
                    for arrival in point.arrivals(0.1 * f64::from(direction)).expect("few paths") {
                        check_arrival(&simulator, &arrival, pose.position(), &mut fan_rounds);
                        let face = |mechanism| mechanism == Mechanism::Transducer;
                        multiple += usize::from(arrival.path.mechanisms().any(face));
                        checked += 1;
                    }
                }
            }
        }
    }
    assert!(checked > 10_000 && multiple > 100, "{checked} {multiple}");
    // Without them the law would be violated by 0.3 and more, where the bound is 1e-6.
    let FanRounds { lawful, missed } = fan_rounds;
    assert!(lawful > 500 && 50 * missed < lawful, "{fan_rounds:?}");
}

/// Paths of the fan by one cylinder: those that obey the law of reflection at each point, and those
/// whose returning neighbour misses the cylinder, so that the last leg is not lawful.
#[derive(Debug, Default)]
struct FanRounds {
    lawful: usize,
    missed: usize,
}

fn check_arrival(simulator: &Simulator, arrival: &Arrival, at: DVec2, fan_rounds: &mut FanRounds) {
    let (path, ends) = (&arrival.path, [at; 2]);
    let drawn = simulator.scene();
    let plan = Room { scene: drawn.ray_plan().planned_scene(drawn), z_m: None };
    let off_m = || length_m(&points(path, ends, None)) - arrival.length_m;
    let round =
        path.reflectors().filter(|reflector| matches!(reflector, Reflector::Cylinder(_))).count();
    match (simulator.options().engine.kind(), round) {
        (EngineKind::Paths, _) => {
            let room = Room::new(simulator.scene(), simulator.sensor_z_m());
            room.check(path, ends, arrival.length_m, if round > 0 { 1e-7 } else { 1e-9 });
        }
        // The fan's ray represents a neighbour that may pass a corner on its other side. Lengths
        // over a cylinder are approximate, by the curvature of the front, where the points are
        // exact; over two, neighbours diverge too fast to be found.
        (EngineKind::Fan, 0 | 1)
            if path.interactions.iter().all(|interaction| plan.is_on_wall(interaction)) =>
        {
            assert!(round > 0 || off_m().abs() < 1e-9, "{} {arrival:?}", off_m());
            let points = points(path, ends, None);
            let last = path.interactions.len() - 1;
            for (place, interaction) in path.interactions.iter().enumerate() {
                let legs = [1, 2].map(|to| points[place + to] - points[place + to - 1]);
                let is_listed = legs.iter().all(|leg| leg.length() > SHORT_M);
                let off = plan.off_law(interaction, legs.map(DVec3::normalize_or_zero));
                let is_lawful = !is_listed || off < 1e-6;
                let may_miss = round > 0 && place == last;
                assert!(is_lawful || may_miss, "{off} {arrival:?}");
                if may_miss {
                    *(if is_lawful { &mut fan_rounds.lawful } else { &mut fan_rounds.missed }) += 1;
                }
            }
        }
        (EngineKind::Fan, _) => {
            assert!(path.interactions.iter().all(|interaction| interaction.z_m.is_none()));
        }
        // The nearest hit, mirror or not.
        (EngineKind::Cone, _) => {
            assert!(off_m().abs() < 1e-9, "{} {arrival:?}", off_m());
            assert!(plan.off_place_m(&path.interactions[0], ends) < 1e-8, "{arrival:?}");
        }
    }
}

/// Only mirror reflections count; an edge, a patch of a rough wall and the face do not.
#[test]
fn order_counts_mirrors_only() {
    let meets = |mechanisms: &[Mechanism]| Path {
        interactions: mechanisms
            .iter()
            .map(|&mechanism| Interaction { mechanism, point: DVec2::ZERO, z_m: None })
            .collect(),
    };
    let wall = Mechanism::Reflection(Reflector::Wall(0));
    let level = Mechanism::Diffraction(Diffractor::Level { wall: 1, is_upper: true });
    let rough = Mechanism::Scattering { wall: 2 };
    let floor = Mechanism::Reflection(Reflector::Floor);
    for (path, kind, order) in [
        (meets(&[wall, Mechanism::Transducer, wall]), PathKind::Specular, 2),
        (meets(&[wall, floor, level, floor]), PathKind::Diffracted, 3),
        (meets(&[wall, rough, wall]), PathKind::Scattered, 2),
        (meets(&[level, Mechanism::Transducer, rough]), PathKind::Scattered, 0),
    ] {
        assert_eq!((path.kind(), path.order()), (kind, order), "{path:?}");
    }
}
