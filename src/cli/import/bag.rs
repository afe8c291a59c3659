//! Folders of rosbag2: the recordings in them.

use std::{
    fs,
    path::{Path, PathBuf},
};

use super::super::{Failure, output::note_input};

/// The recordings of a folder, in the order in which they were written.
pub(super) fn files(folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let refuse =
        |what: String, help: &str| Failure::input(format!("{}: {what}", folder.display()), help);
    let entries = fs::read_dir(folder)
        .and_then(|entries| entries.map(|entry| Ok(entry?.path())).collect::<Result<Vec<_>, _>>())
        .map_err(|error| {
            refuse(format!("cannot be read: {error}"), "give the folder of a recording")
        })?;
    let ends = |path: &&PathBuf, ending: &str| path.extension().is_some_and(|end| end == ending);
    let mut files: Vec<PathBuf> =
        entries.iter().filter(|path| ends(path, "mcap")).cloned().collect();
    if files.is_empty() {
        return Err(match entries.iter().any(|path| ends(&path, "db3")) {
            true => refuse(
                "its recording is an SQLite database".to_owned(),
                "write it as MCAP: `ros2 bag convert`, or `rosbags-convert --src BAG --dst NEW --dst-storage \
                 mcap` without ROS",
            ),
            false => {
                refuse("there is no recording (.mcap) in it".to_owned(), "give a folder of rosbag2")
            }
        });
    }
    files.sort_by_key(|path| (number(path), path.clone()));
    files.iter().for_each(|path| note_input(path));
    Ok(files)
}

/// rosbag2 numbers the files of a recording: `NAME_0.mcap` to `NAME_10.mcap`.
fn number(path: &Path) -> u64 {
    let name = path.file_stem().and_then(|name| name.to_str()).unwrap_or_default();
    name.rsplit('_').next().and_then(|number| number.parse().ok()).unwrap_or(0)
}
