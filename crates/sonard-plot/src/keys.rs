//! Legend entries for what a picture shows, with numbers.

use super::{
    floor::MIN_RANGE_DASH,
    legend::{Entry, Sample},
    materials::Materials,
    readings::{Kind, Readings},
    theme,
};
use sonard_model::scene::Scene;

/// Everything on a floor plan or polar plot of scans; `beyond` readings lie outside it.
pub(super) fn all(scans: &[Readings], scene: Option<&Scene>, beyond: usize) -> Vec<Entry> {
    let mut entries = heard(scans);
    for (kind, n) in present(scans, &Kind::UNHEARD) {
        let sample = Sample::Tick { colour: kind.colour() };
        entries.push(Entry::new(sample, format!("{} ({n})", kind.words())));
    }
    if beyond > 0 {
        entries.push(Entry::new(Sample::Outward, format!("beyond the view ({beyond})")));
    }
    if scans.iter().any(|scan| scan.has_model) {
        entries.push(Entry::new(Sample::Ring { colour: theme::SKY }, "model"));
    }
    if let Some(range_m) = scans.iter().find_map(|scan| scan.min_range_m) {
        let sample = Sample::Line { colour: theme::PURPLE, width_px: 1.0, dash: MIN_RANGE_DASH };
        entries.push(Entry::new(sample, format!("blind within {range_m:.2} m")));
    }
    entries.extend(scene.map(materials).into_iter().flatten());
    entries
}

/// The marks of readings.
pub(super) fn heard(scans: &[Readings]) -> Vec<Entry> {
    present(scans, &Kind::HEARD)
        .map(|(kind, n)| {
            let sample = Sample::Mark { shape: kind.shape(), colour: kind.colour() };
            Entry::new(sample, format!("{} ({n})", kind.words()))
        })
        .collect()
}

/// The line styles of walls, and the robot's body.
pub(super) fn materials(scene: &Scene) -> Vec<Entry> {
    let body = scene.robot.as_ref().map(|robot| {
        let sample = Sample::Line { colour: theme::FRAME, width_px: 1.6, dash: "none" };
        Entry::new(sample, format!("robot {}", robot.id))
    });
    Materials::of(scene)
        .styles()
        .map(|(dash, material)| {
            let sample = Sample::Line { colour: theme::WALL, width_px: theme::WALL_PX, dash };
            Entry::new(sample, Materials::describe(&material))
        })
        .chain(body)
        .collect()
}

/// The kinds that occur, with their numbers.
fn present<'a>(scans: &'a [Readings], kinds: &'a [Kind]) -> impl Iterator<Item = (Kind, usize)> {
    kinds
        .iter()
        .map(|kind| (*kind, scans.iter().map(|scan| scan.count(*kind)).sum()))
        .filter(|(_, n)| *n > 0)
}
