//! Pictures that verbs write, and the scene and damage that they tell of.

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

/// Which pictures.
#[derive(Debug, clap::Args)]
pub(super) struct PictureArgs {
    /// File to write; a picture, .svg or .png by its name, or - for SVG to standard output; may be given several times
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
    /// Checked before anything is read, so that a wrong name costs no time.
    pub(super) fn targets(&self) -> Result<Vec<Target>, Failure> {
        self.output.iter().map(|path| Target::of(path, self.overwrite)).collect()
    }
}

/// Where a picture goes, and in which format.
pub(super) enum Target {
    StandardOutput,
    File(PathBuf, Product, Overwrite),
}

impl Target {
    /// A place whose name says the format, and that may be written to.
    pub(super) fn of(path: &Path, overwrite: Overwrite) -> Result<Self, Failure> {
        if path == Path::new("-") {
            return Ok(Self::StandardOutput);
        }
        let product = output::picture(path)?;
        overwrite.check(path, product)?;
        Ok(Self::File(path.into(), product, overwrite))
    }

    /// Writes a picture; `width_px` is a PNG's.
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

/// Without a name the picture goes to standard output, unless that is a terminal.
pub(super) fn targets(args: &PictureArgs) -> Result<Vec<Target>, Failure> {
    if args.output.is_empty() && io::stdout().is_terminal() {
        return Err(Failure::input(
            "the picture would go to the terminal",
            "name a file with -o scan.svg or -o scan.png, or send standard output somewhere",
        ));
    }
    if args.output.is_empty() { Ok(vec![Target::StandardOutput]) } else { args.targets() }
}

/// The scene named on the command line, else the one that the first of these scans with a scene was
/// predicted in: as the log has it, or, in logs that only name it, the shipped one.
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
             differs): walls and predictions may not fit",
            scene.name
        );
    }
    Ok(Some(scene))
}
