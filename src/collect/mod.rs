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
//! Taking the scans, asking people and programs, and the pictures are `sonard collect`'s; here is
//! what can be tested without them.

mod checks;
mod folder;
mod journal;
mod keys;
mod manifest;
mod order;
mod poses;
mod repeatability;

pub use checks::{Figures, Finding, check, is_cut, verdict};
pub use folder::{Folder, FolderError, INPUTS, JOURNAL, SCANS, SET_ASIDE, Sealed, sha256, stem};
pub use journal::{
    AirBefore, Borrowed, Entry, History, Journal, Outcome, PlanEntry, Started, Take, read_journal,
};
pub use keys::{
    Action, AfterRetakes, AirAction, AskKeys, CheckKeys, CollectionAirKeys, CollectionKeys,
    CollectionSection, Conditions, Order, PosesKeys, SceneKeys, SensorKeys,
};
pub use manifest::{Counts, FileEntry, MANIFEST, Manifest, ScanEntry, Verified, verify};
pub use order::{Slot, slots};
pub use poses::{NamedPose, PoseFault, PoseLine, numbers_of, read_file, read_lines};
pub use repeatability::{BeamSpread, Repeatability, repeatability};
