//! Residuals before and after a change of the model, such as a calibration.

use super::{
    canvas::{Layer, MarkShape, Px, Rect},
    caption,
    legend::{self, LegendEntry, LegendSample},
    picture::Picture,
    scan_strips,
    strip::{AzimuthAxis, AzimuthStrip, Scale},
    theme,
};
use sonard_interpret::compare::agrees;
use sonard_records::text::{format_count, format_length};

/// Height of a strip, pixels.
const STRIP_PX: f64 = 230.0;
const MARK_PX: f64 = 2.1;

/// Reading with its prediction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ComparedReading {
    /// Azimuth from the heading, degrees counter-clockwise.
    pub azimuth_deg: f64,
    /// Measured range, metres; `None` without an echo.
    pub measured_m: Option<f64>,
    /// Predicted range, metres; `None` without an echo.
    pub predicted_m: Option<f64>,
}

impl ComparedReading {
    fn residual_m(&self) -> Option<f64> {
        Some(self.measured_m? - self.predicted_m?)
    }

    fn agrees(&self) -> bool {
        self.measured_m.zip(self.predicted_m).is_some_and(|(a_m, b_m)| agrees(a_m, b_m))
    }
}

/// Draws the residuals of the same readings under two models, one strip below the other on a common
/// scale, with the number of echoes that agree and the median residual above each strip.
///
/// `names` are those of the two models.
#[must_use]
pub fn draw_before_after(
    title: &str,
    badge: Option<&str>,
    lines: &[String],
    names: [&str; 2],
    readings: [&[ComparedReading]; 2],
) -> Picture {
    let unit = "residual: measured \u{2212} predicted range, mm".to_owned();
    let (heading, top) = caption::draw(title, badge, &[lines, &[unit]].concat());
    let left = theme::MARGIN_PX + 50.0;
    let width = theme::PAGE_PX - theme::MARGIN_PX - left;
    let all = readings.iter().copied().flatten().filter_map(ComparedReading::residual_m);
    let scale = scan_strips::scale_of_residuals(all);
    let azimuths = AzimuthAxis { from_deg: 0.0, to_deg: 360.0, step_deg: 0.9 };
    let mut page = Layer::new("before-after");
    page.add(heading);
    let mut below = top + 22.0;
    for (number, (name, readings)) in names.into_iter().zip(readings).enumerate() {
        let panel = Rect::new(left, below, width, STRIP_PX);
        let strip = AzimuthStrip { panel, azimuths, scale };
        page.extend(scan_strips::linear_band(&strip));
        page.add(strip.frame(&format!("{name}: {}", describe(readings)), number == 1));
        page.add(marks(&strip, readings));
        below = panel.bottom + 36.0;
    }
    let key = Px::new(theme::MARGIN_PX, below + 10.0);
    let (key_layer, height) = legend::draw(&entries(readings, scale), key, width);
    page.add(key_layer);
    Picture::new(theme::PAGE_PX, key.y + height + theme::MARGIN_PX / 2.0, page)
}

/// Summary of one model: agreement, median residual, echoes on one side only.
fn describe(readings: &[ComparedReading]) -> String {
    let mut residuals: Vec<f64> =
        readings.iter().filter_map(|reading| Some(reading.residual_m()?.abs())).collect();
    residuals.sort_by(f64::total_cmp);
    let agreeing = readings.iter().filter(|reading| reading.agrees()).count();
    let one_sided = readings
        .iter()
        .filter(|reading| reading.measured_m.is_some() != reading.predicted_m.is_some())
        .count();
    let median = residuals.get(residuals.len() / 2).map_or("-".into(), |m| format_length(*m));
    format!(
        "{agreeing} of {} agree, |residual| median {median}; {} measured or predicted only",
        format_count(residuals.len(), "echo"),
        format_count(one_sided, "echo"),
    )
}

/// Style of agreeing and of other readings.
const STYLES: [(bool, MarkShape, &str, &str); 2] = [
    (true, MarkShape::Dot, theme::BLUE, "agrees with the model"),
    (false, MarkShape::Cross, theme::INK, "disagrees with the model"),
];

fn marks(strip: &AzimuthStrip, readings: &[ComparedReading]) -> Layer {
    let mut layer = Layer::new("readings").with("fill-opacity", 0.6);
    for (agreeing, shape, colour, name) in STYLES {
        let mut marks = Layer::new(name).with("fill", colour);
        for reading in readings.iter().filter(|reading| reading.agrees() == agreeing) {
            let Some(residual_m) = reading.residual_m() else { continue };
            let hint = format!("{:.1}\u{b0}: {}", reading.azimuth_deg, format_length(residual_m));
            let at = (reading.azimuth_deg, 1e3 * residual_m);
            strip.mark(&mut marks, at, (shape, MARK_PX), &hint);
        }
        layer.add(marks);
    }
    layer
}

fn entries(readings: [&[ComparedReading]; 2], scale: Scale) -> Vec<LegendEntry> {
    let drawn = |agreeing: bool| {
        let all = readings.iter().copied().flatten();
        all.filter(|reading| reading.residual_m().is_some())
            .any(|reading| reading.agrees() == agreeing)
    };
    let kinds = STYLES.iter().filter(|(agreeing, ..)| drawn(*agreeing));
    let mut entries: Vec<LegendEntry> = kinds
        .map(|&(_, shape, colour, name)| {
            LegendEntry::new(LegendSample::Mark { shape, colour }, name)
        })
        .collect();
    if matches!(scale, Scale::SymLog { .. }) {
        entries.push(LegendEntry::new(
            LegendSample::Patch { colour: "#dcedf9" },
            "within 10 mm; the scale is logarithmic beyond",
        ));
    }
    entries
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reading(measured_m: Option<f64>, predicted_m: Option<f64>) -> ComparedReading {
        ComparedReading { azimuth_deg: 10.0, measured_m, predicted_m }
    }

    #[test]
    fn figures_of_each_model() {
        let before = [
            reading(Some(1.0), Some(1.05)),
            reading(Some(2.0), Some(2.03)),
            reading(Some(1.0), None),
        ];
        let after =
            [reading(Some(1.0), Some(1.0004)), reading(Some(2.0), Some(2.0)), reading(None, None)];
        let names = ["initial values", "fitted values"];
        let badge = Some("MOCK, not hardware");
        let svg = draw_before_after("a fit", badge, &[], names, [&before, &after]).to_svg();
        for text in [
            "initial values: 0 of 2 echoes agree, |residual| median 50.0 mm; 1 echo measured",
            "fitted values: 2 of 2 echoes agree, |residual| median 0.4 mm; 0 echoes measured",
            "agrees with the model",
            "disagrees with the model",
            "MOCK, not hardware",
        ] {
            assert!(svg.contains(text), "{text}: {svg}");
        }
    }

    #[test]
    fn without_readings() {
        let svg = draw_before_after("a fit", None, &[], ["a", "b"], [&[], &[]]).to_svg();
        assert!(svg.contains("0 of 0 echoes agree, |residual| median -"), "{svg}");
    }
}
