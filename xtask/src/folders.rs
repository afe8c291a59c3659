//! Folders of the repository, and copies of what they contain.

use std::{
    env, fs,
    path::{Path, PathBuf},
};

use crate::Failure;

/// Root of the repository.
///
/// # Errors
/// None in a checkout: this package is a folder of it.
pub(crate) fn root() -> Result<&'static Path, Failure> {
    Ok(Path::new(env!("CARGO_MANIFEST_DIR")).parent().ok_or("no workspace")?)
}

/// Folder of cargo's output.
///
/// # Errors
/// As [`root`].
pub(crate) fn target() -> Result<PathBuf, Failure> {
    let folder = env::var_os("CARGO_TARGET_DIR").map(PathBuf::from);
    Ok(folder.unwrap_or(root()?.join("target")))
}

/// Copies a file, or the files of a folder, into folders that are made.
///
/// # Errors
/// A file that can't be read or written.
pub(crate) fn copy(from: &Path, to: &Path) -> Result<(), Failure> {
    if from.is_dir() {
        for entry in fs::read_dir(from)? {
            let entry = entry?;
            copy(&entry.path(), &to.join(entry.file_name()))?;
        }
        return Ok(());
    }
    fs::create_dir_all(to.parent().ok_or("no folder")?)?;
    fs::copy(from, to).map_err(|error| format!("{}: {error}", from.display()))?;
    Ok(())
}
