//! A collection of scans that is taken over days and can be trusted: plan, order, checks, what lies
//! where on the disk, and what came of it.
//!
//! ```text
//!  plan.toml ──> CollectionKeys ──> slots (pose, repeat) ──> one scan at a time
//!                                                               │
//!   taking/p001-r01.jsonl <── records ── Ranger ────────────────┘
//!        │ checks
//!        ├── accepted: renamed into scans/        journal.jsonl says so, manifest.json has the sums
//!        └── refused or cut: into set-aside/, and taken again
//! ```
//!
//! [`collect`] takes the scans with any [`Device`] while a [`Watcher`] looks on; options, the terminal and
//! the pictures are `sonard collect`'s.
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod by_daemon;
mod changes;
mod checks;
mod device;
mod engine;
mod estimate;
mod folder;
mod halt;
mod journal;
mod keys;
mod manifest;
mod order;
mod patience;
mod plan;
mod poses;
mod repeatability;
mod source;
mod taking;
mod watcher;

pub use by_daemon::{ByDaemon, steps_per_revolution};
pub use checks::{Figures, Finding, check, is_cut, verdict};
pub use device::{Connected, Device, ScanOrder};
pub use engine::{Choices, collect};
pub use estimate::{budget, disk_bytes};
pub use folder::{Folder, FolderError, INPUTS, JOURNAL, SCANS, SET_ASIDE, Sealed, sha256, stem};
pub use halt::Halt;
pub use journal::{
    AirBefore, Borrowed, Entry, History, Journal, Outcome, PlanEntry, Started, Take, read_journal,
};
pub use keys::{
    Action, AfterRetakes, AirAction, AskKeys, CheckKeys, CollectionKeys, CollectionSection,
    Conditions, Order, PosesKeys, SceneKeys, SensorKeys,
};
pub use manifest::{Counts, FileEntry, MANIFEST, Manifest, ScanEntry, Verified, verify};
pub use order::{Slot, slots};
pub use patience::Patience;
pub use plan::{Plan, Poses};
pub use poses::{NamedPose, PoseFault, PoseLine, numbers_of, read_file, read_lines};
pub use repeatability::{BeamSpread, Repeatability, repeatability};
pub use taking::{Taken, take};
pub use watcher::Watcher;
