//! Random rooms by kind, courses through them, and their odometry.

use std::{fmt, str::FromStr};

use rand::{Rng, RngExt, SeedableRng};
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64;
use sonard_model::{
    geometry::{DVec2, Pose},
    scene::{Cylinder, Scene, SceneError, Wall},
};

/// Kind of a random room.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RoomKind {
    /// Rectangle.
    Rectangle,
    /// Rectangle with one slanted wall.
    Oblique,
    /// Rectangle with a cut corner.
    Cut,
    /// L-shaped room.
    L,
    /// Rectangle with a box inside.
    Box,
    /// Rectangle or L with one to three posts.
    Posts,
    /// T-shaped room.
    T,
    /// Rectangle, L or T with boxes at any angle, posts, and up to one partition.
    Furnished,
}

impl RoomKind {
    /// All kinds.
    pub const ALL: [Self; 8] = [
        Self::Rectangle,
        Self::Oblique,
        Self::Cut,
        Self::L,
        Self::T,
        Self::Box,
        Self::Posts,
        Self::Furnished,
    ];

    /// Name of the kind, as parsed.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Rectangle => "rectangle",
            Self::Oblique => "oblique",
            Self::Cut => "cut",
            Self::L => "l",
            Self::Box => "box",
            Self::Posts => "posts",
            Self::T => "t",
            Self::Furnished => "furnished",
        }
    }

    /// Returns `true` for rooms that [`add_posts`] completes.
    const fn has_posts(self) -> bool {
        matches!(self, Self::Posts | Self::Furnished)
    }
}

impl fmt::Display for RoomKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for RoomKind {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let kinds = Self::ALL.map(Self::name).join(", ");
        let found = Self::ALL.into_iter().find(|kind| kind.name() == text);
        found.ok_or_else(|| format!("{text} is no kind of room: use {kinds}"))
    }
}

/// Random number generator of a trial: independent of those of all other kinds and seeds.
#[must_use]
pub fn generator(kind: RoomKind, seed: u64) -> Pcg64 {
    Pcg64::seed_from_u64(seed.wrapping_mul(1000).wrapping_add(kind as u64))
}

/// Draws a room without posts.
fn draw_room(kind: RoomKind, random: &mut impl Rng) -> Result<Scene, SceneError> {
    let (mut w, mut d) = (random.random_range(2.4..4.0), random.random_range(2.2..3.4));
    let mut inside = Vec::new();
    let outline = match kind {
        RoomKind::Posts => {
            let outline = [RoomKind::Rectangle, RoomKind::L][random.random_range(0..2)];
            return draw_room(outline, random);
        }
        RoomKind::Furnished => {
            let outline =
                [RoomKind::Rectangle, RoomKind::L, RoomKind::T][random.random_range(0..3)];
            let mut room = draw_room(outline, random)?;
            add_furniture(&mut room, random);
            return Ok(room);
        }
        RoomKind::Rectangle => vec![[0.0, 0.0], [w, 0.0], [w, d], [0.0, d]],
        RoomKind::Oblique => {
            let slant = random.random_range(0.2..0.9);
            vec![[0.0, 0.0], [w, 0.0], [w, d], [0.0, d - slant]]
        }
        RoomKind::Cut => {
            let (a, b) = (random.random_range(0.6..1.1), random.random_range(0.6..1.1));
            vec![[0.0, 0.0], [w, 0.0], [w, d - a], [w - b, d], [0.0, d]]
        }
        RoomKind::L => {
            (w, d) = (random.random_range(3.0..4.2), random.random_range(2.6..3.8));
            let (a, b) = (w * random.random_range(0.35..0.55), d * random.random_range(0.35..0.55));
            vec![[0.0, 0.0], [w, 0.0], [w, d - b], [w - a, d - b], [w - a, d], [0.0, d]]
        }
        RoomKind::T => {
            (w, d) = (random.random_range(3.2..4.2), random.random_range(2.6..3.8));
            let [a, b] = [0.25..0.35, 0.25..0.35].map(|share| w * random.random_range(share));
            let e = d * random.random_range(0.35..0.55);
            let [left, right, top] = [a, w - b, d - e];
            vec![
                [0.0, 0.0],
                [w, 0.0],
                [w, top],
                [right, top],
                [right, d],
                [left, d],
                [left, top],
                [0.0, top],
            ]
        }
        RoomKind::Box => {
            (w, d) = (random.random_range(3.2..4.2), random.random_range(2.8..3.8));
            let (a, b) = (random.random_range(0.3..0.7), random.random_range(0.3..0.7));
            let x = random.random_range(0.7..w - 0.7 - a);
            let y = random.random_range(0.7..d - 0.7 - b);
            inside = vec![[x, y], [x + a, y], [x + a, y + b], [x, y + b]];
            vec![[0.0, 0.0], [w, 0.0], [w, d], [0.0, d]]
        }
    };
    let turn = DVec2::from_angle(random.random_range(0.0_f64..90.0).to_radians());
    let turned = |corners: Vec<[f64; 2]>| -> Vec<[f64; 2]> {
        corners.into_iter().map(|corner| turn.rotate(DVec2::from(corner)).to_array()).collect()
    };
    let room = Scene::builder(kind.name()).material("wall", 0.97);
    let room = room.room("wall", &turned(outline), "wall");
    if inside.is_empty() { room.build() } else { room.room("box", &turned(inside), "wall").build() }
}

/// Draws a room of 2.2 to 4.2 m, turned by any angle up to a right one, and a course of stops
/// through it.
///
/// # Errors
/// None: corners and materials are valid.
pub fn draw_trial(
    kind: RoomKind,
    stops: usize,
    random: &mut impl Rng,
) -> Result<(Scene, Vec<Pose>), SceneError> {
    let mut room = draw_room(kind, random)?;
    let course = draw_course(&room, stops, random);
    if kind.has_posts() {
        add_posts(&mut room, &course, random);
    }
    Ok((room, course))
}

/// Extent of the walls of a scene: lower left and upper right, metres.
#[must_use]
pub fn extent(scene: &Scene) -> [DVec2; 2] {
    let ends = || scene.walls.iter().flat_map(|wall| [wall.a, wall.b]);
    [ends().fold(DVec2::INFINITY, DVec2::min), ends().fold(DVec2::NEG_INFINITY, DVec2::max)]
}

/// Clearance of a ranger from all walls, metres.
const CLEAR_M: f64 = 0.25;

/// Returns `true` if a ranger fits at a place.
#[must_use]
pub fn is_free(scene: &Scene, at: DVec2) -> bool {
    is_within(scene, at, CLEAR_M)
}

/// Adds up to three boxes with sides of 0.3 to 0.8 m at any angle, at least 0.3 m from walls and
/// each other, and in half of the rooms a partition of 0.5 to 1.5 m at a right angle to a wall.
fn add_furniture(scene: &mut Scene, random: &mut impl Rng) {
    const GAP_M: f64 = 0.3;
    const MAX_TRIES: usize = 200;
    let material = scene.walls[0].material;
    let wall = |id: String, a, b| Wall { id: id.into(), a, b, material, z_m: None };
    if random.random() {
        let outer = &scene.walls[random.random_range(0..scene.walls.len())];
        let from = outer.a.lerp(outer.b, random.random_range(0.3..0.7));
        let inward = (outer.b - outer.a).normalize_or_zero().perp();
        let to = from + random.random_range(0.5..1.5) * inward;
        if is_within(scene, to, GAP_M) {
            scene.walls.push(wall("partition-1".to_owned(), from, to));
        }
    }
    let [low, high] = extent(scene);
    let count = random.random_range(0..=3);
    let mut boxes = 0;
    for _ in 0..MAX_TRIES {
        if boxes == count {
            break;
        }
        let center = low + DVec2::new(random.random(), random.random()) * (high - low);
        let half = 0.5 * DVec2::new(random.random_range(0.3..0.8), random.random_range(0.3..0.8));
        let turn = DVec2::from_angle(random.random_range(0.0_f64..90.0).to_radians());
        if !is_within(scene, center, half.length() + GAP_M) {
            continue;
        }
        boxes += 1;
        let corner = |signs: [f64; 2]| center + turn.rotate(half * DVec2::from_array(signs));
        let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(corner);
        for side in 0..4 {
            let id = format!("box-{boxes}-{}", side + 1);
            scene.walls.push(wall(id, corners[side], corners[(side + 1) % 4]));
        }
    }
}

/// Returns `true` if a place is within the room, farther than a clearance from all walls.
fn is_within(scene: &Scene, at: DVec2, clear_m: f64) -> bool {
    scene.clearance_m(at) > clear_m && scene.are_accessible(&[at]) == [true]
}

/// Adds one to three posts with a radius of 2 to 12 cm, at least 0.3 m from walls, stops and each
/// other.
fn add_posts(scene: &mut Scene, stops: &[Pose], random: &mut impl Rng) {
    const CLEAR_M: f64 = 0.3;
    const MAX_TRIES: usize = 5000;
    let [low, high] = extent(scene);
    let material = scene.walls[0].material;
    let count = random.random_range(1..=3);
    for _ in 0..MAX_TRIES {
        if scene.cylinders.len() == count {
            break;
        }
        let center = low + DVec2::new(random.random(), random.random()) * (high - low);
        let radius_m = random.random_range(0.02..0.12);
        let clear_m = radius_m + CLEAR_M;
        let is_clear = is_within(scene, center, clear_m)
            && stops.iter().all(|stop| stop.position().distance(center) > clear_m);
        if is_clear {
            let id = format!("post-{}", scene.cylinders.len() + 1).into();
            scene.cylinders.push(Cylinder { id, center, radius_m, material, z_m: None });
        }
    }
}

/// Draws a place with clearance in a room that has one.
pub fn draw_place(scene: &Scene, random: &mut impl Rng) -> DVec2 {
    let [low, high] = extent(scene);
    loop {
        let share = DVec2::new(random.random(), random.random());
        let at = low + share * (high - low);
        if is_free(scene, at) {
            return at;
        }
    }
}

/// Draws a course of stops, 0.4 to 0.8 m from each to the next, straight and with clearance.
fn draw_course(scene: &Scene, stops: usize, random: &mut impl Rng) -> Vec<Pose> {
    const MAX_TRIES: usize = 5000;
    let mut places = vec![draw_place(scene, random)];
    let mut heading_deg: f64 = random.random_range(0.0..360.0);
    let mut tries = 0;
    while places.len() < stops && tries < MAX_TRIES {
        tries += 1;
        let turn = normal(random) * (50.0 + tries.min(130) as f64);
        let next_deg = heading_deg + turn;
        let from = places[places.len() - 1];
        let step_m = random.random_range(0.4..0.8);
        let to = from + step_m * DVec2::from_angle(next_deg.to_radians());
        let is_clear = (0..9).all(|at| is_free(scene, from.lerp(to, f64::from(at) / 8.0)));
        let is_old = places.iter().any(|place| place.distance(to) < 0.35);
        if !is_clear || (is_old && random.random::<f64>() < 0.9) {
            continue;
        }
        places.push(to);
        (heading_deg, tries) = (next_deg, 0);
    }
    let heading = |at: usize| match places.get(at + 1) {
        Some(next) => (next - places[at]).to_angle().to_degrees(),
        None => heading_deg,
    };
    let pose = |at: usize| Pose { x_m: places[at].x, y_m: places[at].y, heading_deg: heading(at) };
    (0..places.len()).map(pose).collect()
}

/// Poses at equal distances along a course, each with the heading of its leg.
#[must_use]
pub fn poses_along(course: &[Pose], count: usize) -> Vec<Pose> {
    let leg_m = |pair: &[Pose]| pair[0].position().distance(pair[1].position());
    let total_m: f64 = course.windows(2).map(leg_m).sum();
    let pose = |at: usize| {
        let mut rest_m = total_m * at as f64 / count.saturating_sub(1).max(1) as f64;
        let leg = course.windows(2).find(|pair| {
            let is_here = rest_m <= leg_m(pair);
            rest_m -= if is_here { 0.0 } else { leg_m(pair) };
            is_here
        });
        let (Some(leg), true) = (leg, at + 1 < count) else { return course.last().copied() };
        let place = leg[0].position().lerp(leg[1].position(), rest_m / leg_m(leg).max(1e-9));
        Some(Pose { x_m: place.x, y_m: place.y, heading_deg: leg[0].heading_deg })
    };
    (0..count).filter_map(pose).collect()
}

/// Odometry of a course whose moves have errors: standard deviations of the position, metres per
/// metre, and of the heading, degrees per metre.
pub fn drift(poses: &[Pose], per_m: [f64; 2], random: &mut impl Rng) -> Vec<Pose> {
    let Some(first) = poses.first() else { return Vec::new() };
    let mut odometry = vec![*first];
    for pair in poses.windows(2) {
        let moved = pair[0].point_in_frame(pair[1].position());
        let length_m = moved.length();
        let error = DVec2::new(normal(random), normal(random)) * per_m[0] * length_m;
        let turn_deg =
            pair[1].heading_deg - pair[0].heading_deg + per_m[1] * length_m * normal(random);
        let from = odometry[odometry.len() - 1];
        let by = from.rotate_to_world(moved + error);
        odometry.push(Pose {
            x_m: from.x_m + by.x,
            y_m: from.y_m + by.y,
            heading_deg: from.heading_deg + turn_deg,
        });
    }
    odometry
}

/// Standard normal deviate.
pub(super) fn normal(random: &mut impl Rng) -> f64 {
    Normal::new(0.0, 1.0).map_or(0.0, |normal| normal.sample(random))
}
