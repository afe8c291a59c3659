//! Output files, written atomically and never over an input.

use std::{
    fs, io,
    io::Write as _,
    os::unix::fs::{MetadataExt as _, PermissionsExt as _},
    path::{Path, PathBuf},
    sync::{Mutex, PoisonError},
};

use sonard_interpret::interpret::{
    grid::{Grid, MapYaml, to_pgm},
    lines::MapLine,
};
use sonard_plot::{MAX_WIDTH_PX, Picture};

use super::{Failure, Outcome};

/// Device and inode of each file that this process reads.
static INPUTS: Mutex<Vec<(u64, u64)>> = Mutex::new(Vec::new());

/// Protects an input file from replacement by an output, under any of its names.
pub(crate) fn note_input(path: &Path) {
    if let Ok(file) = fs::metadata(path) {
        INPUTS.lock().unwrap_or_else(PoisonError::into_inner).push((file.dev(), file.ino()));
    }
}

/// Permission to replace files.
#[derive(Debug, Clone, Copy, Default, clap::Args)]
pub(crate) struct Overwrite {
    /// Replace existing output files. Inputs are never replaced
    #[arg(long)]
    force: bool,
}

impl Overwrite {
    /// Checks an output path before the experiment runs.
    pub(crate) fn check(self, path: &Path) -> Outcome {
        let Ok(existing) = fs::metadata(path) else { return Ok(()) };
        let inputs = INPUTS.lock().unwrap_or_else(PoisonError::into_inner);
        if inputs.contains(&(existing.dev(), existing.ino())) {
            return Err(Failure::input(
                format!("{} is an input of this command", path.display()),
                "give another output",
            ));
        }
        if !existing.is_file() {
            return Err(Failure::input(
                format!("{} is not a regular file", path.display()),
                "give another output",
            ));
        }
        if !self.force {
            return Err(Failure::input(
                format!("{} exists", path.display()),
                "give another output, or --force to replace it",
            ));
        }
        Ok(())
    }

    /// Writes a file atomically.
    pub(crate) fn save(self, path: &Path, bytes: &[u8]) -> Outcome {
        self.check(path)?;
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        let written = || -> io::Result<()> {
            let permissions = fs::Permissions::from_mode(0o666);
            let mut builder = tempfile::Builder::new();
            let mut draft =
                builder.permissions(permissions).tempfile_in(folder.unwrap_or(Path::new(".")))?;
            draft.write_all(bytes)?;
            draft.as_file().sync_all()?;
            draft.persist(path)?;
            Ok(())
        };
        written().map_err(|error| Failure::write(&path.display(), &error))
    }
}

/// Creates a folder and its parents.
pub(crate) fn make_folder(folder: &Path) -> Outcome {
    fs::create_dir_all(folder)
        .map_err(|error| Failure::write(&format!("the folder {}", folder.display()), &error))
}

/// Writes `map.pgm` and `map.yaml`, the pair that ROS's map_server reads.
pub(crate) fn write_map(folder: &Path, grid: &Grid, overwrite: Overwrite) -> Outcome {
    make_folder(folder)?;
    overwrite.save(&folder.join("map.pgm"), &to_pgm(grid))?;
    let yaml = MapYaml::new(grid.shape(), "map.pgm").to_text();
    overwrite.save(&folder.join("map.yaml"), yaml.as_bytes())
}

/// JSON record of a map line in the format of `sonard lines --json`.
pub(crate) fn line_record(line: &MapLine) -> serde_json::Value {
    let [a, b] = line.ends;
    serde_json::json!({
        "kind": line.kind, "from_m": a.to_array(), "to_m": b.to_array(),
        "length_m": line.length_m(), "confidence": line.confidence, "terminal": line.terminal,
    })
}

/// Options for picture files.
#[derive(Debug, clap::Args)]
pub(crate) struct PictureArgs {
    /// Picture to write, .svg or .png (repeatable)
    #[arg(short, long, value_name = "FILE")]
    output: Vec<PathBuf>,
    /// Width of a PNG, pixels
    #[arg(long, value_name = "PX", default_value_t = 1000,
          value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_WIDTH_PX)))]
    width: u32,
    #[command(flatten)]
    overwrite: Overwrite,
}

impl PictureArgs {
    /// Checks names and places before the experiment runs.
    pub(crate) fn check(&self) -> Outcome {
        for path in &self.output {
            if !is_svg(path) && !has_extension(path, "png") {
                return Err(Failure::input(
                    format!("{}: unknown picture format", path.display()),
                    "use the extension .svg or .png",
                ));
            }
            self.overwrite.check(path)?;
        }
        Ok(())
    }

    /// Writes a picture to every file.
    pub(crate) fn write(&self, picture: &Picture) -> Outcome {
        self.output.iter().try_for_each(|path| {
            let bytes = match is_svg(path) {
                true => picture.to_svg().into_bytes(),
                false => picture.to_png(self.width).map_err(|error| {
                    Failure::input(format!("{}: {error}", path.display()), "choose another --width")
                })?,
            };
            self.overwrite.save(path, &bytes)
        })
    }
}

fn is_svg(path: &Path) -> bool {
    has_extension(path, "svg")
}

fn has_extension(path: &Path, expected: &str) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case(expected))
}
