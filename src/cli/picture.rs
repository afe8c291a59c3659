//! Pictures that verbs write, and the scene and damage that they tell of.

use std::{
    fs,
    io::{self, IsTerminal, Write as _},
    path::{Path, PathBuf},
};

use super::{Failure, Outcome, scene_file};
use crate::{
    plot::{MAX_WIDTH_PX, Picture},
    scan::ScanView,
    scene::{Scene, shipped},
    store::LineError,
};

/// Which pictures.
#[derive(Debug, clap::Args)]
pub(super) struct PictureArgs {
    /// Picture to write, .svg or .png, or - for SVG to standard output; several are possible
    #[arg(short = 'o', long = "out", value_name = "FILE")]
    pub(super) out: Vec<PathBuf>,
    /// Width of a PNG, pixels
    #[arg(long, value_name = "PX", default_value_t = 1000,
          value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_WIDTH_PX)))]
    pub(super) width: u32,
}

impl PictureArgs {
    /// Checked before anything is read, so that a wrong name costs no time.
    pub(super) fn targets(&self) -> Result<Vec<Target>, Failure> {
        self.out.iter().map(|path| target(path)).collect()
    }
}

/// Where a picture goes, and in which format.
pub(super) enum Target {
    StandardOutput,
    Svg(PathBuf),
    Png(PathBuf),
}

impl Target {
    /// Writes a picture; `width_px` is a PNG's.
    pub(super) fn write(&self, picture: &Picture, width_px: u32) -> Outcome {
        let (path, bytes) = match self {
            Self::StandardOutput => {
                return io::stdout()
                    .lock()
                    .write_all(picture.to_svg().as_bytes())
                    .or_else(|error| Failure::from_write("standard output", &error));
            }
            Self::Svg(path) => (path, picture.to_svg().into_bytes()),
            Self::Png(path) => {
                let png = picture.to_png(width_px).map_err(|error| {
                    Failure::input(format!("{}: {error}", path.display()), "choose another --width")
                })?;
                (path, png)
            }
        };
        fs::write(path, bytes).map_err(|error| {
            Failure::device(
                format!("cannot write {}: {error}", path.display()),
                "check that its folder exists, may be written to and has room",
            )
        })
    }
}

/// Without a name the picture goes to standard output, unless that is a terminal.
pub(super) fn targets(args: &PictureArgs) -> Result<Vec<Target>, Failure> {
    if args.out.is_empty() && io::stdout().is_terminal() {
        return Err(Failure::input(
            "the picture would go to the terminal",
            "name a file with -o scan.svg or -o scan.png, or send standard output somewhere",
        ));
    }
    if args.out.is_empty() { Ok(vec![Target::StandardOutput]) } else { args.targets() }
}

fn target(path: &Path) -> Result<Target, Failure> {
    let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
    match extension.as_deref() {
        Some("svg") => Ok(Target::Svg(path.into())),
        Some("png") => Ok(Target::Png(path.into())),
        None if path == Path::new("-") => Ok(Target::StandardOutput),
        _ => Err(Failure::input(
            format!("{}: the format of a picture follows from its ending", path.display()),
            "let the name end in .svg or .png",
        )),
    }
}

/// Names the lines of a log that could not be read.
pub(super) fn warn_of_damage(log: &Path, damaged: &[LineError]) {
    const SHOWN: usize = 5;
    for error in damaged.iter().take(SHOWN) {
        anstream::eprintln!("warning: {}: {error}; the line is left out", log.display());
    }
    if damaged.len() > SHOWN {
        let more = damaged.len() - SHOWN;
        anstream::eprintln!("warning: {more} more damaged lines; see `sonard log verify`");
    }
}

/// The scene named on the command line, else the shipped scene that the log names.
pub(super) fn scene_for(views: &[ScanView], given: Option<&str>) -> Result<Option<Scene>, Failure> {
    let logged = views.iter().find_map(|view| view.session.as_ref()?.scene.as_ref());
    let scene = match (given, logged) {
        (Some(given), _) => scene_file::load(given)?,
        (None, Some(logged)) if shipped::text(&logged.name).is_some() => {
            scene_file::shipped(&logged.name)?
        }
        (None, Some(logged)) => {
            anstream::eprintln!(
                "note: the log's scene `{}` does not come with sonard: drawn without walls; give \
                 its file with --scene",
                logged.name
            );
            return Ok(None);
        }
        (None, None) => return Ok(None),
    };
    if logged.is_some_and(|logged| logged.sha256 != scene.sha256) {
        anstream::eprintln!(
            "warning: the scene `{}` is not the one that the log's model used (its SHA-256 \
             differs): walls and predictions may not fit",
            scene.name
        );
    }
    Ok(Some(scene))
}
