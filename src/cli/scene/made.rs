//! Scenes made from drawings, maps and worlds of other programs.

use std::{f64::consts::PI, fs, path::Path};

use super::super::{
    Failure, Outcome,
    numbers::probability,
    output::{OutPath, Overwrite, Product, register_input},
};
use crate::{geometry::DVec2, scene::Surfaces};

/// Options of made scenes.
#[derive(Debug, clap::Args)]
pub(in crate::cli) struct MadeArgs {
    /// Reflectance (amplitude) of all surfaces, 0 to 1
    #[arg(long, value_name = "R", default_value_t = 0.97, value_parser = probability)]
    reflectance: f64,
    /// Name of the scene [default: the file's]
    #[arg(long, value_name = "NAME")]
    name: Option<String>,
    /// File to write; the scene goes to it instead of to standard output
    #[arg(short, long, value_name = "FILE")]
    output: Option<OutPath>,
    #[command(flatten)]
    overwrite: Overwrite,
}

/// Maximum deviation of walls from a curve, metres.
const MAX_CURVE_ERROR_M: f64 = 1e-3;
/// Minimum and maximum number of walls of a full circle.
const CIRCLE_WALLS: (f64, f64) = (12.0, 360.0);

/// Reads a source file and registers it as an input.
///
/// # Errors
///
/// The file can't be read; `help` is the advice.
pub(super) fn read(path: &Path, help: &str) -> Result<Vec<u8>, Failure> {
    register_input(path);
    fs::read(path).map_err(|error| file_failure(path, &error, help))
}

/// Failure with the name of a file.
pub(super) fn file_failure(path: &Path, what: &dyn std::fmt::Display, help: &str) -> Failure {
    Failure::input(format!("{}: {what}", path.display()), help)
}

/// Corners along a circular arc from `from` (exclusive) by an angle about a centre, radians,
/// counter-clockwise.
pub(super) fn arc(center: DVec2, from: DVec2, turn_rad: f64) -> impl Iterator<Item = DVec2> {
    let radius = from - center;
    let (min, max) = CIRCLE_WALLS;
    let step_rad = 2.0 * (1.0 - MAX_CURVE_ERROR_M / radius.length().max(MAX_CURVE_ERROR_M)).acos();
    let parts = turn_rad.abs() * (1.0 / step_rad).clamp(min / (2.0 * PI), max / (2.0 * PI));
    let parts = parts.ceil().max(1.0) as usize;
    (1..=parts).map(move |part| {
        center + DVec2::from_angle(turn_rad * part as f64 / parts as f64).rotate(radius)
    })
}

impl MadeArgs {
    /// Writes the scene of the surfaces found in a file, and prints assumptions and omissions.
    ///
    /// # Errors
    ///
    /// No surfaces were found, with the given advice, or the scene can't be written.
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
        for (what, count) in found.ignored() {
            notice!("warning: {shown}: ignored: {count} {what}");
        }
        if found.is_empty() {
            return Err(file_failure(from, &"no walls found", help_if_none));
        }
        let stem = from.file_stem().map(|stem| stem.to_string_lossy().into_owned());
        let name = self.name.clone().or(stem).filter(|name| !name.is_empty());
        let scene = found.scene(name.as_deref().unwrap_or("scene"), self.reflectance);
        let built = scene
            .build()
            .map_err(|error| file_failure(from, &error, "check the units of its lengths"))?;
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
    fn arc_is_approximated() {
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
                // The walls of a large arc are at least a degree long.
                let max_m = MAX_CURVE_ERROR_M.max(radius_m * (1.0 - (PI / 360.0).cos()));
                assert!(sag_m < 1.01 * max_m, "{radius_m}: {sag_m}");
            }
        }
    }
}
