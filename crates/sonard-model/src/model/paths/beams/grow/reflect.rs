//! Beams at walls that reflect them.

use super::Grower;
use crate::{
    geometry::DVec2,
    model::paths::{
        beams::{beam::RayBeam, lit::LitWall, tree::BeamNode},
        floor::WallMirror,
    },
};

impl Grower<'_> {
    /// Adds the reflection of a beam at a wall to the next order, merged with the beam before it
    /// where both are one beam that a corner had split.
    pub(super) fn reflect(&mut self, beam: &RayBeam, wall: u32, side: usize) {
        let Some(next) = self.reflected(beam, wall, side) else { return };
        if let Some(last) = self.next.last_mut() {
            let border = if next.mirrored { next.left } else { next.right };
            if last.merge(&next) {
                last.slopes = self.tree.slopes.union(last.slopes, next.slopes);
                let nodes = &mut self.tree.nodes;
                let (left, right) =
                    if next.mirrored { (last.node, next.node) } else { (next.node, last.node) };
                nodes.push(BeamNode::Merged { border, left, right });
                // `next` has the newest node, so the merged node follows it.
                last.node = next.node + 1;
                return;
            }
        }
        self.next.push(next);
    }

    /// Returns the beam that a wall reflects, if it can still give an echo.
    pub(super) fn reflected(&mut self, beam: &RayBeam, wall: u32, side: usize) -> Option<RayBeam> {
        let slopes = self.slopes_at(beam, wall, side)?;
        let is_level = beam.is_level && self.plan.climbs.is_hit_by_level(wall);
        let wall_mirror = &self.plan.walls[wall as usize];
        // Scattered sound returns along its own path, level.
        if wall_mirror.scatter > 0.0 && self.plan.settings.scatter_height_rad > 0.0 && is_level {
            let span_m = self.lit_span_m(beam, wall_mirror, side);
            self.plan.effort.keep::<LitWall>(1);
            self.tree.on_rough_walls.push(LitWall { beam: *beam, wall, span_m });
        }
        if self.plan.lets_pass(wall) {
            let span_m = self.lit_span_m(beam, wall_mirror, side);
            let beam = RayBeam { slopes, ..*beam };
            self.plan.effort.keep::<LitWall>(1);
            self.tree.below_level_edges.push(LitWall { beam, wall, span_m });
        }
        let gain = beam.gain * wall_mirror.gain;
        if beam.order >= self.max_reflections || gain < self.plan.settings.floor {
            return None;
        }
        let next = RayBeam {
            gain,
            detectable_m: beam.detectable_m - wall_mirror.loss_m,
            slopes,
            is_level,
            side: side as u8,
            ..beam.reflected(&wall_mirror.mirror, wall_mirror.rotor)
        };
        if self.min_path_m(beam, &next, wall_mirror, side) > self.longest_m(&next) {
            return None;
        }
        self.plan.effort.keep::<(RayBeam, BeamNode)>(1);
        let nodes = &mut self.tree.nodes;
        nodes.push(BeamNode::Wall { wall, before: beam.node });
        Some(RayBeam { node: nodes.len() as u32 - 1, ..next })
    }

    /// Length of the shortest path from the beam's image to its part of a wall and straight back to
    /// the start. The length is a convex function of the position along the wall: it is smallest at
    /// one end of the part, or where an image and the start see each other through it.
    fn min_path_m(
        &self,
        beam: &RayBeam,
        next: &RayBeam,
        wall_mirror: &WallMirror,
        side: usize,
    ) -> f64 {
        let mirror = &wall_mirror.mirror;
        let height = mirror.signed_distance_m(beam.image);
        let behind = mirror.signed_distance_m(self.target) * height < 0.0;
        let through = if behind { beam } else { next };
        let run = self.target - through.image;
        if through.holds(run) {
            return run.length();
        }
        let along = mirror.normal.perp();
        let ends = self.mesh.side(beam.triangle, side).map(|end| along.dot(end));
        let (low, high) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
        let by = |border: DVec2| {
            let hit = beam.image - height / mirror.normal.dot(border) * border;
            // Clamped, for borders that graze the wall; min and max drop a NaN.
            let along_m = along.dot(hit).max(low).min(high);
            let hit = mirror.offset_m * mirror.normal + along_m * along;
            hit.distance(beam.image) + hit.distance(self.target)
        };
        by(beam.right).min(by(beam.left))
    }

    /// Interval along a wall's line that a beam illuminates, metres.
    pub(super) fn lit_span_m(
        &self,
        beam: &RayBeam,
        wall_mirror: &WallMirror,
        side: usize,
    ) -> [f64; 2] {
        let mirror = &wall_mirror.mirror;
        let along = mirror.normal.perp();
        let ends = self.mesh.side(beam.triangle, side).map(|end| along.dot(end));
        let (low, high) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
        let by = |border: DVec2| {
            let hit = beam.image
                - mirror.signed_distance_m(beam.image) / mirror.normal.dot(border) * border;
            along.dot(hit).max(low).min(high)
        };
        let (right, left) = (by(beam.right), by(beam.left));
        [right.min(left), right.max(left)]
    }
}
