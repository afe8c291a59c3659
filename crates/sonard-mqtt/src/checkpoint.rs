//! The place in the log that everything before is acknowledged of, in a file beside the logs.

use std::{
    fs::File,
    io,
    os::unix::fs::FileExt as _,
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};
use sonard_log::{MARK_BYTES, WholeFile, hexadecimal, read_small};

use super::window::LogPosition;

/// The file's name in the folder of the logs.
const NAME: &str = "mqtt-place.json";
/// Largest file that is read, bytes.
const MOST_BYTES: u64 = 4096;

/// A place, and what stood before it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Bookmark {
    /// The log's name.
    file: String,
    /// So many bytes of it are behind.
    bytes: u64,
    /// SHA-256 of the last of these, at most [`MARK_BYTES`].
    sha256: String,
}

impl Bookmark {
    /// The place.
    pub(super) fn place(&self) -> LogPosition {
        LogPosition { file: self.file.as_str().into(), bytes: self.bytes }
    }

    /// Whether the log in `folder` is still what was read up to the place.
    pub(super) fn fits(&self, folder: &Path) -> bool {
        before(folder, &self.place()).is_ok_and(|sha256| sha256 == self.sha256)
    }

    /// The one of the logs in `folder`; `None` if nothing was remembered yet.
    ///
    /// # Errors
    /// When there is one that can't be read.
    pub(super) fn read(folder: &Path) -> io::Result<Option<Self>> {
        read_small(&path_in(folder), MOST_BYTES)
    }

    /// Brings a place to the disk: after a crash either it is remembered, or the one before it.
    ///
    /// # Errors
    /// When the log can't be read, or the file not be written.
    pub(super) fn write(folder: &Path, place: &LogPosition) -> io::Result<()> {
        let sha256 = match before(folder, place) {
            // It was removed, and that is told when it is read on.
            Err(error) if error.kind() == io::ErrorKind::NotFound => String::new(),
            other => other?,
        };
        let mark = Self { file: place.file.to_string(), bytes: place.bytes, sha256 };
        WholeFile::write(&path_in(folder), &serde_json::to_vec(&mark)?)
    }
}

fn path_in(folder: &Path) -> PathBuf {
    folder.join(NAME)
}

/// SHA-256 of what stands before a place.
fn before(folder: &Path, place: &LogPosition) -> io::Result<String> {
    let from = place.bytes.saturating_sub(MARK_BYTES);
    let mut bytes = vec![0; usize::try_from(place.bytes - from).unwrap_or_default()];
    // What a damaged file names must not lead out of the folder.
    let name = Path::new(&*place.file).file_name().ok_or(io::ErrorKind::NotFound)?;
    File::open(folder.join(name))?.read_exact_at(&mut bytes, from)?;
    Ok(hexadecimal(&Sha256::digest(&bytes)))
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn a_place_is_found_again_and_a_log_that_is_another_is_noticed() {
        let folder = tempfile::tempdir().expect("a folder");
        let folder = folder.path();
        assert_eq!(Bookmark::read(folder).expect("none yet"), None);
        let log = folder.join("sonard-1.jsonl");
        fs::write(&log, "one\ntwo\n").expect("writes");
        let place = LogPosition { file: "sonard-1.jsonl".into(), bytes: 4 };
        Bookmark::write(folder, &place).expect("writes");
        let mark = Bookmark::read(folder).expect("reads").expect("one");
        assert!(mark.place() == place && mark.fits(folder));
        fs::write(&log, "one\ntwo\nthree\n").expect("writes");
        assert!(mark.fits(folder), "a log may grow");
        for other in ["one", "", "uno\ntwo\n"] {
            fs::write(&log, other).expect("writes");
            assert!(!mark.fits(folder), "{other:?}");
        }
        fs::remove_file(&log).expect("is there");
        assert!(!mark.fits(folder));
    }

    #[test]
    fn a_damaged_file_is_an_error_and_leads_nowhere() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = path_in(folder.path());
        for text in ["", "{", "[]", r#"{"file":"a","bytes":-1,"sha256":""}"#, &" ".repeat(5000)] {
            fs::write(&path, text).expect("writes");
            assert!(Bookmark::read(folder.path()).is_err(), "{text:?}");
        }
        fs::write(&path, r#"{"file":"../../etc/passwd","bytes":0,"sha256":""}"#).expect("writes");
        let mark = Bookmark::read(folder.path()).expect("reads").expect("one");
        assert!(!mark.fits(folder.path()));
    }
}
