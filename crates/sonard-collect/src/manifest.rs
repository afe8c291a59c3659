//! The manifest: what belongs to a collection, with checksums; and its check.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    io::BufReader,
    path::Path,
};

use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use sonard_log::{Severity, check, load};
use sonard_records::SceneRef;
use uuid::Uuid;

use super::{
    folder::{Folder, FolderError, JOURNAL, Sealed},
    journal::{History, Outcome, Started, read_journal},
    order::Slot,
    poses::NamedPose,
};

/// The manifest's name.
pub const MANIFEST: &str = "manifest.json";
/// Version of the manifest's form.
const FORMAT: u32 = 1;

/// The files of a collection.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// Version of this form.
    pub format: u32,
    /// Identifies the collection.
    pub collection: Uuid,
    /// What it is called.
    pub name: String,
    /// When this was written.
    pub written: Timestamp,
    /// Version of the program.
    pub sonard: String,
    /// Whether every scan of the plan is there or was given up.
    pub complete: bool,
    /// How many of what.
    pub counts: Counts,
    /// Every key of the plan in force.
    pub plan: Value,
    /// SHA-256 of those keys as compact JSON, hexadecimal.
    pub plan_sha256: String,
    /// The scene.
    pub scene: SceneRef,
    /// SHA-256 of the sensor's data, hexadecimal.
    pub sensor_sha256: String,
    /// Each start of the program, with the device that answered and what was noted.
    pub starts: Vec<Started>,
    /// The poses by number.
    pub poses: BTreeMap<u32, NamedPose>,
    /// Every file, but for this one.
    pub files: Vec<FileEntry>,
}

/// Counts of scans by outcome.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Counts {
    /// Scans of the plan, as far as its poses are known.
    pub wanted: u32,
    /// Scans that count.
    pub accepted: u32,
    /// Scans cut off or refused, kept beside them.
    pub set_aside: u32,
    /// Scans that are not tried again.
    pub given_up: u32,
    /// Beams of the scans that count.
    pub beams: u64,
    /// Of those, beams without a usable reading.
    pub missing: u64,
}

/// A file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FileEntry {
    /// Seen from the folder.
    pub path: String,
    /// Its size, bytes.
    pub bytes: u64,
    /// Its SHA-256, hexadecimal.
    pub sha256: String,
    /// The scan in it, if it holds one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scan: Option<ScanEntry>,
}

/// A scan in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct ScanEntry {
    /// Which one it is, or was to be.
    #[serde(flatten)]
    pub slot: Slot,
    /// Its id in records.
    pub id: Option<Uuid>,
    /// Whether it counts.
    pub outcome: Outcome,
    /// Beams of its plan.
    pub beams: u32,
    /// Of those, beams without a usable reading.
    pub missing: u32,
}

impl Manifest {
    /// Of a folder as its journal tells; the scans' checksums are the journal's, taken when each
    /// was sealed, and other files are read.
    ///
    /// # Errors
    /// When a file can't be read, or there is no plan yet.
    pub fn of(folder: &Folder, history: &History) -> Result<Self, FolderError> {
        let wanted = history.wanted();
        let plan = history.plans.last().ok_or_else(|| FolderError::Damaged {
            path: folder.journal(),
            line: 1,
            message: "the journal holds no plan".into(),
        })?;
        let mut files = BTreeMap::new();
        for take in &history.takes {
            let scan = ScanEntry {
                slot: take.slot,
                id: take.scan,
                outcome: take.outcome,
                beams: take.figures.beams,
                missing: take.figures.missing,
            };
            let entry = FileEntry {
                path: take.file.clone(),
                bytes: take.bytes,
                sha256: take.sha256.clone(),
                scan: Some(scan),
            };
            files.insert(take.file.clone(), entry);
        }
        for path in folder.all_files()? {
            if path != MANIFEST && !files.contains_key(&path) {
                let Sealed { file: path, bytes, sha256 } = folder.look(path)?;
                files.insert(path.clone(), FileEntry { path, bytes, sha256, scan: None });
            }
        }
        let done: BTreeSet<Slot> = history.accepted().map(|take| take.slot).collect();
        let open = |slot: &&Slot| !done.contains(slot) && !history.given_up.contains(slot);
        let keys = serde_json::to_vec(&plan.keys).unwrap_or_default();
        Ok(Self {
            format: FORMAT,
            collection: plan.collection,
            name: plan.keys["collection"]["name"].as_str().unwrap_or_default().to_owned(),
            written: Timestamp::now(),
            sonard: env!("CARGO_PKG_VERSION").into(),
            complete: wanted.iter().find(open).is_none(),
            counts: Counts {
                wanted: wanted.len() as u32,
                accepted: done.len() as u32,
                set_aside: history.set_aside().count() as u32,
                given_up: history.given_up.difference(&done).count() as u32,
                beams: history.accepted().map(|take| u64::from(take.figures.beams)).sum(),
                missing: history.accepted().map(|take| u64::from(take.figures.missing)).sum(),
            },
            plan: plan.keys.clone(),
            plan_sha256: super::folder::sha256(&keys),
            scene: plan.scene.clone(),
            sensor_sha256: plan.sensor_sha256.clone(),
            starts: history.starts.clone(),
            poses: history.poses.clone(),
            files: files.into_values().collect(),
        })
    }

    /// Writes it into the folder.
    ///
    /// # Errors
    /// When the disk is full or fails; then the one before is still there.
    pub fn write(&self, folder: &Folder) -> Result<(), FolderError> {
        let text = serde_json::to_string_pretty(self).unwrap_or_default() + "\n";
        folder.write(MANIFEST, text.as_bytes())
    }

    /// Reads a folder's manifest.
    ///
    /// # Errors
    /// When it can't be read, or is none.
    pub fn read(root: &Path) -> Result<Self, FolderError> {
        let path = root.join(MANIFEST);
        let text = fs::read_to_string(&path).map_err(|s| FolderError::io("read", &path, s))?;
        serde_json::from_str(&text).map_err(|error| FolderError::Damaged {
            line: error.line() as u64,
            message: error.to_string(),
            path,
        })
    }
}

/// The result of verifying a collection.
#[derive(Debug, Clone, PartialEq)]
pub struct Verified {
    /// The manifest it was checked against.
    pub manifest: Manifest,
    /// What is wrong, each with the file it is about; empty if all is as it was written.
    pub problems: Vec<String>,
}

/// Checks every file of a collection against its manifest, and every scan as a log.
///
/// # Errors
/// When there is no manifest to check against, or the folder can't be read.
pub fn verify(root: &Path, mut each: impl FnMut()) -> Result<Verified, FolderError> {
    let manifest = Manifest::read(root)?;
    let folder = Folder::at(root);
    let mut problems = Vec::new();
    let listed: BTreeSet<&str> = manifest.files.iter().map(|file| file.path.as_str()).collect();
    for path in folder.all_files()? {
        if path != MANIFEST && !listed.contains(path.as_str()) {
            problems.push(format!("{path}: not in the manifest"));
        }
    }
    let mut seen = BTreeSet::new();
    for file in &manifest.files {
        problems.extend(differs(&folder, file));
        if let Some(scan) = &file.scan {
            if scan.outcome == Outcome::Accepted && !seen.insert(scan.slot) {
                let Slot { pose, repeat } = scan.slot;
                problems.push(format!("{}: pose {pose}, repeat {repeat} twice", file.path));
            }
            problems.extend(scan_problems(&root.join(&file.path), file, scan));
        }
        each();
    }
    if seen.len() as u32 != manifest.counts.accepted {
        let counted = manifest.counts.accepted;
        problems.push(format!("{MANIFEST}: counts {counted} scans and lists {}", seen.len()));
    }
    problems.extend(journal_problems(root, &seen));
    if !manifest.complete {
        problems.push("the collection is not complete: start it again, it goes on".into());
    }
    Ok(Verified { manifest, problems })
}

fn differs(folder: &Folder, file: &FileEntry) -> Option<String> {
    let path = &file.path;
    match folder.look(path.clone()) {
        Err(error) => Some(format!("{path}: {error}")),
        Ok(found) if found.bytes != file.bytes => {
            Some(format!("{path}: {} bytes, {} in the manifest", found.bytes, file.bytes))
        }
        Ok(found) if found.sha256 != file.sha256 => {
            Some(format!("{path}: changed: its SHA-256 is not the manifest's"))
        }
        Ok(_) => None,
    }
}

/// What is wrong with the log of a scan that counts.
fn scan_problems(path: &Path, file: &FileEntry, scan: &ScanEntry) -> Vec<String> {
    if scan.outcome != Outcome::Accepted {
        return Vec::new();
    }
    let Ok(open) = fs::File::open(path) else { return Vec::new() };
    let mut problems = Vec::new();
    let name = &file.path;
    let checked = check(BufReader::new(open), |finding| {
        if finding.severity == Severity::Problem {
            problems.push(format!("{name}: {finding}"));
        }
    });
    match checked {
        Ok(totals) if totals.scans != 1 => {
            problems.push(format!("{name}: {} scans in it", totals.scans));
        }
        Ok(_) => {}
        Err(error) => problems.push(format!("{name}: {error}")),
    }
    let views = load(path).map(|loaded| sonard_records::ScanView::from_records(loaded.records));
    if let Ok(views) = views
        && views.first().map(|view| view.scan) != scan.id
    {
        problems.push(format!("{name}: it holds another scan than the manifest says"));
    }
    problems
}

fn journal_problems(root: &Path, accepted: &BTreeSet<Slot>) -> Vec<String> {
    let history = match read_journal(&root.join(JOURNAL)) {
        Ok(history) => history,
        Err(error) => return vec![error.to_string()],
    };
    let told: BTreeSet<Slot> = history.accepted().map(|take| take.slot).collect();
    told.symmetric_difference(accepted)
        .map(|slot| {
            let Slot { pose, repeat } = slot;
            format!(
                "{JOURNAL}: it does not agree with the manifest on pose {pose}, repeat {repeat}"
            )
        })
        .collect()
}
