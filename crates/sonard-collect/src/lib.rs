//! Unattended collection of scans over days: plan, scan order, checks, folder layout and results.
//!
//! ```text
//!  plan.toml ──> CollectionKeys ──> slots (pose, repeat) ──> one scan at a time
//!                                                                    │
//!   in-progress/p001-r01.jsonl <── records ── Ranger ────────────────┘
//!        │ checks
//!        ├── accepted: renamed into scans/     entry in journal.jsonl, digests in manifest.json
//!        └── rejected or incomplete: renamed into rejected/, then repeated
//! ```
//!
//! [`collect`] takes the scans with any [`ScanDevice`] and reports to a [`Observer`]. The command
//! `sonard collect` adds options, terminal and figures.
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![warn(clippy::expect_used, clippy::indexing_slicing, clippy::panic)]

mod checks;
mod device;
mod engine;
mod error;
mod estimate;
mod folder;
mod journal;
mod keys;
mod manifest;
mod observer;
mod order;
mod plan;
mod plan_changes;
mod pose_source;
mod record_scan;
mod remote_device;
mod repeatability;
mod retry;

pub use checks::{CheckFinding, ScanFigures, check_figures, ended_early, strongest_action};
pub use device::{ConnectedDevice, ScanDevice, ScanTask};
pub use engine::{RunOptions, collect};
pub use error::CollectError;
pub use estimate::{budget, disk_bytes};
pub use folder::{
    CollectionFolder, FolderError, INPUTS, JOURNAL, REJECTED, SealedFile, scan_stem, sha256,
};
pub use journal::{
    CollectionHistory, CollectionJournal, JournalEntry, PlanEntry, RunStart, SavedAir,
    SavedSettings, ScanAttempt, ScanOutcome, read_journal,
};
pub use keys::{
    Action, AfterRetakes, AirAction, AskKeys, CheckKeys, CollectionKeys, CollectionSection, Order,
    PosesKeys, SceneKeys, SensorKeys,
};
pub use manifest::{
    CollectionCounts, CollectionManifest, FileEntry, MANIFEST, ScanEntry, Verification,
    verify_collection,
};
pub use observer::Observer;
pub use order::{Slot, slots};
pub use plan::{CollectionPlan, Poses};
pub use record_scan::{RecordedScan, record_scan};
pub use remote_device::{RemoteDevice, steps_per_revolution};
pub use repeatability::{BeamSpread, Repeatability, repeatability};
pub use retry::RetrySchedule;
pub use sonard_import::poses::{Conditions, NamedPose, PoseFault, find_numbers, parse_pose_file};
pub use sonard_log::COLLECTED_SCANS as SCANS;
