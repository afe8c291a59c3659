//! Which shard of which set something is, and who drew it.

use serde::{Deserialize, Serialize};

use crate::{seed::DRAWING, spec::Loaded};

/// The form of what sets and shards say of themselves.
const FORMAT: u32 = 1;

/// Which shard of which set it is, and who drew it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Summary {
    pub(crate) format: u32,
    /// Version of the program.
    pub(crate) sonard: String,
    /// How the program draws: raised when the same specification draws something else.
    pub(crate) drawing: u32,
    pub(crate) spec_sha256: String,
    pub(crate) shard: u32,
    pub(crate) of: u32,
}

impl Summary {
    pub(crate) fn new(loaded: &Loaded, shard: u32) -> Self {
        Self {
            format: FORMAT,
            sonard: env!("CARGO_PKG_VERSION").to_owned(),
            drawing: DRAWING,
            spec_sha256: loaded.sha256.clone(),
            shard,
            of: loaded.spec.set.shards,
        }
    }

    /// As it stands in the metadata of tables.
    pub(crate) fn remark(&self) -> String {
        // Numbers and texts: there is nothing that JSON has no words for.
        serde_json::to_string(self).unwrap_or_default()
    }
}
