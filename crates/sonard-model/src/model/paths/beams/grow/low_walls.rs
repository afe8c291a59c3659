//! Beams at walls that end below the ceiling or above the floor.

use super::Grower;
use crate::{
    geometry::DVec2,
    model::{
        SearchPart,
        paths::{
            beams::beam::Beam,
            plan::{ALL_SLOPES, WallMirror},
        },
    },
};

impl Grower<'_> {
    /// The slopes of a beam's rays that meet a wall where it stands; `None` if none does.
    pub(super) fn slopes_at(&mut self, beam: &Beam, wall: u32, side: usize) -> Option<u32> {
        let plan = self.plan;
        match plan.climbs.of_wall(wall) {
            Some(climbs) => self.slopes_to(beam, wall, side, &climbs.met),
            None => Some(beam.slopes),
        }
    }

    /// The slopes of a beam's rays that pass a wall above or below; `None` if none does.
    pub(super) fn slopes_behind(&mut self, beam: &Beam, wall: u32, side: usize) -> Option<u32> {
        let plan = self.plan;
        self.slopes_to(beam, wall, side, &plan.climbs.of_wall(wall)?.passed)
    }

    /// Those by which rays come to one of these climbs at a wall and back to the target within their longest path.
    fn slopes_to(
        &mut self,
        beam: &Beam,
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
        // How many times longer a run may be in space: the way back is no shorter than in the plan.
        let longer = |longest_m: f64| ((longest_m - back_m) / run_m[0]).max(1.0);
        // An edge makes up for no more than that, and for a wall's echo and the image that it replaces.
        let bending = 2.0 * longer(settings.max_path_m);
        let audible_m = beam.audible_m + settings.same_loss_m(bending.recip());
        let longer = longer(audible_m.min(settings.max_path_m));
        let least_gain = settings.floor / (beam.gain * bending);
        let highest_m = self.plan.climbs.highest_m(least_gain);
        let steepest = (longer * longer - 1.0).sqrt().min(highest_m / run_m[0]);
        let known = self.tree.slopes.kept();
        let slopes = self.tree.slopes.reaching(beam.slopes, climbs, run_m, steepest);
        self.plan.effort.step(SearchPart::Beams, 1);
        self.plan.effort.keep::<[f64; 2]>(self.tree.slopes.kept() - known);
        slopes
    }
}

/// The least and the most distance of a part of a wall's line from a point, metres.
fn distances_m(wall_mirror: &WallMirror, [low_m, high_m]: [f64; 2], from: DVec2) -> [f64; 2] {
    let mirror = &wall_mirror.mirror;
    let foot_m = mirror.normal.perp().dot(from);
    let off_m = mirror.height_m(from).powi(2);
    let beside_m = [low_m - foot_m, foot_m - high_m];
    let nearest_m = beside_m[0].max(beside_m[1]).max(0.0);
    let farthest_m = beside_m[0].abs().max(beside_m[1].abs());
    [nearest_m, farthest_m].map(|beside_m| (off_m + beside_m * beside_m).sqrt())
}
