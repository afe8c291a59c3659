//! File operations of Windows.

use std::{
    fs::{File, FileType, OpenOptions},
    io,
    os::windows::{
        fs::{FileExt as _, OpenOptionsExt as _},
        io::{AsHandle as _, BorrowedHandle},
    },
    path::Path,
};

use winapi_util::{AsHandleRef, file::information};

use super::FileId;

/// Opens a symbolic link itself: `FILE_FLAG_OPEN_REPARSE_POINT` of CreateFileW.
const OPEN_LINK: u32 = 0x0020_0000;
/// Permits opening folders: `FILE_FLAG_BACKUP_SEMANTICS` of CreateFileW.
const OPEN_FOLDER: u32 = 0x0200_0000;
/// Errors of operations that a file system lacks: `ERROR_INVALID_FUNCTION`, `ERROR_NOT_SUPPORTED`,
/// `ERROR_CALL_NOT_IMPLEMENTED`.
const LACKING: [i32; 3] = [1, 50, 120];
/// `ERROR_TOO_MANY_OPEN_FILES`.
const TOO_MANY_OPEN_FILES: i32 = 4;

fn id(file: impl AsHandleRef) -> io::Result<FileId> {
    let found = information(file)?;
    Ok(FileId { device: found.volume_serial_number(), index: found.file_index() })
}

pub(super) fn id_of_file(file: &File) -> io::Result<FileId> {
    id(file)
}

pub(super) fn id_of_path(path: &Path) -> io::Result<FileId> {
    id(&open_folder(path)?)
}

pub(super) fn id_of_entry(path: &Path) -> io::Result<FileId> {
    id(&OpenOptions::new().read(true).custom_flags(OPEN_FOLDER | OPEN_LINK).open(path)?)
}

/// Number of names of an open file; zero once it is deleted.
pub(crate) fn link_count(file: &File) -> io::Result<u64> {
    Ok(information(file)?.number_of_links())
}

/// Reads bytes at an offset. The position of the file moves.
///
/// # Errors
/// Returns the error of the system, or `UnexpectedEof` for a shorter file.
pub fn read_exact_at(file: &File, mut bytes: &mut [u8], mut offset: u64) -> io::Result<()> {
    while !bytes.is_empty() {
        match file.seek_read(bytes, offset) {
            Ok(0) => return Err(io::ErrorKind::UnexpectedEof.into()),
            Ok(read) => {
                bytes = bytes.get_mut(read..).unwrap_or_default();
                offset += read as u64;
            }
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

/// Makes opening return symbolic links themselves, which have no contents.
pub(crate) fn reject_links(options: &mut OpenOptions) -> &mut OpenOptions {
    options.custom_flags(OPEN_LINK)
}

/// Opens a folder, to lock or to sync it.
pub(crate) fn open_folder(path: &Path) -> io::Result<File> {
    OpenOptions::new().read(true).custom_flags(OPEN_FOLDER).open(path)
}

/// Returns the builder unchanged: new files inherit the access of their folder.
pub(crate) fn with_mode<'a, 'b, 'c>(
    builder: &'c mut tempfile::Builder<'a, 'b>,
    _mode: u32,
) -> &'c mut tempfile::Builder<'a, 'b> {
    builder
}

/// Returns `None`: the system has no unnamed files.
pub(crate) fn create_unnamed(_folder: &Path, _mode: u32) -> io::Result<Option<File>> {
    Ok(None)
}

/// Fails: the system has no unnamed files.
pub(crate) fn name_file(_file: &File, _name: &Path) -> io::Result<()> {
    Err(io::ErrorKind::Unsupported.into())
}

/// Returns `false`: deleted files have no hidden names.
pub(crate) fn is_removed_when_closed(_file: &File) -> bool {
    false
}

/// Returns `true`: file systems have no fixed number of files.
pub(crate) fn has_free_inodes(_path: &Path) -> io::Result<bool> {
    Ok(true)
}

/// Returns `true` if the process has no free file handles.
pub(crate) fn is_out_of_descriptors(error: &io::Error) -> bool {
    error.raw_os_error() == Some(TOO_MANY_OPEN_FILES)
}

/// Returns `true` if an operation failed because the file system lacks it.
pub(crate) fn is_unsupported(error: &io::Error) -> bool {
    error.raw_os_error().is_some_and(|number| LACKING.contains(&number))
}

/// Returns `false`: paths name no terminals or pipes that outputs could be written to.
#[must_use]
pub fn is_stream(_kind: FileType) -> bool {
    false
}

/// Standard input as a file; `None` if it is closed.
#[must_use]
pub fn standard_input() -> Option<File> {
    duplicate(io::stdin().as_handle())
}

/// Standard output as a file; `None` if it is closed.
#[must_use]
pub fn standard_output() -> Option<File> {
    duplicate(io::stdout().as_handle())
}

fn duplicate(stream: BorrowedHandle<'_>) -> Option<File> {
    stream.try_clone_to_owned().ok().map(File::from)
}
