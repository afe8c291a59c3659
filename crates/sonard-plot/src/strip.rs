//! Strips of a quantity against azimuth.

use super::{
    canvas::{Anchor, Layer, MarkShape, Px, Rect},
    theme, ticks,
};
use sonard_model::geometry::wrap_360;
use sonard_records::ScanPlan;

/// Azimuth range of a strip.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct AzimuthAxis {
    pub(super) from_deg: f64,
    pub(super) to_deg: f64,
    /// Angle between neighbouring beams, degrees.
    pub(super) step_deg: f64,
}

impl AzimuthAxis {
    /// Azimuth range of a plan; a full turn without a valid plan.
    pub(super) fn from_plan(plan: Option<&ScanPlan>) -> Self {
        plan.filter(|plan| plan.check().is_ok()).map_or(
            Self { from_deg: 0.0, to_deg: 360.0, step_deg: 0.9 },
            |plan| Self { from_deg: plan.from_deg, to_deg: plan.to_deg, step_deg: plan.step_deg },
        )
    }

    /// Azimuth unwrapped from the start of the axis.
    pub(super) fn unwrapped(&self, azimuth_deg: f64) -> f64 {
        let along = wrap_360(azimuth_deg - self.from_deg);
        // Rounding may place the first beam slightly below the start.
        self.from_deg + if along > 360.0 - 1e-6 { 0.0 } else { along }
    }

    fn tick_step(&self, width_px: f64) -> f64 {
        let parts = width_px / 52.0;
        let span = self.to_deg - self.from_deg;
        [1.0, 2.0, 5.0, 10.0, 15.0, 30.0, 45.0, 60.0]
            .into_iter()
            .find(|step| span / step <= parts)
            .unwrap_or(90.0)
    }
}

/// Mapping of a quantity to a height.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Scale {
    /// From `min` to `max`.
    Linear { min: f64, max: f64 },
    /// Linear up to `threshold` on either side of zero, then this many decades, each as
    /// high as the linear part of its side.
    SymLog { threshold: f64, decades: f64 },
}

impl Scale {
    /// Fraction of the height: 0 at the lower end, 1 at the upper, beyond these outside.
    fn fraction(&self, value: f64) -> f64 {
        match *self {
            Self::Linear { min, max } => (value - min) / (max - min),
            Self::SymLog { threshold, decades } => {
                let size = value.abs() / threshold;
                let reach = if size <= 1.0 { size } else { 1.0 + size.log10() };
                0.5 + 0.5 * value.signum() * reach / (1.0 + decades)
            }
        }
    }

    /// Tick values and their labels.
    fn ticks(&self, height_px: f64) -> Vec<(f64, String)> {
        match *self {
            Self::Linear { min, max } => {
                let step = ticks::nice_step(max - min, height_px / 30.0);
                ticks::multiples(min, max, step).map(|v| (v, ticks::label(v, step))).collect()
            }
            Self::SymLog { threshold, decades } => {
                let sizes: Vec<f64> =
                    (0..=(decades + 1e-9) as i32).map(|d| threshold * 10_f64.powi(d)).collect();
                let below = sizes.iter().rev().map(|size| -size);
                let half = threshold / 2.0;
                let all = below.chain([-half, 0.0, half]).chain(sizes.iter().copied());
                all.map(|v| (v, ticks::label(v, 1.0))).collect()
            }
        }
    }
}

/// Panel with its axes.
#[derive(Debug, Clone, Copy)]
pub(super) struct AzimuthStrip {
    pub(super) panel: Rect,
    pub(super) azimuths: AzimuthAxis,
    pub(super) scale: Scale,
}

impl AzimuthStrip {
    pub(super) fn x(&self, azimuth_deg: f64) -> f64 {
        let axis = self.azimuths;
        let along = (axis.unwrapped(azimuth_deg) - axis.from_deg) / (axis.to_deg - axis.from_deg);
        self.panel.left + along * self.panel.width()
    }

    pub(super) fn y(&self, value: f64) -> f64 {
        self.panel.bottom - self.scale.fraction(value).clamp(0.0, 1.0) * self.panel.height()
    }

    /// Width of one beam, pixels.
    fn beam_px(&self) -> f64 {
        let span = self.azimuths.to_deg - self.azimuths.from_deg;
        self.panel.width() * self.azimuths.step_deg / span
    }

    /// Draws border, grid, title above, and numbers; azimuths below on request.
    pub(super) fn frame(&self, title: &str, azimuth_title: bool) -> Layer {
        let Rect { left, top, right, bottom } = self.panel;
        let mut layer = Layer::new("frame");
        let mut grid = Layer::new("grid").stroked(theme::GRID, theme::HAIRLINE_PX);
        let mut numbers = Layer::new("numbers").with("fill", theme::QUIET);
        for (value, text) in self.scale.ticks(self.panel.height()) {
            let y = self.y(value);
            grid.line(Px::new(left, y), Px::new(right, y));
            numbers.text(Px::new(left - 5.0, y + 4.0), Anchor::End, theme::SMALL_PX, &text);
        }
        let step = self.azimuths.tick_step(self.panel.width());
        for azimuth in ticks::multiples(self.azimuths.from_deg, self.azimuths.to_deg, step) {
            let span = self.azimuths.to_deg - self.azimuths.from_deg;
            let x = left + (azimuth - self.azimuths.from_deg) / span * self.panel.width();
            grid.line(Px::new(x, top), Px::new(x, bottom));
            if azimuth_title {
                let text = format!("{}\u{b0}", ticks::label(azimuth, step));
                numbers.text(Px::new(x, bottom + 15.0), Anchor::Middle, theme::SMALL_PX, &text);
            }
        }
        if azimuth_title {
            let middle = Px::new(self.panel.center().x, bottom + 32.0);
            let text = "azimuth, counter-clockwise from the heading";
            numbers.text(middle, Anchor::Middle, theme::SMALL_PX, text);
        }
        let mut border = Layer::new("border").stroked(theme::FRAME, 1.0);
        border.rect(self.panel, 0.0);
        layer.add(grid);
        layer.add(numbers);
        layer.add(border);
        layer.text(Px::new(left, top - 6.0), Anchor::Start, theme::TEXT_PX, title);
        layer
    }

    /// Draws a shaded band between two values.
    pub(super) fn band(&self, low: f64, high: f64) -> Layer {
        let mut layer = Layer::new("band").with("fill", theme::SKY).with("fill-opacity", 0.22);
        let (top, bottom) = (self.y(high), self.y(low));
        layer.rect(Rect::new(self.panel.left, top, self.panel.width(), bottom - top), 0.0);
        layer
    }

    /// Draws a mark for a value, or an arrow at the end of the scale for one beyond it.
    pub(super) fn mark(
        &self,
        layer: &mut Layer,
        (azimuth_deg, value): (f64, f64),
        (shape, radius_px): (MarkShape, f64),
        hint: &str,
    ) {
        let (x, y) = (self.x(azimuth_deg), self.y(value));
        let fraction = self.scale.fraction(value);
        let beyond = match fraction {
            f if f > 1.0 + 1e-9 => Some(1.0),
            f if f < -1e-9 => Some(-1.0),
            _ => None,
        };
        match beyond {
            None => layer.mark(shape, Px::new(x, y), radius_px, Some(hint)),
            Some(up) => {
                let tip = Px::new(x, y + up);
                let wing = |side: f64| Px::new(x + 3.2 * side, y + 8.0 * up);
                layer.polygon_with_hint(&[tip, wing(1.0), wing(-1.0)], hint);
            }
        }
    }

    /// Draws a line through closely spaced values, broken at gaps and jumps; `points` are sorted by
    /// azimuth on this axis.
    pub(super) fn line(&self, layer: &mut Layer, points: &[(f64, f64)]) {
        let half = Px::new(self.beam_px() / 2.0, 0.0);
        let within = |at: Px| Px::new(at.x.clamp(self.panel.left, self.panel.right), at.y);
        let mut runs: Vec<Vec<Px>> = Vec::new();
        let mut last: Option<(f64, f64)> = None;
        for &(azimuth_deg, value) in points {
            let azimuth_deg = self.azimuths.unwrapped(azimuth_deg);
            let at = Px::new(self.x(azimuth_deg), self.y(value));
            let joined = last.is_some_and(|(last_deg, last_value)| {
                azimuth_deg - last_deg < 1.5 * self.azimuths.step_deg
                    && (value - last_value).abs() < 0.02 + 0.05 * value.abs()
            });
            match runs.last_mut().filter(|_| joined) {
                Some(run) => run.push(at),
                None => runs.push(vec![within(at - half), at]),
            }
            last = Some((azimuth_deg, value));
        }
        for run in &mut runs {
            let end = run.last().map(|at| within(*at + half));
            run.extend(end);
        }
        layer.runs(runs);
    }

    /// Sorts readings along this axis.
    pub(super) fn sorted(&self, points: impl IntoIterator<Item = (f64, f64)>) -> Vec<(f64, f64)> {
        let mut points: Vec<_> = points.into_iter().collect();
        points
            .sort_by(|a, b| self.azimuths.unwrapped(a.0).total_cmp(&self.azimuths.unwrapped(b.0)));
        points
    }
}
