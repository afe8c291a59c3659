//! The interactions of echo paths: what they meet, in order, and where.
//!
//! A survey keeps an echo by what the tracer needs to find it again ([`Via`]): rays by their last node,
//! edges, contacts with cylinders by their angle. In which order all is met follows from these alone (the
//! way out, the edge or the contact in the middle, the way back in reverse), and where by unfolding: from
//! the end of each ray backwards, from wall to wall. Heights come last. If floor and ceiling were
//! windows, a path would rise evenly over its length in the plan; where it crosses one of their images,
//! it is reflected by the real one.

use smallvec::SmallVec;

use super::{
    Echo, EchoPath, Paths, Trees, Via,
    beam::Ray,
    bridges::Bridged,
    heights::Heights,
    joints::Joint,
    rims::Rim,
    trace::Tree,
    tube::{Curved, Tracer, surfaces_to},
};
use crate::{
    geometry::DVec2,
    model::{Bend, Interaction, Mechanism, Path, Reflector},
};

/// A ray from the start by what its walls follow from.
#[derive(Debug, Clone, Copy)]
pub(super) struct Leg {
    pub(super) node: u32,
    pub(super) run: DVec2,
}

impl From<&Ray> for Leg {
    fn from(ray: &Ray) -> Self {
        Self { node: ray.node, run: ray.run }
    }
}

/// A ray from the start: over walls alone, or by way of cylinders.
#[derive(Debug, Clone, Copy)]
pub(super) enum Part {
    Flat(Leg),
    /// By its place in [`super::trace::Tree::curved`].
    Curved(u32),
}

/// What a path meets within this length, metres, it meets at once.
const AT_ONCE_M: f64 = 1e-12;

/// The interactions of a path in the plan, in order, before any height.
pub(super) type Contacts = SmallVec<[(DVec2, Mechanism); 8]>;

/// A part of a path whose ends and contacts are known in the plan.
struct Stretch<'a> {
    from: DVec2,
    contacts: &'a [(DVec2, Mechanism)],
    to: DVec2,
    /// How much higher it ends than it begins if floor and ceiling are windows, metres.
    climb_m: f64,
    /// Reflections at floor and ceiling.
    bounces: u16,
}

impl Paths {
    pub(super) fn path(&self, trees: &Trees, echo: &Echo) -> EchoPath {
        EchoPath {
            length_m: echo.length_m,
            amplitude: echo.amplitude,
            phase_rad: echo.phase_rad,
            departure_rad: echo.departure.to_angle(),
            arrival_rad: echo.arrival.to_angle(),
            rise_rad: echo.rise_rad,
            path: Path { interactions: self.interactions(trees, echo) },
        }
    }

    /// The interactions of an echo, in order.
    fn interactions(&self, trees: &Trees, echo: &Echo) -> Vec<Interaction> {
        let [from, to] = trees.ends;
        if let Via::Rim { rim } = echo.via {
            return self.over_rim(trees, &trees.rims[rim as usize]);
        }
        let image = self.image(echo.image);
        let contacts = self.contacts(trees, echo, to);
        let (climb_m, bounces) = (image.rise_m, image.bounces);
        Stretch { from, contacts: &contacts, to, climb_m, bounces }.in_space(&self.heights)
    }

    /// Out to where it bends, and in reverse the way from the receiver to there.
    fn over_rim(&self, trees: &Trees, rim: &Rim) -> Vec<Interaction> {
        let wall = rim.wall;
        let rise_m = self.heights.rim_rise_m(wall, rim.is_upper);
        let way = |end: usize, tree: &Tree| {
            let (from, leg) = (trees.ends[end], rim.legs[end]);
            let to = self.end_of(tree, leg, from);
            let contacts = self.leg_contacts(tree, leg, to);
            let image = self.image(rim.images[end]);
            let (climb_m, bounces) = (image.climb_m(rise_m), image.bounces);
            let stretch = Stretch { from, contacts: &contacts, to, climb_m, bounces };
            (to, stretch.in_space(&self.heights))
        };
        let (point, mut interactions) = way(0, &trees.out);
        let (_, back) = way(1, trees.back());
        let bend = Bend::Level { wall, is_upper: rim.is_upper };
        let z_m = self.heights.z_at(rise_m);
        interactions.push(Interaction { mechanism: Mechanism::Diffraction(bend), point, z_m });
        interactions.extend(back.into_iter().rev());
        interactions
    }

    /// Where a ray from `start` ends.
    fn end_of(&self, tree: &Tree, leg: Leg, start: DVec2) -> DVec2 {
        let walls: SmallVec<[u32; 8]> = tree.walls_back(&self.faces, leg).collect();
        let mirror = |wall: &u32| self.faces[*wall as usize].mirror;
        let image = walls.iter().rev().map(mirror).fold(start, |at, mirror| mirror.image(at));
        image + leg.run
    }

    /// How many mirrors an echo meets that is neither bent nor scattered.
    pub(super) fn mirrors_met(&self, trees: &Trees, echo: &Echo) -> usize {
        let upright = match echo.via {
            Via::Walls { node } => {
                self.order(&trees.out, Part::Flat(Leg { node, run: -echo.arrival }))
            }
            Via::Cylinder { joint } => {
                let Joint { out, back, .. } = trees.joints[joint as usize];
                self.order(&trees.out, out) + 1 + self.order(trees.back(), back)
            }
            _ => 0,
        };
        upright + usize::from(self.image(echo.image).bounces)
    }

    /// How many walls and cylinders a ray from the start met.
    fn order(&self, tree: &Tree, part: Part) -> usize {
        let (leg, round) = match part {
            Part::Flat(leg) => (leg, 0),
            Part::Curved(curved) => {
                let Curved { view, link, contact_rad } = tree.curved[curved as usize];
                let view = &tree.to_cylinders[view as usize];
                let surfaces = surfaces_to(&tree.links, link);
                let tracer = Tracer { paths: self, view, surfaces: &surfaces };
                (tracer.leg(contact_rad), 1 + surfaces.len())
            }
        };
        round + tree.walls_back(&self.faces, leg).count()
    }

    /// The interactions of a path in the plan, from transmitter to receiver.
    pub(super) fn contacts(&self, trees: &Trees, echo: &Echo, target: DVec2) -> Contacts {
        let (there, here) = (&trees.out, trees.back());
        match echo.via {
            // A rim has ways to floor and ceiling of its own.
            Via::Upright | Via::Rim { .. } => Contacts::new(),
            Via::Walls { node } => {
                self.leg_contacts(there, Leg { node, run: -echo.arrival }, target)
            }
            Via::Scatter { spot } => {
                let spot = &there.spots[spot as usize];
                let part = Part::Flat(spot.leg);
                let middle = (spot.place, Mechanism::Scattering { wall: spot.wall });
                self.out_and_back([(there, part), (there, part)], middle)
            }
            Via::Cylinder { joint } => {
                let Joint { cylinder, place_rad, out, back } = trees.joints[joint as usize];
                let place = self.rounds.circles[cylinder as usize].point(place_rad);
                let middle = (place, Mechanism::Reflection(Reflector::Cylinder(cylinder)));
                self.out_and_back([(there, out), (here, back)], middle)
            }
            Via::Edges { way } => self.bridged_contacts(trees, &trees.bridged[way as usize]),
            Via::Edge { point, out, back } => {
                let Some(middle) = self.upright_bend(point) else { return Contacts::new() };
                self.out_and_back([(there, there.part(out)), (here, here.part(back))], middle)
            }
        }
    }

    /// Out on one ray to a place, and back in reverse on another that ends there.
    fn out_and_back(&self, rays: [(&Tree, Part); 2], middle: (DVec2, Mechanism)) -> Contacts {
        let [mut out, back] = rays.map(|(tree, part)| self.part_contacts(tree, part, middle.0));
        out.push(middle);
        out.extend(back.into_iter().rev());
        out
    }

    fn upright_bend(&self, point: u32) -> Option<(DVec2, Mechanism)> {
        let bend = Bend::Upright(self.edges.edge(point)?);
        Some((self.edges.place(point)?, Mechanism::Diffraction(bend)))
    }

    fn bridged_contacts(&self, trees: &Trees, way: &Bridged) -> Contacts {
        let Bridged { points: [first, second], leg, out, back } = *way;
        let bends = [first, second].map(|point| self.upright_bend(point));
        let [Some(one), Some(other)] = bends else { return Contacts::new() };
        let (there, here) = (&trees.out, trees.back());
        let between = self.bridges.tree(self, first);
        let mut contacts = self.part_contacts(there, there.part(out), one.0);
        contacts.push(one);
        contacts.extend(self.part_contacts(between, between.part(leg), other.0));
        contacts.push(other);
        let back = self.part_contacts(here, here.part(back), other.0);
        contacts.extend(back.into_iter().rev());
        contacts
    }

    pub(super) fn part_contacts(&self, tree: &Tree, part: Part, end: DVec2) -> Contacts {
        match part {
            Part::Flat(leg) => self.leg_contacts(tree, leg, end),
            Part::Curved(curved) => {
                let Curved { view, link, contact_rad } = tree.curved[curved as usize];
                let view = &tree.to_cylinders[view as usize];
                let surfaces = surfaces_to(&tree.links, link);
                let tracer = Tracer { paths: self, view, surfaces: &surfaces };
                let points = tracer.contacts(contact_rad);
                let mut contacts = self.leg_contacts(tree, tracer.leg(contact_rad), points[0]);
                let first = Reflector::Cylinder(view.cylinder);
                let met = [first].into_iter().chain(surfaces.iter().copied());
                contacts.extend(points.into_iter().zip(met.map(Mechanism::Reflection)));
                contacts
            }
        }
    }

    fn leg_contacts(&self, tree: &Tree, leg: Leg, end: DVec2) -> Contacts {
        let (mut to, mut run) = (end, leg.run);
        let mut contacts: Contacts = tree
            .walls_back(&self.faces, leg)
            .map(|wall| {
                let mirror = &self.faces[wall as usize].mirror;
                to -= mirror.height_m(to) / mirror.normal.dot(run) * run;
                run = mirror.turn(run);
                (to, Mechanism::Reflection(Reflector::Wall(wall)))
            })
            .collect();
        contacts.reverse();
        contacts
    }
}

impl Stretch<'_> {
    /// Its interactions with their heights, those at floor and ceiling among them.
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
        for ((from, leg_m), (to, met)) in starts.clone().zip(legs_m()).zip(ends()) {
            // In the corner of a wall and the floor both are met at once; the wall then stands first.
            let is_before =
                |share: f64| met.is_none() || share * plan_m < along_m + leg_m - AT_ONCE_M;
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
            interactions.extend(met.map(|mechanism| Interaction { mechanism, point: to, z_m }));
        }
        interactions
    }
}
