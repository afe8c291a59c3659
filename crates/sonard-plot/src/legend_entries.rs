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
pub(super) fn all(
    scans: &[PlottedScan],
    scene: Option<&Scene>,
    outside: usize,
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
    if scans.iter().any(|scan| scan.has_model) {
        entries.push(LegendEntry::new(LegendSample::Ring { colour: theme::SKY }, "prediction"));
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
