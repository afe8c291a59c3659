//! Identity of a shard: specification, number and program version.

use serde::{Deserialize, Serialize};

use crate::{seed::DRAWING, spec::LoadedSpec};

/// Format version of `manifest.json` and `shard.json`.
const FORMAT: u32 = 1;

/// Identity of a shard, as recorded in its files.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct ShardIdentity {
    pub(crate) format: u32,
    /// Version of the program.
    pub(crate) sonard: String,
    /// Version of the sampling procedure.
    pub(crate) sampling_version: u32,
    pub(crate) spec_sha256: String,
    pub(crate) shard: u32,
    pub(crate) of: u32,
}

impl ShardIdentity {
    pub(crate) fn new(loaded: &LoadedSpec, shard: u32) -> Self {
        Self {
            format: FORMAT,
            sonard: env!("CARGO_PKG_VERSION").to_owned(),
            sampling_version: DRAWING,
            spec_sha256: loaded.sha256.clone(),
            shard,
            of: loaded.spec.set.shards,
        }
    }

    /// Serializes the identity for the metadata of tables.
    pub(crate) fn to_json(&self) -> String {
        // Numbers and texts are always serializable as JSON.
        serde_json::to_string(self).unwrap_or_default()
    }
}
