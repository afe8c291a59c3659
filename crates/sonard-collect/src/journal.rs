//! Journal of decisions and results: one JSON object per line, synced before the decision is
//! carried out.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs::{File, OpenOptions},
    io::{Read as _, Seek as _, SeekFrom, Write as _},
    path::{Path, PathBuf},
};

use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use sonard_api::{AirOrder, config::ScanningKeys};
use sonard_import::poses::{Conditions, NamedPose};
use sonard_log::{open_no_follow, sync_file};
use sonard_records::{Device, Provenance, SceneRef};
use uuid::Uuid;

use super::{
    checks::{CheckFinding, ScanFigures},
    folder::FolderError,
    keys::CollectionKeys,
    order::{Slot, slots},
};

/// Line of the journal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "entry", rename_all = "snake_case")]
pub enum JournalEntry {
    /// Plan that applies to the following entries.
    Plan(Box<PlanEntry>),
    /// Start of a run.
    Started(Box<RunStart>),
    /// Number assigned to a pose, or its updated conditions.
    Pose {
        /// Number of the pose, from 1.
        number: u32,
        /// Pose and its conditions.
        #[serde(flatten)]
        pose: NamedPose,
    },
    /// Result of a scan.
    Attempt(Box<ScanAttempt>),
    /// Settings of the daemon before the collection changed them.
    SavedSettings(SavedSettings),
    /// Restoration of the daemon's settings.
    RestoredSettings {
        /// Time of the restoration.
        time: Timestamp,
    },
    /// Scan that is not repeated any more.
    GivenUp {
        /// Pose and repeat of the scan.
        #[serde(flatten)]
        slot: Slot,
        /// Time of the decision.
        time: Timestamp,
    },
}

/// Plan with digests of its inputs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PlanEntry {
    /// Time from which the plan applies.
    pub time: Timestamp,
    /// Identifier of the collection.
    pub collection: Uuid,
    /// Version of `sonard` that wrote the file.
    pub sonard: String,
    /// Effective values of all keys.
    pub keys: Value,
    /// Scene with its digest.
    pub scene: SceneRef,
    /// SHA-256 of the sensor's data, hexadecimal.
    pub sensor_sha256: String,
    /// Numbers of the requested poses, in order; `null` for every pose of the source.
    pub poses: Option<Vec<u32>>,
}

/// Start of a run, with the identified device.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunStart {
    /// Start time.
    pub time: Timestamp,
    /// Identity of the ranger.
    pub device: Device,
    /// Origin of the readings: hardware, mock or simulation.
    pub provenance: Provenance,
    /// Conditions entered at the start.
    #[serde(default, skip_serializing_if = "Conditions::is_empty")]
    pub conditions: Conditions,
}

/// Settings of a daemon before a collection changed them; unchanged ones are omitted.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct SavedSettings {
    /// Scan mode and interval.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scanning: Option<ScanningKeys>,
    /// Source of the air settings.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub air: Option<SavedAir>,
}

/// Source of a daemon's air settings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SavedAir {
    /// Configuration and thermometer of the daemon.
    Daemon,
    /// Values set by a client.
    Client(AirOrder),
}

/// Outcome of a scan.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ScanOutcome {
    /// Accepted as part of the collection.
    Accepted,
    /// Rejected by a check; kept in `rejected/`.
    Rejected,
    /// Ended early; kept in `rejected/`.
    Incomplete,
}

/// Result of one attempt at a scan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ScanAttempt {
    /// Pose and repeat of the scan.
    #[serde(flatten)]
    pub slot: Slot,
    /// Identifier of the scan in records; `null` if the scan ended before its first record.
    pub scan: Option<Uuid>,
    /// Start time of the scan.
    pub started: Option<Timestamp>,
    /// Outcome of the scan.
    pub outcome: ScanOutcome,
    /// Path of the log, relative to the collection's folder.
    pub file: String,
    /// Size of the log, bytes.
    pub bytes: u64,
    /// SHA-256 of the log, hexadecimal.
    pub sha256: String,
    /// Quality figures of the scan.
    pub figures: ScanFigures,
    /// Violations of the plan's checks.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub findings: Vec<CheckFinding>,
    /// Reason for an early end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub incomplete_reason: Option<String>,
    /// Duration by the wall clock, seconds; `null` if unknown.
    pub wall_s: Option<f64>,
}

/// State of a collection, accumulated from its journal.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CollectionHistory {
    /// Plans in order; the last one is current.
    pub plans: Vec<PlanEntry>,
    /// Starts of runs, in order.
    pub starts: Vec<RunStart>,
    /// Poses by their number, from 1.
    pub poses: BTreeMap<u32, NamedPose>,
    /// Results of all attempts, in order.
    pub attempts: Vec<ScanAttempt>,
    /// Scans that are not repeated any more.
    pub given_up: BTreeSet<Slot>,
    /// Settings that still have to be restored.
    pub saved_settings: Option<SavedSettings>,
}

impl CollectionHistory {
    fn apply(&mut self, entry: JournalEntry) {
        match entry {
            JournalEntry::Plan(plan) => self.plans.push(*plan),
            JournalEntry::Started(started) => self.starts.push(*started),
            JournalEntry::Pose { number, pose } => drop(self.poses.insert(number, pose)),
            JournalEntry::Attempt(take) => self.attempts.push(*take),
            JournalEntry::SavedSettings(before) => self.saved_settings = Some(before),
            JournalEntry::RestoredSettings { .. } => self.saved_settings = None,
            JournalEntry::GivenUp { slot, .. } => drop(self.given_up.insert(slot)),
        }
    }

    /// Lists the scans requested by the current plan, in measuring order, for all known poses.
    #[must_use]
    pub fn requested(&self) -> Vec<Slot> {
        let Some(plan) = self.plans.last() else { return Vec::new() };
        let keys: CollectionKeys = serde_json::from_value(plan.keys.clone()).unwrap_or_default();
        let all = || self.poses.keys().copied().collect();
        let poses = plan.poses.clone().unwrap_or_else(all);
        let keys = keys.collection;
        slots(&poses, keys.repeats, keys.order, keys.seed)
    }

    /// Returns `true` if a scan is missing and not repeated any more.
    #[must_use]
    pub fn is_given_up(&self, slot: Slot) -> bool {
        self.given_up.contains(&slot) && !self.accepted().any(|take| take.slot == slot)
    }

    /// Iterates over the accepted scans.
    pub fn accepted(&self) -> impl Iterator<Item = &ScanAttempt> {
        self.attempts.iter().filter(|take| take.outcome == ScanOutcome::Accepted)
    }

    /// Iterates over the rejected and incomplete scans.
    pub fn set_aside(&self) -> impl Iterator<Item = &ScanAttempt> {
        self.attempts.iter().filter(|take| take.outcome != ScanOutcome::Accepted)
    }
}

/// Journal file, locked by this process.
#[derive(Debug)]
pub struct CollectionJournal {
    file: File,
    path: PathBuf,
    history: CollectionHistory,
}

impl CollectionJournal {
    /// Opens and reads a journal, or creates it. An incomplete last line is removed: its decision
    /// was not carried out.
    ///
    /// # Errors
    /// Returns an error if another process has locked the journal, if reading fails, or if a line
    /// is not a valid entry.
    pub fn open(path: &Path) -> Result<Self, FolderError> {
        let fail = |source| FolderError::io("open", path, source);
        let mut file =
            open_no_follow(OpenOptions::new().read(true).append(true).create(true), path)
                .map_err(fail)?;
        match rustix::fs::flock(&file, rustix::fs::FlockOperation::NonBlockingLockExclusive) {
            Ok(()) => {}
            Err(rustix::io::Errno::WOULDBLOCK) => {
                return Err(FolderError::Busy { path: path.into() });
            }
            Err(error) => return Err(fail(error.into())),
        }
        let mut text = Vec::new();
        file.read_to_end(&mut text).map_err(fail)?;
        let complete = complete_lines(&text);
        // Parsed before truncation: a file that is not a journal must remain unchanged.
        let history = read(complete, path)?;
        if complete.len() < text.len() {
            let length = complete.len() as u64;
            file.set_len(length).and_then(|()| sync_file(&file)).map_err(fail)?;
            file.seek(SeekFrom::End(0)).map_err(fail)?;
        }
        Ok(Self { file, path: path.into(), history })
    }

    /// State accumulated from the journal.
    #[must_use]
    pub const fn history(&self) -> &CollectionHistory {
        &self.history
    }

    /// Appends an entry and syncs the file.
    ///
    /// # Errors
    /// Returns an error if the disk is full or fails; the entry is then removed from the journal.
    pub fn append(&mut self, entry: JournalEntry) -> Result<(), FolderError> {
        let fail = |source| FolderError::io("write to", &self.path, source);
        let mut line = serde_json::to_vec(&entry).map_err(|error| fail(error.into()))?;
        line.push(b'\n');
        let before = self.file.metadata().map_err(fail)?.len();
        if let Err(error) = self.file.write_all(&line).and_then(|()| sync_file(&self.file)) {
            // A partial line would corrupt the next one. If truncation fails as well, `open`
            // repairs the file.
            let _ = self.file.set_len(before);
            return Err(fail(error));
        }
        self.history.apply(entry);
        Ok(())
    }
}

/// Reads a journal that another process may be writing.
///
/// # Errors
/// Returns an error if the file cannot be read or a line is not a valid entry.
pub fn read_journal(path: &Path) -> Result<CollectionHistory, FolderError> {
    let text = std::fs::read(path).map_err(|source| FolderError::io("read", path, source))?;
    read(complete_lines(&text), path)
}

/// Text up to its last line feed.
fn complete_lines(text: &[u8]) -> &[u8] {
    let last = text.iter().rposition(|&byte| byte == b'\n');
    last.and_then(|at| text.get(..=at)).unwrap_or_default()
}

fn read(text: &[u8], path: &Path) -> Result<CollectionHistory, FolderError> {
    let mut history = CollectionHistory::default();
    let lines = text.split(|&byte| byte == b'\n').enumerate();
    for (index, line) in lines.filter(|(_, line)| !line.is_empty()) {
        let entry = serde_json::from_slice(line).map_err(|error| FolderError::Damaged {
            path: path.into(),
            line: index as u64 + 1,
            message: error.to_string(),
        })?;
        history.apply(entry);
    }
    Ok(history)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Bytes changed at random: the journal is read or rejected with a line number.
        #[test]
        fn corrupted_journal(
            changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
        ) {
            let mut text: Vec<u8> = Vec::new();
            for number in 1..4 {
                serde_json::to_writer(&mut text, &pose(number)).expect("JSON");
                text.push(b'\n');
            }
            for (at, byte) in changes {
                let at = at.index(text.len());
                text[at] = byte;
            }
            match read(&text, Path::new("journal.jsonl")) {
                Ok(history) => prop_assert!(history.poses.len() <= 3),
                Err(FolderError::Damaged { line, .. }) => {
                    let lines = text.split(|&byte| byte == b'\n').count() as u64;
                    prop_assert!((1..=lines).contains(&line));
                }
                Err(other) => return Err(TestCaseError::fail(other.to_string())),
            }
        }
    }

    fn pose(number: u32) -> JournalEntry {
        let pose = sonard_model::geometry::Pose { x_m: 0.5, y_m: 0.25, heading_deg: 90.0 };
        let conditions = [("door".to_owned(), Value::from("open"))].into_iter().collect();
        JournalEntry::Pose { number, pose: NamedPose { name: Some("a".into()), pose, conditions } }
    }

    #[test]
    fn truncation_at_any_byte() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("journal.jsonl");
        let mut journal = CollectionJournal::open(&path).expect("created");
        for number in 1..=3 {
            journal.append(pose(number)).expect("written");
        }
        let slot = Slot { pose: 3, repeat: 2 };
        let time = Timestamp::UNIX_EPOCH;
        journal.append(JournalEntry::GivenUp { slot, time }).expect("written");
        assert!(matches!(CollectionJournal::open(&path), Err(FolderError::Busy { .. })));
        drop(journal);
        let text = std::fs::read(&path).expect("readable");
        for length in 0..=text.len() {
            std::fs::write(&path, &text[..length]).expect("writable");
            let lines = text[..length].iter().filter(|&&byte| byte == b'\n').count();
            let mut journal = CollectionJournal::open(&path).expect("reopened");
            assert_eq!(journal.history().poses.len(), lines.min(3));
            assert_eq!(journal.history().given_up.contains(&slot), lines == 4);
            journal.append(pose(9)).expect("written");
            drop(journal);
            assert!(read_journal(&path).expect("complete").poses.contains_key(&9), "{length}");
        }
    }

    #[test]
    fn line_of_an_invalid_entry() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("journal.jsonl");
        std::fs::write(&path, "{\"entry\":\"given_up\"}\n").expect("writable");
        let error = CollectionJournal::open(&path).expect_err("damaged");
        assert!(error.to_string().contains("journal.jsonl:1: missing field"), "{error}");
    }
}
