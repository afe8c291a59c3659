//! A file that is there whole or not at all.

use std::{
    ffi::OsString,
    fs::{File, Permissions},
    io::{self, Write},
    os::unix::fs::PermissionsExt as _,
    path::{Path, PathBuf},
};

use tempfile::{Builder, NamedTempFile};

use super::open::sync_folder_of;

/// A file that is being made beside the place it will take: dropped before
/// [`take_place`](Self::take_place), it is gone, and what was in that place stays.
#[derive(Debug)]
pub struct WholeFile {
    draft: NamedTempFile,
    path: PathBuf,
}

impl WholeFile {
    /// Begins a file for `path`, readable for whom the umask leaves it.
    ///
    /// # Errors
    /// As the system says, about the folder.
    pub fn create(path: &Path) -> io::Result<Self> {
        let mut name = OsString::from(".");
        name.push(path.file_name().ok_or(io::ErrorKind::IsADirectory)?);
        let draft = Builder::new()
            .prefix(&name)
            .suffix(".new")
            .permissions(Permissions::from_mode(0o666))
            .tempfile_in(folder_of(path))?;
        Ok(Self { draft, path: path.into() })
    }

    /// Brings the file to the disk and puts it in its place, over what may be there.
    ///
    /// # Errors
    /// As the system says; what was in its place stays.
    pub fn take_place(self) -> io::Result<()> {
        self.draft.as_file().sync_all()?;
        self.draft.persist(&self.path).map_err(|error| error.error)?;
        sync_folder_of(&self.path)
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
        self.draft.as_file()
    }
}

impl Write for WholeFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.draft.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.draft.flush()
    }
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}
