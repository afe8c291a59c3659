//! Polar plot of range against azimuth.

use super::{
    canvas::{Anchor, Layer, Px},
    caption,
    labels::Labels,
    legend, legend_entries,
    picture::Picture,
    readings::{PlottedScan, ReadingKind},
    scan_caption,
    scan_strips::top_m,
    theme, ticks,
};
use sonard_model::scene::Scene;
use sonard_records::ScanView;

const RADIUS_PX: f64 = 310.0;
const RING_PX: f64 = 3.4;
const DOT_PX: f64 = 2.6;

/// Draws a polar plot of scans: the heading is up, azimuths are counter-clockwise, circles mark
/// ranges.
///
/// Beams without a range are ticks on the rim, readings beyond the rim arrows. The scene only
/// contributes its name and that of the pose.
#[must_use]
pub fn draw_polar(scans: &[ScanView], scene: Option<&Scene>) -> Picture {
    let readings: Vec<PlottedScan> = scans.iter().map(PlottedScan::from_scan).collect();
    let (heading, top) = caption::draw(
        &scan_caption::title(scans, scene),
        scan_caption::badge(scans),
        &scan_caption::lines(scans),
    );
    let center = Px::new(theme::PAGE_PX / 2.0, top + 34.0 + RADIUS_PX);
    let polar = Polar { center, rim_m: top_m(&readings) };
    let outside = readings.iter().map(|scan| polar.outside(scan).count()).sum();

    let mut page = Layer::new("polar");
    page.add(heading);
    page.add(polar.frame());
    page.add(polar.numbers());
    for scan in readings.iter().take(1) {
        page.add(polar.predictions(scan));
    }
    let opacity = if readings.len() > 1 { 0.6 } else { 1.0 };
    for scan in &readings {
        page.add(polar.marks(scan, opacity));
        page.add(polar.rim(scan));
    }
    let below = Px::new(theme::MARGIN_PX, center.y + RADIUS_PX + 40.0);
    let width = theme::PAGE_PX - 2.0 * theme::MARGIN_PX;
    let (key, height) =
        legend::draw(&legend_entries::all(&readings, None, outside, false), below, width);
    page.add(key);
    Picture::new(theme::PAGE_PX, below.y + height + theme::MARGIN_PX / 2.0, page)
}

struct Polar {
    center: Px,
    /// Range of the outermost circle, metres.
    rim_m: f64,
}

impl Polar {
    fn at(&self, azimuth_deg: f64, range_m: f64) -> Px {
        self.center + RADIUS_PX * range_m / self.rim_m * outward(azimuth_deg)
    }

    fn step_m(&self) -> f64 {
        ticks::nice_step(self.rim_m, 5.0)
    }

    fn circles_m(&self) -> impl Iterator<Item = f64> {
        ticks::multiples(self.step_m(), self.rim_m, self.step_m())
    }

    fn frame(&self) -> Layer {
        let mut grid = Layer::new("grid").stroked(theme::GRID, 1.0);
        for range_m in self.circles_m() {
            grid.circle(self.center, RADIUS_PX * range_m / self.rim_m);
        }
        let mut names = Layer::new("azimuths").with("fill", theme::QUIET);
        for azimuth_deg in (0..360).step_by(30).map(f64::from) {
            let rim = self.at(azimuth_deg, self.rim_m);
            grid.line(self.center, rim);
            let at = rim + 17.0 * outward(azimuth_deg) + Px::new(0.0, 4.5);
            let text = match azimuth_deg {
                0.0 => "0\u{b0} heading".to_owned(),
                other => format!("{other}\u{b0}"),
            };
            names.text(at, Anchor::Middle, theme::SMALL_PX, &text);
        }
        let mut border = Layer::new("border").stroked(theme::FRAME, 1.0);
        border.circle(self.center, RADIUS_PX);
        let mut layer = Layer::new("frame");
        layer.add(grid);
        layer.add(names);
        layer.add(border);
        layer
    }

    /// Draws the ranges of the circles, between two spokes.
    fn numbers(&self) -> Layer {
        let mut layer = Layer::new("ranges").with("fill", theme::QUIET).haloed();
        let mut labels = Labels::new(super::canvas::Rect::new(
            self.center.x - RADIUS_PX,
            self.center.y - RADIUS_PX,
            2.0 * RADIUS_PX,
            2.0 * RADIUS_PX,
        ));
        for range_m in self.circles_m() {
            let at = self.at(-15.0, range_m) + Px::new(0.0, 4.0);
            let text = format!("{} m", ticks::label(range_m, self.step_m()));
            if labels.place(at, Anchor::Middle, theme::SMALL_PX, &text) {
                layer.text(at, Anchor::Middle, theme::SMALL_PX, &text);
            }
        }
        layer
    }

    fn predictions(&self, scan: &PlottedScan) -> Layer {
        let mut layer = Layer::new("predictions");
        if let Some(range_m) = scan.min_range_m.filter(|range| *range <= self.rim_m) {
            let mut circle = Layer::new("min-range")
                .stroked(theme::PURPLE, 1.0)
                .with("stroke-dasharray", super::floor::MIN_RANGE_DASH);
            circle.circle(self.center, RADIUS_PX * range_m / self.rim_m);
            layer.add(circle);
        }
        let mut rings = Layer::new("model").stroked(theme::SKY, 1.0);
        for beam in &scan.beams {
            if let Some(range_m) = beam.model_range_m.filter(|range| *range <= self.rim_m) {
                rings.circle(self.at(beam.azimuth_deg, range_m), RING_PX);
            }
        }
        layer.add(rings);
        layer
    }

    fn marks(&self, scan: &PlottedScan, opacity: f64) -> Layer {
        let mut layer = Layer::new("readings").with("fill-opacity", opacity);
        for kind in ReadingKind::WITH_RANGE {
            let mut marks = Layer::new(kind.label()).with("fill", kind.colour());
            for beam in scan.beams.iter().filter(|beam| beam.kind == kind) {
                if let Some(range_m) = beam.range_m.filter(|range| *range <= self.rim_m) {
                    let at = self.at(beam.azimuth_deg, range_m);
                    marks.mark(kind.shape(), at, DOT_PX, Some(&beam.hint));
                }
            }
            layer.add(marks);
        }
        layer
    }

    /// Draws ticks for beams without a range, arrows for readings beyond the outermost circle.
    fn rim(&self, scan: &PlottedScan) -> Layer {
        let mut layer = Layer::new("rim");
        for kind in ReadingKind::WITHOUT_RANGE {
            let mut ticks = Layer::new(kind.label()).stroked(kind.colour(), 1.3);
            let beams = scan.beams.iter().filter(|beam| beam.kind == kind);
            ticks.runs(beams.map(|beam| {
                let at = self.at(beam.azimuth_deg, self.rim_m);
                [at - 7.0 * outward(beam.azimuth_deg), at]
            }));
            layer.add(ticks);
        }
        for (azimuth_deg, kind) in self.outside(scan) {
            let nose = self.at(azimuth_deg, self.rim_m);
            let tail = nose - 9.0 * outward(azimuth_deg);
            let side = 3.5 * outward(azimuth_deg).perp();
            let mut arrow = Layer::new("arrow").with("fill", kind.colour());
            arrow.polygon(&[nose, tail + side, tail - side]);
            layer.add(arrow);
        }
        layer
    }

    fn outside<'a>(
        &'a self,
        scan: &'a PlottedScan,
    ) -> impl Iterator<Item = (f64, ReadingKind)> + 'a {
        let far = |beam: &&super::readings::PlottedBeam| {
            beam.range_m.is_some_and(|range_m| range_m > self.rim_m)
        };
        scan.beams.iter().filter(far).map(|beam| (beam.azimuth_deg, beam.kind))
    }
}

/// Unit vector on the page for an azimuth: up is 0, counter-clockwise is positive.
fn outward(azimuth_deg: f64) -> Px {
    let (sin, cos) = azimuth_deg.to_radians().sin_cos();
    Px::new(-sin, -cos)
}
