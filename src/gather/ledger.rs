//! How far a robot's logs were taken, in a file beside them.

use std::{collections::BTreeMap, fs, io, path::Path};

use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

use crate::store::WholeFile;

/// The file's name in a robot's folder.
pub const LEDGER: &str = "gathered.json";
/// Largest one that is read, bytes.
const MOST_BYTES: u64 = 16 << 20;
/// So many bytes before a place tell whether a log is the one it was.
pub(super) const LOOKED_AT: u64 = 256;

/// What was taken from a robot.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ledger {
    /// Its name.
    pub robot: String,
    /// Where its daemon was last.
    pub address: String,
    /// Its logs, by their names.
    pub logs: BTreeMap<String, Taken>,
}

/// How far a log was taken.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Taken {
    /// So many bytes of the daemon's log were looked at.
    pub bytes: u64,
    /// So long is the copy that was made of them, bytes: shorter where lines were refused.
    pub kept_bytes: u64,
    /// SHA-256 of the last of the daemon's bytes, at most 256.
    pub sha256: String,
}

impl Ledger {
    /// The one of a robot's folder; `None` if there is none yet.
    ///
    /// # Errors
    /// When there is one that can't be read.
    pub fn read(folder: &Path) -> io::Result<Option<Self>> {
        let path = folder.join(LEDGER);
        match fs::metadata(&path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Ok(metadata) if metadata.is_file() && metadata.len() <= MOST_BYTES => {}
            Ok(_) => return Err(io::ErrorKind::InvalidData.into()),
            Err(error) => return Err(error),
        }
        Ok(Some(serde_json::from_slice(&fs::read(&path)?)?))
    }

    /// Brings it to the disk: after a crash it is there, or the one before it.
    ///
    /// # Errors
    /// As the system says.
    pub fn write(&self, folder: &Path) -> io::Result<()> {
        WholeFile::write(&folder.join(LEDGER), &serde_json::to_vec(self)?)
    }
}

/// The last bytes of what was taken of a log.
#[derive(Debug, Clone, Default)]
pub(super) struct Mark(Vec<u8>);

impl Mark {
    pub(super) fn push(&mut self, bytes: &[u8]) {
        let most = LOOKED_AT as usize;
        self.0.extend_from_slice(&bytes[bytes.len().saturating_sub(most)..]);
        self.0.drain(..self.0.len().saturating_sub(most));
    }

    pub(super) fn sha256(&self) -> String {
        Sha256::digest(&self.0).iter().map(|byte| format!("{byte:02x}")).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mark_is_of_the_last_bytes_however_they_came() {
        let bytes: Vec<u8> = (0..=255).cycle().take(1000).collect();
        let (mut whole, mut pieces) = (Mark::default(), Mark::default());
        whole.push(&bytes);
        bytes.chunks(7).for_each(|piece| pieces.push(piece));
        assert_eq!((whole.sha256(), whole.0.len()), (pieces.sha256(), 256));
        assert_eq!(whole.0, bytes[744..]);
    }

    #[test]
    fn a_ledger_is_read_as_it_was_written_and_a_damaged_one_is_an_error() {
        let folder = tempfile::tempdir().expect("a folder");
        assert_eq!(Ledger::read(folder.path()).expect("reads"), None);
        let taken = Taken { bytes: 9, kept_bytes: 8, sha256: "ab".into() };
        let logs = [("sonard-1.jsonl".to_owned(), taken)].into();
        let ledger = Ledger { robot: "kiwi".into(), address: "h:1".into(), logs };
        ledger.write(folder.path()).expect("writes");
        assert_eq!(Ledger::read(folder.path()).expect("reads"), Some(ledger));
        for text in ["", "[]", "{\"robot\":1}"] {
            fs::write(folder.path().join(LEDGER), text).expect("writes");
            assert!(Ledger::read(folder.path()).is_err(), "{text:?}");
        }
    }
}
