//! Interactions of echo paths, in order, and their positions.
//!
//! An echo stores what the tracer needs to reconstruct its path ([`Via`]): the last node of its
//! rays, edges, and contacts with cylinders by their angle. The order of the interactions follows
//! from these alone (the ray out, the edge or the contact in the middle, the ray back in reverse).
//! Their positions follow by unfolding, from the end of each ray backwards, from wall to wall.
//! Heights come last: with floor and ceiling as windows a path rises evenly over its length in the
//! plan, and where it crosses one of their images the real surface reflects it.

use super::{
    beams::RayLeg,
    cylinders::{MiddleContact, OneWay},
    diffraction::{double::DoubleDiffraction, level::LevelDiffraction},
    echo::{PathEcho, Via},
    height::{Heights, PathEnds},
    prepare::Paths,
    rays::{Contacts, Rays, end_of, wall_contacts},
    traced::Traced,
};
use crate::{
    geometry::DVec2,
    model::{Diffractor, Interaction, Mechanism, Path, Reflector, SearchPart},
};

/// An echo path, before the beam pattern.
#[derive(Debug, Clone, PartialEq)]
pub struct EchoPath {
    /// Length there and back, metres.
    pub length_m: f64,
    /// Product of reflectances, edge diffraction, curvature and absorption; a head-on, rigid wall
    /// without absorption at the same range gives 1.
    pub amplitude: f64,
    /// Phase relative to that of the path's length, for `exp(+i omega t)`, radians; caused by
    /// edges.
    pub phase_rad: f64,
    /// World direction of departure, radians.
    pub departure_rad: f64,
    /// World direction towards the origin of the arriving sound, radians.
    pub arrival_rad: f64,
    /// Elevation of departure and arrival, radians.
    pub rise_rad: [f64; 2],
    /// Interactions along the path, in order.
    pub path: Path,
}

/// Effort of reconstructing a path, in steps.
const STEPS_PER_PATH: usize = 10;

/// Length within which interactions coincide, metres.
const COINCIDENT_M: f64 = 1e-12;

/// A part of a path with known ends and contacts in the plan.
struct Stretch<'a> {
    from: DVec2,
    contacts: &'a [(DVec2, Mechanism)],
    to: DVec2,
    /// Height gained along it with floor and ceiling as windows, metres.
    climb_m: f64,
    /// Number of reflections at floor and ceiling.
    bounces: u16,
}

impl Paths {
    /// Returns the full description of an echo.
    pub(super) fn path(&self, traced: &Traced, echo: &PathEcho) -> EchoPath {
        EchoPath {
            length_m: echo.length_m,
            amplitude: echo.amplitude,
            phase_rad: echo.phase_rad,
            departure_rad: echo.departure.to_angle(),
            arrival_rad: echo.arrival.to_angle(),
            rise_rad: echo.rise_rad,
            path: Path { interactions: self.interactions(traced, echo).into() },
        }
    }

    /// Number of mirror reflections of an echo that is neither diffracted nor scattered.
    pub(super) fn reflection_count(&self, traced: &Traced, echo: &PathEcho) -> usize {
        let (there, here) = (&traced.out, traced.back());
        let upright = match echo.via {
            Via::Walls { node } => {
                there.order(&self.plan, OneWay::Walls(RayLeg { node, run: -echo.arrival }))
            }
            Via::Cylinder { connection } => {
                let MiddleContact { out, back, .. } = traced.connections[connection as usize];
                there.order(&self.plan, out) + 1 + here.order(&self.plan, back)
            }
            _ => 0,
        };
        upright + usize::from(self.heights.image(echo.image).bounces)
    }

    /// Removes echoes with too many reflections, those at floor and ceiling included.
    pub(super) fn retain_allowed(&self, traced: &Traced, echoes: &mut Vec<PathEcho>) {
        let settings = &self.plan.settings;
        if settings.max_order.is_none() {
            return;
        }
        echoes.retain(|echo| {
            let bounces = self.heights.image(echo.image).bounces;
            bounces == 0 || {
                let contacts = self.contacts(traced, echo, traced.ends[1]);
                let is_mirror =
                    |contact: &&(DVec2, Mechanism)| matches!(contact.1, Mechanism::Reflection(_));
                settings.allows(bounces + contacts.iter().filter(is_mirror).count() as u16)
            }
        });
    }

    /// Removes echoes whose path misses a wall above or below, or is blocked by one.
    pub(super) fn retain_clear(&self, traced: &Traced, echoes: &mut Vec<PathEcho>) {
        let [start, target] = traced.ends;
        let is_clear = |echo: &PathEcho| {
            if !self.plan.effort.step(SearchPart::Images, STEPS_PER_PATH) {
                return false;
            }
            let rise_m = self.heights.image(echo.image).rise_m;
            let ends = PathEnds { start, end: Some(target), rise_m };
            let contacts = self.contacts(traced, echo, target);
            self.heights.is_path_clear(&self.plan.cylinders, &contacts, &ends)
        };
        if self.heights.need_checks() {
            echoes.retain(is_clear);
        }
    }

    /// Interactions of an echo, in order.
    fn interactions(&self, traced: &Traced, echo: &PathEcho) -> Vec<Interaction> {
        let [from, to] = traced.ends;
        if let Via::LevelEdge { level } = echo.via {
            return self.by_level_edge(traced, &traced.level[level as usize]);
        }
        let image = self.heights.image(echo.image);
        let contacts = self.contacts(traced, echo, to);
        let (climb_m, bounces) = (image.rise_m, image.bounces);
        Stretch { from, contacts: &contacts, to, climb_m, bounces }.in_space(&self.heights)
    }

    /// Interactions from the ray out to the point of diffraction, and from the receiver's ray in
    /// reverse.
    fn by_level_edge(&self, traced: &Traced, level: &LevelDiffraction) -> Vec<Interaction> {
        let wall = level.wall;
        let rise_m = self.heights.edge_rise_m(wall, level.is_upper);
        let half = |end: usize, Rays { beams, .. }: &Rays| {
            let (from, leg) = (traced.ends[end], level.legs[end]);
            let to = end_of(beams, &self.plan, leg, from);
            let contacts = wall_contacts(beams, &self.plan, leg, to);
            let image = self.heights.image(level.images[end]);
            let (climb_m, bounces) = (image.climb_m(rise_m), image.bounces);
            let stretch = Stretch { from, contacts: &contacts, to, climb_m, bounces };
            (to, stretch.in_space(&self.heights))
        };
        let (point, mut interactions) = half(0, &traced.out);
        let (_, back) = half(1, traced.back());
        let diffractor = Diffractor::Level { wall, is_upper: level.is_upper };
        let z_m = self.heights.z_at(rise_m);
        interactions.push(Interaction {
            mechanism: Mechanism::Diffraction(diffractor),
            point,
            z_m,
        });
        interactions.extend(back.into_iter().rev());
        interactions
    }

    /// Interactions of a path in the plan, from transmitter to receiver.
    fn contacts(&self, traced: &Traced, echo: &PathEcho, target: DVec2) -> Contacts {
        let (there, here) = (&traced.out, traced.back());
        match echo.via {
            // A level edge has its own images by floor and ceiling.
            Via::Upright | Via::LevelEdge { .. } => Contacts::new(),
            Via::Walls { node } => {
                let leg = RayLeg { node, run: -echo.arrival };
                wall_contacts(&there.beams, &self.plan, leg, target)
            }
            Via::Scatter { patch } => {
                let patch = &traced.patches[patch as usize];
                let ray = OneWay::Walls(patch.leg);
                let middle = (patch.point, Mechanism::Scattering { wall: patch.wall });
                self.out_and_back([(there, ray), (there, ray)], middle)
            }
            Via::Cylinder { connection } => {
                let MiddleContact { cylinder, angle_rad, out, back } =
                    traced.connections[connection as usize];
                let point = self.plan.cylinders.circles[cylinder as usize].point(angle_rad);
                let middle = (point, Mechanism::Reflection(Reflector::Cylinder(cylinder)));
                self.out_and_back([(there, out), (here, back)], middle)
            }
            Via::Edges { double } => self.by_two_edges(traced, &traced.double[double as usize]),
            Via::Edge { point, out, back, .. } => {
                let Some(middle) = self.upright_diffractor(point) else { return Contacts::new() };
                let rays = [(there, there.to_edge(out)), (here, here.to_edge(back))];
                self.out_and_back(rays, middle)
            }
        }
    }

    /// Interactions out on one ray to a point, and back in reverse on another that ends there.
    fn out_and_back(&self, rays: [(&Rays, OneWay); 2], middle: (DVec2, Mechanism)) -> Contacts {
        let [mut out, back] = rays.map(|(rays, ray)| rays.contacts(&self.plan, ray, middle.0));
        out.push(middle);
        out.extend(back.into_iter().rev());
        out
    }

    fn upright_diffractor(&self, point: u32) -> Option<(DVec2, Mechanism)> {
        let corners = &self.plan.corners;
        Some((corners.position(point)?, Mechanism::Diffraction(corners.diffractor(point)?)))
    }

    fn by_two_edges(&self, traced: &Traced, path: &DoubleDiffraction) -> Contacts {
        let DoubleDiffraction { points: [first, second], leg, out, back } = *path;
        let diffractors = [first, second].map(|point| self.upright_diffractor(point));
        let [Some(a), Some(b)] = diffractors else { return Contacts::new() };
        let (there, here) = (&traced.out, traced.back());
        let between = &self.edge_to_edge.at(&self.plan, first).beams;
        let leg = RayLeg::from(&between.to_edges[leg as usize].1);
        let mut contacts = there.contacts(&self.plan, there.to_edge(out), a.0);
        contacts.push(a);
        contacts.extend(wall_contacts(between, &self.plan, leg, b.0));
        contacts.push(b);
        let back = here.contacts(&self.plan, here.to_edge(back), b.0);
        contacts.extend(back.into_iter().rev());
        contacts
    }
}

impl Stretch<'_> {
    /// Interactions with their heights, including those at floor and ceiling.
    fn in_space(&self, heights: &Heights) -> Vec<Interaction> {
        let mut interactions = Vec::with_capacity(self.contacts.len() + usize::from(self.bounces));
        let z_m = |share: f64| heights.z_at(share * self.climb_m);
        let contacts = self.contacts.iter().map(|&(at, mechanism)| (at, Some(mechanism)));
        let ends = || contacts.clone().chain([(self.to, None)]);
        let starts = std::iter::once(self.from).chain(self.contacts.iter().map(|&(at, _)| at));
        let legs_m = || starts.clone().zip(ends()).map(|(from, (to, _))| from.distance(to));
        let plan_m: f64 = legs_m().sum();
        let mut bounces = heights.bounces(self.climb_m, self.bounces).peekable();
        let mut along_m = 0.0;
        for ((from, leg_m), (to, mechanism)) in starts.clone().zip(legs_m()).zip(ends()) {
            // In the corner of a wall and the floor both coincide; the wall is then listed first.
            let is_before =
                |share: f64| mechanism.is_none() || share * plan_m < along_m + leg_m - COINCIDENT_M;
            while let Some(bounce) = bounces.next_if(|bounce| is_before(bounce.share)) {
                let leg_share = (bounce.share * plan_m - along_m) / leg_m.max(f64::MIN_POSITIVE);
                interactions.push(Interaction {
                    mechanism: Mechanism::Reflection(bounce.surface),
                    point: from.lerp(to, leg_share.clamp(0.0, 1.0)),
                    z_m: Some(bounce.z_m),
                });
            }
            along_m += leg_m;
            let z_m = z_m(along_m / plan_m);
            interactions.extend(mechanism.map(|mechanism| Interaction {
                mechanism,
                point: to,
                z_m,
            }));
        }
        interactions
    }
}
