//! How far a robot's logs were taken, in a file beside them.

use std::{collections::BTreeMap, io, path::Path};

use serde::{Deserialize, Serialize};

use crate::store::{WholeFile, read_small};

/// The file's name in a robot's folder.
pub const LEDGER: &str = "gathered.json";
/// Largest one that is read, bytes.
const MOST_BYTES: u64 = 16 << 20;

/// A record of what was gathered from a robot.
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

/// How far a log was gathered.
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
        read_small(&folder.join(LEDGER), MOST_BYTES)
    }

    /// Brings it to the disk: after a crash it is there, or the one before it.
    ///
    /// # Errors
    /// As the system says.
    pub fn write(&self, folder: &Path) -> io::Result<()> {
        WholeFile::write(&folder.join(LEDGER), &serde_json::to_vec(self)?)
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

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
