//! The ways of echoes: what they meet, and where.

use smallvec::{SmallVec, smallvec};

use super::{
    Echo, EchoPath, Paths, Trees, Via,
    beam::Ray,
    bridges::Bridged,
    joints::Joint,
    rims::Rim,
    trace::Tree,
    tube::{Curved, Tracer, surfaces_to},
};
use crate::{
    geometry::DVec2,
    model::{Bend, Path, Reflector},
    reading::PathKind,
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

/// A point where a path in the plan meets something.
pub(super) type Contacts = SmallVec<[(DVec2, Reflector); 8]>;

impl Paths {
    pub(super) fn path(&self, trees: &Trees, echo: &Echo) -> EchoPath {
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
        let kind = match echo.via {
            Via::Edge { .. } | Via::Edges { .. } | Via::Rim { .. } => PathKind::Diffracted,
            Via::Walls { .. } | Via::Cylinder { .. } | Via::Upright => PathKind::Specular,
            Via::Scatter { .. } => PathKind::Scattered,
        };
        let mut walls = match echo.via {
            Via::Walls { node } => self.met(tree, Part::Flat(Leg { node, run: -echo.arrival })),
            Via::Upright => SmallVec::new(),
            Via::Scatter { spot } => {
                let spot = &tree.spots[spot as usize];
                self.there_and_back(tree, spot.leg, spot.wall)
            }
            Via::Rim { rim } => {
                let Rim { wall, legs: [out, back], .. } = trees.rims[rim as usize];
                let mut walls = self.met(tree, Part::Flat(out));
                walls.push(Reflector::Wall(wall));
                walls.extend(self.met(home, Part::Flat(back)).into_iter().rev());
                walls
            }
            Via::Cylinder { joint } => {
                let Joint { cylinder, out, back, .. } = trees.joints[joint as usize];
                let mut walls = self.met(tree, out);
                walls.push(Reflector::Cylinder(cylinder));
                walls.extend(self.met(home, back).into_iter().rev());
                walls
            }
            Via::Edges { way } => {
                let Bridged { points: [first, _], leg, out, back } = trees.bridged[way as usize];
                let mut walls = self.met(tree, tree.part(out));
                let between = self.bridges.tree(self, first);
                walls.extend(self.met(between, between.part(leg)));
                walls.extend(self.met(home, home.part(back)).into_iter().rev());
                walls
            }
            Via::Edge { out, back, .. } => {
                let mut walls = self.met(tree, tree.part(out));
                walls.extend(self.met(home, home.part(back)).into_iter().rev());
                walls
            }
        };
        // Floor and ceiling stand after the walls, wherever on the way they are met.
        match echo.via {
            Via::Rim { rim } => {
                let [out, back] = trees.rims[rim as usize].images.map(|image| self.image(image));
                walls.extend(out.met().into_iter().rev());
                walls.extend(back.met());
            }
            _ => walls.extend(self.image(echo.image).met()),
        }
        Path { kind, walls, bends: self.bends(trees, echo) }
    }

    fn bends(&self, trees: &Trees, echo: &Echo) -> SmallVec<[Bend; 2]> {
        let upright = |point| self.edges.edge(point).map(Bend::Upright);
        match echo.via {
            Via::Edge { point, .. } => upright(point).into_iter().collect(),
            Via::Edges { way } => {
                let points = trees.bridged[way as usize].points;
                points.into_iter().filter_map(upright).collect()
            }
            Via::Rim { rim } => {
                let Rim { wall, is_upper, .. } = trees.rims[rim as usize];
                smallvec![Bend::Level { wall, is_upper }]
            }
            _ => SmallVec::new(),
        }
    }

    /// The reflectors of a way that comes back from a wall as it went.
    fn there_and_back(&self, tree: &Tree, leg: Leg, wall: u32) -> SmallVec<[Reflector; 4]> {
        let mut walls = self.met(tree, Part::Flat(leg));
        let back: SmallVec<[Reflector; 4]> = walls.iter().rev().copied().collect();
        walls.push(Reflector::Wall(wall));
        walls.extend(back);
        walls
    }

    /// What a ray from the start met, in order.
    fn met(&self, tree: &Tree, part: Part) -> SmallVec<[Reflector; 4]> {
        let mut met = SmallVec::new();
        let leg = match part {
            Part::Flat(leg) => leg,
            Part::Curved(curved) => {
                let Curved { view, link, contact_rad } = tree.curved[curved as usize];
                let view = &tree.to_cylinders[view as usize];
                let surfaces = surfaces_to(&tree.links, link);
                met.extend(surfaces.iter().rev().copied());
                met.push(Reflector::Cylinder(view.cylinder));
                Tracer { paths: self, view, surfaces: &surfaces }.leg(contact_rad)
            }
        };
        met.extend(tree.walls_back(&self.faces, leg).map(Reflector::Wall));
        met.reverse();
        met
    }

    /// What a path meets in the plan, from transmitter to receiver; an edge counts as its wall.
    pub(super) fn contacts(&self, trees: &Trees, echo: &Echo, target: DVec2) -> Contacts {
        match echo.via {
            // A rim has seen to that for itself.
            Via::Upright | Via::Rim { .. } => Contacts::new(),
            Via::Scatter { spot } => {
                let spot = &trees.out.spots[spot as usize];
                let mut contacts = self.part_contacts(&trees.out, Part::Flat(spot.leg), spot.place);
                let back: Contacts = contacts.iter().rev().copied().collect();
                contacts.push((spot.place, Reflector::Wall(spot.wall)));
                contacts.extend(back);
                contacts
            }
            Via::Walls { node } => {
                let leg = Leg { node, run: -echo.arrival };
                self.part_contacts(&trees.out, Part::Flat(leg), target)
            }
            Via::Cylinder { joint } => {
                let Joint { cylinder, place_rad, out, back } = trees.joints[joint as usize];
                let place = self.rounds.circles[cylinder as usize].point(place_rad);
                let mut contacts = self.part_contacts(&trees.out, out, place);
                contacts.push((place, Reflector::Cylinder(cylinder)));
                let back = self.part_contacts(trees.back(), back, place);
                contacts.extend(back.into_iter().rev());
                contacts
            }
            Via::Edges { way } => self.bridged_contacts(trees, &trees.bridged[way as usize]),
            Via::Edge { point, out, back } => {
                let Some(place) = self.edges.place(point) else { return Contacts::new() };
                let (there, here) = (&trees.out, trees.back());
                let mut contacts = self.part_contacts(there, there.part(out), place);
                let wall = self.edges.edge(point).map(|edge| Reflector::Wall(edge.wall));
                contacts.extend(wall.map(|wall| (place, wall)));
                let back = self.part_contacts(here, here.part(back), place);
                contacts.extend(back.into_iter().rev());
                contacts
            }
        }
    }

    fn bridged_contacts(&self, trees: &Trees, way: &Bridged) -> Contacts {
        let Bridged { points: [first, second], leg, out, back } = *way;
        let places = [first, second].map(|point| self.edges.place(point));
        let [Some(here), Some(there)] = places else { return Contacts::new() };
        let at =
            |point, place| self.edges.edge(point).map(|edge| (place, Reflector::Wall(edge.wall)));
        let mut contacts = self.part_contacts(&trees.out, trees.out.part(out), here);
        contacts.extend(at(first, here));
        let between = self.bridges.tree(self, first);
        contacts.extend(self.part_contacts(between, between.part(leg), there));
        contacts.extend(at(second, there));
        let back = self.part_contacts(trees.back(), trees.back().part(back), there);
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
                contacts.extend(points.into_iter().zip(met));
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
                (to, Reflector::Wall(wall))
            })
            .collect();
        contacts.reverse();
        contacts
    }
}
