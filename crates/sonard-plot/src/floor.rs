//! Scan on the floor plan: rays and rings for the model, marks for the readings, and ticks or
//! arrows on the border for readings without a range or outside the view.

use super::{
    canvas::{Anchor, Layer, Px},
    labels::Labels,
    plan::PlanProjection,
    readings::{PlottedBeam, PlottedScan, ReadingKind},
    theme,
};
use sonard_model::geometry::{DVec2, Pose, wrap_360};

/// Maximum number of rays; more are thinned out.
const MAX_RAYS: usize = 120;
const DOT_PX: f64 = 2.6;
const RING_PX: f64 = 3.4;

/// Scan with its pose and floor plan.
#[derive(Debug, Clone, Copy)]
pub(super) struct Floor<'a> {
    pub(super) plan: &'a PlanProjection,
    pub(super) pose: Pose,
    pub(super) scan: &'a PlottedScan,
}

impl Floor<'_> {
    /// Draws rays from the ranger to each predicted range with a ring there; for a simulated scan,
    /// rays to its readings; for an array, fans.
    pub(super) fn model(&self) -> Layer {
        if let (Some(fan), false) = (self.scan.fan, self.scan.has_model) {
            return fan.draw(self.plan, self.scan);
        }
        let mut rays =
            Layer::new("rays").stroked(theme::SKY, theme::HAIRLINE_PX).with("stroke-opacity", 0.55);
        let mut rings = Layer::new("model").stroked(theme::SKY, 1.0);
        let every = self.scan.beams.len().div_ceil(MAX_RAYS).max(1);
        let mut ends = Vec::new();
        for (i, beam) in self.scan.beams.iter().enumerate() {
            let target = if self.scan.has_model { beam.model_range_m } else { beam.range_m };
            let Some(range_m) = target else { continue };
            let at = self.at(beam, range_m);
            if i % every == 0 {
                ends.push([self.plan.px(beam.ray(&self.pose).0), at]);
            }
            if self.scan.has_model && self.plan.panel.contains(at) {
                rings.circle(at, RING_PX);
            }
        }
        rays.runs(ends);
        let mut layer = Layer::new("predictions");
        layer.add(rays);
        layer.add(rings);
        layer
    }

    /// Draws the circle of the minimum range.
    pub(super) fn min_range(&self) -> Layer {
        if let Some(fan) = self.scan.fan {
            return fan.min_range(self.plan, self.scan);
        }
        let mut layer = Layer::new("min-range")
            .stroked(theme::PURPLE, 1.0)
            .with("stroke-dasharray", MIN_RANGE_DASH);
        if let Some(range_m) = self.scan.min_range_m {
            // A transducer off the rotation axis travels around it.
            let axis = self.pose.position();
            let from_axis_m = |beam: &PlottedBeam| beam.point(&self.pose, range_m).distance(axis);
            let radius_m = self.scan.beams.first().map_or(range_m, from_axis_m);
            layer.circle(self.plan.px(axis), self.plan.length_px(radius_m));
        }
        layer
    }

    /// Draws a mark for each reading within the view.
    pub(super) fn marks(&self, opacity: f64) -> Layer {
        let mut layer = Layer::new("readings").with("fill-opacity", opacity);
        for kind in ReadingKind::WITH_RANGE {
            let mut marks = Layer::new(kind.label()).with("fill", kind.colour());
            for (beam, at) in self.located(kind).filter(|(_, at)| self.plan.panel.contains(*at)) {
                marks.mark(kind.shape(), at, DOT_PX, Some(&beam.hint));
            }
            layer.add(marks);
        }
        layer
    }

    /// Lets labels avoid the marks of the readings, the rings of the predictions and the ranger.
    pub(super) fn avoid_marks(&self, labels: &mut Labels) {
        for beam in &self.scan.beams {
            let ranges = [(beam.range_m, DOT_PX), (beam.model_range_m, RING_PX)];
            for (range_m, radius_px) in ranges {
                let at = range_m.map(|range_m| self.at(beam, range_m));
                if let Some(at) = at.filter(|at| self.plan.panel.contains(*at)) {
                    labels.avoid_mark(at, radius_px);
                }
            }
        }
        if let (Some(fan), false) = (self.scan.fan, self.scan.has_model) {
            fan.reserve_names(self.plan, self.scan, labels);
        }
        self.plan.avoid_pose(&self.pose, labels);
    }

    /// Draws short ticks on the panel's border in the direction of each beam without a range.
    pub(super) fn border_ticks(&self) -> Layer {
        let mut layer = Layer::new("no-range");
        for kind in ReadingKind::WITHOUT_RANGE {
            let mut ticks = Layer::new(kind.label()).stroked(kind.colour(), 1.3);
            let length_px = if kind == ReadingKind::NoEcho { 6.0 } else { 10.0 };
            let beams = self.scan.beams.iter().filter(|beam| beam.kind == kind);
            let runs = beams.filter_map(|beam| {
                let (at, outward) = self.rim(beam.ray(&self.pose))?;
                Some([at - length_px * outward, at])
            });
            ticks.runs(runs);
            layer.add(ticks);
        }
        layer
    }

    /// Draws arrows on the border for readings outside the view, with their number and range.
    pub(super) fn outside(&self, labels: &mut Labels) -> Layer {
        let mut layer = Layer::new("outside").with("fill", theme::INK);
        let mut texts = Layer::new("ranges").haloed();
        for cluster in self.clusters_outside() {
            let direction_rad = self.pose.direction_rad(cluster.azimuth_deg);
            let ray = (self.pose.position(), direction_rad);
            let Some((at, outward)) = self.rim(ray) else { continue };
            let (nose, side) = (at - 2.0 * outward, 4.5 * outward.perp());
            let tail = nose - 9.0 * outward;
            let mut arrow = Layer::new("arrow").with("fill", cluster.colour());
            arrow.polygon(&[nose, tail + side, tail - side]);
            layer.add(arrow);
            let text = cluster.label();
            let anchor = match outward.x {
                x if x > 0.35 => Anchor::End,
                x if x < -0.35 => Anchor::Start,
                _ => Anchor::Middle,
            };
            // At the arrow, else along the border or farther inside.
            let base = tail - 4.0 * outward + Px::new(0.0, 4.0 - 5.0 * outward.y);
            let along = outward.perp();
            let shifts = [0.0, 1.0, -1.0, 2.0, -2.0].into_iter().flat_map(|side| {
                [0.0, 1.0, 2.0].map(|inward| 14.0 * (side * along - inward * outward))
            });
            let places = shifts.map(|shift| (base + shift, anchor));
            if let Some((at, anchor)) = labels.place_at_one(places, theme::SMALL_PX, &text) {
                texts.text(at, anchor, theme::SMALL_PX, &text);
            }
        }
        layer.add(texts);
        layer
    }

    /// Number of readings outside the view.
    pub(super) fn count_outside(&self) -> usize {
        self.clusters_outside().iter().map(|cluster| cluster.count).sum()
    }

    fn located(&self, kind: ReadingKind) -> impl Iterator<Item = (&PlottedBeam, Px)> {
        let of_kind = self.scan.beams.iter().filter(move |beam| beam.kind == kind);
        of_kind.filter_map(|beam| Some((beam, self.at(beam, beam.range_m?))))
    }

    fn at(&self, beam: &PlottedBeam, range_m: f64) -> Px {
        self.plan.px(beam.point(&self.pose, range_m))
    }

    /// Intersection of a beam with the border of the panel, and its direction on the page; `None`
    /// if the ranger itself is outside.
    fn rim(&self, (position, direction_rad): (DVec2, f64)) -> Option<(Px, Px)> {
        let panel = self.plan.panel;
        let from = self.plan.px(position);
        if !panel.contains(from) {
            return None;
        }
        let outward = Px::new(direction_rad.cos(), -direction_rad.sin());
        let until = |at: f64, along: f64, low: f64, high: f64| match along {
            a if a > 1e-12 => (high - at) / a,
            a if a < -1e-12 => (low - at) / a,
            _ => f64::INFINITY,
        };
        let distance = until(from.x, outward.x, panel.left, panel.right).min(until(
            from.y,
            outward.y,
            panel.top,
            panel.bottom,
        ));
        Some((from + distance * outward, outward))
    }

    /// Readings outside the view, grouped by direction.
    fn clusters_outside(&self) -> Vec<Cluster> {
        let mut clusters: Vec<Cluster> = Vec::new();
        for beam in &self.scan.beams {
            let Some(range_m) = beam.range_m else { continue };
            if self.plan.panel.contains(self.at(beam, range_m)) {
                continue;
            }
            match clusters.last_mut() {
                Some(last) if beam.azimuth_deg - last.from_deg < CLUSTER_DEG => {
                    last.extend(beam, range_m);
                }
                _ => clusters.push(Cluster::new(beam, range_m)),
            }
        }
        clusters
    }
}

/// Dash pattern of the minimum-range circle.
pub(super) const MIN_RANGE_DASH: &str = "5 4";

/// Maximum angle spanned by one arrow, degrees.
const CLUSTER_DEG: f64 = 15.0;

#[derive(Debug)]
struct Cluster {
    from_deg: f64,
    azimuth_deg: f64,
    count: usize,
    nearest_m: f64,
    farthest_m: f64,
    kinds: Vec<ReadingKind>,
}

impl Cluster {
    fn new(beam: &PlottedBeam, range_m: f64) -> Self {
        Self {
            from_deg: beam.azimuth_deg,
            azimuth_deg: wrap_360(beam.azimuth_deg),
            count: 1,
            nearest_m: range_m,
            farthest_m: range_m,
            kinds: vec![beam.kind],
        }
    }

    fn extend(&mut self, beam: &PlottedBeam, range_m: f64) {
        self.azimuth_deg = (self.from_deg + beam.azimuth_deg) / 2.0;
        self.count += 1;
        self.nearest_m = self.nearest_m.min(range_m);
        self.farthest_m = self.farthest_m.max(range_m);
        self.kinds.push(beam.kind);
    }

    /// Colour of the most frequent kind.
    fn colour(&self) -> &'static str {
        let times = |kind: &ReadingKind| self.kinds.iter().filter(|k| *k == kind).count();
        self.kinds.iter().max_by_key(|kind| times(kind)).map_or(theme::INK, |kind| kind.colour())
    }

    fn label(&self) -> String {
        let [near, far] = [self.nearest_m, self.farthest_m].map(metres);
        match (self.count, near == far) {
            (1, _) => format!("{near} m"),
            (n, true) => format!("{n} at {near} m"),
            (n, false) => format!("{n} at {near}\u{2013}{far} m"),
        }
    }
}

fn metres(range_m: f64) -> String {
    if range_m < 100.0 { format!("{range_m:.1}") } else { format!("{range_m:.0e}") }
}
