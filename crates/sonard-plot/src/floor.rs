//! A scan on the floor plan: rays and rings for the model, marks for the readings, and the rim
//! for everything that has a direction only or lies beyond the view.

use super::{
    canvas::{Anchor, Layer, Px},
    labels::Labels,
    plan::Plan,
    readings::{Kind, Reading, Readings},
    theme,
};
use sonard_model::geometry::{DVec2, Pose, wrap_360};

/// More rays than this are thinned out.
const MAX_RAYS: usize = 120;
const DOT_PX: f64 = 2.6;
const RING_PX: f64 = 3.4;

/// One scan and how it is drawn among others.
#[derive(Debug, Clone, Copy)]
pub(super) struct Floor<'a> {
    pub(super) plan: &'a Plan,
    pub(super) pose: Pose,
    pub(super) scan: &'a Readings,
}

impl Floor<'_> {
    /// Rays from the ranger to each predicted range, and a ring there; for a scan that the
    /// model made, rays to its readings.
    /// Of an array, fans to its readings.
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

    /// The circle within which nothing is measured.
    pub(super) fn min_range(&self) -> Layer {
        if let Some(fan) = self.scan.fan {
            return fan.min_range(self.plan, self.scan);
        }
        let mut layer = Layer::new("min-range")
            .stroked(theme::PURPLE, 1.0)
            .with("stroke-dasharray", MIN_RANGE_DASH);
        if let Some(range_m) = self.scan.min_range_m {
            // A transducer beside its axis goes round it too.
            let axis = self.pose.position();
            let from_axis_m = |beam: &Reading| beam.point(&self.pose, range_m).distance(axis);
            let radius_m = self.scan.beams.first().map_or(range_m, from_axis_m);
            layer.circle(self.plan.px(axis), self.plan.length_px(radius_m));
        }
        layer
    }

    /// A mark for each reading within the view.
    pub(super) fn marks(&self, opacity: f64) -> Layer {
        let mut layer = Layer::new("readings").with("fill-opacity", opacity);
        for kind in Kind::HEARD {
            let mut marks = Layer::new(kind.words()).with("fill", kind.colour());
            for (beam, at) in self.heard(kind).filter(|(_, at)| self.plan.panel.contains(*at)) {
                marks.mark(kind.shape(), at, DOT_PX, Some(&beam.hint));
            }
            layer.add(marks);
        }
        layer
    }

    /// Short ticks on the panel's border in the direction of each silent beam.
    pub(super) fn silent_ticks(&self) -> Layer {
        let mut layer = Layer::new("unheard");
        for kind in Kind::UNHEARD {
            let mut ticks = Layer::new(kind.words()).stroked(kind.colour(), 1.3);
            let length_px = if kind == Kind::Silent { 6.0 } else { 10.0 };
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

    /// Arrows on the border for readings beyond it, with their number and range.
    pub(super) fn beyond(&self, labels: &mut Labels) -> Layer {
        let mut layer = Layer::new("beyond").with("fill", theme::INK);
        let mut texts = Layer::new("ranges").haloed();
        for cluster in self.clusters_beyond() {
            let direction_rad = self.pose.direction_rad(cluster.azimuth_deg);
            let ray = (self.pose.position(), direction_rad);
            let Some((at, outward)) = self.rim(ray) else { continue };
            let (nose, side) = (at - 2.0 * outward, 4.5 * outward.perp());
            let tail = nose - 9.0 * outward;
            let mut arrow = Layer::new("arrow").with("fill", cluster.colour());
            arrow.polygon(&[nose, tail + side, tail - side]);
            layer.add(arrow);
            let words = cluster.words();
            let base = tail - 4.0 * outward + Px::new(0.0, 4.0 - 5.0 * outward.y);
            let anchor = match outward.x {
                x if x > 0.35 => Anchor::End,
                x if x < -0.35 => Anchor::Start,
                _ => Anchor::Middle,
            };
            if labels.place(base, anchor, theme::SMALL_PX, &words) {
                texts.text(base, anchor, theme::SMALL_PX, &words);
            }
        }
        layer.add(texts);
        layer
    }

    /// How many readings lie beyond the view.
    pub(super) fn count_beyond(&self) -> usize {
        self.clusters_beyond().iter().map(|cluster| cluster.count).sum()
    }

    fn heard(&self, kind: Kind) -> impl Iterator<Item = (&Reading, Px)> {
        let of_kind = self.scan.beams.iter().filter(move |beam| beam.kind == kind);
        of_kind.filter_map(|beam| Some((beam, self.at(beam, beam.range_m?))))
    }

    fn at(&self, beam: &Reading, range_m: f64) -> Px {
        self.plan.px(beam.point(&self.pose, range_m))
    }

    /// Where a beam leaves the panel, and its direction on the page; `None` when the ranger
    /// itself is outside.
    fn rim(&self, (place, direction_rad): (DVec2, f64)) -> Option<(Px, Px)> {
        let panel = self.plan.panel;
        let from = self.plan.px(place);
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

    /// Readings beyond the view, gathered by direction.
    fn clusters_beyond(&self) -> Vec<Cluster> {
        let mut clusters: Vec<Cluster> = Vec::new();
        for beam in &self.scan.beams {
            let Some(range_m) = beam.range_m else { continue };
            if self.plan.panel.contains(self.at(beam, range_m)) {
                continue;
            }
            match clusters.last_mut() {
                Some(last) if beam.azimuth_deg - last.from_deg < CLUSTER_DEG => {
                    last.take(beam, range_m);
                }
                _ => clusters.push(Cluster::new(beam, range_m)),
            }
        }
        clusters
    }
}

/// Dash pattern of the minimum range's circle.
pub(super) const MIN_RANGE_DASH: &str = "5 4";

/// No arrow stands for beams farther apart than this, degrees.
const CLUSTER_DEG: f64 = 15.0;

#[derive(Debug)]
struct Cluster {
    from_deg: f64,
    azimuth_deg: f64,
    count: usize,
    nearest_m: f64,
    farthest_m: f64,
    kinds: Vec<Kind>,
}

impl Cluster {
    fn new(beam: &Reading, range_m: f64) -> Self {
        Self {
            from_deg: beam.azimuth_deg,
            azimuth_deg: wrap_360(beam.azimuth_deg),
            count: 1,
            nearest_m: range_m,
            farthest_m: range_m,
            kinds: vec![beam.kind],
        }
    }

    fn take(&mut self, beam: &Reading, range_m: f64) {
        self.azimuth_deg = (self.from_deg + beam.azimuth_deg) / 2.0;
        self.count += 1;
        self.nearest_m = self.nearest_m.min(range_m);
        self.farthest_m = self.farthest_m.max(range_m);
        self.kinds.push(beam.kind);
    }

    /// The colour of most of its readings.
    fn colour(&self) -> &'static str {
        let times = |kind: &Kind| self.kinds.iter().filter(|other| *other == kind).count();
        self.kinds.iter().max_by_key(|kind| times(kind)).map_or(theme::INK, |kind| kind.colour())
    }

    fn words(&self) -> String {
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
