//! Folders and files that verbs write.

use std::{fs, path::Path};

use super::{Failure, Outcome};

/// Makes a folder for what is to be written, if there is none.
pub(super) fn make_folder(folder: &Path) -> Outcome {
    fs::create_dir_all(folder).map_err(|error| {
        Failure::input(
            format!("cannot make the folder {}: {error}", folder.display()),
            "give a folder that you may write to",
        )
    })
}

/// Writes a whole file.
pub(super) fn save(path: &Path, bytes: &[u8]) -> Outcome {
    fs::write(path, bytes).map_err(|error| {
        Failure::device(
            format!("cannot write {}: {error}", path.display()),
            "check that its folder exists, may be written to and has room",
        )
    })
}
