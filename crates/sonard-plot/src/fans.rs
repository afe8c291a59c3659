//! Fans for the readings of an array, each from its ranger's position. An echo lies somewhere on
//! the arc; a reading without echo is an outline up to the maximum range.

use super::{
    canvas::{Anchor, Layer, MarkShape, Px},
    floor::MIN_RANGE_DASH,
    labels::Labels,
    plan::PlanProjection,
    readings::{PlottedBeam, PlottedScan},
    theme,
};
use sonard_model::{geometry::DVec2, viewpoint::Viewpoint};

/// Number of segments of an arc.
const PIECES: i32 = 12;

/// Maximum number of fans with labels.
const MAX_LABELLED: usize = 24;

/// Drawing style of an array's readings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct FanStyle {
    /// Half width of the beam at -6 dB one-way, radians.
    pub(super) half_rad: f64,
    /// Maximum range, metres.
    pub(super) max_range_m: f64,
}

impl FanStyle {
    /// Draws every fan, with a dot at its ranger.
    pub(super) fn draw(&self, plan: &PlanProjection, scan: &PlottedScan) -> Layer {
        let mut layer = Layer::new("fans");
        let mut faces = Layer::new("faces").with("fill", theme::INK);
        for (beam, at) in scan.beams.iter().filter_map(|beam| Some((beam, beam.viewpoint?))) {
            layer.add(self.fan(plan, beam, &at));
            faces.mark(MarkShape::Dot, plan.px(at.position()), 1.6, None);
        }
        layer.add(faces);
        if scan.beams.len() <= MAX_LABELLED {
            layer.add(self.names(plan, scan));
        }
        layer
    }

    /// Draws the name of each ranger in its fan.
    fn names(&self, plan: &PlanProjection, scan: &PlottedScan) -> Layer {
        let mut names = Layer::new("rangers").with("fill", theme::QUIET).haloed();
        for (name, at) in self.places_of_names(plan, scan) {
            names.text(at, Anchor::Middle, theme::SMALL_PX, name);
        }
        names
    }

    /// Keeps other labels off the names of the rangers.
    pub(super) fn reserve_names(
        &self,
        plan: &PlanProjection,
        scan: &PlottedScan,
        labels: &mut Labels,
    ) {
        if scan.beams.len() <= MAX_LABELLED {
            for (name, at) in self.places_of_names(plan, scan) {
                // A name at the border has its place, too.
                let _is_inside = labels.place(at, Anchor::Middle, theme::SMALL_PX, name);
            }
        }
    }

    /// Name of each ranger with its place in the fan.
    fn places_of_names<'a>(
        &'a self,
        plan: &'a PlanProjection,
        scan: &'a PlottedScan,
    ) -> impl Iterator<Item = (&'a str, Px)> {
        scan.beams.iter().filter_map(move |beam| {
            let (viewpoint, name) = (beam.viewpoint.as_ref()?, beam.ranger.as_deref()?);
            let range_m = beam.range_m.unwrap_or(self.max_range_m);
            // Where the fan is wide enough, but still within the picture; closer for a fan without
            // echo, where fewer other names are.
            let share = if beam.range_m.is_some() { 0.3 } else { 0.15 };
            let out_m = (0.6 * range_m).min(share * plan.view.size().min_element());
            Some((name, plan.px(viewpoint.point_at(out_m)) + Px::new(0.0, 4.0)))
        })
    }

    fn fan(&self, plan: &PlanProjection, beam: &PlottedBeam, from: &Viewpoint) -> Layer {
        let colour = beam.kind.colour();
        let arc = self.arc(plan, from, beam.range_m.unwrap_or(self.max_range_m));
        let outline = [&[plan.px(from.position())], arc.as_slice()].concat();
        if beam.range_m.is_none() {
            let mut empty = Layer::new("no-echo").stroked(colour, theme::HAIRLINE_PX);
            empty.polygon_with_hint(&outline, &beam.hint);
            return empty;
        }
        let mut fan = Layer::new("echo").with("fill", colour).with("fill-opacity", 0.13);
        fan.polygon_with_hint(&outline, &beam.hint);
        let mut rim = Layer::new("arc").stroked(colour, 2.2);
        rim.runs([arc]);
        fan.add(rim);
        fan
    }

    /// Draws the arcs of the minimum range.
    pub(super) fn min_range(&self, plan: &PlanProjection, scan: &PlottedScan) -> Layer {
        let mut layer = Layer::new("min-range")
            .stroked(theme::PURPLE, 1.0)
            .with("stroke-dasharray", MIN_RANGE_DASH);
        if let Some(range_m) = scan.min_range_m {
            let viewpoints = scan.beams.iter().filter_map(|beam| beam.viewpoint);
            layer.runs(viewpoints.map(|from| self.arc(plan, &from, range_m)));
        }
        layer
    }

    fn arc(&self, plan: &PlanProjection, from: &Viewpoint, range_m: f64) -> Vec<Px> {
        let point = |i: i32| {
            let off_rad = self.half_rad * (2.0 * f64::from(i) / f64::from(PIECES) - 1.0);
            let direction = DVec2::from_angle(from.direction_rad() + off_rad);
            plan.px(from.position() + range_m * direction)
        };
        (0..=PIECES).map(point).collect()
    }
}
