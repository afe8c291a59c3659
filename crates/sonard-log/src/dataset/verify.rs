//! Whether a set is what it says.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    io::{self, Write},
    sync::{Arc, Mutex, PoisonError},
};

use sha2::{Digest as _, Sha256};
use sonard_generate::{ShardFacts, Table};

use super::{CARD, DataSet, DataSetError, MANIFEST, SPECIFICATION, digest, name, visible};
use crate::hexadecimal;

impl DataSet<'_> {
    /// Holds a shard that is there against the digests that it names; what is wrong, in words.
    ///
    /// # Errors
    /// None: what can't be read is what is wrong.
    #[must_use]
    pub fn check_digests(&self, shard: u32) -> Vec<String> {
        let facts = match self.facts(shard) {
            Ok(Some(facts)) => facts,
            Ok(None) => return vec![format!("{} is missing", name(shard))],
            Err(error) => return vec![error.to_string()],
        };
        let place = self.place(shard);
        let differs = |(file, known): (&String, &sonard_generate::FileFacts)| {
            let shown = format!("{}/{file}", name(shard));
            match digest(&place.join(file)) {
                Err(error) => Some(format!("{shown}: {error}")),
                Ok((_, found)) if found != known.sha256 => {
                    Some(format!("{shown}: its SHA-256 is not the one in shard.json"))
                }
                Ok(_) => None,
            }
        };
        facts.files.iter().filter_map(differs).collect()
    }

    /// Draws a shard that is there anew and holds the digests against each other; what is wrong, in words. `told`
    /// as for [`make`](Self::make).
    ///
    /// # Errors
    /// When it can't be drawn.
    pub fn check_again(&self, shard: u32, told: &dyn Fn(u64)) -> Result<Vec<String>, DataSetError> {
        let Some(facts) = self.facts(shard)? else { return Ok(Vec::new()) };
        let mut hashes: BTreeMap<Table, Hasher> = BTreeMap::new();
        let mut create = |table| -> io::Result<Box<dyn Write + Send>> {
            Ok(Box::new(hashes.entry(table).or_default().clone()))
        };
        let made = self
            .generator
            .shard(shard, &mut create, told)
            .map_err(|error| DataSetError::Shard { shard, error })?;
        let files = hashes.iter().map(|(table, hash)| (*table, hash.sealed())).collect();
        let again = ShardFacts::new(self.generator, shard, &made, &files);
        let differs = |(file, anew): (&String, &sonard_generate::FileFacts)| {
            let is_same = facts.files.get(file) == Some(anew);
            (!is_same).then(|| format!("{}/{file}: drawn anew it is another one", name(shard)))
        };
        Ok(again.files.iter().filter_map(differs).collect())
    }

    /// What is wrong with the set as a whole, in words: its manifest, and what does not belong there.
    ///
    /// # Errors
    /// When the folder can't be read.
    pub fn check_manifest(&self) -> Result<Vec<String>, DataSetError> {
        let mut problems = Vec::new();
        let known: BTreeSet<String> = self.shards().map(name).collect();
        for found in visible(&self.root)? {
            let belongs = [SPECIFICATION, MANIFEST, CARD].contains(&&*found);
            if !belongs && !known.contains(&found) {
                problems.push(format!("{found}: it is no part of the set"));
            }
        }
        // A shard that is not as it should be is told by itself.
        let Ok(manifest) = self.manifest() else { return Ok(problems) };
        let written = fs::read_to_string(self.root.join(MANIFEST)).ok();
        match (manifest, written) {
            (Some(manifest), Some(written)) if written != manifest.to_text() => {
                problems.push(format!("{MANIFEST}: it does not say what the shards say"));
            }
            (Some(_), None) => problems.push(format!("{MANIFEST} is missing")),
            _ => {}
        }
        Ok(problems)
    }
}

/// Takes a table for its digest alone.
#[derive(Debug, Clone, Default)]
struct Hasher(Arc<Mutex<(u64, Sha256)>>);

impl Hasher {
    fn sealed(&self) -> (u64, String) {
        let held = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        (held.0, hexadecimal(&held.1.clone().finalize()))
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
