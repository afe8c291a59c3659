//! The exact engine: all echo paths of a place, by tracing beams through the floor plan.
//!
//! # Mirror reflections
//!
//! Sound that mirrors have turned back and forth runs straight on from an image of its source
//! (Allen and Berkley, JASA 65, 1979, for boxes; Borish, JASA 75, 1984, for any polyhedron). How
//! many images there are grows without bounds, but few are seen from where one listens. Beams
//! find those alone (Heckbert and Hanrahan 1984; Funkhouser et al., JASA 115, 2004): a beam is
//! all rays from an image that met the same walls. The plan is triangulated once, with the walls
//! as sides of triangles (`mesh`). A beam walks from triangle to triangle; at the
//! triangle's far corner it splits in two, at a wall it turns into a beam from the next image.
//! So visibility needs no search: what a beam walks through is what its rays see, a step costs
//! the same in a plan of ten walls and of ten thousand, and each ray from the source is in exactly
//! one beam at each order. An echo is a beam that holds the source itself. Beams that a corner
//! split but that stand side by side before the same image and wall later are joined again
//! (`trace`).
//!
//! A beam ends when no echo of it can be both short and strong enough: the shortest way from the
//! image through the beam's part of the wall back to the source bounds the length from below, and
//! with it absorption and the reflectances so far bound the amplitude from above.
//!
//! # Ties
//!
//! The echo of a right-angled corner runs exactly through the corner, on the border of two beams
//! (wall a first, or wall b first). Beams therefore are closed: a ray within a nanometre
//! of a border counts as inside, and such an echo is found on both sides. Both have the same
//! length, departure and arrival. But only one ray leaves in a given direction, so two echoes
//! that agree in all three are one, and one is kept. The same rule covers joints of collinear
//! walls and all corners of `pi / m`. An echo on the very end of a wall counts as seen, and the
//! edge's echo, which is minus half of it there, knows that. Corners that are right-angled but for
//! the rounding of their coordinates are made so first ([`square_up`]).
//!
//! # Pairs
//!
//! An echo path can be run through in both directions. If the walls read the same backwards the
//! path comes back on itself and is one echo. Otherwise both directions arrive, at the same time
//! and in phase, with departure and arrival swapped: they are listed as two echoes, as two images
//! of the source. (A right-angled corner is both in one: one image, one echo.)
//!
//! # Edges
//!
//! Sound bends at free ends and at corners that are not `pi / m`. By reciprocity the ways back
//! from an edge are the ways to it, so the one-way rays to each edge, from the same tree,
//! give all echoes with one diffraction and any reflections before and after: every pair of a way
//! out and a way back (`edges`). How much comes back says [`crate::acoustics::edge`].
//!
//! # Cylinders
//!
//! Cylinders hide what is behind them and reflect. Behind a cylinder a beam has no image any more;
//! it goes on as a tube of rays (`tubes`), which walks the same mesh. Rays off convex surfaces
//! spread and never cross, so in each tube one ray at most comes back to the receiver, or to an
//! edge, and is found as the zero of a monotone function. Its tube's width, by the mirror equation
//! at each cylinder, says how much the sound has spread.
//!
//! Paths touch cylinders three times at most, and are followed down to the threshold only: between
//! a round body and a wall beside it they are without number. The sound that creeps around a
//! cylinder is left out, which matters in the shadow and for radii of few wavelengths; cylinders
//! thinner than a wavelength reflect less than they would here.
//!
//! # Rough walls
//!
//! They scatter what they do not mirror, and so are seen at aspects from which a mirror is not
//! (`scatter`).
//!
//! # Heights
//!
//! Walls are upright: what floor and ceiling add to the paths of the plan, and what low walls take
//! away, is worked out after them (`vertical`, `heights`).
//!
//! # The transducer's face
//!
//! It reflects too, and turns with the azimuth: an echo may go round again (`trains`).
//!
//! # Scans
//!
//! Paths depend on the place alone. A survey by [`PathEngine`] finds them,
//! and each azimuth weighs them with the beam pattern on departure and arrival (`survey`).
//! For a transducer off the rotation axis each azimuth is a place of its own: survey from where the
//! face is. Transmitter and receiver apart are two places ([`Paths::enumerate_between`]). A robot
//! body is part of the scene ([`Scene::with_robot_at`]).

mod beam;
mod edges;
mod heights;
mod mesh;
mod rounds;
mod scatter;
mod survey;
#[cfg(test)]
mod tests;
mod trace;
mod trains;
mod tube;
mod tubes;
mod vertical;
mod wheel;

pub use survey::PathEngine;

use std::sync::Arc;

use smallvec::SmallVec;

use self::{
    beam::Ray,
    edges::Edges,
    heights::Heights,
    mesh::Mesh,
    rounds::{Circle, Rounds},
    trace::Tree,
    tube::{Curved, Tracer},
    tubes::TubeGrower,
    vertical::Image,
};
use crate::{
    acoustics::edge::EdgeLaw,
    geometry::{Arrangement, DVec2, Mirror, square_up},
    model::{Path, Reflector},
    scan::PathKind,
    scene::{Cylinder, Material, Scene, Wall},
};

/// Echoes that agree in length and both directions to within this are one, metres and radians.
const SAME_M: f64 = 1e-8;
const SAME_RAD: f64 = 1e-9;

/// Which paths count, and the physics on the way.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Longest path there and back, metres.
    pub max_path_m: f64,
    /// Most mirror reflections; `None`: as many as length and amplitude allow.
    pub max_order: Option<u16>,
    /// Weakest amplitude, before the beam pattern, relative to a head-on, rigid wall.
    pub floor: f64,
    /// What edges send back; `None`: mirror reflections only.
    pub edge_law: Option<EdgeLaw>,
    /// Attenuation of the amplitude in air, nepers a metre.
    pub absorption_np_per_m: f64,
    /// Wave number `2 pi f / c`, radians a metre.
    pub wave_number_per_m: f64,
    /// Height of the transducer in a scene with heights, metres; `None`: see [`usual_z_m`].
    pub sensor_z_m: Option<f64>,
    /// How far the transducer's axis points up, radians.
    pub tilt_rad: f64,
    /// How high a strip of a rough wall it hears: the integral of the beam pattern's fourth
    /// power over the rise, radians. 0: rough walls only mirror.
    pub scatter_height_rad: f64,
}

/// The height of a transducer of which nothing is said, metres: half a metre above the floor, or
/// half way up to a low ceiling.
#[must_use]
pub fn usual_z_m(floor_z_m: Option<f64>, ceiling_z_m: Option<f64>) -> f64 {
    let floor_z_m = floor_z_m.or(ceiling_z_m.map(|ceiling| ceiling - 1.0)).unwrap_or(0.0);
    let middle_m = ceiling_z_m.map_or(f64::INFINITY, |ceiling| 0.5 * (ceiling - floor_z_m));
    floor_z_m + middle_m.min(0.5)
}

impl Settings {
    fn allows(&self, order: u16) -> bool {
        self.max_order.is_none_or(|most| order <= most)
    }

    /// The length of air that leaves a share `gain` of the amplitude; 0 without absorption.
    fn same_loss_m(&self, gain: f64) -> f64 {
        if self.absorption_np_per_m > 0.0 { -gain.ln() / self.absorption_np_per_m } else { 0.0 }
    }

    /// The longest path over perfect walls that is strong enough.
    fn audible_m(&self) -> f64 {
        if self.absorption_np_per_m > 0.0 { self.same_loss_m(self.floor) } else { self.max_path_m }
    }

    fn air_gain(&self, length_m: f64) -> f64 {
        (-self.absorption_np_per_m * length_m).exp()
    }
}

/// A scene made ready for enumerating echo paths.
#[derive(Debug, Clone)]
pub struct Paths {
    settings: Settings,
    /// By wall.
    faces: Arc<[Face]>,
    edges: Arc<Edges>,
    rounds: Arc<Rounds>,
    heights: Arc<Heights>,
    /// By floor and ceiling; none in a scene in the plane.
    images: Arc<[Image]>,
    /// `None` for a scene with nothing in it.
    mesh: Option<Arc<Mesh>>,
}

/// A wall as beams need it.
#[derive(Debug, Clone, Copy)]
struct Face {
    mirror: Mirror,
    /// [`Mirror::rotor`].
    rotor: DVec2,
    gain: f64,
    /// The length of air that weakens as much, metres; 0 without absorption.
    loss_m: f64,
    /// Share of the energy that it scatters.
    scatter: f64,
}

/// An echo path, before the beam pattern.
#[derive(Debug, Clone, PartialEq)]
pub struct EchoPath {
    /// Length there and back, metres.
    pub length_m: f64,
    /// Reflectances, edge, curvature and absorption; a head-on, rigid wall without absorption
    /// at the same range gives 1.
    pub amplitude: f64,
    /// Phase beside that of the way, for `exp(+i omega t)`, radians: what an edge adds.
    pub phase_rad: f64,
    /// World direction in which the sound leaves, radians.
    pub departure_rad: f64,
    /// World direction towards where the sound comes from, radians.
    pub arrival_rad: f64,
    /// How far up it leaves and comes from, radians.
    pub rise_rad: [f64; 2],
    /// The way it took.
    pub path: Path,
}

impl Paths {
    /// Prepares a scene.
    #[must_use]
    pub fn new(scene: &Scene, settings: Settings) -> Self {
        let mut segments: Vec<_> = scene.walls.iter().map(|wall| (wall.a, wall.b)).collect();
        square_up(&mut segments);
        let usual = || usual_z_m(scene.floor_z_m, scene.ceiling_z_m);
        let z_m = settings.sensor_z_m.unwrap_or_else(usual);
        let heights = Heights::new(scene, &segments, z_m);
        for (segment, wall) in segments.iter_mut().zip(&scene.walls) {
            if !heights.is_there(wall.z_m) {
                // A point: the others keep their numbers.
                segment.1 = segment.0;
            }
        }
        let plan = Arrangement::of(&segments);
        let there = |cylinder: &&Cylinder| heights.is_there(cylinder.z_m);
        let extra: Vec<_> = scene
            .cylinders
            .iter()
            .filter(there)
            .flat_map(|c| [c.center - c.radius_m, c.center + c.radius_m])
            .collect();
        // From outside the box no echo is short enough.
        let mesh = Mesh::new(&plan, &extra, 0.5 * settings.max_path_m + 1.0);
        let face = |((&(a, b), &gain), wall): ((&(DVec2, DVec2), &f64), &Wall)| {
            let scatter = scattered(&wall.material);
            let mirror = Mirror::through(a, b);
            let loss_m = settings.same_loss_m(gain);
            Face { mirror, rotor: mirror.rotor(), gain, loss_m, scatter }
        };
        let gains: Vec<_> = scene.walls.iter().map(|wall| mirror_gain(&wall.material)).collect();
        // One that is not there has no size: the others keep their numbers.
        let circle = |c: &Cylinder| Circle {
            center: c.center,
            radius_m: if heights.is_there(c.z_m) { c.radius_m } else { 0.0 },
            gain: mirror_gain(&c.material),
        };
        let circles = scene.cylinders.iter().map(circle).collect();
        Self {
            faces: segments.iter().zip(&gains).zip(&scene.walls).map(face).collect(),
            edges: settings
                .edge_law
                .map(|law| Edges::new(&plan, &segments, &gains, law))
                .unwrap_or_default()
                .into(),
            rounds: Rounds::new(circles, mesh.as_ref()).into(),
            images: vertical::images(scene.floor_z_m, scene.ceiling_z_m, z_m, settings.max_path_m)
                .into(),
            heights: heights.into(),
            settings,
            mesh: mesh.map(Arc::new),
        }
    }

    /// The same for paths up to a length, metres, which is at most the one it was prepared for.
    fn within(&self, max_path_m: f64) -> Self {
        let settings = Settings { max_path_m, ..self.settings.clone() };
        Self { settings, ..self.clone() }
    }

    /// All echo paths from a place, shortest first.
    #[must_use]
    pub fn enumerate(&self, position: DVec2) -> Vec<EchoPath> {
        self.enumerate_between(position, position)
    }

    /// All echo paths from a transmitter to a receiver, shortest first, without the straight way
    /// from one to the other.
    #[must_use]
    pub fn enumerate_between(&self, transmitter: DVec2, receiver: DVec2) -> Vec<EchoPath> {
        let (trees, echoes) = self.echoes(transmitter, receiver);
        echoes.iter().map(|echo| self.path(&trees, echo)).collect()
    }

    fn echoes(&self, transmitter: DVec2, receiver: DVec2) -> (Trees, Vec<Echo>) {
        let (out, mut echoes) = self.grow(transmitter, receiver);
        // The ways back from the receiver, as ways to it, matter to edges only.
        let apart = transmitter != receiver && self.settings.edge_law.is_some();
        let back = apart.then(|| self.grow(receiver, transmitter).0);
        let mut trees = Trees { out, back };
        if let Some(law) = self.settings.edge_law {
            echoes.extend(self.edges.echoes(&mut trees, law, &self.settings));
        }
        if !self.rounds.is_empty() {
            echoes.retain(|echo| !self.is_hidden(&trees, echo, [transmitter, receiver]));
        }
        self.add_images(&mut echoes, receiver - transmitter);
        self.retain_clear(&trees, &mut echoes, [transmitter, receiver]);
        (trees, sorted(&echoes))
    }

    /// Each echo of the plan also by way of floor and ceiling, and these by themselves.
    fn add_images(&self, echoes: &mut Vec<Echo>, apart: DVec2) {
        let plan = echoes.len();
        for (image, index) in self.images.iter().zip(1..) {
            for at in 0..plan {
                echoes.extend(image.echo(&echoes[at], index, &self.settings));
            }
            echoes.extend(image.upright_echo(index, apart, &self.settings));
        }
    }

    /// The beams from a place, and the echoes without an edge that they bring to another.
    fn grow(&self, start: DVec2, target: DVec2) -> (Tree, Vec<Echo>) {
        let mut tree = Tree::grow(self, start, target);
        let mut echoes: Vec<Echo> = tree
            .returns
            .iter()
            .map(|ray| Echo {
                length_m: ray.run.length(),
                amplitude: ray.gain * self.settings.air_gain(ray.run.length()),
                phase_rad: 0.0,
                departure: ray.departure,
                arrival: -ray.run.normalize_or_zero(),
                rise_rad: [0.0; 2],
                image: 0,
                via: Via::Walls { node: ray.node },
            })
            .filter(|echo| echo.amplitude >= self.settings.floor)
            .collect();
        if !self.rounds.is_empty() {
            echoes.extend(TubeGrower::new(self, &mut tree, [start, target]).grow());
        }
        if start == target {
            echoes.extend(scatter::echoes(self, &mut tree));
        }
        (tree, echoes)
    }

    /// Whether a cylinder stands in an echo's way. Tubes have seen to that for themselves.
    fn is_hidden(&self, trees: &Trees, echo: &Echo, [start, target]: [DVec2; 2]) -> bool {
        let hides = |tree: &Tree, part: Part, start, end| match part {
            Part::Flat(leg) => self.hides_leg(tree, leg, start, end),
            Part::Curved(_) => false,
        };
        match echo.via {
            Via::Walls { node } => {
                let leg = Leg { node, run: -echo.arrival };
                hides(&trees.out, Part::Flat(leg), start, target)
            }
            Via::Cylinders { .. } | Via::Upright => false,
            Via::Scatter { spot } => {
                let spot = &trees.out.spots[spot as usize];
                hides(&trees.out, Part::Flat(spot.leg), start, spot.place)
            }
            Via::Edge { point, out, back } => self.edges.place(point).is_some_and(|end| {
                let (there, here) = (&trees.out, trees.back());
                hides(there, there.part(out), start, end)
                    || hides(here, here.part(back), target, end)
            }),
        }
    }

    /// Whether a cylinder stands in the way from `start` along a leg to `end`.
    fn hides_leg(&self, tree: &Tree, leg: Leg, start: DVec2, end: DVec2) -> bool {
        let (mut to, mut run) = (end, leg.run);
        for wall in tree.walls_back(&self.faces, leg) {
            let mirror = &self.faces[wall as usize].mirror;
            let hit = to - mirror.height_m(to) / mirror.normal.dot(run) * run;
            if self.rounds.hide(hit, to) {
                return true;
            }
            (to, run) = (hit, mirror.turn(run));
        }
        self.rounds.hide(start, to)
    }

    fn path(&self, trees: &Trees, echo: &Echo) -> EchoPath {
        EchoPath {
            length_m: echo.length_m,
            amplitude: echo.amplitude,
            phase_rad: echo.phase_rad,
            departure_rad: echo.departure.to_angle(),
            arrival_rad: echo.arrival.to_angle(),
            rise_rad: echo.rise_rad,
            path: self.way(trees, echo),
        }
    }

    /// The reflectors of an echo, in order.
    fn way(&self, trees: &Trees, echo: &Echo) -> Path {
        let (tree, home) = (&trees.out, trees.back());
        let (kind, edge) = match echo.via {
            Via::Edge { point, .. } => (PathKind::Diffracted, self.edges.edge(point)),
            Via::Walls { .. } | Via::Cylinders { .. } | Via::Upright => (PathKind::Specular, None),
            Via::Scatter { .. } => (PathKind::Scattered, None),
        };
        let mut walls = match echo.via {
            Via::Walls { node } => self.met(tree, Part::Flat(Leg { node, run: -echo.arrival })),
            Via::Upright => SmallVec::new(),
            Via::Scatter { spot } => {
                let spot = &tree.spots[spot as usize];
                let mut walls = self.met(tree, Part::Flat(spot.leg));
                let back: SmallVec<[Reflector; 4]> = walls.iter().rev().copied().collect();
                walls.push(Reflector::Wall(spot.wall));
                walls.extend(back);
                walls
            }
            Via::Cylinders { curved } => self.met(tree, Part::Curved(curved)),
            Via::Edge { out, back, .. } => {
                let mut walls = self.met(tree, tree.part(out));
                walls.extend(self.met(home, home.part(back)).into_iter().rev());
                walls
            }
        };
        // Floor and ceiling stand after the walls, wherever on the way they are met.
        if let Some(image) = echo.image.checked_sub(1) {
            walls.extend(self.images[image as usize].met());
        }
        Path { kind, walls, edge }
    }

    /// What a ray from the start met, in order.
    fn met(&self, tree: &Tree, part: Part) -> SmallVec<[Reflector; 4]> {
        let mut met = SmallVec::new();
        let leg = match part {
            Part::Flat(leg) => leg,
            Part::Curved(curved) => {
                let Curved { view, link, contact_rad } = tree.curved[curved as usize];
                let view = &tree.to_cylinders[view as usize];
                let tracer = Tracer::new(self, view, &tree.links, link);
                met.extend(tracer.surfaces.iter().rev().copied());
                met.push(Reflector::Cylinder(view.arc.cylinder));
                tracer.leg(contact_rad)
            }
        };
        met.extend(tree.walls_back(&self.faces, leg).map(Reflector::Wall));
        met.reverse();
        met
    }
}

/// Amplitude of a material's mirror reflection: a rough surface scatters a share of the energy
/// that it does not absorb.
fn mirror_gain(material: &Material) -> f64 {
    material.reflectance * (1.0 - material.roughness).sqrt()
}

/// The beams of a place, or of transmitter and receiver.
#[derive(Debug)]
struct Trees {
    /// From the transmitter.
    out: Tree,
    /// From the receiver, if it is somewhere else.
    back: Option<Tree>,
}

impl Trees {
    fn back(&self) -> &Tree {
        self.back.as_ref().unwrap_or(&self.out)
    }
}

/// Share of the energy that a material scatters.
fn scattered(material: &Material) -> f64 {
    material.reflectance.powi(2) * material.roughness
}

/// An echo path with its way as nodes of the tree.
#[derive(Debug, Clone, Copy)]
struct Echo {
    length_m: f64,
    amplitude: f64,
    phase_rad: f64,
    /// Unit vector in which it leaves.
    departure: DVec2,
    /// Unit vector towards where it comes from.
    arrival: DVec2,
    /// How far up it leaves and comes from, radians.
    rise_rad: [f64; 2],
    /// Its image over floor and ceiling, counted from 1; 0 for a path in the plan.
    image: u16,
    via: Via,
}

/// The way of an echo.
#[derive(Debug, Clone, Copy)]
enum Via {
    Walls {
        node: u32,
    },
    /// `out` and `back` are rays to the edge; see [`Tree::part`].
    Edge {
        point: u32,
        out: u32,
        back: u32,
    },
    /// By [`Tree::curved`].
    Cylinders {
        curved: u32,
    },
    /// Straight up or down and back.
    Upright,
    /// Back from a place of a rough wall, by [`Tree::spots`].
    Scatter {
        spot: u32,
    },
}

/// A ray from the start by what its walls follow from.
#[derive(Debug, Clone, Copy)]
struct Leg {
    node: u32,
    run: DVec2,
}

impl From<&Ray> for Leg {
    fn from(ray: &Ray) -> Self {
        Self { node: ray.node, run: ray.run }
    }
}

/// A ray from the start: over walls alone, or by way of cylinders.
#[derive(Debug, Clone, Copy)]
enum Part {
    Flat(Leg),
    /// By its place in [`Tree::curved`].
    Curved(u32),
}

impl Echo {
    /// Whether two echoes are one that touches a corner and was found on both sides of it.
    fn is_same(&self, other: &Self) -> bool {
        self.departure.distance_squared(other.departure) < SAME_RAD * SAME_RAD
            && self.arrival.distance_squared(other.arrival) < SAME_RAD * SAME_RAD
            && self.image == other.image
            && std::mem::discriminant(&self.via) == std::mem::discriminant(&other.via)
    }
}

/// Echoes by length, each once.
fn sorted(echoes: &[Echo]) -> Vec<Echo> {
    // Lengths are positive, so their bits sort like the numbers; places make it stable.
    let mut order: Vec<(u64, u32)> =
        echoes.iter().zip(0..).map(|(echo, place)| (echo.length_m.to_bits(), place)).collect();
    order.sort_unstable();
    let mut sorted: Vec<Echo> = order.iter().map(|&(_, place)| echoes[place as usize]).collect();
    drop_repeats(&mut sorted, |echo| echo.length_m, Echo::is_same);
    sorted
}

/// Keeps the first of items that are the same and within [`SAME_M`] in length. Sorted by length.
fn drop_repeats<T: Copy>(
    items: &mut Vec<T>,
    length_m: impl Fn(&T) -> f64,
    same: impl Fn(&T, &T) -> bool,
) {
    let mut kept = 0;
    for i in 0..items.len() {
        let item = items[i];
        let near = items[..kept]
            .iter()
            .rev()
            .take_while(|other| length_m(&item) - length_m(other) < SAME_M)
            .any(|other| same(&item, other));
        if !near {
            items[kept] = item;
            kept += 1;
        }
    }
    items.truncate(kept);
}
