//! Random floor plans, as intended and as drawn by hand.

use std::f64::consts::TAU;

use super::*;

/// Errors of a hand, metres: at a corner, and past a corner or short of it.
const OFF_M: f64 = 5e-4;

/// A floor plan by its joints.
pub(super) struct Sketch {
    corners: Vec<DVec2>,
    walls: Vec<[At; 2]>,
}

/// End of a wall.
#[derive(Clone, Copy)]
enum At {
    Corner(usize),
    /// On a wall, at a share of its length.
    Wall(usize, f64),
}

/// Style of drawing.
pub(super) struct Hand {
    random: Option<Pcg64>,
    /// `true` if each wall is drawn separately; otherwise its ends are at the joints.
    is_shaky: bool,
}

impl Hand {
    /// Draws the intended plan.
    pub(super) fn steady() -> Self {
        Self { random: None, is_shaky: false }
    }

    /// Misses corners, but keeps all joints.
    pub(super) fn careful(random: &mut impl Rng) -> Self {
        Self { random: Some(Pcg64::from_rng(random)), is_shaky: false }
    }

    /// Misses corners differently with each wall, and its length; draws some walls twice.
    pub(super) fn shaky(random: &mut impl Rng) -> Self {
        Self { random: Some(Pcg64::from_rng(random)), is_shaky: true }
    }
}

impl Sketch {
    /// A room with partitions, boxes in it and at its wall, and a second room beyond a shared wall;
    /// and a place for the ranger.
    pub(super) fn random(random: &mut impl Rng) -> (Self, DVec2) {
        let size = DVec2::new(random.random_range(2.0..4.0), random.random_range(1.5..3.0));
        let skew = random.random_range(-0.2..0.2);
        let mut sketch = Self { corners: Vec::new(), walls: Vec::new() };
        let room = [
            DVec2::ZERO,
            DVec2::new(size.x, 0.0),
            size + DVec2::new(skew, 0.0),
            DVec2::new(0.0, size.y),
        ];
        sketch.ring(&room);
        // Beyond the east wall, with that wall drawn again.
        let out = random.random_range(0.8..1.5);
        let [low, high] = [1, 2].map(|corner| sketch.corners[corner]);
        let first = sketch.corners.len();
        sketch.corners.extend([low + DVec2::new(out, 0.1), high + DVec2::new(out, -0.1)]);
        sketch.walls.push([At::Corner(1), At::Corner(first)]);
        sketch.walls.push([At::Corner(first), At::Corner(first + 1)]);
        sketch.walls.push([At::Corner(first + 1), At::Corner(2)]);
        sketch.walls.push([At::Corner(1), At::Corner(2)]);
        // A partition from the south wall, and sometimes from there to the west wall.
        let share = random.random_range(0.55..0.75);
        let end = DVec2::new(
            size.x * (share + random.random_range(-0.1..0.1)),
            size.y * random.random_range(0.2..0.4),
        );
        let free = sketch.corners.len();
        sketch.corners.push(end);
        sketch.walls.push([At::Wall(0, share), At::Corner(free)]);
        // A box in the room, turned, and one at the north wall of three sides.
        let turn = DVec2::from_angle(random.random_range(0.0..TAU));
        let center = size * DVec2::new(0.78, 0.65);
        let half = DVec2::new(random.random_range(0.08..0.2), random.random_range(0.08..0.2));
        let corner = |x: f64, y: f64| center + (half * DVec2::new(x, y)).rotate(turn);
        sketch.ring(&[corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)]);
        let [from, to] = [random.random_range(0.35..0.5), random.random_range(0.6..0.8)];
        let deep = DVec2::new(0.0, -random.random_range(0.1..0.3));
        let [a, b] = [from, to].map(|share| room[2].lerp(room[3], share) + deep);
        let first = sketch.corners.len();
        sketch.corners.extend([a, b]);
        sketch.walls.push([At::Wall(2, from), At::Corner(first)]);
        sketch.walls.push([At::Corner(first), At::Corner(first + 1)]);
        sketch.walls.push([At::Corner(first + 1), At::Wall(2, to)]);
        let at = size * DVec2::new(random.random_range(0.15..0.45), random.random_range(0.2..0.6));
        (sketch, at)
    }

    fn ring(&mut self, corners: &[DVec2]) {
        let first = self.corners.len();
        self.corners.extend(corners);
        let count = corners.len();
        self.walls
            .extend((0..count).map(|i| [i, (i + 1) % count].map(|at| At::Corner(first + at))));
    }

    /// Scene as drawn by a hand.
    pub(super) fn drawn(&self, hand: &Hand) -> Scene {
        let mut random = hand.random.clone();
        let mut off = || match &mut random {
            Some(random) => {
                OFF_M
                    * random.random::<f64>().sqrt()
                    * DVec2::from_angle(random.random_range(0.0..TAU))
            }
            None => DVec2::ZERO,
        };
        let corners: Vec<DVec2> = self.corners.iter().map(|&corner| corner + off()).collect();
        let end = |at: At, off: &mut dyn FnMut() -> DVec2| match at {
            At::Corner(corner) if hand.is_shaky => self.corners[corner] + off(),
            At::Corner(corner) => corners[corner],
            At::Wall(wall, share) => {
                let [a, b] = self.walls[wall].map(|end| match end {
                    At::Corner(corner) if hand.is_shaky => self.corners[corner],
                    At::Corner(corner) => corners[corner],
                    At::Wall(..) => unreachable!("partitions end on outer walls"),
                });
                a.lerp(b, share) + if hand.is_shaky { off() } else { DVec2::ZERO }
            }
        };
        let mut walls = Vec::new();
        for (index, ends) in self.walls.iter().enumerate() {
            let copies = if hand.is_shaky && index % 3 == 0 { 2 } else { 1 };
            for copy in 0..copies {
                let [mut a, mut b] = ends.map(|at| end(at, &mut off));
                if hand.is_shaky {
                    let along = (b - a).normalize();
                    a += off().x * along;
                    b += off().x * along;
                }
                walls.push(wall(&format!("w{index}-{copy}"), a.into(), b.into(), 0.95));
            }
        }
        scene(walls)
    }
}
