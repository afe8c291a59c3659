//! Files that pictures are written to: shared by the verbs that draw.

use std::{
    fs,
    io::{self, Write as _},
    path::{Path, PathBuf},
};

use super::{Failure, Outcome};
use crate::plot::{MAX_WIDTH_PX, Picture};

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
