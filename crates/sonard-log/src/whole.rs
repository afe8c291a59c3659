//! A file that is there whole or not at all.

use std::{
    ffi::{OsStr, OsString},
    fs::{File, Permissions},
    io::{self, Write},
    os::{fd::AsRawFd as _, unix::fs::PermissionsExt as _},
    path::{Path, PathBuf},
};

use rustix::{
    fs::{AtFlags, CWD, Mode, OFlags, linkat, open},
    io::Errno,
};
use tempfile::{Builder, NamedTempFile};

use super::sync::{sync_file, sync_folder_of};

/// A new file is readable for whom the umask leaves it.
const MODE: u32 = 0o666;

/// A file that is being made beside the place it will take: dropped before
/// [`take_place`](Self::take_place), it is gone, and what was in that place stays. Where the file system can
/// (`O_TMPFILE`), it has no name until then, so that a killed program leaves nothing behind.
#[derive(Debug)]
pub struct WholeFile {
    draft: Draft,
    path: PathBuf,
}

#[derive(Debug)]
enum Draft {
    Nameless(File),
    Named(NamedTempFile),
}

impl WholeFile {
    /// Begins a file for `path`, readable for whom the umask leaves it.
    ///
    /// # Errors
    /// As the system says, about the folder.
    pub fn create(path: &Path) -> io::Result<Self> {
        let path = PathBuf::from(path);
        if path.file_name().is_none() {
            return Err(io::ErrorKind::IsADirectory.into());
        }
        let draft = match nameless(folder_of(&path))? {
            Some(file) => Draft::Nameless(file),
            None => Draft::Named(names(&hidden(&path)).tempfile_in(folder_of(&path))?),
        };
        Ok(Self { draft, path })
    }

    /// Brings the file to the disk and puts it in its place, over what may be there.
    ///
    /// # Errors
    /// As the system says; what was in its place stays.
    pub fn take_place(self) -> io::Result<()> {
        sync_file(self.as_file())?;
        let Self { draft, path } = self;
        let persisted = match draft {
            Draft::Named(draft) => draft.persist(&path).map(drop).map_err(|error| error.error),
            // A link can't replace a file, but a rename can.
            Draft::Nameless(file) => names(&hidden(&path))
                .make_in(folder_of(&path), |name| link(&file, name))?
                .persist(&path)
                .map_err(|error| error.error),
        };
        persisted?;
        sync_folder_of(&path)
    }

    /// Writes a whole file.
    ///
    /// # Errors
    /// As the system says; what was in its place stays.
    pub fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
        let mut file = Self::create(path)?;
        file.write_all(bytes)?;
        file.take_place()
    }

    /// The draft.
    #[must_use]
    pub fn as_file(&self) -> &File {
        match &self.draft {
            Draft::Nameless(file) => file,
            Draft::Named(draft) => draft.as_file(),
        }
    }
}

impl Write for WholeFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.as_file().write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.as_file().flush()
    }
}

/// A file in a folder without a name; `None` where there are none, or where it could not be given one.
fn nameless(folder: &Path) -> io::Result<Option<File>> {
    if !Path::new(DESCRIPTORS).exists() {
        return Ok(None);
    }
    let flags = OFlags::TMPFILE | OFlags::RDWR | OFlags::CLOEXEC;
    match open(folder, flags, Mode::from_raw_mode(MODE)) {
        Ok(file) => Ok(Some(file.into())),
        // What kernels say that know no such files, on the whole or on this file system.
        Err(Errno::OPNOTSUPP | Errno::ISDIR | Errno::INVAL) => Ok(None),
        Err(error) => Err(error.into()),
    }
}

const DESCRIPTORS: &str = "/proc/self/fd";

fn link(file: &File, name: &Path) -> io::Result<()> {
    let descriptor = format!("{DESCRIPTORS}/{}", file.as_raw_fd());
    Ok(linkat(CWD, descriptor, CWD, name, AtFlags::SYMLINK_FOLLOW)?)
}

/// Makes hidden names beside a file.
fn names(prefix: &OsStr) -> Builder<'_, 'static> {
    let mut names = Builder::new();
    names.prefix(prefix).suffix(".new").permissions(Permissions::from_mode(MODE));
    names
}

/// What they begin with.
fn hidden(path: &Path) -> OsString {
    let mut name = OsString::from(".");
    name.push(path.file_name().unwrap_or_default());
    name
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names_in(folder: &Path) -> Vec<OsString> {
        let entries = folder.read_dir().expect("a folder");
        entries.map(|entry| entry.expect("an entry").file_name()).collect()
    }

    #[test]
    fn a_draft_has_no_name_that_a_killed_program_could_leave() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("scan.jsonl");
        std::fs::write(&path, "before").expect("writes");
        let mut file = WholeFile::create(&path).expect("begins");
        file.write_all(b"after").expect("writes");
        assert_eq!(names_in(folder.path()), ["scan.jsonl"]);
        assert_eq!(std::fs::read(&path).expect("reads"), b"before");
        file.take_place().expect("takes its place");
        assert_eq!(names_in(folder.path()), ["scan.jsonl"]);
        assert_eq!(std::fs::read(&path).expect("reads"), b"after");
    }

    #[test]
    fn a_draft_with_a_name_takes_its_place_as_well() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("scan.jsonl");
        let draft = names(&hidden(&path)).tempfile_in(folder.path()).expect("begins");
        let mut file = WholeFile { draft: Draft::Named(draft), path: path.clone() };
        file.write_all(b"after").expect("writes");
        file.take_place().expect("takes its place");
        assert_eq!(names_in(folder.path()), ["scan.jsonl"]);
        let mode = |path| std::fs::metadata(path).expect("is there").permissions().mode();
        let nameless = WholeFile::create(&folder.path().join("other")).expect("begins");
        let Draft::Nameless(other) = &nameless.draft else { panic!("the system can") };
        let mode_of_other = other.metadata().expect("is there").permissions().mode();
        assert_eq!(mode(&path) & 0o777, mode_of_other & 0o777, "readable for the same");
    }
}
