//! What a set and its shards say of themselves beside their tables.

mod card;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::{
    draw::Redrawn,
    seed::sha256,
    shard::{Generator, Made},
    summary::Summary,
    table::Table,
};

/// A file of a shard.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FileFacts {
    /// Rows of the table.
    pub rows: u64,
    /// Size, bytes.
    pub bytes: u64,
    /// SHA-256, hexadecimal.
    pub sha256: String,
}

/// What `shard.json` says of a shard.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ShardFacts {
    #[serde(flatten)]
    summary: Summary,
    /// What did not fit and was drawn again.
    pub redrawn: Redrawn,
    /// Its files by name.
    pub files: BTreeMap<String, FileFacts>,
}

/// Why a file about a set or a shard is not one of this set.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum ManifestError {
    /// Not such a file.
    #[error("it is no description of a shard: {0}")]
    Form(String),
    /// Of another specification.
    #[error(
        "it is of another specification (its SHA-256 begins with {found}, this one's with {wanted})"
    )]
    Specification {
        /// The beginning of what it names.
        found: String,
        /// The beginning of what it should name.
        wanted: String,
    },
    /// Of another version.
    #[error("it is by sonard {found}, this is {wanted}: their readings may differ")]
    Version {
        /// The version that it names.
        found: String,
        /// This one.
        wanted: String,
    },
    /// Of another number.
    #[error("it is shard {found}, not {wanted}")]
    Number {
        /// The one that it names.
        found: u32,
        /// The one that it should name.
        wanted: u32,
    },
    /// Not the tables that the specification asks for.
    #[error("it lists other files than the specification asks for")]
    Files,
}

impl ShardFacts {
    /// Of a shard that was made, its tables with their sizes and digests.
    #[must_use]
    pub fn new(
        generator: &Generator,
        shard: u32,
        made: &Made,
        files: &BTreeMap<Table, (u64, String)>,
    ) -> Self {
        let facts = |(table, (bytes, sha256)): (&Table, &(u64, String))| {
            let facts =
                FileFacts { rows: made.rows(*table), bytes: *bytes, sha256: sha256.clone() };
            (table.file().to_owned(), facts)
        };
        Self {
            summary: generator.summary(shard),
            redrawn: made.redrawn,
            files: files.iter().map(facts).collect(),
        }
    }

    /// From the text of `shard.json`, if it is that shard of that set, drawn as this program draws.
    ///
    /// # Errors
    /// Why it is not.
    pub fn read(generator: &Generator, shard: u32, text: &str) -> Result<Self, ManifestError> {
        let facts: Self =
            serde_json::from_str(text).map_err(|error| ManifestError::Form(error.to_string()))?;
        let (found, wanted) = (&facts.summary, generator.summary(shard));
        let head = |sha256: &str| sha256.chars().take(12).collect();
        if found.spec_sha256 != wanted.spec_sha256 {
            return Err(ManifestError::Specification {
                found: head(&found.spec_sha256),
                wanted: head(&wanted.spec_sha256),
            });
        }
        let drawn_by = |of: &Summary| format!("{} (drawing {})", of.sonard, of.drawing);
        if (&found.sonard, found.drawing, found.format)
            != (&wanted.sonard, wanted.drawing, wanted.format)
        {
            return Err(ManifestError::Version {
                found: drawn_by(found),
                wanted: drawn_by(&wanted),
            });
        }
        if found.shard != wanted.shard {
            return Err(ManifestError::Number { found: found.shard, wanted: wanted.shard });
        }
        let tables = generator.tables();
        let is_listed = |table: &Table| facts.files.contains_key(table.file());
        match facts.files.len() == tables.len() && tables.iter().all(is_listed) {
            true => Ok(facts),
            false => Err(ManifestError::Files),
        }
    }

    /// Its text.
    #[must_use]
    pub fn to_text(&self) -> String {
        serde_json::to_string_pretty(self).unwrap_or_default() + "\n"
    }
}

/// What `manifest.json` says of a whole set. It hangs on nothing but the set, so that whoever makes the last shard, and
/// be it two at once, writes the same.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Manifest {
    format: u32,
    name: String,
    about: String,
    sonard: String,
    drawing: u32,
    /// SHA-256 of `spec.json`.
    spec_sha256: String,
    /// How many shards.
    pub shards: u32,
    /// Over all shards.
    pub totals: Totals,
    /// The digest of the set: of the names and digests of all its files, a line each.
    pub sha256: String,
    /// By shard.
    files: Vec<ShardFiles>,
}

/// Sums over all shards.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct Totals {
    /// Rows by table.
    pub rows: BTreeMap<Table, u64>,
    /// Size, bytes.
    pub bytes: u64,
    /// What did not fit and was drawn again.
    pub redrawn: Redrawn,
}

#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
struct ShardFiles {
    shard: u32,
    redrawn: Redrawn,
    files: BTreeMap<String, FileFacts>,
}

impl Manifest {
    /// Of a set that is whole: the facts of its shards, in their order.
    #[must_use]
    pub fn new(generator: &Generator, shards: &[ShardFacts]) -> Self {
        let summary = generator.summary(1);
        let mut totals = Totals::default();
        let mut lines = String::new();
        for facts in shards {
            totals.redrawn += facts.redrawn;
            for table in generator.tables() {
                let Some(file) = facts.files.get(table.file()) else { continue };
                *totals.rows.entry(table).or_default() += file.rows;
                totals.bytes += file.bytes;
                lines += &format!("{} {} {}\n", facts.summary.shard, table.file(), file.sha256);
            }
        }
        let set = &generator.spec().set;
        Self {
            format: summary.format,
            name: set.name.clone(),
            about: set.about.clone(),
            sonard: summary.sonard,
            drawing: summary.drawing,
            spec_sha256: summary.spec_sha256,
            shards: set.shards,
            totals,
            sha256: sha256(lines.as_bytes()),
            files: shards
                .iter()
                .map(|facts| ShardFiles {
                    shard: facts.summary.shard,
                    redrawn: facts.redrawn,
                    files: facts.files.clone(),
                })
                .collect(),
        }
    }

    /// Its text.
    #[must_use]
    pub fn to_text(&self) -> String {
        serde_json::to_string_pretty(self).unwrap_or_default() + "\n"
    }

    /// The data card, in Markdown: what the set is, how it was made, and what its columns mean.
    #[must_use]
    pub fn card(&self, generator: &Generator) -> String {
        card::card(self, generator)
    }
}
