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
/// A file that is there is replaced rather than written to: cargo links its programs to those in
/// `deps`. A file copied to itself is kept.
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
    if to.is_file() {
        if from.canonicalize()? == to.canonicalize()? {
            return Ok(());
        }
        fs::remove_file(to)?;
    }
    fs::copy(from, to).map_err(|error| format!("{}: {error}", from.display()))?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn copies_replace_files_and_keep_their_source() {
        let folder = tempfile::tempdir().expect("a folder");
        let [from, linked, to] = ["from", "linked", "to"].map(|name| folder.path().join(name));
        let read = |path: &Path| fs::read_to_string(path).expect("a file");
        fs::write(&from, "program").expect("written");
        copy(&from, &from).expect("a copy");
        assert_eq!(read(&from), "program");
        fs::write(&linked, "built before").expect("written");
        fs::hard_link(&linked, &to).expect("a link");
        copy(&from, &to).expect("a copy");
        assert_eq!([read(&to), read(&linked)], ["program", "built before"]);
        fs::remove_file(&to).expect("removed");
        fs::hard_link(&from, &to).expect("a link");
        copy(&from, &to).expect("a copy");
        assert_eq!([read(&from), read(&to)], ["program", "program"]);
    }
}
