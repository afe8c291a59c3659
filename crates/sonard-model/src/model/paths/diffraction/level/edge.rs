//! A level edge, and the rays that reach it from an image of the ranger.

use std::f64::consts::TAU;

use super::LevelScene;
use crate::{
    acoustics::edge::Wedge,
    geometry::{DVec2, Mirror},
    model::{
        SearchPart,
        paths::{
            beams::{Beams, LitWall},
            floor::{TracingPlan, WallMirror},
            height::VerticalImage,
            tolerance::TIE_M,
        },
    },
};

/// A level edge, relative to the ranger.
#[derive(Debug, Clone, Copy)]
pub(super) struct LevelEdge {
    pub(super) wall: u32,
    pub(super) is_upper: bool,
    /// Height above the ranger, metres.
    rise_m: f64,
    /// The wall as a mirror in the plan.
    mirror: Mirror,
    pub(super) wedge: Wedge,
}

/// Rays to any point of a level edge: a beam, and an image by floor and ceiling.
#[derive(Debug, Clone, Copy)]
pub(super) struct EdgeBeam<'a> {
    pub(super) lit: &'a LitWall,
    /// Counted as in [`PathEcho::image`](crate::model::paths::echo::PathEcho::image).
    pub(super) image: u16,
    /// Reflections at walls, floor and ceiling.
    pub(super) order: u16,
    pub(super) gain: f64,
    /// Height gained along the path with floor and ceiling as windows, metres.
    pub(super) climb_m: f64,
    /// Distance of the beam's image from the line in the plan, metres; negative behind it.
    before_m: f64,
    /// Distance of the image from the line in space, and its foot on the line, metres.
    pub(super) off_m: f64,
    pub(super) foot_m: f64,
    /// Direction from the line towards the image, around the line from the wall's face, radians.
    pub(super) around_rad: f64,
    /// Length of the shortest ray to the illuminated part, metres.
    pub(super) min_m: f64,
}

impl LevelEdge {
    pub(super) fn new(plan: &TracingPlan, wall: u32, rise_m: f64, is_upper: bool) -> Self {
        let WallMirror { mirror, gain, .. } = plan.walls[wall as usize];
        let wedge = Wedge { opening_rad: TAU, reflectance: [gain; 2] };
        Self { wall, is_upper, rise_m, mirror, wedge }
    }

    /// Returns the beams to the edge, shortest first, without those too long or weak for any path
    /// back.
    pub(super) fn beams<'a>(
        &self,
        scene: LevelScene,
        beams: &Beams,
        lit: &'a [LitWall],
    ) -> Vec<EdgeBeam<'a>> {
        let settings = &scene.plan.settings;
        let effort = &scene.plan.effort;
        let images = || std::iter::once(&VerticalImage::NONE).chain(&scene.heights.images).zip(0..);
        let mut found: Vec<EdgeBeam> = lit
            .iter()
            .flat_map(|lit| images().filter_map(|(image, index)| self.beam(lit, image, index)))
            .filter(|beam| 2.0 * beam.gain >= settings.floor && beam.min_m <= settings.max_path_m)
            .filter(|beam| beams.slopes.any_in(beam.lit.beam.slopes, beam.slopes()))
            .take_while(|_| !effort.is_over())
            .inspect(|_| effort.keep::<EdgeBeam>(1))
            .collect();
        effort.step(SearchPart::LevelEdges, lit.len() * (1 + scene.heights.images.len()));
        found.sort_by(|a, b| a.min_m.total_cmp(&b.min_m));
        found
    }

    /// Returns `None` for an image within the wall's own plane.
    fn beam<'a>(
        &self,
        lit: &'a LitWall,
        image: &VerticalImage,
        index: u16,
    ) -> Option<EdgeBeam<'a>> {
        let before_m = self.mirror.signed_distance_m(lit.beam.image);
        if before_m.abs() <= TIE_M {
            return None;
        }
        let below_m = self.rise_m - image.rise_m;
        let off_m = before_m.hypot(below_m);
        let foot_m = self.mirror.normal.perp().dot(lit.beam.image);
        let [low_m, high_m] = lit.span_m;
        let lateral_m = (low_m - foot_m).max(foot_m - high_m).max(0.0);
        let along_face_m = if self.is_upper { below_m } else { -below_m };
        Some(EdgeBeam {
            lit,
            image: index,
            order: lit.beam.order + image.bounces,
            gain: lit.beam.gain * image.gain,
            climb_m: image.climb_m(self.rise_m),
            before_m,
            off_m,
            foot_m,
            around_rad: before_m.atan2(along_face_m).rem_euclid(TAU),
            min_m: off_m.hypot(lateral_m),
        })
    }

    /// Returns the point at a position along the wall's line.
    pub(super) fn point(&self, along_m: f64) -> DVec2 {
        self.mirror.offset_m * self.mirror.normal + along_m * self.mirror.normal.perp()
    }
}

impl EdgeBeam<'_> {
    /// Smallest and largest slope of the rays.
    fn slopes(&self) -> [f64; 2] {
        let [low_m, high_m] = self.lit.span_m;
        let lateral_m = [low_m, high_m].map(|end| (end - self.foot_m).abs());
        let nearest_m = (low_m - self.foot_m).max(self.foot_m - high_m).max(0.0);
        let [near_m, far_m] =
            [nearest_m, lateral_m[0].max(lateral_m[1])].map(|m| m.hypot(self.before_m));
        let [a, b] = [near_m, far_m].map(|run_m| self.climb_m / run_m);
        [a.min(b), a.max(b)]
    }

    /// Returns `true` if the slopes of the beam include a ray to a position along the wall's line.
    pub(super) fn climbs_to(&self, beams: &Beams, along_m: f64) -> bool {
        let lateral_m = along_m - self.foot_m;
        let run_m = (self.before_m * self.before_m + lateral_m * lateral_m).sqrt();
        beams.slopes.holds(self.lit.beam.slopes, self.climb_m, run_m)
    }

    pub(super) fn lights(&self, along_m: f64) -> bool {
        let [low_m, high_m] = self.lit.span_m;
        (low_m - TIE_M..=high_m + TIE_M).contains(&along_m)
    }
}
