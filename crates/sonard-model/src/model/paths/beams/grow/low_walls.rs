//! Beams at walls that end below the ceiling or above the floor.

use super::Grower;
use crate::{
    geometry::DVec2,
    model::{
        SearchPart,
        paths::{
            beams::beam::RayBeam,
            floor::{ALL_SLOPES, WallMirror},
        },
    },
};

impl Grower<'_> {
    /// Returns the slopes of a beam's rays that hit a wall between its edges; `None` if no ray
    /// does.
    pub(super) fn slopes_at(&mut self, beam: &RayBeam, wall: u32, side: usize) -> Option<u32> {
        let plan = self.plan;
        match plan.climbs.of_wall(wall) {
            Some(climbs) => self.slopes_to(beam, wall, side, &climbs.hit),
            None => Some(beam.slopes),
        }
    }

    /// Returns the slopes of a beam's rays that pass above or below a wall; `None` if no ray does.
    pub(super) fn slopes_behind(&mut self, beam: &RayBeam, wall: u32, side: usize) -> Option<u32> {
        let plan = self.plan;
        self.slopes_to(beam, wall, side, &plan.climbs.of_wall(wall)?.passed)
    }

    /// Returns the slopes by which rays reach one of `climbs` at a wall and return to the target
    /// within their longest path.
    fn slopes_to(
        &mut self,
        beam: &RayBeam,
        wall: u32,
        side: usize,
        climbs: &[[f64; 2]],
    ) -> Option<u32> {
        if !(self.starts_level && self.plan.climbs.ends_beams) {
            return (!climbs.is_empty()).then_some(ALL_SLOPES);
        }
        let wall_mirror = &self.plan.walls[wall as usize];
        let span_m = self.lit_span_m(beam, wall_mirror, side);
        let run_m = distances_m(wall_mirror, span_m, beam.image);
        let [back_m, _] = distances_m(wall_mirror, span_m, self.target);
        let settings = &self.plan.settings;
        // Ratio of a run's length in space to that in the plan; the return is no shorter than in
        // the plan.
        let longer = |longest_m: f64| ((longest_m - back_m) / run_m[0]).max(1.0);
        // An edge compensates no more than that ratio, a wall's echo and the image that it
        // replaces.
        let bending = 2.0 * longer(settings.max_path_m);
        let detectable_m = beam.detectable_m + settings.same_loss_m(bending.recip());
        let longer = longer(detectable_m.min(settings.max_path_m));
        let min_gain = settings.floor / (beam.gain * bending);
        let highest_m = self.plan.climbs.highest_m(min_gain);
        let steepest = (longer * longer - 1.0).sqrt().min(highest_m / run_m[0]);
        let known = self.tree.slopes.kept();
        let slopes = self.tree.slopes.narrow(beam.slopes, climbs, run_m, steepest);
        self.plan.effort.step(SearchPart::Beams, 1);
        self.plan.effort.keep::<[f64; 2]>(self.tree.slopes.kept() - known);
        slopes
    }
}

/// Smallest and largest distance from a point to a part of a wall's line, metres.
fn distances_m(wall_mirror: &WallMirror, [low_m, high_m]: [f64; 2], from: DVec2) -> [f64; 2] {
    let mirror = &wall_mirror.mirror;
    let foot_m = mirror.normal.perp().dot(from);
    let off_m = mirror.signed_distance_m(from).powi(2);
    let lateral_m = [low_m - foot_m, foot_m - high_m];
    let nearest_m = lateral_m[0].max(lateral_m[1]).max(0.0);
    let farthest_m = lateral_m[0].abs().max(lateral_m[1].abs());
    [nearest_m, farthest_m].map(|lateral_m| (off_m + lateral_m * lateral_m).sqrt())
}
