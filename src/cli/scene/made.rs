//! Scenes made from drawings, maps and worlds of other programs.

use std::{
    fs::File,
    io::{self, Read as _},
    path::Path,
};

use super::super::{
    Failure, Outcome,
    numbers::probability,
    output::{OutPath, Overwrite, Product, register_input},
};
use crate::{
    floorplan::{FloorPlan, MAX_FILE_BYTES, PlanError},
    scene::Surfaces,
};

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

/// Reads a source file and registers it as an input.
///
/// # Errors
///
/// The file can't be read; `help` is the advice.
pub(super) fn read(path: &Path, help: &str) -> Result<Vec<u8>, Failure> {
    register_input(path);
    read_limited(path).map_err(|error| file_failure(path, &error, help))
}

/// Reads a file up to a byte above [`MAX_FILE_BYTES`], which suffices for its rejection.
pub(super) fn read_limited(path: &Path) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    File::open(path)?.take(MAX_FILE_BYTES as u64 + 1).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Failure with the name of a file.
pub(super) fn file_failure(path: &Path, what: &dyn std::fmt::Display, help: &str) -> Failure {
    Failure::input(format!("{}: {what}", path.display()), help)
}

/// Failure of reading a floor plan, with the name of the faulty file.
pub(super) fn plan_failure(path: &Path, error: &PlanError) -> Failure {
    file_failure(error.file.as_deref().unwrap_or(path), error, error.help())
}

impl MadeArgs {
    /// Writes the scene of a floor plan.
    ///
    /// # Errors
    ///
    /// No surfaces were found, with the given advice, or the scene can't be written.
    pub(super) fn write_plan(&self, from: &Path, plan: &FloorPlan, help_if_none: &str) -> Outcome {
        self.write(from, &plan.surfaces, &plan.notes, help_if_none)
    }

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
