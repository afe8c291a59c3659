//! Legend entries for the content of a picture, with counts.

use super::{
    floor::MIN_RANGE_DASH,
    legend::{LegendEntry, LegendSample},
    materials::Materials,
    readings::{PlottedScan, ReadingKind},
    theme,
};
use sonard_model::scene::Scene;

/// Entries for a floor plan or polar plot of scans; `outside` counts readings outside the view.
/// `with_rays`: beams of simulated scans are drawn as rays.
pub(super) fn all(
    scans: &[PlottedScan],
    scene: Option<&Scene>,
    outside: usize,
    with_rays: bool,
) -> Vec<LegendEntry> {
    let mut entries = with_range(scans);
    for (kind, n) in present(scans, &ReadingKind::WITHOUT_RANGE) {
        let sample = LegendSample::Tick { colour: kind.colour() };
        entries.push(LegendEntry::new(sample, format!("{} ({n})", kind.label())));
    }
    if outside > 0 {
        entries
            .push(LegendEntry::new(LegendSample::Outward, format!("outside the view ({outside})")));
    }
    let is_predicted = |scan: &PlottedScan| {
        scan.has_model && scan.beams.iter().any(|beam| beam.model_range_m.is_some())
    };
    if scans.iter().any(is_predicted) {
        entries.push(LegendEntry::new(LegendSample::Ring { colour: theme::SKY }, "prediction"));
    }
    // A simulated scan has rays to its readings, an array fans.
    let has_rays = |scan: &PlottedScan| {
        !scan.has_model
            && scan.fan.is_none()
            && scan.beams.iter().any(|beam| beam.range_m.is_some())
    };
    if with_rays && scans.iter().any(has_rays) {
        let ray =
            LegendSample::Line { colour: theme::SKY, width_px: theme::HAIRLINE_PX, dash: "none" };
        entries.push(LegendEntry::new(ray, "direction of a beam"));
    }
    if let Some(range_m) = scans.iter().find_map(|scan| scan.min_range_m) {
        let sample =
            LegendSample::Line { colour: theme::PURPLE, width_px: 1.0, dash: MIN_RANGE_DASH };
        entries.push(LegendEntry::new(sample, format!("minimum range (blanking), {range_m:.2} m")));
    }
    entries.extend(scene.map(materials).into_iter().flatten());
    entries
}

/// Entries for readings with a range.
pub(super) fn with_range(scans: &[PlottedScan]) -> Vec<LegendEntry> {
    present(scans, &ReadingKind::WITH_RANGE)
        .map(|(kind, n)| {
            let sample = LegendSample::Mark { shape: kind.shape(), colour: kind.colour() };
            LegendEntry::new(sample, format!("{} ({n})", kind.label()))
        })
        .collect()
}

/// Entries for the line styles of walls, and the robot's body.
pub(super) fn materials(scene: &Scene) -> Vec<LegendEntry> {
    let body = scene.robot.as_ref().map(|robot| {
        let sample = LegendSample::Line { colour: theme::FRAME, width_px: 1.6, dash: "none" };
        LegendEntry::new(sample, format!("robot {}", robot.id))
    });
    Materials::from_scene(scene)
        .styles()
        .map(|(dash, material)| {
            let sample = LegendSample::Line { colour: theme::WALL, width_px: theme::WALL_PX, dash };
            LegendEntry::new(sample, Materials::describe(&material))
        })
        .chain(body)
        .collect()
}

/// Kinds that occur, with their counts.
fn present<'a>(
    scans: &'a [PlottedScan],
    kinds: &'a [ReadingKind],
) -> impl Iterator<Item = (ReadingKind, usize)> {
    kinds
        .iter()
        .map(|kind| (*kind, scans.iter().map(|scan| scan.count(*kind)).sum()))
        .filter(|(_, n)| *n > 0)
}
