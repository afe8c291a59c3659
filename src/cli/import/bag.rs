//! Files of rosbag2 recordings and their storage format.

use std::{
    fs::{self, File},
    io::{self, Read},
    path::{Path, PathBuf},
};

use super::super::{Failure, output::register_input, progress};
use crate::import;

/// Magic bytes of SQLite databases.
const SQLITE: &[u8] = b"SQLite format 3\0";

/// Lists the recordings in a folder, in the order in which they were written.
pub(super) fn files(folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let failure =
        |what: String, help: &str| Failure::input(format!("{}: {what}", folder.display()), help);
    let entries = fs::read_dir(folder)
        .and_then(|entries| entries.map(|entry| Ok(entry?.path())).collect::<Result<Vec<_>, _>>())
        .map_err(|error| {
            failure(format!("cannot be read: {error}"), "give the folder of a recording")
        })?;
    let ending_in = |ending: &str| -> Vec<PathBuf> {
        let is_one = |path: &&PathBuf| path.extension().is_some_and(|end| end == ending);
        entries.iter().filter(is_one).cloned().collect()
    };
    let found = ["mcap", "db3"].map(ending_in).into_iter().find(|files| !files.is_empty());
    let Some(mut files) = found else {
        let is_packed = !ending_in("zstd").is_empty();
        return Err(if is_packed {
            failure(
                "the recording is compressed".to_owned(),
                "decompress it: `zstd -d FOLDER/*.zstd`",
            )
        } else {
            failure(
                "it contains no recording (.mcap or .db3)".to_owned(),
                "give the folder of a rosbag2 recording",
            )
        });
    };
    files.sort_by_key(|path| (number(path), path.clone()));
    files.iter().for_each(|path| register_input(path));
    Ok(files)
}

/// Number of a file of a recording: `NAME_0.mcap` to `NAME_10.mcap`.
fn number(path: &Path) -> u64 {
    let name = path.file_stem().and_then(|name| name.to_str()).unwrap_or_default();
    name.rsplit('_').next().and_then(|number| number.parse().ok()).unwrap_or(0)
}

/// Rejects databases if this program can't read them.
pub(super) fn check(files: &[PathBuf]) -> Result<(), Failure> {
    match files.iter().find(|path| is_database(path)) {
        Some(path) if !cfg!(feature = "sqlite") => Err(Failure::input(
            format!(
                "{}: SQLite database, but this program was built without the feature sqlite",
                path.display()
            ),
            "build it with `cargo build --release --features sqlite`, or write the recording as MCAP: `ros2 bag \
             convert`, or `rosbags-convert --src BAG --dst NEW --dst-storage mcap` without ROS",
        )),
        _ => Ok(()),
    }
}

fn is_database(path: &Path) -> bool {
    let mut head = [0; SQLITE.len()];
    // A pipe can be read only once, so its beginning must not be examined.
    fs::metadata(path).is_ok_and(|file| file.is_file())
        && File::open(path).and_then(|mut file| file.read_exact(&mut head)).is_ok()
        && head == SQLITE
}

/// Concatenates the bytes of files; databases are converted to MCAP.
pub(super) fn concatenate(files: &[PathBuf]) -> io::Result<Box<dyn Read>> {
    let mut all: Box<dyn Read> = Box::new(io::empty());
    for file in files {
        let next: Box<dyn Read> = match is_database(file) {
            true => database(file)?,
            false => Box::new(progress::reading(file, io::BufReader::new(File::open(file)?))),
        };
        all = Box::new(all.chain(next));
    }
    Ok(all)
}

#[cfg(feature = "sqlite")]
fn database(file: &Path) -> io::Result<Box<dyn Read>> {
    Ok(Box::new(super::database::Database::open(file, &import::MESSAGE_TYPES)?))
}

#[cfg(not(feature = "sqlite"))]
fn database(_file: &Path) -> io::Result<Box<dyn Read>> {
    Err(io::ErrorKind::Unsupported.into())
}

/// SHA-256 of databases as stored on disk; `None` for other files, which are hashed while they are
/// read.
pub(super) fn digest_of_databases(files: &[PathBuf]) -> io::Result<Option<String>> {
    if !files.iter().any(|path| is_database(path)) {
        return Ok(None);
    }
    let mut all: Box<dyn Read> = Box::new(io::empty());
    for file in files {
        all = Box::new(all.chain(File::open(file)?));
    }
    import::sha256_hex(all).map(Some)
}
