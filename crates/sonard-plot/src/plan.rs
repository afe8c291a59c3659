//! Floor plans: conversion of metres to pixels, frame, grid, walls, poses and scale bar.

use std::collections::HashSet;

use super::{
    canvas::{Anchor, Layer, Px, Rect, text_width_px},
    labels::Labels,
    theme, ticks,
};
use sonard_model::{
    geometry::{DVec2, Pose},
    scene::Scene,
};

/// Region of the floor, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Lower left corner, metres.
    pub min: DVec2,
    /// Upper right corner, metres.
    pub max: DVec2,
}

/// Coordinates beyond this are ignored, metres; up to here sizes of regions do not overflow.
const MAX_COORDINATE_M: f64 = 1e100;

impl Bounds {
    /// Smallest region around the valid points; `None` without any.
    pub fn around(points: impl IntoIterator<Item = DVec2>) -> Option<Self> {
        let is_valid =
            |point: &DVec2| point.is_finite() && point.abs().max_element() < MAX_COORDINATE_M;
        points
            .into_iter()
            .filter(is_valid)
            .map(|point| Self { min: point, max: point })
            .reduce(|a, b| Self { min: a.min.min(b.min), max: a.max.max(b.max) })
    }

    /// Bounds of the walls and cylinders of a scene.
    pub fn from_scene(scene: &Scene) -> Option<Self> {
        let ends = scene.walls.iter().flat_map(|wall| [wall.a, wall.b]);
        let discs = scene.cylinders.iter().flat_map(|cylinder| {
            let reach = DVec2::splat(cylinder.radius_m);
            [cylinder.center - reach, cylinder.center + reach]
        });
        Self::around(ends.chain(discs))
    }

    /// Smallest bounds that also contain the points.
    pub fn including(self, points: impl IntoIterator<Item = DVec2>) -> Self {
        Self::around(points.into_iter().chain([self.min, self.max])).unwrap_or(self)
    }

    /// Width and height, metres.
    pub fn size(&self) -> DVec2 {
        self.max - self.min
    }

    /// Bounds with a margin on each side, metres.
    pub fn grown(self, by_m: f64) -> Self {
        let by = DVec2::splat(by_m);
        Self { min: self.min - by, max: self.max + by }
    }
}

/// Placement of a floor plan on the page.
#[derive(Debug, Clone, Copy)]
pub struct PlanProjection {
    /// Panel on the page, pixels.
    pub panel: Rect,
    /// Visible region, metres.
    pub view: Bounds,
    px_per_m: f64,
}

impl PlanProjection {
    /// Fits a region into a panel; spare space at the sides extends the view.
    pub fn fit(region: Bounds, panel: Rect) -> Self {
        let size = region.size().max(DVec2::splat(1e-3));
        let px_per_m = (panel.width() / size.x).min(panel.height() / size.y);
        let middle = (region.min + region.max) / 2.0;
        let half = DVec2::new(panel.width(), panel.height()) / px_per_m / 2.0;
        Self { panel, view: Bounds { min: middle - half, max: middle + half }, px_per_m }
    }

    /// Height of a panel of this width that fits the region without spare space, within limits.
    pub fn height_for(region: &Bounds, width_px: f64, limits_px: [f64; 2]) -> f64 {
        let size = region.size().max(DVec2::splat(1e-3));
        (width_px * size.y / size.x).clamp(limits_px[0], limits_px[1]).round()
    }

    /// Converts a point of the scene, metres, to the page, px.
    pub fn px(&self, at: DVec2) -> Px {
        let from_corner = (at - self.view.min) * self.px_per_m;
        Px::new(self.panel.left + from_corner.x, self.panel.bottom - from_corner.y)
    }

    /// Converts a point of the page, px, to the scene, metres.
    pub fn place(&self, at: Px) -> DVec2 {
        let from_corner = Px::new(at.x - self.panel.left, self.panel.bottom - at.y);
        self.view.min + from_corner / self.px_per_m
    }

    /// Converts a length in the scene, metres, to the page, px.
    pub fn length_px(&self, length_m: f64) -> f64 {
        length_m * self.px_per_m
    }

    /// Draws frame, grid and the coordinates along the left and lower side.
    pub fn frame(&self) -> Layer {
        let mut layer = Layer::new("frame");
        let step = ticks::nice_step(self.panel.width() / self.px_per_m, self.panel.width() / 100.0);
        let xs: Vec<f64> = ticks::multiples(self.view.min.x, self.view.max.x, step).collect();
        let ys: Vec<f64> = ticks::multiples(self.view.min.y, self.view.max.y, step).collect();
        let mut grid = Layer::new("grid").stroked(theme::GRID, theme::HAIRLINE_PX);
        let mut numbers = Layer::new("coordinates").with("fill", theme::QUIET);
        for &x in &xs {
            let at = self.px(DVec2::new(x, 0.0)).x;
            grid.line(Px::new(at, self.panel.top), Px::new(at, self.panel.bottom));
            let below = Px::new(at, self.panel.bottom + 15.0);
            numbers.text(below, Anchor::Middle, theme::SMALL_PX, &ticks::label(x, step));
        }
        for &y in &ys {
            let at = self.px(DVec2::new(0.0, y)).y;
            grid.line(Px::new(self.panel.left, at), Px::new(self.panel.right, at));
            let left = Px::new(self.panel.left - 5.0, at + 4.0);
            numbers.text(left, Anchor::End, theme::SMALL_PX, &ticks::label(y, step));
        }
        let mut border = Layer::new("border").stroked(theme::FRAME, 1.0);
        border.rect(self.panel, 0.0);
        layer.add(grid);
        layer.add(numbers);
        layer.add(border);
        layer
    }

    /// Draws walls and cylinders, in a line style by material.
    pub fn walls(&self, scene: &Scene) -> Layer {
        let materials = super::materials::Materials::from_scene(scene);
        let mut layer = Layer::new("walls")
            .stroked(theme::WALL, theme::WALL_PX)
            .with("stroke-linecap", "round");
        for (dash, material) in materials.styles() {
            let mut style = Layer::new("material").with("stroke-dasharray", dash);
            for wall in scene.walls.iter().filter(|wall| wall.material == material) {
                style.line(self.px(wall.a), self.px(wall.b));
            }
            for cylinder in scene.cylinders.iter().filter(|c| c.material == material) {
                // Keep a table leg visible.
                let radius_px = self.length_px(cylinder.radius_m).max(1.5);
                style.circle(self.px(cylinder.center), radius_px);
            }
            layer.add(style);
        }
        layer
    }

    /// Label placement in the panel that avoids the walls of a scene.
    pub(crate) fn labels(&self, scene: Option<&Scene>) -> Labels {
        let mut labels = Labels::new(self.panel);
        for wall in scene.iter().flat_map(|scene| &scene.walls) {
            labels.keep_off(self.px(wall.a), self.px(wall.b));
        }
        for cylinder in scene.iter().flat_map(|scene| &scene.cylinders) {
            let radius_px = self.length_px(cylinder.radius_m);
            let rim = |i: u32| {
                self.px(cylinder.center)
                    + radius_px * Px::from_angle(f64::from(i) * std::f64::consts::FRAC_PI_8)
            };
            (0..16).for_each(|i| labels.keep_off(rim(i), rim(i + 1)));
        }
        labels
    }

    /// Draws the robot's body, if the scene has one, for the ranger at `pose`.
    pub fn body(&self, scene: &Scene, pose: &Pose) -> Layer {
        let mut layer = Layer::new("robot").stroked(theme::FRAME, 1.6);
        let whole = scene.with_robot_at(pose);
        for side in whole.walls.iter().skip(scene.walls.len()) {
            layer.line(self.px(side.a), self.px(side.b));
        }
        for round in whole.cylinders.iter().skip(scene.cylinders.len()) {
            layer.circle(self.px(round.center), self.length_px(round.radius_m));
        }
        layer
    }

    /// Draws the names of walls and cylinders where they fit.
    pub(crate) fn names(&self, scene: &Scene, labels: &mut Labels) -> Layer {
        let mut layer = Layer::new("names").with("fill", theme::QUIET).haloed();
        let middle = Bounds::from_scene(scene).map_or(DVec2::ZERO, |b| (b.min + b.max) / 2.0);
        let mut groups: Vec<(&str, Bounds)> = Vec::new();
        let is_short = |wall: &sonard_model::scene::Wall| {
            let length_px = (self.px(wall.b) - self.px(wall.a)).length();
            length_px < text_width_px(&wall.id, theme::SMALL_PX)
        };
        // A polyline with a segment that is too short for its name has one name.
        let short = scene.walls.iter().filter(|wall| is_short(wall));
        let grouped: HashSet<&str> = short.map(|wall| polyline_name(&wall.id)).collect();
        for wall in &scene.walls {
            let [a, b] = [self.px(wall.a), self.px(wall.b)];
            let along = b - a;
            if grouped.contains(&polyline_name(&wall.id)) {
                note_group(&mut groups, &wall.id, wall.a, wall.b);
                continue;
            }
            let turn_deg = upright_deg(along);
            let outward = side_away_from(self.px(middle), a, b);
            // In the middle, else nearer to either end, else farther off the wall.
            let offsets_px = [10.0, -10.0, 18.0, -18.0];
            let places = [0.5, 0.25, 0.75, 0.1, 0.9].into_iter().flat_map(|part| {
                offsets_px.map(|offset_px| a + part * along + offset_px * outward)
            });
            let mut places: Vec<_> = places.collect();
            places
                .sort_by_key(|at| labels.covered_turned(*at, turn_deg, theme::SMALL_PX, &wall.id));
            for at in places {
                if labels.place_turned(at, turn_deg, theme::SMALL_PX, &wall.id) {
                    // The baseline is slightly below the middle of the text.
                    let lower = DVec2::from_angle(turn_deg.to_radians()).perp() * 4.0;
                    layer.turned_text(at + lower, turn_deg, theme::SMALL_PX, &wall.id);
                    break;
                }
            }
        }
        let discs = scene.cylinders.iter().map(|c| {
            let reach = DVec2::splat(c.radius_m);
            (&*c.id, Bounds { min: c.center - reach, max: c.center + reach })
        });
        for (name, bounds) in groups.into_iter().chain(discs) {
            let corner = self.px(DVec2::new(bounds.max.x, bounds.max.y));
            let low = self.px(DVec2::new(bounds.max.x, bounds.min.y));
            let middle = (low + corner) / 2.0;
            let left = self.px(DVec2::new(bounds.min.x, bounds.min.y));
            let above = Px::new((left.x + low.x) / 2.0, corner.y);
            let places = [
                (low + Px::new(5.0, 12.0), Anchor::Start),
                (corner + Px::new(5.0, -3.0), Anchor::Start),
                (middle + Px::new(6.0, 4.0), Anchor::Start),
                (above - Px::new(0.0, 6.0), Anchor::Middle),
                (Px::new(left.x - 6.0, middle.y + 4.0), Anchor::End),
                (Px::new(above.x, low.y + 15.0), Anchor::Middle),
                (Px::new(left.x - 5.0, corner.y - 3.0), Anchor::End),
                (Px::new(above.x, middle.y + 4.0), Anchor::Middle),
            ];
            if let Some((at, anchor)) = labels.place_at_one(places, theme::SMALL_PX, name) {
                layer.text(at, anchor, theme::SMALL_PX, name);
            }
        }
        layer
    }

    /// Draws position and heading of the ranger.
    pub fn pose(&self, pose: &Pose) -> Layer {
        let mut layer = Layer::new("pose").stroked(theme::INK, 1.6);
        let at = self.px(pose.position());
        let heading = pose.direction_rad(0.0);
        let ahead = Px::new(heading.cos(), -heading.sin());
        let (tip, wing) = (at + 26.0 * ahead, ahead.perp());
        layer.line(at + 5.0 * ahead, tip - 4.0 * ahead);
        let mut solid = Layer::new("head").with("fill", theme::INK).with("stroke", "none");
        solid.polygon(&[tip, tip - 9.0 * ahead + 4.0 * wing, tip - 9.0 * ahead - 4.0 * wing]);
        let mut body = Layer::new("body").with("fill", theme::PAPER);
        body.circle(at, 5.0);
        layer.add(solid);
        layer.add(body);
        layer
    }

    /// Keeps labels off the ranger and the arrow of its heading.
    pub(crate) fn avoid_pose(&self, pose: &Pose, labels: &mut Labels) {
        let at = self.px(pose.position());
        labels.keep_free(Rect::new(at.x - 6.0, at.y - 6.0, 12.0, 12.0));
        // The head of the arrow, which lies off the mark.
        let heading = pose.direction_rad(0.0);
        let head = at + 20.0 * Px::new(heading.cos(), -heading.sin());
        labels.keep_free(Rect::new(head.x - 5.0, head.y - 5.0, 10.0, 10.0));
    }

    /// Draws a bar of round length, above the panel's right end.
    pub fn scale_bar(&self) -> Layer {
        let length_m = ticks::nice_step(self.panel.width() / self.px_per_m, 9.0);
        let end = Px::new(self.panel.right, self.panel.top - 6.0);
        let start = end - Px::new(self.length_px(length_m), 0.0);
        let rise = Px::new(0.0, 6.0);
        let mut layer = Layer::new("scale-bar");
        let mut bar = Layer::new("bar").stroked(theme::INK, 1.6);
        bar.runs([[start - rise, start, end, end - rise]]);
        layer.add(bar);
        let text = format!("{} m", ticks::label(length_m, length_m));
        layer.text(start - Px::new(6.0, -1.0), Anchor::End, theme::TEXT_PX, &text);
        layer
    }
}

/// Name of the polyline of a segment `id.N`; the name of any other wall.
fn polyline_name(id: &str) -> &str {
    id.rsplit_once('.').map_or(id, |(name, _)| name)
}

/// Extends the bounds of the polyline that a short segment `id.N` belongs to.
fn note_group<'a>(groups: &mut Vec<(&'a str, Bounds)>, id: &'a str, a: DVec2, b: DVec2) {
    let name = polyline_name(id);
    match groups.iter_mut().find(|(known, _)| *known == name) {
        Some((_, bounds)) => *bounds = bounds.including([a, b]),
        None => groups.extend(Bounds::around([a, b]).map(|bounds| (name, bounds))),
    }
}

/// Rotation of a text along a direction, degrees clockwise, never upside down.
fn upright_deg(along: Px) -> f64 {
    let turn = along.y.atan2(along.x).to_degrees();
    // Vertical text reads from below, like an axis title.
    if turn >= 89.9 {
        turn - 180.0
    } else if turn < -90.1 {
        turn + 180.0
    } else {
        turn
    }
}

/// Unit normal of a wall pointing away from the middle of the room.
fn side_away_from(middle: Px, a: Px, b: Px) -> Px {
    let normal = (b - a).perp().normalize_or_zero();
    if normal.dot((a + b) / 2.0 - middle) < 0.0 { -normal } else { normal }
}
