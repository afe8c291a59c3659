//! File operations of Linux and macOS.

use std::{
    fs::{self, File, FileType, Metadata, OpenOptions, Permissions},
    io,
    os::{
        fd::{AsFd as _, AsRawFd as _, BorrowedFd},
        unix::fs::{
            FileExt as _, FileTypeExt as _, MetadataExt as _, OpenOptionsExt as _,
            PermissionsExt as _,
        },
    },
    path::Path,
};

use rustix::{
    fs::{OFlags, statvfs},
    io::Errno,
};

use super::FileId;

/// Folder of the open files of this process, by descriptor. Linux.
const DESCRIPTORS: &str = "/proc/self/fd";

fn id(metadata: &Metadata) -> FileId {
    FileId { device: metadata.dev(), index: metadata.ino() }
}

pub(super) fn id_of_file(file: &File) -> io::Result<FileId> {
    Ok(id(&file.metadata()?))
}

pub(super) fn id_of_path(path: &Path) -> io::Result<FileId> {
    Ok(id(&fs::metadata(path)?))
}

pub(super) fn id_of_entry(path: &Path) -> io::Result<FileId> {
    Ok(id(&fs::symlink_metadata(path)?))
}

/// Number of names of an open file; zero once it is deleted.
pub(crate) fn link_count(file: &File) -> io::Result<u64> {
    Ok(file.metadata()?.nlink())
}

/// Reads bytes at an offset, without moving the position of the file.
///
/// # Errors
/// Returns the error of the system, or `UnexpectedEof` for a shorter file.
pub fn read_exact_at(file: &File, bytes: &mut [u8], offset: u64) -> io::Result<()> {
    file.read_exact_at(bytes, offset)
}

/// Makes opening fail for symbolic links.
pub(crate) fn reject_links(options: &mut OpenOptions) -> &mut OpenOptions {
    options.custom_flags(OFlags::NOFOLLOW.bits().cast_signed())
}

/// Opens a folder, to lock or to sync it.
pub(crate) fn open_folder(path: &Path) -> io::Result<File> {
    File::open(path)
}

/// Sets the mode of a new file or folder, which the umask reduces.
pub(crate) fn with_mode<'a, 'b, 'c>(
    builder: &'c mut tempfile::Builder<'a, 'b>,
    mode: u32,
) -> &'c mut tempfile::Builder<'a, 'b> {
    builder.permissions(Permissions::from_mode(mode))
}

/// Creates an unnamed file in a folder; `None` if the system does not support such files or their
/// later naming.
#[cfg(target_os = "linux")]
pub(crate) fn create_unnamed(folder: &Path, mode: u32) -> io::Result<Option<File>> {
    use rustix::fs::{Mode, open};
    if !Path::new(DESCRIPTORS).exists() {
        return Ok(None);
    }
    let flags = OFlags::TMPFILE | OFlags::RDWR | OFlags::CLOEXEC;
    match open(folder, flags, Mode::from_raw_mode(mode)) {
        Ok(file) => Ok(Some(file.into())),
        // Errors of kernels and file systems without O_TMPFILE.
        Err(Errno::OPNOTSUPP | Errno::ISDIR | Errno::INVAL) => Ok(None),
        Err(error) => Err(error.into()),
    }
}

/// Returns `None`: the system has no unnamed files.
#[cfg(not(target_os = "linux"))]
pub(crate) fn create_unnamed(_folder: &Path, _mode: u32) -> io::Result<Option<File>> {
    Ok(None)
}

/// Links an unnamed file under a name, which must not exist.
pub(crate) fn name_file(file: &File, name: &Path) -> io::Result<()> {
    use rustix::fs::{AtFlags, CWD, linkat};
    let descriptor = format!("{DESCRIPTORS}/{}", file.as_raw_fd());
    Ok(linkat(CWD, descriptor, CWD, name, AtFlags::SYMLINK_FOLLOW)?)
}

/// Returns `true` if the file was removed but its file system keeps it under a hidden name until it
/// is closed: NFS and FUSE.
pub(crate) fn is_removed_when_closed(file: &File) -> bool {
    let path = fs::read_link(format!("{DESCRIPTORS}/{}", file.as_raw_fd())).unwrap_or_default();
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    name.starts_with(".nfs") || name.starts_with(".fuse_hidden")
}

/// Returns `true` if the file system of a path has a free inode, or does not report inodes.
pub(crate) fn has_free_inodes(path: &Path) -> io::Result<bool> {
    let stat = statvfs(path)?;
    // File systems without a fixed number of inodes report zero.
    Ok(stat.f_files == 0 || stat.f_favail > 0)
}

/// Returns `true` if the process or the system has no free file descriptors.
pub(crate) fn is_out_of_descriptors(error: &io::Error) -> bool {
    is_one_of(error, &[Errno::MFILE, Errno::NFILE])
}

/// Returns `true` if fsync(2) or flock(2) failed because the file system lacks the operation.
pub(crate) fn is_unsupported(error: &io::Error) -> bool {
    use Errno as E;
    is_one_of(error, &[E::INVAL, E::NOLCK, E::NOSYS, E::OPNOTSUPP, E::NOTSUP, E::NOTTY])
}

fn is_one_of(error: &io::Error, numbers: &[Errno]) -> bool {
    let number = error.raw_os_error();
    numbers.iter().any(|known| number == Some(known.raw_os_error()))
}

/// Returns `true` for a terminal or pipe, which can be written but not replaced.
#[must_use]
pub fn is_stream(kind: FileType) -> bool {
    kind.is_char_device() || kind.is_fifo()
}

/// Standard input as a file; `None` if it is closed.
#[must_use]
pub fn standard_input() -> Option<File> {
    duplicate(io::stdin().as_fd())
}

/// Standard output as a file; `None` if it is closed.
#[must_use]
pub fn standard_output() -> Option<File> {
    duplicate(io::stdout().as_fd())
}

fn duplicate(stream: BorrowedFd<'_>) -> Option<File> {
    stream.try_clone_to_owned().ok().map(File::from)
}
