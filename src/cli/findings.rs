//! Output files of verbs that interpret scans: pictures, GeoJSON and recordings.

use std::{
    ffi::OsStr,
    io::Write as _,
    path::{Path, PathBuf},
};

use jiff::Timestamp;

use super::{
    Failure, Outcome,
    output::{self, OutPath, Overwrite, Product},
    picture,
};
use crate::{
    export::{self, ExportError, PlaceFindings},
    interpret::{Feature, grid::Grid, lines::MapLine},
    plot::{MAX_WIDTH_PX, Picture},
    scan::{Provenance, ScanView},
};

/// Options of output files.
#[derive(Debug, clap::Args)]
pub(super) struct FindingsArgs {
    /// File to write; by its name a picture (.svg, .png), GeoJSON in local metres (.geojson) or a
    /// recording of ROS 2 with markers (.mcap), or - for SVG to standard output (repeatable)
    #[arg(short, long, value_name = "FILE")]
    pub(super) output: Vec<OutPath>,
    /// Width of a PNG, pixels
    #[arg(long, value_name = "PX", default_value_t = 1000,
          value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_WIDTH_PX)))]
    width: u32,
    #[command(flatten)]
    overwrite: Overwrite,
}

/// Destination and format of an output.
enum Target {
    Picture(picture::Target),
    File(PathBuf, Product),
}

/// Outputs that passed their checks.
pub(super) struct FindingTargets<'a> {
    args: &'a FindingsArgs,
    all: Vec<Target>,
}

impl FindingsArgs {
    /// Checks the outputs before anything is read, so that a wrong name fails early.
    pub(super) fn targets(&self) -> Result<FindingTargets<'_>, Failure> {
        let all = self.output.iter().map(|path| self.target(path));
        Ok(FindingTargets { args: self, all: all.collect::<Result<_, _>>()? })
    }

    fn target(&self, path: &Path) -> Result<Target, Failure> {
        let ending = path.extension().map(OsStr::to_ascii_lowercase);
        let product = match ending.as_deref().and_then(OsStr::to_str) {
            Some("geojson") => Product::GeoJson,
            Some("mcap") => Product::Recording,
            _ if path == Path::new("-") => {
                return picture::Target::new(path, self.overwrite).map(Target::Picture);
            }
            _ => {
                output::picture_format(path).map_err(|_| {
                    Failure::input(
                        format!("{}: unknown file extension", path.display()),
                        "let the name end in .svg, .png, .geojson or .mcap",
                    )
                })?;
                return picture::Target::new(path, self.overwrite).map(Target::Picture);
            }
        };
        self.overwrite.check(path, product)?;
        Ok(Target::File(path.into(), product))
    }
}

impl FindingTargets<'_> {
    /// Writes all outputs; the picture is drawn only if needed.
    pub(super) fn write(
        &self,
        place: &PlaceFindings<'_>,
        picture: impl FnOnce() -> Result<Picture, Failure>,
    ) -> Outcome {
        let has_picture = self.all.iter().any(|target| matches!(target, Target::Picture(_)));
        let picture = if has_picture { Some(picture()?) } else { None };
        for target in &self.all {
            match (target, &picture) {
                (Target::Picture(target), Some(picture)) => {
                    target.write(picture, self.args.width)?;
                }
                (Target::File(path, product), _) => {
                    write(path, *product, self.args.overwrite, place)?;
                }
                (Target::Picture(_), None) => {}
            }
        }
        Ok(())
    }
}

/// Writes findings as GeoJSON or as a recording.
pub(super) fn write(
    path: &Path,
    product: Product,
    overwrite: Overwrite,
    place: &PlaceFindings<'_>,
) -> Outcome {
    let mut stream = overwrite.begin(path, product)?;
    let written = match product {
        Product::GeoJson => {
            stream.write_all(export::to_geojson(place).as_bytes()).map_err(ExportError::from)
        }
        _ => export::write_findings(&mut stream, place),
    };
    let finished = written.and_then(|()| Ok(stream.finish()?));
    finished.or_else(|error| match error {
        ExportError::Write(error) => Failure::from_write(&path.display().to_string(), &error),
        error @ ExportError::Attach { .. } => Err(Failure::input(error, "nothing is attached")),
    })
}

/// Properties of the interpreted scans.
#[derive(Debug, Default)]
pub(super) struct ScanOrigin {
    time: Option<Timestamp>,
    provenance: Option<Provenance>,
    scene: Option<String>,
}

impl ScanOrigin {
    pub(super) fn add(&mut self, scan: &ScanView) {
        self.time = self.time.max(scan.start.as_ref().map(|start| start.time));
        let Some(session) = scan.session.as_deref() else { return };
        // A single simulated scan makes the result a simulated one.
        if self.provenance.is_none_or(|known| known == Provenance::Hardware) {
            self.provenance = Some(session.provenance);
        }
        if self.scene.is_none() {
            self.scene = session.scene.as_ref().map(|scene| scene.name.clone());
        }
    }

    pub(super) fn place<'a>(
        &'a self,
        grid: Option<&'a Grid>,
        lines: &'a [MapLine],
        features: &'a [Feature],
    ) -> PlaceFindings<'a> {
        let Self { time, provenance, scene } = self;
        PlaceFindings {
            time: *time,
            provenance: *provenance,
            scene: scene.as_deref(),
            grid,
            lines,
            features,
        }
    }
}
