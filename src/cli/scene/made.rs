//! Scenes that are made of drawings, maps and worlds of others.

use std::{f64::consts::PI, fs, path::Path};

use super::super::{
    Failure, Outcome,
    numbers::probability,
    output::{OutPath, Overwrite, Product, note_input},
};
use crate::{geometry::DVec2, scene::Surfaces};

/// What a scene that is made of something else is told besides.
#[derive(Debug, clap::Args)]
pub(in crate::cli) struct MadeArgs {
    /// Amplitude that all surfaces mirror, 0 to 1
    #[arg(long, value_name = "R", default_value_t = 0.97, value_parser = probability)]
    reflectance: f64,
    /// The scene's name [default: the file's]
    #[arg(long, value_name = "NAME")]
    name: Option<String>,
    /// File to write; the scene goes to it instead of to standard output
    #[arg(short, long, value_name = "FILE")]
    output: Option<OutPath>,
    #[command(flatten)]
    overwrite: Overwrite,
}

/// Walls in place of a curve are off it by this at most, metres.
const OFF_CURVE_M: f64 = 1e-3;
/// Walls of a full turn, at least and at most.
const OF_A_TURN: (f64, f64) = (12.0, 360.0);

/// A file that a scene is made of, noted as one that is read.
///
/// # Errors
/// When it can't be read; `help` says what would be right.
pub(super) fn read(path: &Path, help: &str) -> Result<Vec<u8>, Failure> {
    note_input(path);
    fs::read(path).map_err(|error| refuse(path, &error, help))
}

/// What is wrong with a file.
pub(super) fn refuse(path: &Path, what: &dyn std::fmt::Display, help: &str) -> Failure {
    Failure::input(format!("{}: {what}", path.display()), help)
}

/// Corners along a circular arc that begins at `from` and turns so far about a centre, radians, counter-clockwise;
/// `from` is not among them.
pub(super) fn arc(center: DVec2, from: DVec2, turn_rad: f64) -> impl Iterator<Item = DVec2> {
    let radius = from - center;
    let (least, most) = OF_A_TURN;
    let step_rad = 2.0 * (1.0 - OFF_CURVE_M / radius.length().max(OFF_CURVE_M)).acos();
    let parts = turn_rad.abs() * (1.0 / step_rad).clamp(least / (2.0 * PI), most / (2.0 * PI));
    let parts = parts.ceil().max(1.0) as usize;
    (1..=parts).map(move |part| {
        center + DVec2::from_angle(turn_rad * part as f64 / parts as f64).rotate(radius)
    })
}

impl MadeArgs {
    /// Writes the scene of what was found in a file, and prints what was assumed and left out.
    ///
    /// # Errors
    /// When nothing was found, with this help, and what the disk refuses.
    pub(super) fn write(
        &self,
        from: &Path,
        found: &Surfaces,
        notes: &[String],
        help_if_none: &str,
    ) -> Outcome {
        let shown = from.display();
        for note in notes {
            notice!("warning: {shown}: {note}");
        }
        for (what, count) in found.left_out() {
            notice!("warning: {shown}: left out: {count} {what}");
        }
        if found.is_empty() {
            return Err(refuse(from, &"no wall is found in it", help_if_none));
        }
        let stem = from.file_stem().map(|stem| stem.to_string_lossy().into_owned());
        let name = self.name.clone().or(stem).filter(|name| !name.is_empty());
        let scene = found.scene(name.as_deref().unwrap_or("scene"), self.reflectance);
        let built = scene.build().map_err(|error| {
            refuse(from, &error, "see that its lengths are in the units that were meant")
        })?;
        match self.output.as_deref() {
            None => super::print(scene.text().trim_end()),
            Some(path) => {
                self.overwrite.save(path, Product::Log, scene.text().as_bytes())?;
                notice!("{}", super::summary(&built));
                Ok(())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn walls_in_place_of_an_arc_are_near_it_and_end_where_it_ends() {
        let center = DVec2::new(1.0, 2.0);
        for (radius_m, turn_rad) in [(0.05, 6.0), (1.0, -1.5), (8.0, 0.01), (500.0, 3.0)] {
            let from = center + DVec2::new(radius_m, 0.0);
            let corners: Vec<DVec2> =
                std::iter::once(from).chain(arc(center, from, turn_rad)).collect();
            let end = center + radius_m * DVec2::from_angle(turn_rad);
            assert!(corners[corners.len() - 1].distance(end) < 1e-9);
            assert!((2..=362).contains(&corners.len()), "{radius_m}: {}", corners.len());
            for ends in corners.windows(2) {
                let sag_m = radius_m - center.distance(ends[0].midpoint(ends[1]));
                // Of a wide one walls are no shorter than a degree.
                let most_m = OFF_CURVE_M.max(radius_m * (1.0 - (PI / 360.0).cos()));
                assert!(sag_m < 1.01 * most_m, "{radius_m}: {sag_m}");
            }
        }
    }
}
