//! File operations that differ between operating systems: identity, links, positions, attributes.
//!
//! `unix` covers Linux and macOS, `windows` Windows. Both have the same functions, so no other
//! module of this crate depends on the system.

#[cfg_attr(unix, path = "platform/unix.rs")]
#[cfg_attr(windows, path = "platform/windows.rs")]
mod system;

use std::{fs::File, io, path::Path};

pub(crate) use system::{
    create_unnamed, has_free_inodes, is_out_of_descriptors, is_removed_when_closed, is_unsupported,
    link_count, name_file, open_folder, reject_links, with_mode,
};
pub use system::{is_stream, read_exact_at, standard_input, standard_output};

/// Identity of a file on this computer, independent of its names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FileId {
    device: u64,
    index: u64,
}

impl FileId {
    /// Identity of an open file.
    ///
    /// # Errors
    /// Returns the error of the system.
    pub fn of_file(file: &File) -> io::Result<Self> {
        system::id_of_file(file)
    }

    /// Identity of the file that a path names, at the end of symbolic links.
    ///
    /// # Errors
    /// Returns the error of the system, for example for a missing file.
    pub fn of_path(path: &Path) -> io::Result<Self> {
        system::id_of_path(path)
    }

    /// Identity of the entry that a path names: of a symbolic link itself.
    ///
    /// # Errors
    /// Returns the error of the system, for example for a missing entry.
    pub fn of_entry(path: &Path) -> io::Result<Self> {
        system::id_of_entry(path)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::{fs, io::Write as _};

    #[test]
    fn identity_outlives_the_name() {
        let folder = tempfile::tempdir().expect("a folder");
        let [path, other, moved] = ["a", "b", "c"].map(|name| folder.path().join(name));
        let file = File::create(&path).expect("created");
        File::create(&other).expect("created");
        let id = FileId::of_file(&file).expect("open");
        assert_eq!(FileId::of_path(&path).expect("there"), id);
        assert_eq!(FileId::of_entry(&path).expect("there"), id);
        assert_ne!(FileId::of_path(&other).expect("there"), id);
        fs::rename(&path, &moved).expect("renamed");
        assert_eq!(FileId::of_path(&moved).expect("there"), id);
        let missing = FileId::of_path(&path).expect_err("no name");
        assert_eq!(missing.kind(), io::ErrorKind::NotFound);
    }

    #[test]
    fn reads_at_a_position() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("log");
        File::create(&path).and_then(|mut file| file.write_all(b"0123456789")).expect("written");
        let file = File::open(&path).expect("there");
        let mut bytes = [0; 4];
        read_exact_at(&file, &mut bytes, 3).expect("in the file");
        assert_eq!(&bytes, b"3456");
        let beyond = read_exact_at(&file, &mut bytes, 8).expect_err("two bytes only");
        assert_eq!(beyond.kind(), io::ErrorKind::UnexpectedEof);
    }
}
