//! Folders of the repository.

use std::{
    env,
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
