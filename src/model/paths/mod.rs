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
//! Cylinders hide what is behind them and reflect. Echoes with one reflection at a cylinder, and
//! any at walls before and after, are exact: pairs of beams that meet the cylinder, joined where
//! the way is shortest (`rounds`), with the spreading of a curved mirror. Echoes that touch
//! cylinders twice, or a cylinder and an edge, and the sound that creeps around a cylinder are
//! left out; cylinders thinner than a wavelength reflect less than they would here.
//!
//! # Scans
//!
//! Paths depend on the place alone. A survey by [`PathEngine`] finds them,
//! and each azimuth weighs them with the beam pattern on departure and arrival (`survey`).
//! For a transducer off the rotation axis, or a robot body that turns with it, each azimuth is a
//! place of its own: survey from where the face is, in the scene as it then stands.

mod beam;
mod edges;
mod mesh;
mod rounds;
mod survey;
#[cfg(test)]
mod tests;
mod trace;
mod trains;

pub use survey::PathEngine;

use smallvec::SmallVec;

use self::{beam::Ray, edges::Edges, mesh::Mesh, rounds::Rounds, trace::Tree};
use crate::{
    acoustics::edge::EdgeLaw,
    geometry::{Arrangement, DVec2, Mirror, square_up},
    model::{Path, Reflector},
    scan::PathKind,
    scene::{Material, Scene},
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
#[derive(Debug)]
pub struct Paths {
    settings: Settings,
    /// By wall.
    faces: Vec<Face>,
    edges: Edges,
    rounds: Rounds,
    /// `None` for a scene with nothing in it.
    mesh: Option<Mesh>,
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
    /// The way it took.
    pub path: Path,
}

impl Paths {
    /// Prepares a scene.
    #[must_use]
    pub fn new(scene: &Scene, settings: Settings) -> Self {
        let mut segments: Vec<_> = scene.walls.iter().map(|wall| (wall.a, wall.b)).collect();
        square_up(&mut segments);
        let plan = Arrangement::of(&segments);
        let extra: Vec<_> = scene
            .cylinders
            .iter()
            .flat_map(|c| [c.center - c.radius_m, c.center + c.radius_m])
            .collect();
        // From outside the box no echo is short enough.
        let mesh = Mesh::new(&plan, &extra, 0.5 * settings.max_path_m + 1.0);
        let face = |(&(a, b), &gain): (&(DVec2, DVec2), &f64)| {
            let mirror = Mirror::through(a, b);
            let loss_m = settings.same_loss_m(gain);
            Face { mirror, rotor: mirror.rotor(), gain, loss_m }
        };
        let gains: Vec<_> = scene.walls.iter().map(|wall| mirror_gain(&wall.material)).collect();
        let round: Vec<_> = scene.cylinders.iter().map(|c| mirror_gain(&c.material)).collect();
        Self {
            faces: segments.iter().zip(&gains).map(face).collect(),
            edges: settings
                .edge_law
                .map(|law| Edges::new(&plan, &segments, &gains, law))
                .unwrap_or_default(),
            rounds: Rounds::new(&scene.cylinders, &round, mesh.as_ref()),
            settings,
            mesh,
        }
    }

    /// All echo paths from a place, shortest first.
    #[must_use]
    pub fn enumerate(&self, position: DVec2) -> Vec<EchoPath> {
        let (tree, echoes) = self.echoes(position);
        echoes.iter().map(|echo| self.path(&tree, echo)).collect()
    }

    fn echoes(&self, position: DVec2) -> (Tree, Vec<Echo>) {
        let mut tree = Tree::grow(self, position);
        let mut echoes: Vec<Echo> = tree
            .returns
            .iter()
            .map(|ray| Echo {
                length_m: ray.run.length(),
                amplitude: ray.gain * self.settings.air_gain(ray.run.length()),
                phase_rad: 0.0,
                departure: ray.departure,
                arrival: -ray.run.normalize_or_zero(),
                via: Via::Walls { node: ray.node },
            })
            .filter(|echo| echo.amplitude >= self.settings.floor)
            .collect();
        if let Some(law) = self.settings.edge_law {
            echoes.extend(self.edges.echoes(&mut tree, law, &self.settings));
        }
        if let Some(mesh) = self.mesh.as_ref().filter(|_| !self.rounds.is_empty()) {
            echoes.extend(self.rounds.echoes(&mut tree, mesh, &self.settings));
            echoes.retain(|echo| !self.is_hidden(&tree, echo, position));
        }
        (tree, sorted(&echoes))
    }

    /// Whether a cylinder stands in an echo's way.
    fn is_hidden(&self, tree: &Tree, echo: &Echo, position: DVec2) -> bool {
        let hides = |leg: Leg, end| self.hides_leg(tree, leg, position, end);
        match tree.legs(echo) {
            (out, None) => hides(out, position),
            (out, Some(back)) => {
                let end = match echo.via {
                    Via::Edge { point, .. } => self.edges.place(point),
                    Via::Cylinder { bounce, .. } => Some(tree.bounces[bounce as usize].hit),
                    Via::Walls { .. } => None,
                };
                end.is_some_and(|end| hides(out, end) || hides(back, end))
            }
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

    fn path(&self, tree: &Tree, echo: &Echo) -> EchoPath {
        EchoPath {
            length_m: echo.length_m,
            amplitude: echo.amplitude,
            phase_rad: echo.phase_rad,
            departure_rad: echo.departure.to_angle(),
            arrival_rad: echo.arrival.to_angle(),
            path: self.way(tree, echo),
        }
    }

    /// The reflectors of an echo, in order.
    fn way(&self, tree: &Tree, echo: &Echo) -> Path {
        let back_to = |leg| tree.walls_back(&self.faces, leg).map(Reflector::Wall);
        let (out, back) = tree.legs(echo);
        let mut walls: SmallVec<[Reflector; 4]> = back_to(out).collect();
        walls.reverse();
        let (kind, edge) = match echo.via {
            Via::Walls { .. } => (PathKind::Specular, None),
            Via::Edge { point, .. } => (PathKind::Diffracted, self.edges.edge(point)),
            Via::Cylinder { bounce, .. } => {
                walls.push(Reflector::Cylinder(tree.bounces[bounce as usize].cylinder));
                (PathKind::Specular, None)
            }
        };
        walls.extend(back.into_iter().flat_map(back_to));
        Path { kind, walls, edge }
    }
}

/// Amplitude of a material's mirror reflection: a rough surface scatters a share of the energy
/// that it does not absorb.
fn mirror_gain(material: &Material) -> f64 {
    material.reflectance * (1.0 - material.roughness).sqrt()
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
    via: Via,
}

/// The way of an echo; see [`Tree::legs`].
#[derive(Debug, Clone, Copy)]
enum Via {
    Walls {
        node: u32,
    },
    /// `out` and `back` are rays to the edge.
    Edge {
        point: u32,
        out: u32,
        back: u32,
    },
    Cylinder {
        bounce: u32,
        backwards: bool,
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

impl Echo {
    /// The same way run through backwards.
    fn reversed(&self) -> Self {
        let via = match self.via {
            Via::Walls { .. } => self.via,
            Via::Edge { point, out, back } => Via::Edge { point, out: back, back: out },
            Via::Cylinder { bounce, backwards } => Via::Cylinder { bounce, backwards: !backwards },
        };
        Self { departure: self.arrival, arrival: self.departure, via, ..*self }
    }

    /// Whether two echoes are one that touches a corner and was found on both sides of it.
    fn is_same(&self, other: &Self) -> bool {
        self.departure.distance_squared(other.departure) < SAME_RAD * SAME_RAD
            && self.arrival.distance_squared(other.arrival) < SAME_RAD * SAME_RAD
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
