//! Random scenes.

mod changed;

use std::f64::consts::{PI, TAU};

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use sonard_model::{
    acoustics::edge::EdgeLaw,
    geometry::{DVec2, distance_to_segment},
    model::paths::{DEFAULT_REPEATED_CONTACT_RATIO, EchoPath, PathSettings, Paths},
    scene::{Scene, SceneBuilder},
};

/// A flat wall.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Wall {
    pub(crate) ends: [DVec2; 2],
    pub(crate) reflectance: f64,
    pub(crate) roughness: f64,
    /// Lower and upper end; `None` from floor to ceiling.
    pub(crate) z_m: Option<[f64; 2]>,
}

/// An upright cylinder.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Round {
    pub(crate) center: DVec2,
    pub(crate) radius_m: f64,
    pub(crate) reflectance: f64,
    /// Lower and upper end; `None` from floor to ceiling.
    pub(crate) z_m: Option<[f64; 2]>,
}

/// Floor and ceiling, and the height of the transducers between them.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Heights {
    /// Reflectances of floor and ceiling.
    pub(crate) limits_z_m: [f64; 2],
    /// Roughnesses of floor and ceiling.
    pub(crate) reflectance: [f64; 2],
    pub(crate) sensor_z_m: f64,
}

/// A scene with a transmitter and a receiver in it.
#[derive(Debug, Clone)]
pub(crate) struct World {
    pub(crate) walls: Vec<Wall>,
    pub(crate) rounds: Vec<Round>,
    /// Transmitter and receiver.
    pub(crate) ends: [DVec2; 2],
    /// `None` for a planar scene.
    pub(crate) heights: Option<Heights>,
}

/// Contents of a world.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Kind {
    /// Number of walls inside the room.
    pub(crate) partitions: usize,
    /// Number of walls of less than a wavelength.
    pub(crate) strips: usize,
    pub(crate) rounds: usize,
    /// Roughness of all walls.
    pub(crate) roughness: f64,
    /// `true` for a separate transmitter and receiver.
    pub(crate) is_pair: bool,
    /// `true` for a world with floor and ceiling, and objects that end below or above.
    pub(crate) has_heights: bool,
}

/// A furnished room.
pub(crate) const FURNISHED: Kind = Kind {
    partitions: 3,
    strips: 1,
    rounds: 0,
    roughness: 0.0,
    is_pair: false,
    has_heights: false,
};
/// A furnished room with a transmitter and a receiver.
pub(crate) const FURNISHED_PAIR: Kind = Kind { is_pair: true, ..FURNISHED };
/// A room with walls and legs in it.
pub(crate) const WITH_LEGS: Kind = Kind { partitions: 1, rounds: 3, ..FURNISHED };
/// A room with walls and legs in it, and with a transmitter and a receiver.
pub(crate) const WITH_LEGS_PAIR: Kind = Kind { is_pair: true, ..WITH_LEGS };

/// A room with floor, ceiling, and low and hanging walls.
pub(crate) const WITH_HEIGHTS: Kind =
    Kind { partitions: 2, strips: 0, has_heights: true, ..FURNISHED };
/// A room with floor, ceiling, low and hanging walls and cylinders, and with a transmitter and a
/// receiver.
pub(crate) const WITH_HEIGHTS_AND_LEGS_PAIR: Kind =
    Kind { partitions: 1, rounds: 2, is_pair: true, ..WITH_HEIGHTS };

/// Minimum distance between objects, metres: far above the ties of geometry, and a pose has to be
/// off walls.
const GAP_M: f64 = 0.04;

/// Walls shorter than this are narrow strips, which sound passes: less than a wavelength.
pub(crate) const STRIP_M: f64 = 0.0065;

/// Maximum number of tries to find a free place.
const TRIES: usize = 200;

/// Number of scenes for each law.
pub(crate) fn cases() -> u64 {
    let requested = std::env::var("SONARD_LAWS").ok().and_then(|count| count.parse().ok());
    requested.unwrap_or(200)
}

/// Generator of a law's scene.
pub(crate) fn generator(law: &str, case: u64) -> Pcg64 {
    let seed = law.bytes().fold(case, |seed, byte| {
        (seed ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3).rotate_left(5)
    });
    Pcg64::seed_from_u64(seed)
}

/// Runs a law on its scenes; a failure names the scene.
pub(crate) fn on_random_worlds(law: &str, kind: Kind, check: impl Fn(&World, &mut Pcg64)) {
    for case in 0..cases() {
        let mut random = generator(law, case);
        let world = World::random(kind, &mut random);
        let _report = FailureReport { law, case, world: &world };
        check(&world, &mut random);
    }
}

/// Prints the scene on a panic.
struct FailureReport<'a> {
    law: &'a str,
    case: u64,
    world: &'a World,
}

impl Drop for FailureReport<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            let World { ends, .. } = self.world;
            eprintln!(
                "`{}` broke on scene {}, {ends:?}: {}",
                self.law,
                self.case,
                self.world.text()
            );
        }
    }
}

/// Settings of the listings: paths to 5 m by UTD, with usual absorption in air.
pub(crate) fn settings() -> PathSettings {
    PathSettings {
        max_path_m: 5.0,
        max_order: None,
        floor: 0.01,
        repeated_contact_ratio: DEFAULT_REPEATED_CONTACT_RATIO,
        unrestricted_m: 0.0,
        edge_law: Some(EdgeLaw::Utd),
        double_diffraction: false,
        absorption_np_per_m: 0.19,
        wave_number_per_m: TAU * 49_400.0 / 343.2,
        sensor_z_m: None,
        tilt_rad: 0.0,
        scatter_height_rad: 0.16,
        direct: false,
    }
}

impl World {
    /// A room of four walls at some angle, with the contents of `kind`.
    pub(crate) fn random(kind: Kind, random: &mut Pcg64) -> Self {
        let size = DVec2::new(random.random_range(1.0..4.0), random.random_range(1.0..4.0));
        let mut off = || random.random_range(-0.15..0.15);
        let corners = loop {
            let corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
                .map(|(x, y)| size * DVec2::new(x, y) + DVec2::new(off(), off()));
            if !is_nearly_right(&corners) {
                break corners;
            }
        };
        let heights = kind.has_heights.then(|| Heights::random(random));
        let mut world =
            Self { walls: Vec::new(), rounds: Vec::new(), ends: [DVec2::ZERO; 2], heights };
        for i in 0..4 {
            let wall = wall([corners[i], corners[(i + 1) % 4]], kind, random);
            world.walls.push(wall);
        }
        let place = |random: &mut Pcg64| {
            DVec2::new(random.random_range(0.0..size.x), random.random_range(0.0..size.y))
        };
        for number in 0..kind.rounds {
            // Posts, such as chair legs, and bodies.
            let radius_m =
                random.random_range(if number % 3 == 2 { 0.004..0.016 } else { 0.018..0.2 });
            let found = (0..TRIES).map(|_| place(random)).find(|at| world.is_free(*at, radius_m));
            let reflectance = random.random_range(0.7..1.0);
            let z_m = heights.and_then(|heights| heights.some_of_it(random));
            let round = |center| Round { center, radius_m, reflectance, z_m };
            world.rounds.extend(found.map(round));
        }
        for number in 0..kind.partitions + kind.strips {
            let lengths_m = if number < kind.partitions { 0.1..0.9 } else { 0.0015..STRIP_M };
            let found = (0..TRIES)
                .map(|_| {
                    let a = place(random);
                    let turn = DVec2::from_angle(random.random_range(0.0..TAU));
                    [a, a + random.random_range(lengths_m.clone()) * turn]
                })
                .find(|ends| world.has_room_for(*ends));
            if let Some(ends) = found {
                let partition = wall(ends, kind, random);
                let z_m = heights.and_then(|heights| heights.some_of_it(random));
                world.walls.push(Wall { z_m, ..partition });
            }
        }
        world.place_ends(kind, size, random);
        let (turn, shift) = (random.random_range(0.0..TAU), place(random));
        world.moved(|p| p.rotate(DVec2::from_angle(turn)) + shift)
    }

    /// Puts transmitter and receiver at free places.
    fn place_ends(&mut self, kind: Kind, size: DVec2, random: &mut Pcg64) {
        let apart_m = if kind.is_pair { 0.026 } else { 0.0 };
        loop {
            let share = DVec2::new(random.random(), random.random());
            let side = apart_m * DVec2::from_angle(random.random_range(0.0..TAU));
            self.ends = [size * share, size * share + side];
            if self.ends.iter().all(|&end| self.is_free(end, 0.0)) && self.is_inside(self.ends[0]) {
                return;
            }
        }
    }

    /// Returns `true` if a point is within the first four walls.
    fn is_inside(&self, at: DVec2) -> bool {
        self.walls[..4].iter().all(|wall| {
            let [a, b] = wall.ends;
            (b - a).perp_dot(at - a) > 0.0
        })
    }

    /// Returns `true` if a disc is in the room and off everything.
    fn is_free(&self, at: DVec2, radius_m: f64) -> bool {
        let walls = self.walls.iter().map(|w| distance_to_segment(at, w.ends[0], w.ends[1]));
        let rounds = self.rounds.iter().map(|round| at.distance(round.center) - round.radius_m);
        self.is_inside(at) && walls.chain(rounds).all(|off_m| off_m > radius_m + GAP_M)
    }

    /// Returns `true` if a wall is in the room and off everything.
    fn has_room_for(&self, [a, b]: [DVec2; 2]) -> bool {
        let steps = (a.distance(b) / (0.5 * GAP_M)).ceil();
        (0..=steps as u32).all(|step| self.is_free(a.lerp(b, f64::from(step) / steps), 0.0))
    }

    /// Builds the scene.
    pub(crate) fn scene(&self) -> Scene {
        Scene::from_json(&self.text()).expect("a valid scene")
    }

    /// Writes the world as a scene file.
    pub(crate) fn text(&self) -> String {
        let mut builder = Scene::builder("random");
        for (number, wall) in self.walls.iter().enumerate() {
            let (id, ends) = (format!("w{number}"), wall.ends.map(|end| end.to_array()));
            let material = format!("m{number}");
            builder = builder
                .rough_material(&material, wall.reflectance, wall.roughness)
                .walls(&id, &ends, &material);
            builder = with_limits(builder, wall.z_m);
        }
        for (number, round) in self.rounds.iter().enumerate() {
            let material = format!("n{number}");
            let center = round.center.to_array();
            builder = builder.material(&material, round.reflectance).cylinder(
                &format!("c{number}"),
                center,
                round.radius_m,
                &material,
            );
            builder = with_limits(builder, round.z_m);
        }
        if let Some(heights) = self.heights {
            let [floor_z_m, ceiling_z_m] = heights.limits_z_m;
            let [floor, ceiling] = heights.reflectance;
            builder = builder
                .heights(floor_z_m, ceiling_z_m)
                .material("floor", floor)
                .material("ceiling", ceiling)
                .floor_and_ceiling("floor", "ceiling");
        }
        builder.text()
    }

    /// Lists all echoes.
    pub(crate) fn echoes(&self, settings: &PathSettings) -> Vec<EchoPath> {
        let [transmitter, receiver] = self.ends;
        let sensor_z_m = self.heights.map(|heights| heights.sensor_z_m);
        let paths = Paths::new(&self.scene(), PathSettings { sensor_z_m, ..settings.clone() });
        paths.enumerate_between(transmitter, receiver).expect("few paths")
    }
}

impl Heights {
    fn random(random: &mut Pcg64) -> Self {
        let floor_z_m = random.random_range(-1.0..1.0);
        let height_m = random.random_range(1.2..3.0);
        Self {
            limits_z_m: [floor_z_m, floor_z_m + height_m],
            reflectance: [random.random_range(0.3..1.0), random.random_range(0.3..1.0)],
            sensor_z_m: floor_z_m + random.random_range(0.1..0.9) * height_m,
        }
    }

    /// From the floor, from the ceiling, between both, or all of it.
    fn some_of_it(&self, random: &mut Pcg64) -> Option<[f64; 2]> {
        let [floor_z_m, ceiling_z_m] = self.limits_z_m;
        let at = |share: f64| floor_z_m + share * (ceiling_z_m - floor_z_m);
        match random.random_range(0..4) {
            0 => None,
            1 => Some([floor_z_m, at(random.random_range(0.1..0.9))]),
            2 => Some([at(random.random_range(0.1..0.9)), ceiling_z_m]),
            _ => Some([at(random.random_range(0.1..0.45)), at(random.random_range(0.55..0.9))]),
        }
    }
}

fn with_limits(builder: SceneBuilder, z_m: Option<[f64; 2]>) -> SceneBuilder {
    match z_m {
        Some([bottom_z_m, top_z_m]) => builder.z_range(bottom_z_m, top_z_m),
        None => builder,
    }
}

/// Returns `true` if a corner is so nearly right that it is squared before tracing, by moving it
/// slightly.
fn is_nearly_right(corners: &[DVec2; 4]) -> bool {
    (0..4).any(|i| {
        let [a, b, c] = [0, 1, 2].map(|next| corners[(i + next) % 4]);
        (b - a).normalize().dot((c - b).normalize()).abs() < 1e-3
    })
}

fn wall(ends: [DVec2; 2], kind: Kind, random: &mut Pcg64) -> Wall {
    let reflectance = random.random_range(0.6..1.0);
    Wall { ends, reflectance, roughness: kind.roughness, z_m: None }
}

/// A random angle.
pub(crate) fn any_angle(random: &mut Pcg64) -> f64 {
    random.random_range(-PI..PI)
}
