//! Folder layout of a collection and atomic acceptance of scans.
//!
//! Each scan is recorded into its own log in `in-progress/` and accepted by renaming the log into
//! `scans/`, with pose and repeat in its name. A rename is atomic, so after a crash at any time
//! each scan is present once or not at all. Incomplete and rejected scans are renamed into
//! `rejected/`.

mod error;

use std::{
    fs::{self, File},
    io,
    path::{Path, PathBuf},
};

use sha2::{Digest as _, Sha256};
use sonard_log::{AtomicFile, COLLECTED_SCANS as SCANS, file_digest, sync_folder_of, to_hex};

use super::order::Slot;

pub use error::FolderError;

/// Subfolder of scans being recorded: empty unless the program is running or was killed.
pub(super) const IN_PROGRESS: &str = "in-progress";
/// Subfolder of incomplete and rejected scans.
pub const REJECTED: &str = "rejected";
/// Subfolder with copies of plan, scene and sensor.
pub const INPUTS: &str = "inputs";
/// Suffix of files that are still being written.
const DRAFT_SUFFIX: &str = ".new";
/// File name of the journal.
pub const JOURNAL: &str = "journal.jsonl";

/// File at its final path, with size and digest.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SealedFile {
    /// Path relative to the collection's folder.
    pub file: String,
    /// File size, bytes.
    pub bytes: u64,
    /// SHA-256 of the file, hexadecimal.
    pub sha256: String,
}

/// Folder of a collection.
#[derive(Debug, Clone)]
pub struct CollectionFolder {
    root: PathBuf,
}

impl CollectionFolder {
    /// Opens the folder and creates missing subfolders.
    ///
    /// # Errors
    /// Returns an error if the folder cannot be created, or contains other files.
    pub fn open(root: &Path) -> Result<Self, FolderError> {
        let has_other_files = fs::read_dir(root).is_ok_and(|mut entries| entries.next().is_some())
            && !root.join(JOURNAL).exists()
            && !root.join(IN_PROGRESS).exists();
        if has_other_files {
            return Err(FolderError::NotACollection { path: root.into() });
        }
        for part in [IN_PROGRESS, SCANS, REJECTED, INPUTS] {
            let path = root.join(part);
            fs::create_dir_all(&path).map_err(|source| FolderError::io("create", &path, source))?;
        }
        Ok(Self { root: root.into() })
    }

    /// Creates a handle for reading, without touching the folder.
    #[must_use]
    pub fn existing(root: &Path) -> Self {
        Self { root: root.into() }
    }

    /// Path of the folder.
    #[must_use]
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Path of the journal.
    #[must_use]
    pub fn journal(&self) -> PathBuf {
        self.root.join(JOURNAL)
    }

    /// Path of a scan while it is recorded.
    #[must_use]
    pub fn draft_path(&self, slot: Slot) -> PathBuf {
        self.root.join(IN_PROGRESS).join(format!("{}.jsonl", scan_stem(slot)))
    }

    /// Lists the accepted scans by their file names.
    ///
    /// # Errors
    /// Returns an error if the folder cannot be read.
    pub fn scans(&self) -> Result<Vec<Slot>, FolderError> {
        Ok(self.files(SCANS)?.iter().filter_map(|name| slot_of(name)).collect())
    }

    /// Lists the scans that were being recorded when an earlier run ended.
    ///
    /// # Errors
    /// Returns an error if the folder cannot be read.
    pub fn interrupted_scans(&self) -> Result<Vec<Slot>, FolderError> {
        Ok(self.files(IN_PROGRESS)?.iter().filter_map(|name| slot_of(name)).collect())
    }

    /// Accepts a scan by renaming its file, which must be synced and closed.
    ///
    /// # Errors
    /// Returns an error if the scan was accepted before, or the disk fails.
    pub fn accept(&self, slot: Slot) -> Result<SealedFile, FolderError> {
        self.seal(slot, format!("{SCANS}/{}.jsonl", scan_stem(slot)))
    }

    /// Moves an incomplete or rejected scan into `rejected/`, under the next attempt number.
    ///
    /// # Errors
    /// Returns an error if the disk fails.
    pub fn set_aside(&self, slot: Slot) -> Result<SealedFile, FolderError> {
        let stem = scan_stem(slot);
        let prefix = format!("{stem}-attempt");
        let attempts = self.files(REJECTED)?;
        let last = attempts
            .iter()
            .filter_map(|name| name.strip_prefix(&prefix)?.split('.').next()?.parse::<u32>().ok());
        let attempt = last.max().unwrap_or(0) + 1;
        let name = format!("{stem}-attempt{attempt}.jsonl");
        // Torn ends removed from the log are moved along.
        let torn = format!("{stem}.jsonl.torn-");
        for name in self.files(IN_PROGRESS)?.iter().filter(|name| name.starts_with(&torn)) {
            let to = format!(
                "{REJECTED}/{}",
                name.replacen(&stem, &format!("{stem}-attempt{attempt}"), 1)
            );
            self.rename(&self.root.join(IN_PROGRESS).join(name), &to)?;
        }
        self.seal(slot, format!("{REJECTED}/{name}"))
    }

    /// Removes a scan without readings.
    ///
    /// # Errors
    /// Returns an error if the disk fails.
    pub fn discard(&self, slot: Slot) -> Result<(), FolderError> {
        let path = self.draft_path(slot);
        match fs::remove_file(&path) {
            Err(source) if source.kind() != io::ErrorKind::NotFound => {
                Err(FolderError::io("remove", &path, source))
            }
            _ => Ok(()),
        }
    }

    /// Returns size and SHA-256 of an accepted scan.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read.
    pub fn digest_of_scan(&self, slot: Slot) -> Result<SealedFile, FolderError> {
        self.digest_of_file(format!("{SCANS}/{}.jsonl", scan_stem(slot)))
    }

    /// Replaces a file atomically: a crash leaves either the old or the new content.
    ///
    /// # Errors
    /// Returns an error if the disk is full or fails; the old content is then kept.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<(), FolderError> {
        let path = self.root.join(name);
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).map_err(|s| FolderError::io("create", folder, s))?;
        }
        AtomicFile::write(&path, bytes).map_err(|source| FolderError::io("write", &path, source))
    }

    /// Removes unfinished files of [`write`](Self::write) after a kill. The caller must hold the
    /// journal's lock.
    ///
    /// # Errors
    /// Returns an error if a file cannot be removed.
    pub fn remove_drafts(&self) -> Result<(), FolderError> {
        for name in self.all_files()?.iter().filter(|name| name.ends_with(DRAFT_SUFFIX)) {
            let path = self.root.join(name);
            fs::remove_file(&path).map_err(|source| FolderError::io("remove", &path, source))?;
        }
        Ok(())
    }

    /// Computes size and SHA-256 of a file, named relative to the folder.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read.
    pub fn digest_of_file(&self, file: String) -> Result<SealedFile, FolderError> {
        let path = self.root.join(&file);
        let (bytes, sha256) = File::open(&path)
            .and_then(|mut file| file_digest(&mut file))
            .map_err(|source| FolderError::io("read", &path, source))?;
        Ok(SealedFile { file, bytes, sha256 })
    }

    /// Lists all files recursively, relative to the folder and sorted.
    ///
    /// # Errors
    /// Returns an error if a folder cannot be read.
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
                let file_type = entry.file_type().map_err(fail)?;
                if file_type.is_dir() { folders.push(name) } else { files.push(name) }
            }
        }
        files.sort();
        Ok(files)
    }

    fn seal(&self, slot: Slot, file: String) -> Result<SealedFile, FolderError> {
        self.rename(&self.draft_path(slot), &file)?;
        self.digest_of_file(file)
    }

    /// Renames without replacing an existing file, and syncs both folders.
    fn rename(&self, from: &Path, to: &str) -> Result<(), FolderError> {
        let target = self.root.join(to);
        let rename = || {
            // The journal's lock excludes other writers between check and rename.
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
    to_hex(&Sha256::digest(bytes))
}

/// File name of a scan without extension. Names sort in scan order up to 999 poses.
#[must_use]
pub fn scan_stem(slot: Slot) -> String {
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
    fn file_names_of_slots() {
        for slot in [Slot { pose: 1, repeat: 2 }, Slot { pose: 1234, repeat: 567 }] {
            assert_eq!(slot_of(&format!("{}.jsonl", scan_stem(slot))), Some(slot));
        }
        assert_eq!(slot_of("p001-r01.jsonl.torn-1"), None);
        assert_eq!(slot_of("notes.txt"), None);
    }

    #[test]
    fn accepts_once_and_numbers_takes() {
        let root = tempfile::tempdir().expect("a folder");
        let folder = CollectionFolder::open(root.path()).expect("created");
        let slot = Slot { pose: 2, repeat: 1 };
        let attempt = |text: &str| fs::write(folder.draft_path(slot), text).expect("writable");
        attempt("one");
        fs::write(root.path().join("in-progress/p002-r01.jsonl.torn-1"), "x").expect("writable");
        assert_eq!(folder.interrupted_scans().expect("readable"), [slot]);
        assert_eq!(folder.set_aside(slot).expect("kept").file, "rejected/p002-r01-attempt1.jsonl");
        attempt("two");
        assert_eq!(folder.set_aside(slot).expect("kept").file, "rejected/p002-r01-attempt2.jsonl");
        attempt("abc");
        let sealed = folder.accept(slot).expect("accepted");
        assert_eq!(sealed, folder.digest_of_scan(slot).expect("readable"));
        // FIPS 180-2, appendix B.1.
        let known = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!((sealed.bytes, sealed.sha256.as_str()), (3, known));
        attempt("again");
        assert!(folder.accept(slot).is_err(), "an accepted scan was replaced");
        assert_eq!(folder.digest_of_scan(slot).expect("readable"), sealed);
        let files = folder.all_files().expect("readable");
        assert!(files.contains(&"rejected/p002-r01-attempt1.jsonl.torn-1".to_owned()), "{files:?}");
    }

    #[test]
    fn rejects_other_folders() {
        let root = tempfile::tempdir().expect("a folder");
        fs::write(root.path().join("thesis.tex"), "").expect("writable");
        assert!(matches!(
            CollectionFolder::open(root.path()),
            Err(FolderError::NotACollection { .. })
        ));
        assert_eq!(fs::read_dir(root.path()).expect("readable").count(), 1);
    }

    #[test]
    fn replaces_files_atomically() {
        let root = tempfile::tempdir().expect("a folder");
        let folder = CollectionFolder::open(root.path()).expect("created");
        for text in ["first", "second"] {
            folder.write("manifest.json", text.as_bytes()).expect("written");
        }
        let text = fs::read_to_string(root.path().join("manifest.json")).expect("readable");
        assert_eq!(text, "second");
        fs::write(root.path().join("manifest.json.new"), "hal").expect("writable");
        folder.remove_drafts().expect("removed");
        assert_eq!(folder.all_files().expect("readable"), ["manifest.json"]);
    }
}
