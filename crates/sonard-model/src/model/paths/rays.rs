//! Rays from one start, over walls alone and by way of cylinders, and their contacts.

use smallvec::SmallVec;

use super::{
    beams::{Beams, RayLeg, UnfoldedRay},
    cylinders::{CylinderRay, CylinderRays, OneWay, SpreadRay, Tracer, surfaces_to},
    floor::TracingPlan,
};
use crate::{
    geometry::DVec2,
    model::{Mechanism, Reflector},
};

/// Interactions of a path in the plan, in order, without heights.
pub(super) type Contacts = SmallVec<[(DVec2, Mechanism); 8]>;

/// Rays from one start.
#[derive(Debug, Default)]
pub(super) struct Rays {
    pub(super) beams: Beams,
    pub(super) cylinders: CylinderRays,
}

impl Rays {
    /// Groups the rays by edge.
    pub(super) fn sort_by_edge(&mut self) {
        self.beams.sort_by_edge();
        self.cylinders.to_edges.sort_by_key(|ray| ray.point);
    }

    /// Edges that rays reach, each once; sorted by edge.
    pub(super) fn edges(&self) -> Vec<u32> {
        let to_edges = &self.beams.to_edges;
        let by_walls = to_edges.chunk_by(|a, b| a.0 == b.0).map(|rays| rays[0].0);
        let mut edges: Vec<u32> = by_walls.collect();
        if !self.cylinders.to_edges.is_empty() {
            edges.extend(self.cylinders.to_edges.iter().map(|ray| ray.point));
            edges.sort_unstable();
            edges.dedup();
        }
        edges
    }

    /// Returns a ray to an edge by its number: those over walls alone first, then those by
    /// cylinders.
    pub(super) fn to_edge(&self, number: u32) -> OneWay {
        match (number as usize).checked_sub(self.beams.to_edges.len()) {
            None => OneWay::Walls((&self.beams.to_edges[number as usize].1).into()),
            Some(spread) => OneWay::Cylinders(self.cylinders.to_edges[spread].ray.node),
        }
    }

    /// Returns a ray to an edge over walls alone, by its number.
    pub(super) fn to_edge_by_walls(&self, number: u32) -> Option<&UnfoldedRay> {
        self.beams.to_edges.get(number as usize).map(|(_, ray)| ray)
    }

    /// Rays by way of cylinders to an edge, and the number of the first; requires
    /// [`Self::sort_by_edge`].
    pub(super) fn spread_to_edge(&self, point: u32) -> (u32, &[SpreadRay]) {
        let all = &self.cylinders.to_edges;
        let from = all.partition_point(|ray| ray.point < point);
        let count = all[from..].partition_point(|ray| ray.point == point);
        ((self.beams.to_edges.len() + from) as u32, &all[from..from + count])
    }

    /// Number of walls and cylinders that reflected a ray.
    pub(super) fn order(&self, plan: &TracingPlan, ray: OneWay) -> usize {
        let (leg, cylinders) = match ray {
            OneWay::Walls(leg) => (leg, 0),
            OneWay::Cylinders(number) => self.traced(plan, number, |tracer, contact_rad| {
                (tracer.leg(contact_rad), 1 + tracer.surfaces.len())
            }),
        };
        cylinders + self.beams.walls_back(&plan.walls, leg).count()
    }

    /// Interactions of a ray that ends at `end`, in order.
    pub(super) fn contacts(&self, plan: &TracingPlan, ray: OneWay, end: DVec2) -> Contacts {
        match ray {
            OneWay::Walls(leg) => wall_contacts(&self.beams, plan, leg, end),
            OneWay::Cylinders(number) => self.traced(plan, number, |tracer, contact_rad| {
                let points = tracer.contacts(contact_rad);
                let leg = tracer.leg(contact_rad);
                let mut contacts = wall_contacts(&self.beams, plan, leg, points[0]);
                let first = Reflector::Cylinder(tracer.view.cylinder);
                let surfaces = [first].into_iter().chain(tracer.surfaces.iter().copied());
                contacts.extend(points.into_iter().zip(surfaces.map(Mechanism::Reflection)));
                contacts
            }),
        }
    }

    /// Traces a ray by way of cylinders.
    fn traced<T>(
        &self,
        plan: &TracingPlan,
        number: u32,
        visit: impl FnOnce(&Tracer, f64) -> T,
    ) -> T {
        let CylinderRay { view, link, contact_rad } = self.cylinders.rays[number as usize];
        let view = &self.beams.to_cylinders[view as usize];
        let surfaces = surfaces_to(&self.cylinders.links, link);
        visit(&Tracer::new(plan, view, &surfaces), contact_rad)
    }
}

/// Walls that a ray hits, in order, with the points.
///
/// From its end backwards: the leg before a wall runs along the mirrored direction, from the last
/// point to the intersection with the wall's line.
pub(super) fn wall_contacts(
    beams: &Beams,
    plan: &TracingPlan,
    leg: RayLeg,
    end: DVec2,
) -> Contacts {
    let (mut to, mut run) = (end, leg.run);
    let mut contacts: Contacts = beams
        .walls_back(&plan.walls, leg)
        .map(|wall| {
            let mirror = &plan.walls[wall as usize].mirror;
            to -= mirror.signed_distance_m(to) / mirror.normal.dot(run) * run;
            run = mirror.image_of_direction(run);
            (to, Mechanism::Reflection(Reflector::Wall(wall)))
        })
        .collect();
    contacts.reverse();
    contacts
}

/// End of a ray from `start` over walls.
pub(super) fn end_of(beams: &Beams, plan: &TracingPlan, leg: RayLeg, start: DVec2) -> DVec2 {
    let walls: SmallVec<[u32; 8]> = beams.walls_back(&plan.walls, leg).collect();
    let mirror = |wall: &u32| plan.walls[*wall as usize].mirror;
    let image = walls.iter().rev().map(mirror).fold(start, |at, mirror| mirror.image(at));
    image + leg.run
}
