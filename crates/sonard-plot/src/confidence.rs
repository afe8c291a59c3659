//! The floor plan with each reading in the colour of its confidence.

use super::{
    canvas::{Layer, Shape},
    keys,
    legend::{Entry, Sample},
    overlay,
    picture::Picture,
    plan::Plan,
    theme,
};
use sonard_model::scene::Scene;
use sonard_records::{Ping, PingStatus, ScanView};

/// Classes of confidence, the highest first: from where, what it is called, shape and colour.
/// 0.48 is what `sonard map` asks for; 0.25 is the least of a feature that should have been heard.
const CLASSES: [(f64, &str, Shape, &str); 4] = [
    (0.48, "0.48 to 0.5: believed", Shape::Dot, theme::BLUE),
    (0.40, "0.40 to 0.48", Shape::Triangle, theme::GREEN),
    (0.25, "0.25 to 0.40", Shape::Diamond, theme::ORANGE),
    (0.0, "below 0.25: contradicted", Shape::Square, theme::VERMILLION),
];

/// Draws the readings that have a range by the confidence that Feature Prediction gave them
/// (`sonard log annotate`); those without one stay small and grey.
#[must_use]
pub fn draw_confidence(scans: &[ScanView], scene: Option<&Scene>) -> Picture {
    let heard: Vec<Vec<(usize, &Ping)>> = scans.iter().map(classed).collect();
    let counts = |class: usize| heard.iter().flatten().filter(|(of, _)| *of == class).count();
    let classes = CLASSES.iter().enumerate().map(|(class, (_, words, shape, colour))| {
        let sample = Sample::Mark { shape: *shape, colour };
        Entry::new(sample, format!("{words} ({})", counts(class)))
    });
    let entries: Vec<Entry> =
        classes.chain(scene.map(keys::materials).into_iter().flatten()).collect();
    let weighed = scans.iter().flat_map(|scan| &scan.pings).filter_map(|ping| ping.confidence);
    let (sum, count) = weighed.fold((0.0, 0), |(sum, count), one| (sum + one, count + 1));
    let finding = if count == 0 {
        "no reading has a confidence: `sonard log annotate` writes them".to_owned()
    } else {
        format!("confidence of {count} readings: {:.3} on average", sum / f64::from(count))
    };
    let draw = |plan: &Plan| {
        scans.iter().zip(&heard).filter_map(|(scan, pings)| layer(plan, scan, pings)).collect()
    };
    overlay::draw(scans, scene, finding, &[], draw, |_| None, &entries)
}

/// Readings with a range and a confidence, each with its class.
fn classed(scan: &ScanView) -> Vec<(usize, &Ping)> {
    let class = |ping: &Ping| {
        let confidence = ping.confidence.filter(|_| ping.status == PingStatus::Echo)?;
        CLASSES.iter().position(|(from, ..)| confidence >= *from)
    };
    scan.pings.iter().filter_map(|ping| Some((class(ping)?, ping))).collect()
}

fn layer(plan: &Plan, scan: &ScanView, pings: &[(usize, &Ping)]) -> Option<Layer> {
    scan.pose()?;
    let mut layer = Layer::new("confidences");
    // The doubtful ones lie on top.
    for (class, (_, words, shape, colour)) in CLASSES.iter().enumerate() {
        let mut marks = Layer::new(words).with("fill", *colour);
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
