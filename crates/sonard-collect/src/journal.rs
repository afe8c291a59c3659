//! What was decided and what came of it: one JSON object a line, each on the disk before anything
//! is done by it.

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
use sonard_log::{open_own, sync_file};
use sonard_records::{Device, Provenance, SceneRef};
use uuid::Uuid;

use super::{
    checks::{Figures, Finding},
    folder::FolderError,
    keys::{CollectionKeys, Conditions},
    order::{Slot, slots},
    poses::NamedPose,
};

/// One line.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "entry", rename_all = "snake_case")]
pub enum Entry {
    /// The plan from here on.
    Plan(Box<PlanEntry>),
    /// The program began or went on.
    Started(Box<Started>),
    /// A pose got its number.
    Pose {
        /// Its number, from 1.
        number: u32,
        /// Where, and what was noted.
        #[serde(flatten)]
        pose: NamedPose,
    },
    /// A scan is over, one way or another.
    Take(Box<Take>),
    /// What the daemon that takes the scans did by itself before that was changed.
    Borrowed(Borrowed),
    /// It does that again.
    GivenBack {
        /// When.
        time: Timestamp,
    },
    /// The scan is not tried again.
    GivenUp {
        /// Which.
        #[serde(flatten)]
        slot: Slot,
        /// When.
        time: Timestamp,
    },
}

/// The plan in force, with what it names.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PlanEntry {
    /// When it came into force.
    pub time: Timestamp,
    /// Identifies the collection.
    pub collection: Uuid,
    /// Version of the program.
    pub sonard: String,
    /// Every key in force.
    pub keys: Value,
    /// The scene.
    pub scene: SceneRef,
    /// SHA-256 of the sensor's data, hexadecimal.
    pub sensor_sha256: String,
    /// Numbers of the poses wanted, in order; `null` for all that come.
    pub poses: Option<Vec<u32>>,
}

/// The program began or went on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Started {
    /// When.
    pub time: Timestamp,
    /// Who measures.
    pub device: Device,
    /// Whether it is hardware.
    pub provenance: Provenance,
    /// What was noted.
    #[serde(default, skip_serializing_if = "Conditions::is_empty")]
    pub conditions: Conditions,
}

/// Settings of a daemon before a collection changed them; unchanged ones are left out.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Borrowed {
    /// When it took scans.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scanning: Option<ScanningKeys>,
    /// In which air.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub air: Option<AirBefore>,
}

/// The air of a daemon.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AirBefore {
    /// What its configuration and its thermometer say.
    Own,
    /// What a program had said.
    Given(AirOrder),
}

/// The outcome of a scan.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// It counts.
    Accepted,
    /// A check refused it: it is kept and does not count.
    Refused,
    /// It was broken off: it is kept and does not count.
    Cut,
}

/// A scan that is over.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Take {
    /// Which scan it was to be.
    #[serde(flatten)]
    pub slot: Slot,
    /// Its id in records; `null` if it was cut before its first one.
    pub scan: Option<Uuid>,
    /// When it began.
    pub started: Option<Timestamp>,
    /// What became of it.
    pub outcome: Outcome,
    /// Its file, seen from the collection's folder.
    pub file: String,
    /// Size of that file, bytes.
    pub bytes: u64,
    /// SHA-256 of that file, hexadecimal.
    pub sha256: String,
    /// The scan in figures.
    pub figures: Figures,
    /// What the checks found.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub findings: Vec<Finding>,
    /// Why it does not count, for one that was cut.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cut: Option<String>,
    /// From its beginning to its end by the wall clock, seconds; `null` if that is not known.
    pub wall_s: Option<f64>,
}

/// Everything a journal says.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct History {
    /// The plans, the last one in force.
    pub plans: Vec<PlanEntry>,
    /// Each start of the program.
    pub starts: Vec<Started>,
    /// The poses by number.
    pub poses: BTreeMap<u32, NamedPose>,
    /// Every scan that is over, in order.
    pub takes: Vec<Take>,
    /// Scans that are not tried again.
    pub given_up: BTreeSet<Slot>,
    /// What was not given back yet.
    pub borrowed: Option<Borrowed>,
}

impl History {
    fn learn(&mut self, entry: Entry) {
        match entry {
            Entry::Plan(plan) => self.plans.push(*plan),
            Entry::Started(started) => self.starts.push(*started),
            Entry::Pose { number, pose } => drop(self.poses.insert(number, pose)),
            Entry::Take(take) => self.takes.push(*take),
            Entry::Borrowed(before) => self.borrowed = Some(before),
            Entry::GivenBack { .. } => self.borrowed = None,
            Entry::GivenUp { slot, .. } => drop(self.given_up.insert(slot)),
        }
    }

    /// Every scan that the plan in force wants, in its order, as far as its poses are known.
    #[must_use]
    pub fn wanted(&self) -> Vec<Slot> {
        let Some(plan) = self.plans.last() else { return Vec::new() };
        let keys: CollectionKeys = serde_json::from_value(plan.keys.clone()).unwrap_or_default();
        let all = || self.poses.keys().copied().collect();
        let poses = plan.poses.clone().unwrap_or_else(all);
        let keys = keys.collection;
        slots(&poses, keys.repeats, keys.order, keys.seed)
    }

    /// Whether a scan is not there and not tried again.
    #[must_use]
    pub fn is_given_up(&self, slot: Slot) -> bool {
        self.given_up.contains(&slot) && !self.accepted().any(|take| take.slot == slot)
    }

    /// The scans that count.
    pub fn accepted(&self) -> impl Iterator<Item = &Take> {
        self.takes.iter().filter(|take| take.outcome == Outcome::Accepted)
    }

    /// Those kept beside them, refused or cut.
    pub fn set_aside(&self) -> impl Iterator<Item = &Take> {
        self.takes.iter().filter(|take| take.outcome != Outcome::Accepted)
    }
}

/// The journal's file, held by this process alone.
#[derive(Debug)]
pub struct Journal {
    file: File,
    path: PathBuf,
    history: History,
}

impl Journal {
    /// Opens a journal, or begins one, and reads what it says. A last line that was cut off in
    /// mid-write is removed: nothing was done by it yet.
    ///
    /// # Errors
    /// When another process holds it, it can't be read, or a line in it is no entry.
    pub fn open(path: &Path) -> Result<Self, FolderError> {
        let fail = |source| FolderError::io("open", path, source);
        let mut file = open_own(OpenOptions::new().read(true).append(true).create(true), path)
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
        let whole = text.iter().rposition(|&byte| byte == b'\n').map_or(0, |at| at + 1);
        // Read before it is cut: what is no journal must stay as it is.
        let history = read(&text[..whole], path)?;
        if whole < text.len() {
            file.set_len(whole as u64).and_then(|()| sync_file(&file)).map_err(fail)?;
            file.seek(SeekFrom::End(0)).map_err(fail)?;
        }
        Ok(Self { file, path: path.into(), history })
    }

    /// What it says.
    #[must_use]
    pub const fn history(&self) -> &History {
        &self.history
    }

    /// Writes an entry, and returns when it is on the disk.
    ///
    /// # Errors
    /// When the disk is full or fails; then nothing of it is in the journal.
    pub fn append(&mut self, entry: Entry) -> Result<(), FolderError> {
        let fail = |source| FolderError::io("write to", &self.path, source);
        let mut line = serde_json::to_vec(&entry).map_err(|error| fail(error.into()))?;
        line.push(b'\n');
        let before = self.file.metadata().map_err(fail)?.len();
        if let Err(error) = self.file.write_all(&line).and_then(|()| sync_file(&self.file)) {
            // Half a line would hide what comes after it. If this fails too, opening mends it.
            let _ = self.file.set_len(before);
            return Err(fail(error));
        }
        self.history.learn(entry);
        Ok(())
    }
}

/// Reads a journal that another process may be writing.
///
/// # Errors
/// As [`Journal::open`].
pub fn read_journal(path: &Path) -> Result<History, FolderError> {
    let text = std::fs::read(path).map_err(|source| FolderError::io("read", path, source))?;
    let whole = text.iter().rposition(|&byte| byte == b'\n').map_or(0, |at| at + 1);
    read(&text[..whole], path)
}

fn read(text: &[u8], path: &Path) -> Result<History, FolderError> {
    let mut history = History::default();
    let lines = text.split(|&byte| byte == b'\n').enumerate();
    for (index, line) in lines.filter(|(_, line)| !line.is_empty()) {
        let entry = serde_json::from_slice(line).map_err(|error| FolderError::Damaged {
            path: path.into(),
            line: index as u64 + 1,
            message: error.to_string(),
        })?;
        history.learn(entry);
    }
    Ok(history)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// A journal that was changed at any place is read or refused at a line, without a panic.
        #[test]
        fn a_changed_journal_is_read_or_refused(
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

    fn pose(number: u32) -> Entry {
        let pose = sonard_model::geometry::Pose { x_m: 0.5, y_m: 0.25, heading_deg: 90.0 };
        let conditions = [("door".to_owned(), Value::from("open"))].into_iter().collect();
        Entry::Pose { number, pose: NamedPose { name: Some("a".into()), pose, conditions } }
    }

    #[test]
    fn a_journal_cut_at_any_byte_keeps_its_whole_lines_and_goes_on() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("journal.jsonl");
        let mut journal = Journal::open(&path).expect("it begins");
        for number in 1..=3 {
            journal.append(pose(number)).expect("there is room");
        }
        let slot = Slot { pose: 3, repeat: 2 };
        let time = Timestamp::UNIX_EPOCH;
        journal.append(Entry::GivenUp { slot, time }).expect("there is room");
        assert!(matches!(Journal::open(&path), Err(FolderError::Busy { .. })));
        drop(journal);
        let text = std::fs::read(&path).expect("readable");
        for length in 0..=text.len() {
            std::fs::write(&path, &text[..length]).expect("writable");
            let lines = text[..length].iter().filter(|&&byte| byte == b'\n').count();
            let mut journal = Journal::open(&path).expect("it goes on");
            assert_eq!(journal.history().poses.len(), lines.min(3));
            assert_eq!(journal.history().given_up.contains(&slot), lines == 4);
            journal.append(pose(9)).expect("there is room");
            drop(journal);
            assert!(read_journal(&path).expect("whole").poses.contains_key(&9), "{length}");
        }
    }

    #[test]
    fn a_line_that_is_no_entry_is_named() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("journal.jsonl");
        std::fs::write(&path, "{\"entry\":\"given_up\"}\n").expect("writable");
        let error = Journal::open(&path).expect_err("it is damaged");
        assert!(error.to_string().contains("journal.jsonl:1: missing field"), "{error}");
    }
}
