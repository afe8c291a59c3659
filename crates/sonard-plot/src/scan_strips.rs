//! Strips of a scan: range, residual, and level above threshold.

use super::{
    canvas::{Layer, Rect},
    readings::{PlottedBeam, PlottedScan, ReadingKind},
    strip::{AzimuthAxis, AzimuthStrip, Scale},
    theme,
};

const MARK_PX: f64 = 2.1;
/// Linear part of the residual scale: the band in which a measured and a predicted range always
/// agree, millimetres.
const RESIDUAL_LINEAR_MM: f64 = 10.0;

/// Minimum half range of the residual scale, millimetres.
const MIN_SCALE_MM: f64 = 1.0;

/// Range against azimuth: measured marks over the predicted line.
pub(super) fn range(
    panel: Rect,
    azimuths: AzimuthAxis,
    scans: &[PlottedScan],
    last: bool,
) -> Layer {
    let scale = Scale::Linear { min: 0.0, max: top_m(scans) };
    let strip = AzimuthStrip { panel, azimuths, scale };
    let mut layer = Layer::new("range-strip");
    layer.add(strip.frame("range, m", last));
    for scan in scans.iter().filter(|scan| scan.has_model) {
        let predicted = scan.beams.iter().filter_map(|b| Some((b.azimuth_deg, b.model_range_m?)));
        let mut line = Layer::new("model").stroked(theme::SKY, 7.0).with("stroke-opacity", 0.7);
        strip.line(&mut line, &strip.sorted(predicted));
        layer.add(line);
    }
    layer.add(marks(&strip, scans, |beam| beam.range_m));
    layer
}

/// Measured minus predicted range against azimuth, on a scale that shows millimetres and metres.
pub(super) fn residual(
    panel: Rect,
    azimuths: AzimuthAxis,
    scans: &[PlottedScan],
    last: bool,
) -> Layer {
    let strip = AzimuthStrip { panel, azimuths, scale: residual_scale(scans) };
    let mut layer = Layer::new("residual-strip");
    layer.extend(linear_band(&strip));
    let title = match strip.scale {
        Scale::Linear { .. } => "measured \u{2212} predicted, mm",
        Scale::SymLog { .. } => "measured \u{2212} predicted, mm (logarithmic beyond \u{b1}10)",
    };
    layer.add(strip.frame(title, last));
    layer.add(marks(&strip, scans, |beam| beam.residual_m.map(|r| 1e3 * r)));
    layer
}

/// Band of the linear part of a residual scale; a linear scale lies within it entirely.
pub(super) fn linear_band(strip: &AzimuthStrip) -> Option<Layer> {
    let is_logarithmic = matches!(strip.scale, Scale::SymLog { .. });
    is_logarithmic.then(|| strip.band(-RESIDUAL_LINEAR_MM, RESIDUAL_LINEAR_MM))
}

/// Linear if every residual is within 10 mm; otherwise logarithmic beyond that, up to 10 m, with
/// arrows for larger residuals.
pub(super) fn residual_scale(scans: &[PlottedScan]) -> Scale {
    scale_of_residuals(
        scans.iter().flat_map(PlottedScan::residuals).map(|(_, residual_m)| residual_m),
    )
}

/// Scale of residuals in metres, as [`residual_scale`].
pub(super) fn scale_of_residuals(residuals_m: impl Iterator<Item = f64>) -> Scale {
    let largest_mm = residuals_m.map(|residual_m| 1e3 * residual_m.abs()).fold(0.0, f64::max);
    if largest_mm <= RESIDUAL_LINEAR_MM {
        let max = (1.15 * largest_mm).max(MIN_SCALE_MM);
        return Scale::Linear { min: -max, max };
    }
    let decades = (1.2 * largest_mm / RESIDUAL_LINEAR_MM).log10().clamp(1.0, 3.0);
    Scale::SymLog { threshold: RESIDUAL_LINEAR_MM, decades }
}

/// Level above threshold against azimuth, of simulated readings.
pub(super) fn margin(
    panel: Rect,
    azimuths: AzimuthAxis,
    scans: &[PlottedScan],
    last: bool,
) -> Layer {
    let margins = scans.iter().flat_map(|scan| &scan.beams).filter_map(|beam| beam.margin_db);
    let (low, high) = margins
        .fold((-6.0, 12.0), |(low, high): (f64, f64), margin| (low.min(margin), high.max(margin)));
    // The nulls of the beam pattern are unbounded; -40 dB is low enough.
    let scale = Scale::Linear { min: low.max(-40.0), max: 1.05 * high.min(120.0) };
    let strip = AzimuthStrip { panel, azimuths, scale };
    let mut layer = Layer::new("margin-strip");
    layer.add(strip.frame("level above threshold, dB", last));
    layer.add(marks(&strip, scans, |beam| beam.margin_db));
    layer
}

fn marks(
    strip: &AzimuthStrip,
    scans: &[PlottedScan],
    value: impl Fn(&PlottedBeam) -> Option<f64>,
) -> Layer {
    // Transparency shows what many overlaid scans have in common.
    let opacity = match scans.len() {
        0 | 1 => 1.0,
        2..=5 => 0.6,
        _ => 0.3,
    };
    let mut layer = Layer::new("readings").with("fill-opacity", opacity);
    for kind in ReadingKind::WITH_RANGE.into_iter().chain(ReadingKind::WITHOUT_RANGE) {
        let mut marks = Layer::new(kind.label()).with("fill", kind.colour());
        let beams = scans.iter().flat_map(|scan| &scan.beams).filter(|beam| beam.kind == kind);
        for beam in beams {
            if let Some(value) = value(beam) {
                let at = (beam.azimuth_deg, value);
                strip.mark(&mut marks, at, (kind.shape(), MARK_PX), &beam.hint);
            }
        }
        layer.add(marks);
    }
    layer
}

/// Upper end of the range axis, not extended by a few far readings.
pub(super) fn top_m(scans: &[PlottedScan]) -> f64 {
    let mut ranges: Vec<f64> = scans
        .iter()
        .flat_map(|scan| &scan.beams)
        .flat_map(|beam| [beam.range_m, beam.model_range_m])
        .flatten()
        .collect();
    ranges.sort_by(f64::total_cmp);
    let p95 = ranges.get(ranges.len() * 95 / 100).copied().unwrap_or(1.0);
    let farthest = ranges.last().copied().unwrap_or(1.0);
    let top = if farthest <= 1.6 * p95 { farthest } else { 1.4 * p95 };
    if top > 0.0 { 1.06 * top } else { 1.0 }
}
