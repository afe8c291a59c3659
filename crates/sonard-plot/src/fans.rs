//! An array's readings: a fan for each, from the ranger's own place. What was heard is somewhere on
//! the arc; a silent one is an empty outline as far as the ranger listens.

use super::{
    canvas::{Anchor, Layer, Px, Shape},
    floor::MIN_RANGE_DASH,
    plan::Plan,
    readings::{Reading, Readings},
    theme,
};
use sonard_model::{geometry::DVec2, viewpoint::Viewpoint};

/// An arc has so many pieces.
const PIECES: i32 = 12;

/// More fans than this are not named.
const MOST_NAMED: usize = 24;

/// How an array's readings are drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Fan {
    /// Half the beam's width, radians: to where the sound that leaves is 6 dB weaker.
    pub(super) half_rad: f64,
    /// How far the rangers listen, metres.
    pub(super) max_range_m: f64,
}

impl Fan {
    /// Every fan, and a dot where its ranger is.
    pub(super) fn draw(&self, plan: &Plan, scan: &Readings) -> Layer {
        let mut layer = Layer::new("fans");
        let mut faces = Layer::new("faces").with("fill", theme::INK);
        for (beam, at) in scan.beams.iter().filter_map(|beam| Some((beam, beam.viewpoint?))) {
            layer.add(self.fan(plan, beam, &at));
            faces.mark(Shape::Dot, plan.px(at.position()), 1.6, None);
        }
        layer.add(faces);
        if scan.beams.len() <= MOST_NAMED {
            layer.add(self.names(plan, scan));
        }
        layer
    }

    /// Each ranger's name, in its fan.
    fn names(&self, plan: &Plan, scan: &Readings) -> Layer {
        let mut names = Layer::new("rangers").with("fill", theme::QUIET).haloed();
        for beam in &scan.beams {
            let (Some(viewpoint), Some(name)) = (&beam.viewpoint, &beam.ranger) else { continue };
            let range_m = beam.range_m.unwrap_or(self.max_range_m);
            // Where the fan is wide enough, but not so far out that it leaves the picture; a silent
            // one's nearer, where fewer other names are.
            let share = if beam.range_m.is_some() { 0.3 } else { 0.15 };
            let out_m = (0.6 * range_m).min(share * plan.view.size().min_element());
            let at = plan.px(viewpoint.point_at(out_m)) + Px::new(0.0, 4.0);
            names.text(at, Anchor::Middle, theme::SMALL_PX, name);
        }
        names
    }

    fn fan(&self, plan: &Plan, beam: &Reading, from: &Viewpoint) -> Layer {
        let colour = beam.kind.colour();
        let arc = self.arc(plan, from, beam.range_m.unwrap_or(self.max_range_m));
        let outline = [&[plan.px(from.position())], arc.as_slice()].concat();
        if beam.range_m.is_none() {
            let mut silent = Layer::new("silent").stroked(colour, theme::HAIRLINE_PX);
            silent.polygon_with_hint(&outline, &beam.hint);
            return silent;
        }
        let mut heard = Layer::new("heard").with("fill", colour).with("fill-opacity", 0.13);
        heard.polygon_with_hint(&outline, &beam.hint);
        let mut rim = Layer::new("arc").stroked(colour, 2.2);
        rim.runs([arc]);
        heard.add(rim);
        heard
    }

    /// The arcs within which nothing is measured.
    pub(super) fn min_range(&self, plan: &Plan, scan: &Readings) -> Layer {
        let mut layer = Layer::new("min-range")
            .stroked(theme::PURPLE, 1.0)
            .with("stroke-dasharray", MIN_RANGE_DASH);
        if let Some(range_m) = scan.min_range_m {
            let viewpoints = scan.beams.iter().filter_map(|beam| beam.viewpoint);
            layer.runs(viewpoints.map(|from| self.arc(plan, &from, range_m)));
        }
        layer
    }

    fn arc(&self, plan: &Plan, from: &Viewpoint, range_m: f64) -> Vec<Px> {
        let point = |i: i32| {
            let off_rad = self.half_rad * (2.0 * f64::from(i) / f64::from(PIECES) - 1.0);
            let direction = DVec2::from_angle(from.direction_rad() + off_rad);
            plan.px(from.position() + range_m * direction)
        };
        (0..=PIECES).map(point).collect()
    }
}
