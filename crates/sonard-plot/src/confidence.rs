//! Floor plan with the readings coloured by confidence.

use super::{
    canvas::{Layer, MarkShape},
    legend::{LegendEntry, LegendSample},
    legend_entries, overlay,
    picture::Picture,
    plan::PlanProjection,
    theme,
};
use sonard_model::scene::Scene;
use sonard_records::{Ping, PingStatus, ScanView, text::format_count};

/// Classes of confidence, highest first: lower limit, label, shape and colour. 0.48 is the default
/// of `sonard map`; 0.25 is the minimum for a feature that should have been detected.
const CLASSES: [(f64, &str, MarkShape, &str); 4] = [
    (0.48, "0.48 to 0.5: trusted", MarkShape::Dot, theme::BLUE),
    (0.40, "0.40 to 0.48", MarkShape::Triangle, theme::GREEN),
    (0.25, "0.25 to 0.40", MarkShape::Diamond, theme::ORANGE),
    (0.0, "below 0.25: contradicted by a predicted feature", MarkShape::Square, theme::VERMILLION),
];

/// Draws the readings with a range by their confidence from Feature Prediction (`sonard log
/// annotate`); those without confidence stay small and grey.
#[must_use]
pub fn draw_confidence(scans: &[ScanView], scene: Option<&Scene>) -> Picture {
    let classified: Vec<Vec<(usize, &Ping)>> = scans.iter().map(classify).collect();
    let count = |class: usize| classified.iter().flatten().filter(|(of, _)| *of == class).count();
    let classes = CLASSES.iter().enumerate().filter_map(|(class, (_, label, shape, colour))| {
        let sample = LegendSample::Mark { shape: *shape, colour };
        let entry = || LegendEntry::new(sample, format!("{label} ({})", count(class)));
        (count(class) > 0).then(entry)
    });
    let dots = scans
        .iter()
        .flat_map(|scan| &scan.pings)
        .filter(|ping| ping.range_m.is_some() && ping.confidence.is_none())
        .count();
    let dot = LegendSample::Mark { shape: MarkShape::Dot, colour: theme::NO_ECHO };
    let dots = (dots > 0).then(|| LegendEntry::new(dot, format!("without a confidence ({dots})")));
    let entries: Vec<LegendEntry> = classes
        .chain(dots)
        .chain(scene.map(legend_entries::materials).into_iter().flatten())
        .collect();
    let confidences = scans.iter().flat_map(|scan| &scan.pings).filter_map(|ping| ping.confidence);
    let (sum, count) =
        confidences.fold((0.0, 0_u32), |(sum, count), confidence| (sum + confidence, count + 1));
    let finding = if count == 0 {
        "no reading has a confidence: run `sonard log annotate`".to_owned()
    } else {
        let readings = format_count(count, "reading");
        format!("mean confidence of {readings}: {:.3}", sum / f64::from(count))
    };
    let draw = |plan: &PlanProjection| {
        scans.iter().zip(&classified).filter_map(|(scan, pings)| layer(plan, scan, pings)).collect()
    };
    overlay::draw(scans, scene, finding, &[], draw, |_| None, &entries)
}

/// Readings with a range and a confidence, each with the index of its class.
fn classify(scan: &ScanView) -> Vec<(usize, &Ping)> {
    let class = |ping: &Ping| {
        let confidence = ping.confidence.filter(|_| ping.status == PingStatus::Echo)?;
        CLASSES.iter().position(|(from, ..)| confidence >= *from)
    };
    scan.pings.iter().filter_map(|ping| Some((class(ping)?, ping))).collect()
}

fn layer(plan: &PlanProjection, scan: &ScanView, pings: &[(usize, &Ping)]) -> Option<Layer> {
    scan.pose()?;
    let mut layer = Layer::new("confidences");
    // Low confidence is drawn on top.
    for (class, (_, label, shape, colour)) in CLASSES.iter().enumerate() {
        let mut marks = Layer::new(label).with("fill", *colour);
        for (_, ping) in pings.iter().filter(|(of, _)| *of == class) {
            let Some(range_m) = ping.range_m else { continue };
            let Some(viewpoint) = scan.viewpoint(ping) else { continue };
            let at = plan.px(viewpoint.point_at(range_m));
            let confidence = ping.confidence.unwrap_or_default();
            let hint = format!("{:.1}\u{b0} {range_m:.3} m: {confidence:.3}", ping.azimuth_deg);
            marks.mark(*shape, at, 2.6, Some(&hint));
        }
        layer.add(marks);
    }
    Some(layer)
}
