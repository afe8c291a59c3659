//! Manifest of a collection: files with digests, and their verification.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    io::BufReader,
    path::Path,
};

use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use sonard_import::poses::NamedPose;
use sonard_log::{Severity, check_log, load};
use sonard_records::SceneRef;
use uuid::Uuid;

use super::{
    folder::{CollectionFolder, FolderError, JOURNAL, SealedFile},
    journal::{CollectionHistory, RunStart, ScanOutcome, read_journal},
    order::Slot,
};

/// File name of the manifest.
pub const MANIFEST: &str = "manifest.json";
/// Format version of the manifest.
const FORMAT: u32 = 1;

/// Contents of a collection, with a digest per file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CollectionManifest {
    /// Format version of the manifest.
    pub format: u32,
    /// Identifier of the collection.
    pub collection: Uuid,
    /// Name of the collection.
    pub name: String,
    /// Time at which the manifest was written.
    pub written: Timestamp,
    /// Version of `sonard` that wrote the file.
    pub sonard: String,
    /// `true` if every scan of the plan is accepted or given up.
    pub complete: bool,
    /// Numbers of scans and beams.
    pub counts: CollectionCounts,
    /// Effective values of all keys of the plan.
    pub plan: Value,
    /// SHA-256 of the plan's keys as compact JSON, hexadecimal.
    pub plan_sha256: String,
    /// Scene with its digest.
    pub scene: SceneRef,
    /// SHA-256 of the sensor's data, hexadecimal.
    pub sensor_sha256: String,
    /// Starts of runs, with the identified device and the entered conditions.
    pub starts: Vec<RunStart>,
    /// Poses by their number, from 1.
    pub poses: BTreeMap<u32, NamedPose>,
    /// All files except the manifest.
    pub files: Vec<FileEntry>,
}

/// Numbers of scans by outcome, and of beams.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct CollectionCounts {
    /// Scans requested by the plan, for all known poses.
    pub wanted: u32,
    /// Number of accepted scans.
    pub accepted: u32,
    /// Incomplete and rejected scans in `rejected/`.
    pub set_aside: u32,
    /// Scans that are not repeated any more.
    pub given_up: u32,
    /// Beams of the accepted scans.
    pub beams: u64,
    /// Beams of the accepted scans without a usable reading.
    pub missing: u64,
}

/// File of a collection.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FileEntry {
    /// Path relative to the collection's folder.
    pub path: String,
    /// File size, bytes.
    pub bytes: u64,
    /// SHA-256 of the file, hexadecimal.
    pub sha256: String,
    /// Scan in the file, if any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scan: Option<ScanEntry>,
}

/// Scan in a file of the collection.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct ScanEntry {
    /// Pose and repeat of the scan.
    #[serde(flatten)]
    pub slot: Slot,
    /// Identifier of the scan in records.
    pub id: Option<Uuid>,
    /// Outcome of the scan.
    pub outcome: ScanOutcome,
    /// Beams of the scan plan.
    pub beams: u32,
    /// Beams without a usable reading.
    pub missing: u32,
}

impl CollectionManifest {
    /// Builds the manifest of a folder. Digests of scans are those of the journal, computed at
    /// acceptance; other files are read.
    ///
    /// # Errors
    /// Returns an error if a file cannot be read or the journal has no plan.
    pub fn from_history(
        folder: &CollectionFolder,
        history: &CollectionHistory,
    ) -> Result<Self, FolderError> {
        let requested = history.requested();
        let plan = history.plans.last().ok_or_else(|| FolderError::Damaged {
            path: folder.journal(),
            line: 1,
            message: "the journal has no plan".into(),
        })?;
        let mut files = BTreeMap::new();
        for take in &history.attempts {
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
                let SealedFile { file: path, bytes, sha256 } = folder.digest_of_file(path)?;
                files.insert(path.clone(), FileEntry { path, bytes, sha256, scan: None });
            }
        }
        let done: BTreeSet<Slot> = history.accepted().map(|take| take.slot).collect();
        let open = |slot: &&Slot| !done.contains(slot) && !history.given_up.contains(slot);
        let name = plan.keys.get("collection").and_then(|keys| keys.get("name")?.as_str());
        let keys = serde_json::to_vec(&plan.keys).unwrap_or_default();
        Ok(Self {
            format: FORMAT,
            collection: plan.collection,
            name: name.unwrap_or_default().to_owned(),
            written: Timestamp::now(),
            sonard: env!("CARGO_PKG_VERSION").into(),
            complete: requested.iter().find(open).is_none(),
            counts: CollectionCounts {
                wanted: requested.len() as u32,
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

    /// Writes the manifest into the folder, replacing it atomically.
    ///
    /// # Errors
    /// Returns an error if the disk is full or fails; the previous manifest is then kept.
    pub fn write(&self, folder: &CollectionFolder) -> Result<(), FolderError> {
        let text = serde_json::to_string_pretty(self).unwrap_or_default() + "\n";
        folder.write(MANIFEST, text.as_bytes())
    }

    /// Reads the manifest of a folder.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read or is not a manifest.
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

/// Result of verifying a collection.
#[derive(Debug, Clone, PartialEq)]
pub struct Verification {
    /// Manifest that the files were compared with.
    pub manifest: CollectionManifest,
    /// Problems, each with its file; empty if the collection is intact.
    pub problems: Vec<String>,
}

/// Verifies every file of a collection against its manifest, and checks every scan's log. Calls
/// `each` after each file.
///
/// # Errors
/// Returns an error if the manifest or the folder cannot be read.
pub fn verify_collection(root: &Path, mut each: impl FnMut()) -> Result<Verification, FolderError> {
    let manifest = CollectionManifest::read(root)?;
    let folder = CollectionFolder::existing(root);
    let mut problems = Vec::new();
    let listed: BTreeSet<&str> = manifest.files.iter().map(|file| file.path.as_str()).collect();
    for path in folder.all_files()? {
        if path != MANIFEST && !listed.contains(path.as_str()) {
            problems.push(format!("{path}: not in the manifest"));
        }
    }
    let mut seen = BTreeSet::new();
    for file in &manifest.files {
        problems.extend(difference(&folder, file));
        if let Some(scan) = &file.scan {
            if scan.outcome == ScanOutcome::Accepted && !seen.insert(scan.slot) {
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
        problems.push("the collection is not complete: run the same command to resume".into());
    }
    Ok(Verification { manifest, problems })
}

fn difference(folder: &CollectionFolder, file: &FileEntry) -> Option<String> {
    let path = &file.path;
    match folder.digest_of_file(path.clone()) {
        Err(error) => Some(format!("{path}: {error}")),
        Ok(found) if found.bytes != file.bytes => {
            Some(format!("{path}: {} bytes, {} in the manifest", found.bytes, file.bytes))
        }
        Ok(found) if found.sha256 != file.sha256 => {
            Some(format!("{path}: changed: its SHA-256 differs from the manifest"))
        }
        Ok(_) => None,
    }
}

/// Problems in the log of an accepted scan.
fn scan_problems(path: &Path, file: &FileEntry, scan: &ScanEntry) -> Vec<String> {
    if scan.outcome != ScanOutcome::Accepted {
        return Vec::new();
    }
    let Ok(open) = fs::File::open(path) else { return Vec::new() };
    let mut problems = Vec::new();
    let name = &file.path;
    let checked = check_log(BufReader::new(open), |finding| {
        if finding.severity == Severity::Problem {
            problems.push(format!("{name}: {finding}"));
        }
    });
    match checked {
        Ok(totals) if totals.scans != 1 => {
            problems.push(format!("{name}: contains {} scans", totals.scans));
        }
        Ok(_) => {}
        Err(error) => problems.push(format!("{name}: {error}")),
    }
    let views = load(path).map(|loaded| sonard_records::ScanView::from_records(loaded.records));
    if let Ok(views) = views
        && views.first().map(|view| view.scan) != scan.id
    {
        problems.push(format!("{name}: the scan's id differs from the manifest"));
    }
    problems
}

fn journal_problems(root: &Path, accepted: &BTreeSet<Slot>) -> Vec<String> {
    let history = match read_journal(&root.join(JOURNAL)) {
        Ok(history) => history,
        Err(error) => return vec![error.to_string()],
    };
    let journaled: BTreeSet<Slot> = history.accepted().map(|take| take.slot).collect();
    journaled
        .symmetric_difference(accepted)
        .map(|slot| {
            let Slot { pose, repeat } = slot;
            format!("{JOURNAL}: differs from the manifest in pose {pose}, repeat {repeat}")
        })
        .collect()
}
