//! The folder of a collection: what lies where, and how a scan comes to count.
//!
//! Each scan is measured into a log of its own in `taking/`. It counts from the moment its file is
//! renamed into `scans/`, under a name that says pose and repeat: a rename happens or does not, so
//! a crash at any time leaves every scan there once or not at all. What was cut off or refused is
//! renamed into `set-aside/`.

mod error;

use std::{
    fs::{self, File},
    io,
    path::{Path, PathBuf},
};

use sha2::{Digest as _, Sha256};
use sonard_log::{WholeFile, digest_of, hexadecimal, sync_folder_of};

use super::order::Slot;

pub use error::FolderError;

/// Scans under way: empty unless the program is running or was killed.
pub(super) const TAKING: &str = "taking";
/// Scans that count.
pub const SCANS: &str = "scans";
/// Scans that were cut off or refused.
pub const SET_ASIDE: &str = "set-aside";
/// Plan, scene and sensor as they were used.
pub const INPUTS: &str = "inputs";
/// What a file's name ends in until it is whole.
const DRAFT: &str = ".new";
/// The journal's name.
pub const JOURNAL: &str = "journal.jsonl";

/// A file at its final place.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Sealed {
    /// Seen from the collection's folder.
    pub file: String,
    /// Its size, bytes.
    pub bytes: u64,
    /// Its SHA-256, hexadecimal.
    pub sha256: String,
}

/// A collection's folder.
#[derive(Debug, Clone)]
pub struct Folder {
    root: PathBuf,
}

impl Folder {
    /// Makes the folder and what it is divided into, as far as it is not there.
    ///
    /// # Errors
    /// When it can't be made, or holds something else than a collection.
    pub fn open(root: &Path) -> Result<Self, FolderError> {
        let strange = fs::read_dir(root).is_ok_and(|mut entries| entries.next().is_some())
            && !root.join(JOURNAL).exists()
            && !root.join(TAKING).exists();
        if strange {
            return Err(FolderError::Strange { path: root.into() });
        }
        for part in [TAKING, SCANS, SET_ASIDE, INPUTS] {
            let path = root.join(part);
            fs::create_dir_all(&path).map_err(|source| FolderError::io("make", &path, source))?;
        }
        Ok(Self { root: root.into() })
    }

    /// A folder that is only read.
    #[must_use]
    pub fn at(root: &Path) -> Self {
        Self { root: root.into() }
    }

    /// Where it is.
    #[must_use]
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Where the journal is.
    #[must_use]
    pub fn journal(&self) -> PathBuf {
        self.root.join(JOURNAL)
    }

    /// Where a scan is measured into.
    #[must_use]
    pub fn taking(&self, slot: Slot) -> PathBuf {
        self.root.join(TAKING).join(format!("{}.jsonl", stem(slot)))
    }

    /// The scans that count, by what their files say.
    ///
    /// # Errors
    /// When the folder can't be read.
    pub fn scans(&self) -> Result<Vec<Slot>, FolderError> {
        Ok(self.files(SCANS)?.iter().filter_map(|name| slot_of(name)).collect())
    }

    /// Scans that were under way when the program ended.
    ///
    /// # Errors
    /// When the folder can't be read.
    pub fn left_over(&self) -> Result<Vec<Slot>, FolderError> {
        Ok(self.files(TAKING)?.iter().filter_map(|name| slot_of(name)).collect())
    }

    /// Lets a scan count. Its file must be written, synced and closed.
    ///
    /// # Errors
    /// When there is one already, or the disk fails.
    pub fn accept(&self, slot: Slot) -> Result<Sealed, FolderError> {
        self.seal(slot, format!("{SCANS}/{}.jsonl", stem(slot)))
    }

    /// Keeps a scan beside those that count.
    ///
    /// # Errors
    /// When the disk fails.
    pub fn set_aside(&self, slot: Slot) -> Result<Sealed, FolderError> {
        let stem = stem(slot);
        let prefix = format!("{stem}-take");
        let takes = self.files(SET_ASIDE)?;
        let last = takes
            .iter()
            .filter_map(|name| name.strip_prefix(&prefix)?.split('.').next()?.parse::<u32>().ok());
        let take = last.max().unwrap_or(0) + 1;
        let name = format!("{stem}-take{take}.jsonl");
        // What was cut off its end goes with it.
        let torn = format!("{stem}.jsonl.torn-");
        for name in self.files(TAKING)?.iter().filter(|name| name.starts_with(&torn)) {
            let to =
                format!("{SET_ASIDE}/{}", name.replacen(&stem, &format!("{stem}-take{take}"), 1));
            self.rename(&self.root.join(TAKING).join(name), &to)?;
        }
        self.seal(slot, format!("{SET_ASIDE}/{name}"))
    }

    /// Removes a scan that has no reading in it.
    ///
    /// # Errors
    /// When the disk fails.
    pub fn discard(&self, slot: Slot) -> Result<(), FolderError> {
        let path = self.taking(slot);
        match fs::remove_file(&path) {
            Err(source) if source.kind() != io::ErrorKind::NotFound => {
                Err(FolderError::io("remove", &path, source))
            }
            _ => Ok(()),
        }
    }

    /// Size and SHA-256 of a scan that counts.
    ///
    /// # Errors
    /// When it can't be read.
    pub fn sealed(&self, slot: Slot) -> Result<Sealed, FolderError> {
        self.look(format!("{SCANS}/{}.jsonl", stem(slot)))
    }

    /// Writes a file so that at any time either the old or the new one is there, whole.
    ///
    /// # Errors
    /// When the disk is full or fails; then the old one is still there.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<(), FolderError> {
        let path = self.root.join(name);
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).map_err(|s| FolderError::io("make", folder, s))?;
        }
        WholeFile::write(&path, bytes).map_err(|source| FolderError::io("write", &path, source))
    }

    /// Removes what [`write`](Self::write) was at when the program was killed. Only for who holds
    /// the journal.
    ///
    /// # Errors
    /// When it can't be removed.
    pub fn remove_drafts(&self) -> Result<(), FolderError> {
        for name in self.all_files()?.iter().filter(|name| name.ends_with(DRAFT)) {
            let path = self.root.join(name);
            fs::remove_file(&path).map_err(|source| FolderError::io("remove", &path, source))?;
        }
        Ok(())
    }

    /// Looks at a file, named as seen from the folder.
    ///
    /// # Errors
    /// When it can't be read.
    pub fn look(&self, file: String) -> Result<Sealed, FolderError> {
        let path = self.root.join(&file);
        let (bytes, sha256) = File::open(&path)
            .and_then(|mut file| digest_of(&mut file))
            .map_err(|source| FolderError::io("read", &path, source))?;
        Ok(Sealed { file, bytes, sha256 })
    }

    /// Every file, as seen from the folder, sorted.
    ///
    /// # Errors
    /// When a folder can't be read.
    pub fn all_files(&self) -> Result<Vec<String>, FolderError> {
        let mut files = Vec::new();
        let mut folders = vec![String::new()];
        while let Some(folder) = folders.pop() {
            let path = self.root.join(&folder);
            let fail = |source| FolderError::io("read", &path, source);
            for entry in fs::read_dir(&path).map_err(fail)? {
                let entry = entry.map_err(fail)?;
                let name = entry.file_name().to_string_lossy().into_owned();
                let name = if folder.is_empty() { name } else { format!("{folder}/{name}") };
                let of = entry.file_type().map_err(fail)?;
                if of.is_dir() { folders.push(name) } else { files.push(name) }
            }
        }
        files.sort();
        Ok(files)
    }

    fn seal(&self, slot: Slot, file: String) -> Result<Sealed, FolderError> {
        self.rename(&self.taking(slot), &file)?;
        self.look(file)
    }

    /// Renames, but over no other file, and brings both folders to the disk.
    fn rename(&self, from: &Path, to: &str) -> Result<(), FolderError> {
        let target = self.root.join(to);
        let rename = || {
            // This process holds the journal's lock: nobody else puts one there meanwhile.
            if target.exists() {
                return Err(io::ErrorKind::AlreadyExists.into());
            }
            fs::rename(from, &target)?;
            sync_folder_of(&target)?;
            sync_folder_of(from)
        };
        rename().map_err(|source| FolderError::io("move a scan to", &target, source))
    }

    fn files(&self, part: &str) -> Result<Vec<String>, FolderError> {
        let path = self.root.join(part);
        let fail = |source| FolderError::io("read", &path, source);
        let entries = fs::read_dir(&path).map_err(fail)?;
        let mut names = entries
            .map(|entry| Ok(entry?.file_name().to_string_lossy().into_owned()))
            .collect::<io::Result<Vec<_>>>()
            .map_err(fail)?;
        names.sort();
        Ok(names)
    }
}

/// SHA-256 of bytes, hexadecimal.
#[must_use]
pub fn sha256(bytes: &[u8]) -> String {
    hexadecimal(&Sha256::digest(bytes))
}

/// The name of a scan's file without its ending; names sort as the scans do up to 999 poses.
#[must_use]
pub fn stem(slot: Slot) -> String {
    format!("p{:03}-r{:02}", slot.pose, slot.repeat)
}

fn slot_of(name: &str) -> Option<Slot> {
    let (pose, repeat) = name.strip_suffix(".jsonl")?.strip_prefix('p')?.split_once("-r")?;
    Some(Slot { pose: pose.parse().ok()?, repeat: repeat.parse().ok()? })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_say_pose_and_repeat() {
        for slot in [Slot { pose: 1, repeat: 2 }, Slot { pose: 1234, repeat: 567 }] {
            assert_eq!(slot_of(&format!("{}.jsonl", stem(slot))), Some(slot));
        }
        assert_eq!(slot_of("p001-r01.jsonl.torn-1"), None);
        assert_eq!(slot_of("notes.txt"), None);
    }

    #[test]
    fn a_scan_counts_once_and_what_is_set_aside_is_numbered() {
        let root = tempfile::tempdir().expect("a folder");
        let folder = Folder::open(root.path()).expect("it is made");
        let slot = Slot { pose: 2, repeat: 1 };
        let take = |text: &str| fs::write(folder.taking(slot), text).expect("writable");
        take("one");
        fs::write(root.path().join("taking/p002-r01.jsonl.torn-1"), "x").expect("writable");
        assert_eq!(folder.left_over().expect("readable"), [slot]);
        assert_eq!(folder.set_aside(slot).expect("kept").file, "set-aside/p002-r01-take1.jsonl");
        take("two");
        assert_eq!(folder.set_aside(slot).expect("kept").file, "set-aside/p002-r01-take2.jsonl");
        take("abc");
        let sealed = folder.accept(slot).expect("it counts");
        assert_eq!(sealed, folder.sealed(slot).expect("readable"));
        // FIPS 180-2, appendix B.1.
        let known = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!((sealed.bytes, sealed.sha256.as_str()), (3, known));
        take("again");
        assert!(folder.accept(slot).is_err(), "nothing is written over");
        assert_eq!(folder.sealed(slot).expect("readable"), sealed);
        let files = folder.all_files().expect("readable");
        assert!(files.contains(&"set-aside/p002-r01-take1.jsonl.torn-1".to_owned()), "{files:?}");
    }

    #[test]
    fn a_folder_with_other_files_in_it_is_left_alone() {
        let root = tempfile::tempdir().expect("a folder");
        fs::write(root.path().join("thesis.tex"), "").expect("writable");
        assert!(matches!(Folder::open(root.path()), Err(FolderError::Strange { .. })));
        assert_eq!(fs::read_dir(root.path()).expect("readable").count(), 1);
    }

    #[test]
    fn a_file_is_replaced_whole() {
        let root = tempfile::tempdir().expect("a folder");
        let folder = Folder::open(root.path()).expect("it is made");
        for text in ["first", "second"] {
            folder.write("manifest.json", text.as_bytes()).expect("there is room");
        }
        let text = fs::read_to_string(root.path().join("manifest.json")).expect("readable");
        assert_eq!(text, "second");
        fs::write(root.path().join("manifest.json.new"), "hal").expect("writable");
        folder.remove_drafts().expect("it goes");
        assert_eq!(folder.all_files().expect("readable"), ["manifest.json"]);
    }
}
