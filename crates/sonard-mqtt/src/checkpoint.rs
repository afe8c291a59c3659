//! Checkpoint file next to the logs: the position up to which all records are acknowledged.

use std::{
    fs::File,
    io,
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};
use sonard_log::{AtomicFile, FINGERPRINT_BYTES, platform::read_exact_at, read_small_json, to_hex};

use super::in_flight::LogPosition;

/// File name in the log folder.
const FILE_NAME: &str = "mqtt-place.json";
/// Maximum size of the file, bytes.
const MAX_FILE_BYTES: u64 = 4096;

/// Log position with a hash of the preceding bytes.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LogCheckpoint {
    /// Name of the log file.
    file: String,
    /// Byte offset of the position.
    bytes: u64,
    /// SHA-256 of up to [`MARK_BYTES`] bytes before the position.
    sha256: String,
}

impl LogCheckpoint {
    pub(super) fn position(&self) -> LogPosition {
        LogPosition { file: self.file.as_str().into(), bytes: self.bytes }
    }

    /// Returns `true` if the log in `folder` is unchanged up to the position.
    pub(super) fn matches(&self, folder: &Path) -> bool {
        hash_before(folder, &self.position()).is_ok_and(|sha256| sha256 == self.sha256)
    }

    /// Reads the checkpoint of the logs in `folder`; `None` if there is none yet.
    ///
    /// # Errors
    /// If the file can't be read or parsed.
    pub(super) fn read(folder: &Path) -> io::Result<Option<Self>> {
        read_small_json(&path_in(folder), MAX_FILE_BYTES)
    }

    /// Writes a checkpoint atomically: after a crash either the new or the previous one is valid.
    ///
    /// # Errors
    /// If the log can't be read, or the file can't be written.
    pub(super) fn write(folder: &Path, position: &LogPosition) -> io::Result<()> {
        let sha256 = match hash_before(folder, position) {
            // The log was removed, which the next read reports.
            Err(error) if error.kind() == io::ErrorKind::NotFound => String::new(),
            other => other?,
        };
        let checkpoint = Self { file: position.file.to_string(), bytes: position.bytes, sha256 };
        AtomicFile::write(&path_in(folder), &serde_json::to_vec(&checkpoint)?)
    }
}

fn path_in(folder: &Path) -> PathBuf {
    folder.join(FILE_NAME)
}

/// Computes the SHA-256 of up to [`MARK_BYTES`] bytes before a position.
fn hash_before(folder: &Path, position: &LogPosition) -> io::Result<String> {
    let from = position.bytes.saturating_sub(FINGERPRINT_BYTES);
    let mut bytes = vec![0; usize::try_from(position.bytes - from).unwrap_or_default()];
    // A damaged file name must not lead out of the folder.
    let name = Path::new(&*position.file).file_name().ok_or(io::ErrorKind::NotFound)?;
    read_exact_at(&File::open(folder.join(name))?, &mut bytes, from)?;
    Ok(to_hex(&Sha256::digest(&bytes)))
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn changed_log_is_detected() {
        let folder = tempfile::tempdir().expect("a folder");
        let folder = folder.path();
        assert_eq!(LogCheckpoint::read(folder).expect("none yet"), None);
        let log = folder.join("sonard-1.jsonl");
        fs::write(&log, "one\ntwo\n").expect("writes");
        let position = LogPosition { file: "sonard-1.jsonl".into(), bytes: 4 };
        LogCheckpoint::write(folder, &position).expect("writes");
        let mark = LogCheckpoint::read(folder).expect("reads").expect("one");
        assert!(mark.position() == position && mark.matches(folder));
        fs::write(&log, "one\ntwo\nthree\n").expect("writes");
        assert!(mark.matches(folder), "a log may grow");
        for other in ["one", "", "uno\ntwo\n"] {
            fs::write(&log, other).expect("writes");
            assert!(!mark.matches(folder), "{other:?}");
        }
        fs::remove_file(&log).expect("is there");
        assert!(!mark.matches(folder));
    }

    #[test]
    fn damaged_file_is_an_error() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = path_in(folder.path());
        for text in ["", "{", "[]", r#"{"file":"a","bytes":-1,"sha256":""}"#, &" ".repeat(5000)] {
            fs::write(&path, text).expect("writes");
            assert!(LogCheckpoint::read(folder.path()).is_err(), "{text:?}");
        }
        fs::write(&path, r#"{"file":"../../etc/passwd","bytes":0,"sha256":""}"#).expect("writes");
        let mark = LogCheckpoint::read(folder.path()).expect("reads").expect("one");
        assert!(!mark.matches(folder.path()));
    }
}
