//! Clearance: a path of the plan, at its heights, has to hit its reflectors and nothing else.

use rstar::AABB;

use super::limits::{Heights, holds};
use crate::{
    geometry::DVec2,
    model::{
        Mechanism, Reflector,
        paths::{floor::Cylinders, tolerance::TIE_M},
    },
};

/// Start and end of a path, or of a part of one.
pub(crate) struct PathEnds {
    pub(crate) start: DVec2,
    /// `None` for a part that ends at its last contact, the level edge of a wall.
    pub(crate) end: Option<DVec2>,
    /// Height gained along the path with floor and ceiling as windows, metres.
    pub(crate) rise_m: f64,
}

impl Heights {
    /// Returns `true` if a path hits its contacts within their heights, and nothing else.
    ///
    /// With floor and ceiling as windows the height grows evenly with the length in the plan; the
    /// real height is that one, folded back between them.
    pub(crate) fn is_path_clear(
        &self,
        cylinders: &Cylinders,
        contacts: &[(DVec2, Mechanism)],
        ends: &PathEnds,
    ) -> bool {
        let points = || {
            let first = [(ends.start, None)].into_iter();
            let last = ends.end.map(|end| (end, None));
            first.chain(contacts.iter().map(|&(at, what)| (at, what.surface()))).chain(last)
        };
        let plan_m: f64 =
            points().zip(points().skip(1)).map(|((a, _), (b, _))| a.distance(b)).sum();
        let straight_z = |along_m: f64| self.z_m + ends.rise_m * along_m / plan_m;
        let mut along_m = 0.0;
        let mut left_contacts = contacts.len();
        for ((from, departed), (to, arrived)) in points().zip(points().skip(1)) {
            let leg_m = from.distance(to);
            let z_at = |share: f64| straight_z(along_m + share * leg_m);
            if self.is_blocked(cylinders, [from, to], [departed, arrived], z_at) {
                return false;
            }
            left_contacts = left_contacts.saturating_sub(1);
            let is_level_edge = ends.end.is_none() && left_contacts == 0;
            let z_m = self.folded_m(z_at(1.0));
            if !is_level_edge && arrived.is_some_and(|arrived| !holds(self.limits(arrived), z_m)) {
                return false;
            }
            along_m += leg_m;
        }
        true
    }

    /// Returns `true` if an object with limited height blocks a leg between two surfaces. `z_at`
    /// gives the height, with floor and ceiling as windows, for each share of the leg.
    fn is_blocked(
        &self,
        cylinders: &Cylinders,
        [from, to]: [DVec2; 2],
        own: [Option<Reflector>; 2],
        z_at: impl Fn(f64) -> f64,
    ) -> bool {
        let around = AABB::from_corners(from.to_array(), to.to_array());
        let by_wall = self.limited.locate_in_envelope_intersecting(around).any(|near| {
            let (wall, ends) = near.data;
            !own.contains(&Some(Reflector::Wall(wall)))
                && crossing(from, to, ends)
                    .is_some_and(|share| self.blocks_at(wall, self.folded_m(z_at(share))))
        });
        let by_cylinder = || {
            cylinders.circles.iter().zip(0..).any(|(circle, cylinder)| {
                !circle.is_opaque
                    && !own.contains(&Some(Reflector::Cylinder(cylinder)))
                    && circle.chord(from, to).is_some_and(|chord| {
                        self.blocks(self.cylinders[cylinder as usize], chord.map(&z_at))
                    })
            })
        };
        by_wall || by_cylinder()
    }
}

/// Intersection of the leg from `from` to `to` with a segment, as a share of the leg. `None` at the
/// very ends of the leg, where it reaches a corner whose other wall is that segment.
fn crossing(from: DVec2, to: DVec2, [a, b]: [DVec2; 2]) -> Option<f64> {
    let (run, along) = (to - from, b - a);
    let slant = run.perp_dot(along);
    let share = (a - from).perp_dot(along) / slant;
    let on_segment = (a - from).perp_dot(run) / slant;
    let off_ends_m = share.min(1.0 - share) * run.length();
    (off_ends_m > TIE_M && (0.0..=1.0).contains(&on_segment)).then_some(share)
}
