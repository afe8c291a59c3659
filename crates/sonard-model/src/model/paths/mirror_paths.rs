//! Paths by mirror reflections alone, for lists of image sources.

use super::{
    beams::{Beams, UnfoldedRay},
    echo::drop_repeats,
    prepare::Paths,
    rays::wall_contacts,
    tolerance::SAME_RAD,
};
use crate::{
    geometry::DVec2,
    model::{Mechanism, Reflector, TooCostly},
};

/// A path of mirror reflections in the plan.
#[derive(Debug, Clone, Default)]
pub(crate) struct MirrorPath {
    /// Vector from the image of the source to the receiver, metres.
    pub(crate) run: DVec2,
    /// Product of the reflectances.
    pub(crate) gain: f64,
    /// Walls from the source to the receiver, each with the length of the path up to it, metres.
    pub(crate) walls: Vec<(u32, f64)>,
}

impl Paths {
    /// Returns all paths by walls alone from a source to a receiver, each once, shortest first.
    ///
    /// # Errors
    /// When there are too many.
    pub(crate) fn mirror_paths(
        &self,
        source: DVec2,
        receiver: DVec2,
    ) -> Result<Vec<MirrorPath>, TooCostly> {
        let plan = self.plan.for_search(self.bound);
        let beams = Beams::grow(&plan, source, receiver);
        plan.effort.check(&plan.settings)?;
        let mut rays: Vec<UnfoldedRay> = beams.to_receiver.clone();
        rays.sort_by(|a, b| a.run.length_squared().total_cmp(&b.run.length_squared()));
        // Rays that touch a corner are found on both sides of it.
        drop_repeats(&mut rays, |ray| ray.run.length(), is_same);
        let path = |ray: &UnfoldedRay| {
            let contacts = wall_contacts(&beams, &plan, ray.into(), receiver);
            let (mut from, mut length_m) = (source, 0.0);
            let walls = contacts.into_iter().filter_map(|(at, mechanism)| {
                length_m += from.distance(at);
                from = at;
                match mechanism {
                    Mechanism::Reflection(Reflector::Wall(wall)) => Some((wall, length_m)),
                    _ => None,
                }
            });
            MirrorPath { run: ray.run, gain: ray.gain, walls: walls.collect() }
        };
        Ok(rays.iter().map(path).collect())
    }
}

/// Returns `true` for two rays of equal length that leave and arrive alike.
fn is_same(a: &UnfoldedRay, b: &UnfoldedRay) -> bool {
    let is_near = |a: DVec2, b: DVec2| a.distance_squared(b) < SAME_RAD * SAME_RAD;
    let arrival = |ray: &UnfoldedRay| ray.run.normalize_or_zero();
    is_near(a.departure, b.departure) && is_near(arrival(a), arrival(b))
}
