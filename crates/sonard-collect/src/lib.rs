//! Unattended collection of scans over days: plan, scan order, checks, folder layout and results.
//!
//! ```text
//!  plan.toml ──> CollectionKeys ──> slots (pose, repeat) ──> one scan at a time
//!                                                               │
//!   taking/p001-r01.jsonl <── records ── Ranger ────────────────┘
//!        │ checks
//!        ├── accepted: renamed into scans/     entry in journal.jsonl, digests in manifest.json
//!        └── rejected or incomplete: renamed into set-aside/, then repeated
//! ```
//!
//! [`collect`] takes the scans with any [`Device`] and reports to a [`Watcher`]. The command
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
mod poses;
mod record_scan;
mod remote_device;
mod repeatability;
mod retry;

pub use checks::{Figures, Finding, check, is_cut, verdict};
pub use device::{Connected, Device, ScanOrder};
pub use engine::{Choices, collect};
pub use error::Halt;
pub use estimate::{budget, disk_bytes};
pub use folder::{Folder, FolderError, INPUTS, JOURNAL, SCANS, SET_ASIDE, Sealed, sha256, stem};
pub use journal::{
    AirBefore, Borrowed, Entry, History, Journal, Outcome, PlanEntry, Started, Take, read_journal,
};
pub use keys::{
    Action, AfterRetakes, AirAction, AskKeys, CheckKeys, CollectionKeys, CollectionSection,
    Conditions, Order, PosesKeys, SceneKeys, SensorKeys,
};
pub use manifest::{Counts, FileEntry, MANIFEST, Manifest, ScanEntry, Verified, verify};
pub use observer::Watcher;
pub use order::{Slot, slots};
pub use plan::{Plan, Poses};
pub use poses::{NamedPose, PoseFault, PoseLine, numbers_of, read_file, read_lines};
pub use record_scan::{Taken, take};
pub use remote_device::{ByDaemon, steps_per_revolution};
pub use repeatability::{BeamSpread, Repeatability, repeatability};
pub use retry::Patience;
