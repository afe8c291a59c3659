//! Verification of a data set.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    io::{self, Write},
    sync::{Arc, Mutex, PoisonError},
};

use sha2::{Digest as _, Sha256};
use sonard_generate::{ShardFacts, ShardTable};

use super::{
    CARD, DataSet, DataSetError, MANIFEST, SPECIFICATION, shard_name, sync_and_digest,
    visible_names,
};
use crate::to_hex;

impl DataSet<'_> {
    /// Compares the files of a shard with its recorded digests; returns a message per problem.
    ///
    /// # Errors
    /// Unreadable files are reported as problems.
    #[must_use]
    pub fn check_digests(&self, shard: u32) -> Vec<String> {
        let facts = match self.facts(shard) {
            Ok(Some(facts)) => facts,
            Ok(None) => return vec![format!("{} is missing", shard_name(shard))],
            Err(error) => return vec![error.to_string()],
        };
        let folder = self.shard_path(shard);
        let difference = |(file, known): (&String, &sonard_generate::FileFacts)| {
            let shown = format!("{}/{file}", shard_name(shard));
            match sync_and_digest(&folder.join(file)) {
                Err(error) => Some(format!("{shown}: {error}")),
                Ok((_, found)) if found != known.sha256 => {
                    Some(format!("{shown}: its SHA-256 differs from shard.json"))
                }
                Ok(_) => None,
            }
        };
        facts.files.iter().filter_map(difference).collect()
    }

    /// Regenerates an existing shard and compares the digests; returns a message per problem.
    /// `progress` is called as by [`generate`](Self::generate).
    ///
    /// # Errors
    /// Returns an error if the shard cannot be generated.
    pub fn check_regenerated(
        &self,
        shard: u32,
        progress: &dyn Fn(u64),
    ) -> Result<Vec<String>, DataSetError> {
        let Some(facts) = self.facts(shard)? else { return Ok(Vec::new()) };
        let mut hashes: BTreeMap<ShardTable, Hasher> = BTreeMap::new();
        let mut create = |table| -> io::Result<Box<dyn Write + Send>> {
            Ok(Box::new(hashes.entry(table).or_default().clone()))
        };
        let made = self
            .generator
            .shard(shard, &mut create, progress)
            .map_err(|error| DataSetError::Shard { shard, error })?;
        let files = hashes.iter().map(|(table, hash)| (*table, hash.digest())).collect();
        let regenerated = ShardFacts::new(self.generator, shard, &made, &files);
        let difference = |(file, expected): (&String, &sonard_generate::FileFacts)| {
            let is_same = facts.files.get(file) == Some(expected);
            (!is_same)
                .then(|| format!("{}/{file}: differs from the regenerated file", shard_name(shard)))
        };
        Ok(regenerated.files.iter().filter_map(difference).collect())
    }

    /// Checks the manifest and looks for foreign files; returns a message per problem.
    ///
    /// # Errors
    /// Returns an error if the folder cannot be read.
    pub fn check_manifest(&self) -> Result<Vec<String>, DataSetError> {
        let mut problems = Vec::new();
        let known: BTreeSet<String> = self.shards().map(shard_name).collect();
        for found in visible_names(&self.root)? {
            let belongs = [SPECIFICATION, MANIFEST, CARD].contains(&&*found);
            if !belongs && !known.contains(&found) {
                problems.push(format!("{found}: not part of the set"));
            }
        }
        // Damaged shards are reported by `check_digests`.
        let Ok(manifest) = self.manifest() else { return Ok(problems) };
        let written = fs::read_to_string(self.root.join(MANIFEST)).ok();
        match (manifest, written) {
            (Some(manifest), Some(written)) if written != manifest.to_text() => {
                problems.push(format!("{MANIFEST}: differs from the shards"));
            }
            (Some(_), None) => problems.push(format!("{MANIFEST} is missing")),
            _ => {}
        }
        Ok(problems)
    }
}

/// Output that only computes size and digest.
#[derive(Debug, Clone, Default)]
struct Hasher(Arc<Mutex<(u64, Sha256)>>);

impl Hasher {
    fn digest(&self) -> (u64, String) {
        let held = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        (held.0, to_hex(&held.1.clone().finalize()))
    }
}

impl Write for Hasher {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let mut held = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        held.0 += bytes.len() as u64;
        held.1.update(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
