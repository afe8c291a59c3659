//! Walls and cylinders that do not reach from floor to ceiling.
//!
//! Without floor and ceiling all sound stays at the ranger's height, and what does not stand there
//! is not there. With them a path has a height at each place. Beams then both turn at such a wall
//! and pass it, and a path counts if it meets its walls where they stand and the others where they
//! do not. What a wall's upper edge bends is left out, and behind a low cylinder sound is taken to
//! be hidden at all heights.

use smallvec::SmallVec;

use super::{
    Echo, Leg, Part, Paths, Trees, Via,
    trace::Tree,
    tube::{Curved, Tracer},
};
use crate::{geometry::DVec2, model::Reflector, scene::Scene};

/// Heights of a scene around a ranger.
#[derive(Debug, Default)]
pub(super) struct Heights {
    floor_z_m: Option<f64>,
    ceiling_z_m: Option<f64>,
    /// The ranger's.
    z_m: f64,
    /// By wall and by cylinder, from and to where; without limits `None`.
    walls: Vec<Option<[f64; 2]>>,
    cylinders: Vec<Option<[f64; 2]>>,
    /// Walls with limits, and their ends in the plan.
    limited: Vec<(u32, [DVec2; 2])>,
}

/// A point where a path in the plan meets something.
type Contacts = SmallVec<[(DVec2, Reflector); 8]>;

impl Heights {
    pub(super) fn new(scene: &Scene, segments: &[(DVec2, DVec2)], z_m: f64) -> Self {
        let walls: Vec<_> = scene.walls.iter().map(|wall| wall.z_m).collect();
        let limited = (0..)
            .zip(&walls)
            .filter(|(_, limits)| limits.is_some())
            .map(|(wall, _)| (wall, <[DVec2; 2]>::from(segments[wall as usize])))
            .collect();
        Self {
            floor_z_m: scene.floor_z_m,
            ceiling_z_m: scene.ceiling_z_m,
            z_m,
            walls,
            cylinders: scene.cylinders.iter().map(|cylinder| cylinder.z_m).collect(),
            limited,
        }
    }

    /// Whether a path has different heights on its way.
    fn rises(&self) -> bool {
        self.floor_z_m.is_some() || self.ceiling_z_m.is_some()
    }

    /// Whether what stands between such heights can matter at all.
    pub(super) fn is_there(&self, limits: Option<[f64; 2]>) -> bool {
        self.rises() || holds(limits, self.z_m)
    }

    /// Whether sound can pass a wall below or above.
    pub(super) fn lets_pass(&self, wall: u32) -> bool {
        self.rises() && self.walls[wall as usize].is_some()
    }

    /// Whether paths have to be asked where they meet things.
    fn matter(&self) -> bool {
        let low_round = self.cylinders.iter().any(Option::is_some);
        self.rises() && (low_round || !self.limited.is_empty())
    }

    fn limits(&self, reflector: Reflector) -> Option<[f64; 2]> {
        match reflector {
            Reflector::Wall(wall) => self.walls[wall as usize],
            Reflector::Cylinder(cylinder) => self.cylinders[cylinder as usize],
            Reflector::Face | Reflector::Floor | Reflector::Ceiling => None,
        }
    }

    /// The height of a path that would be at `z_m` if floor and ceiling were windows.
    fn folded_m(&self, z_m: f64) -> f64 {
        match (self.floor_z_m, self.ceiling_z_m) {
            (None, None) => z_m,
            (Some(floor), None) => floor + (z_m - floor).abs(),
            (None, Some(ceiling)) => ceiling - (ceiling - z_m).abs(),
            (Some(floor), Some(ceiling)) => {
                let height = ceiling - floor;
                let above = (z_m - floor).rem_euclid(2.0 * height);
                floor + above.min(2.0 * height - above)
            }
        }
    }
}

fn holds(limits: Option<[f64; 2]>, z_m: f64) -> bool {
    limits.is_none_or(|[from, to]| (from..=to).contains(&z_m))
}

impl Paths {
    /// Leaves out echoes whose way misses a wall above or below, or is barred by one.
    pub(super) fn retain_clear(
        &self,
        trees: &Trees,
        echoes: &mut Vec<Echo>,
        [start, target]: [DVec2; 2],
    ) {
        if self.heights.matter() {
            echoes.retain(|echo| self.is_clear(trees, echo, start, target));
        }
    }

    fn is_clear(&self, trees: &Trees, echo: &Echo, start: DVec2, target: DVec2) -> bool {
        let heights = &self.heights;
        let image = echo.image.checked_sub(1).map(|image| self.images[image as usize]);
        let rise_m = image.map_or(0.0, |image| image.rise_m);
        let contacts = self.contacts(trees, echo, target);
        let points = || {
            let first = [(start, None)].into_iter();
            let last = [(target, None)];
            first.chain(contacts.iter().map(|&(at, what)| (at, Some(what)))).chain(last)
        };
        let plan_m: f64 =
            points().zip(points().skip(1)).map(|((a, _), (b, _))| a.distance(b)).sum();
        let z_at = |along_m: f64| heights.folded_m(heights.z_m + rise_m * along_m / plan_m);
        let mut along_m = 0.0;
        for ((from, left), (to, met)) in points().zip(points().skip(1)) {
            let leg_m = from.distance(to);
            let barred = heights.limited.iter().any(|&(wall, ends)| {
                let own = Some(Reflector::Wall(wall));
                left != own
                    && met != own
                    && crossing(from, to, ends).is_some_and(|share| {
                        holds(heights.walls[wall as usize], z_at(along_m + share * leg_m))
                    })
            });
            along_m += leg_m;
            let missed = met.is_some_and(|met| !holds(heights.limits(met), z_at(along_m)));
            if barred || missed {
                return false;
            }
        }
        true
    }

    /// What a path meets in the plan, from transmitter to receiver; an edge counts as its wall.
    fn contacts(&self, trees: &Trees, echo: &Echo, target: DVec2) -> Contacts {
        match echo.via {
            Via::Upright => Contacts::new(),
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
            Via::Cylinders { curved } => {
                self.part_contacts(&trees.out, Part::Curved(curved), target)
            }
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

    fn part_contacts(&self, tree: &Tree, part: Part, end: DVec2) -> Contacts {
        match part {
            Part::Flat(leg) => self.leg_contacts(tree, leg, end),
            Part::Curved(curved) => {
                let Curved { view, link, contact_rad } = tree.curved[curved as usize];
                let view = &tree.to_cylinders[view as usize];
                let tracer = Tracer::new(self, view, &tree.links, link);
                let points = tracer.contacts(contact_rad);
                let mut contacts = self.leg_contacts(tree, tracer.leg(contact_rad), points[0]);
                let first = Reflector::Cylinder(view.arc.cylinder);
                let met = [first].into_iter().chain(tracer.surfaces.iter().copied());
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

/// Where on the way from `from` to `to` a segment is crossed, as a share of it.
fn crossing(from: DVec2, to: DVec2, [a, b]: [DVec2; 2]) -> Option<f64> {
    let (run, along) = (to - from, b - a);
    let slant = run.perp_dot(along);
    let share = (a - from).perp_dot(along) / slant;
    let place = (a - from).perp_dot(run) / slant;
    ((0.0..=1.0).contains(&share) && (0.0..=1.0).contains(&place)).then_some(share)
}
