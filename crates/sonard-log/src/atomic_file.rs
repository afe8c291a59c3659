//! Atomic creation and replacement of files.

use std::{
    ffi::{OsStr, OsString},
    fs::File,
    io::{self, Write},
    path::{Path, PathBuf},
};

use tempfile::{Builder, NamedTempFile};

use super::{
    platform::{create_unnamed, name_file, with_mode},
    sync::{sync_file, sync_folder_of},
};

/// Mode of a new file, reduced by the umask.
const MODE: u32 = 0o666;

/// File that replaces another one atomically.
///
/// A draft dropped before [`commit`](Self::commit) is removed, and the existing file stays.
/// Where the file system supports `O_TMPFILE`, the draft has no name, so a killed program
/// leaves no file behind.
#[derive(Debug)]
pub struct AtomicFile {
    draft: Draft,
    path: PathBuf,
}

#[derive(Debug)]
enum Draft {
    Unnamed(File),
    Named(NamedTempFile),
}

impl AtomicFile {
    /// Creates a draft for `path` in the same folder, with permissions set by the umask.
    ///
    /// # Errors
    /// Returns an error if the folder is not writable.
    pub fn create(path: &Path) -> io::Result<Self> {
        let path = PathBuf::from(path);
        if path.file_name().is_none() {
            return Err(io::ErrorKind::IsADirectory.into());
        }
        let draft = match create_unnamed(folder_of(&path), MODE)? {
            Some(file) => Draft::Unnamed(file),
            None => Draft::Named(hidden_names(&prefix(&path)).tempfile_in(folder_of(&path))?),
        };
        Ok(Self { draft, path })
    }

    /// Syncs the file and moves it to its path, replacing an existing file.
    ///
    /// # Errors
    /// Returns the error of the system; the existing file is then kept.
    pub fn commit(self) -> io::Result<()> {
        sync_file(self.as_file())?;
        let Self { draft, path } = self;
        let persisted = match draft {
            Draft::Named(draft) => draft.persist(&path).map(drop).map_err(|error| error.error),
            // linkat(2) cannot replace a file, rename(2) can.
            Draft::Unnamed(file) => hidden_names(&prefix(&path))
                .make_in(folder_of(&path), |name| name_file(&file, name))?
                .persist(&path)
                .map_err(|error| error.error),
        };
        persisted?;
        sync_folder_of(&path)
    }

    /// Writes a file atomically.
    ///
    /// # Errors
    /// Returns the error of the system; the existing file is then kept.
    pub fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
        let mut file = Self::create(path)?;
        file.write_all(bytes)?;
        file.commit()
    }

    /// Open file of the draft.
    #[must_use]
    pub fn as_file(&self) -> &File {
        match &self.draft {
            Draft::Unnamed(file) => file,
            Draft::Named(draft) => draft.as_file(),
        }
    }
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.as_file().write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.as_file().flush()
    }
}

/// Builder of hidden temporary file names.
fn hidden_names(prefix: &OsStr) -> Builder<'_, 'static> {
    let mut builder = Builder::new();
    with_mode(builder.prefix(prefix).suffix(".new"), MODE);
    builder
}

/// Prefix of the hidden names for a file.
fn prefix(path: &Path) -> OsString {
    let mut name = OsString::from(".");
    name.push(path.file_name().unwrap_or_default());
    name
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt as _;

    use super::*;

    fn names_in(folder: &Path) -> Vec<OsString> {
        let entries = folder.read_dir().expect("a folder");
        entries.map(|entry| entry.expect("an entry").file_name()).collect()
    }

    #[test]
    fn unnamed_draft() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("scan.jsonl");
        std::fs::write(&path, "before").expect("writes");
        let mut file = AtomicFile::create(&path).expect("created");
        file.write_all(b"after").expect("writes");
        assert_eq!(names_in(folder.path()), ["scan.jsonl"]);
        assert_eq!(std::fs::read(&path).expect("reads"), b"before");
        file.commit().expect("replaced");
        assert_eq!(names_in(folder.path()), ["scan.jsonl"]);
        assert_eq!(std::fs::read(&path).expect("reads"), b"after");
    }

    #[test]
    fn named_draft() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("scan.jsonl");
        let draft = hidden_names(&prefix(&path)).tempfile_in(folder.path()).expect("created");
        let mut file = AtomicFile { draft: Draft::Named(draft), path: path.clone() };
        file.write_all(b"after").expect("writes");
        file.commit().expect("replaced");
        assert_eq!(names_in(folder.path()), ["scan.jsonl"]);
        let mode = |path| std::fs::metadata(path).expect("exists").permissions().mode();
        let unnamed = AtomicFile::create(&folder.path().join("other")).expect("created");
        let Draft::Unnamed(other) = &unnamed.draft else { panic!("O_TMPFILE is supported") };
        let mode_of_other = other.metadata().expect("exists").permissions().mode();
        assert_eq!(mode(&path) & 0o777, mode_of_other & 0o777, "same permissions");
    }
}
