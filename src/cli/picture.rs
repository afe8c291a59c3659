//! Pictures written by verbs, and the scenes drawn in them.

use std::{
    io::{self, IsTerminal, Write as _},
    path::{Path, PathBuf},
};

use super::{
    Failure, Outcome,
    output::{self, OutPath, Overwrite, Product},
    scene_file,
};
use crate::{
    plot::{MAX_WIDTH_PX, Picture},
    scan::ScanView,
    scene::Scene,
};

#[derive(Debug, clap::Args)]
pub(super) struct PictureArgs {
    /// File to write; a picture, .svg or .png by its name, or - for SVG to standard output
    /// (repeatable)
    #[arg(short, long, value_name = "FILE")]
    pub(super) output: Vec<OutPath>,
    /// Width of a PNG, pixels
    #[arg(long, value_name = "PX", default_value_t = 1000,
          value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_WIDTH_PX)))]
    pub(super) width: u32,
    #[command(flatten)]
    overwrite: Overwrite,
}

impl PictureArgs {
    /// Checks the outputs before anything is read, so that a wrong name fails early.
    pub(super) fn targets(&self) -> Result<Vec<Target>, Failure> {
        self.output.iter().map(|path| Target::new(path, self.overwrite)).collect()
    }
}

/// Destination and format of a picture.
pub(super) enum Target {
    StandardOutput,
    File(PathBuf, Product, Overwrite),
}

impl Target {
    /// Checks that the name has a known extension and that the file may be written.
    pub(super) fn new(path: &Path, overwrite: Overwrite) -> Result<Self, Failure> {
        if path == Path::new("-") {
            return Ok(Self::StandardOutput);
        }
        let product = output::picture_format(path)?;
        overwrite.check(path, product)?;
        Ok(Self::File(path.into(), product, overwrite))
    }

    /// Writes the picture; `width_px` applies to PNG.
    pub(super) fn write(&self, picture: &Picture, width_px: u32) -> Outcome {
        let Self::File(path, product, overwrite) = self else {
            return io::stdout()
                .lock()
                .write_all(picture.to_svg().as_bytes())
                .or_else(|error| Failure::from_write("standard output", &error));
        };
        let bytes = match product {
            Product::Png => picture.to_png(width_px).map_err(|error| {
                Failure::input(format!("{}: {error}", path.display()), "choose another --width")
            })?,
            _ => picture.to_svg().into_bytes(),
        };
        overwrite.save(path, *product, &bytes)
    }
}

/// Returns the outputs; standard output by default, unless it is a terminal.
pub(super) fn targets(args: &PictureArgs) -> Result<Vec<Target>, Failure> {
    if args.output.is_empty() && io::stdout().is_terminal() {
        return Err(Failure::input(
            "the picture would go to the terminal",
            "name a file with -o scan.svg or -o scan.png, or redirect standard output",
        ));
    }
    if args.output.is_empty() { Ok(vec![Target::StandardOutput]) } else { args.targets() }
}

/// Returns the scene named on the command line, or else that of the first scan with a scene: as
/// stored in the log, or the shipped one of that name.
pub(super) fn scene_for(
    log: &Path,
    views: &[ScanView],
    given: Option<&Path>,
) -> Result<Option<Scene>, Failure> {
    let session = views
        .iter()
        .filter_map(|view| view.session.as_deref())
        .find(|session| session.scene.is_some());
    let logged = session.and_then(|session| session.scene.as_ref());
    let scene = match (given, session) {
        (Some(given), _) => scene_file::load(given)?,
        (None, Some(session)) => match scene_file::of_session(log, session)? {
            Some(scene) => scene,
            None => return Ok(None),
        },
        (None, None) => return Ok(None),
    };
    if logged.is_some_and(|logged| logged.sha256 != scene.sha256) {
        notice!(
            "warning: the scene `{}` is not the one that the log's model used (its SHA-256 \
             differs): walls and predictions may be wrong",
            scene.name
        );
    }
    Ok(Some(scene))
}
