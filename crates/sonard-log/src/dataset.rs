//! A data set on disk: a folder for each shard, and what the set says of itself.
//!
//! A shard counts because its folder `shard-00001` is there: its tables are written into a hidden folder beside that
//! place, brought to the disk, and the folder is renamed, which happens or does not. So processes that were told
//! different shards need nothing of each other, two that were told the same one both end well, and one that was killed
//! leaves nothing that looks whole. Whoever finds all shards there writes `manifest.json` and the data card.

mod draft;
mod error;
mod verify;

use std::{
    collections::{BTreeMap, BTreeSet},
    fs::{self, File},
    io::{self, BufWriter, Write},
    path::{Path, PathBuf},
};

use rayon::prelude::*;
use sonard_generate::{Generator, Manifest, Part, ShardFacts, Table};

use crate::{WholeFile, digest_of, sync_file};
use draft::Draft;
pub use error::DataSetError;

/// The specification with all that it names.
pub const SPECIFICATION: &str = "spec.json";
/// Digests, counts and sums.
pub const MANIFEST: &str = "manifest.json";
/// What the set is, in Markdown.
pub const CARD: &str = "README.md";
/// What a shard says of itself.
const FACTS: &str = "shard.json";

/// The folder of a data set.
#[derive(Debug)]
pub struct DataSet<'a> {
    root: PathBuf,
    generator: &'a Generator,
}

/// Whether a shard had to be made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// It is made now.
    Made,
    /// It was there, or somebody else was faster.
    WasThere,
}

/// How many shards of a part had to be made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PartOutcome {
    /// Those that were made now.
    pub made: usize,
    /// Those that were there.
    pub were_there: usize,
}

impl<'a> DataSet<'a> {
    /// Makes the folder with its specification, as far as it is not there.
    ///
    /// # Errors
    /// When it can't be made, or holds something else than this set.
    pub fn open(root: &Path, generator: &'a Generator) -> Result<Self, DataSetError> {
        fs::create_dir_all(root).map_err(|error| DataSetError::io("make", root, error))?;
        let specification = root.join(SPECIFICATION);
        match fs::read_to_string(&specification) {
            Ok(text) if text == generator.text() => {}
            Ok(_) => return Err(DataSetError::OtherSet { root: root.into() }),
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                if let Some(name) = visible(root)?.into_iter().next() {
                    return Err(DataSetError::Strange { root: root.into(), name });
                }
                write(&specification, generator.text())?;
            }
            Err(error) => return Err(DataSetError::io("read", &specification, error)),
        }
        Ok(Self { root: root.into(), generator })
    }

    /// The specification of the set in a folder.
    ///
    /// # Errors
    /// When there is none.
    pub fn specification(root: &Path) -> Result<Generator, DataSetError> {
        let path = root.join(SPECIFICATION);
        let text =
            fs::read_to_string(&path).map_err(|error| DataSetError::io("read", &path, error))?;
        Ok(Generator::from_json(&path.display().to_string(), &text)?)
    }

    /// A specification from its file: TOML, or what [`SPECIFICATION`] of a set holds. Files that it names lie beside it;
    /// `noted` hears of each.
    ///
    /// # Errors
    /// A file that can't be read, or a fault in it.
    pub fn read_specification(
        path: &Path,
        noted: &dyn Fn(&Path),
    ) -> Result<Generator, DataSetError> {
        let text =
            fs::read_to_string(path).map_err(|error| DataSetError::io("read", path, error))?;
        let name = path.display().to_string();
        if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("json")) {
            return Ok(Generator::from_json(&name, &text)?);
        }
        let beside = path.parent().unwrap_or(Path::new(""));
        let read = |file: &str| {
            let path = beside.join(file);
            noted(&path);
            fs::read_to_string(path)
        };
        Ok(Generator::from_toml(&name, &text, &read)?)
    }

    /// A folder that is only read.
    #[must_use]
    pub fn at(root: &Path, generator: &'a Generator) -> Self {
        Self { root: root.into(), generator }
    }

    /// Makes a shard, from 1, unless it is there; `told` hears how many readings were made since it was told last.
    ///
    /// # Errors
    /// When what is in its place is not that shard, and what the disk refuses.
    pub fn make(&self, shard: u32, told: &dyn Fn(u64)) -> Result<Outcome, DataSetError> {
        if self.facts(shard)?.is_some() {
            return Ok(Outcome::WasThere);
        }
        let place = self.place(shard);
        let made = self.draft(shard, told).and_then(|draft| draft.take_place(&place));
        let outcome = match made {
            Ok(()) => Outcome::Made,
            // Somebody else was faster, and perhaps has cleared away what was left.
            Err(_) if self.facts(shard).is_ok_and(|facts| facts.is_some()) => Outcome::WasThere,
            Err(error) => return Err(error),
        };
        Draft::clear(&self.root);
        Ok(outcome)
    }

    /// Makes the shards of a part, on all threads of the pool that this runs in; `told` as for [`make`](Self::make),
    /// and all readings of a shard that was there.
    ///
    /// # Errors
    /// As for a shard; others that were begun are made first.
    pub fn make_part(
        &self,
        part: Part,
        told: &(dyn Fn(u64) + Sync),
    ) -> Result<PartOutcome, DataSetError> {
        let shards: Vec<u32> = part.shards(self.generator.spec().set.shards).collect();
        let outcomes = shards.par_iter().map(|shard| {
            let outcome = self.make(*shard, told)?;
            if outcome == Outcome::WasThere {
                told(self.generator.readings());
            }
            Ok(outcome)
        });
        let outcomes: Vec<Outcome> = outcomes.collect::<Result<_, DataSetError>>()?;
        let made = outcomes.iter().filter(|outcome| **outcome == Outcome::Made).count();
        Ok(PartOutcome { made, were_there: outcomes.len() - made })
    }

    /// The shards that are not there; of those that are, only the names are looked at.
    ///
    /// # Errors
    /// When the folder can't be read.
    pub fn missing(&self) -> Result<Vec<u32>, DataSetError> {
        let there: BTreeSet<String> = visible(&self.root)?.into_iter().collect();
        Ok(self.shards().filter(|shard| !there.contains(&name(*shard))).collect())
    }

    /// Writes manifest and card if all shards are there; `None` if some are not.
    ///
    /// # Errors
    /// When what is in a shard's place is not that shard, and what the disk refuses.
    pub fn seal(&self) -> Result<Option<Manifest>, DataSetError> {
        let Some(manifest) = self.manifest()? else { return Ok(None) };
        // Who was killed between a shard's rename and clearing up after it has left what no one else looks for.
        Draft::clear(&self.root);
        let text = manifest.to_text();
        let (path, card) = (self.root.join(MANIFEST), self.root.join(CARD));
        // A card that somebody has written on since stays.
        let is_known = fs::read_to_string(&path).is_ok_and(|known| known == text);
        if !(is_known && card.exists()) {
            write(&card, &manifest.card(self.generator))?;
        }
        if !is_known {
            write(&path, &text)?;
        }
        Ok(Some(manifest))
    }

    fn manifest(&self) -> Result<Option<Manifest>, DataSetError> {
        // Every process asks this at its end, and the last shards are made last: one look says no to most.
        if self.shards().rev().any(|shard| !self.place(shard).exists()) {
            return Ok(None);
        }
        let mut all = Vec::new();
        for shard in self.shards() {
            let Some(facts) = self.facts(shard)? else { return Ok(None) };
            all.push(facts);
        }
        Ok(Some(Manifest::new(self.generator, &all)))
    }

    fn shards(&self) -> std::ops::RangeInclusive<u32> {
        1..=self.generator.spec().set.shards
    }

    fn place(&self, shard: u32) -> PathBuf {
        self.root.join(name(shard))
    }

    /// What a shard that is there says of itself; `None` if it is not there. Sizes are looked at, digests are not.
    fn facts(&self, shard: u32) -> Result<Option<ShardFacts>, DataSetError> {
        let place = self.place(shard);
        let path = place.join(FACTS);
        let text = match fs::read_to_string(&path) {
            Ok(text) => text,
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                return match fs::symlink_metadata(&place) {
                    Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
                    _ => Err(DataSetError::NotWhole { path: place, lacks: FACTS.to_owned() }),
                };
            }
            Err(error) => return Err(DataSetError::io("read", &path, error)),
        };
        let facts = ShardFacts::read(self.generator, shard, &text)
            .map_err(|why| DataSetError::Foreign { path: place.clone(), why })?;
        for (file, known) in &facts.files {
            let is = fs::metadata(place.join(file)).map(|metadata| metadata.len()).ok();
            if is != Some(known.bytes) {
                let lacks = format!("{file} of {} bytes", known.bytes);
                return Err(DataSetError::NotWhole { path: place, lacks });
            }
        }
        Ok(Some(facts))
    }

    /// A shard in a folder of its own that has not its place yet.
    fn draft(&self, shard: u32, told: &dyn Fn(u64)) -> Result<Draft, DataSetError> {
        let draft = Draft::begin(&self.root, &name(shard))?;
        let mut create = |table: Table| -> io::Result<Box<dyn Write + Send>> {
            let file = File::create_new(draft.path().join(table.file()))?;
            Ok(Box::new(BufWriter::new(file)))
        };
        let made = self
            .generator
            .shard(shard, &mut create, told)
            .map_err(|error| DataSetError::Shard { shard, error })?;
        let mut files = BTreeMap::new();
        for table in self.generator.tables() {
            let path = draft.path().join(table.file());
            let sealed = digest(&path).map_err(|error| DataSetError::io("write", &path, error))?;
            files.insert(table, sealed);
        }
        let facts = ShardFacts::new(self.generator, shard, &made, &files);
        write(&draft.path().join(FACTS), &facts.to_text())?;
        Ok(draft)
    }
}

/// The name of a shard's folder.
fn name(shard: u32) -> String {
    format!("shard-{shard:05}")
}

/// Names in a folder that are not hidden.
fn visible(root: &Path) -> Result<Vec<String>, DataSetError> {
    let fail = |error| DataSetError::io("read", root, error);
    let mut names = Vec::new();
    for entry in fs::read_dir(root).map_err(fail)? {
        let name = entry.map_err(fail)?.file_name().to_string_lossy().into_owned();
        if !name.starts_with('.') {
            names.push(name);
        }
    }
    names.sort_unstable();
    Ok(names)
}

fn write(path: &Path, text: &str) -> Result<(), DataSetError> {
    WholeFile::write(path, text.as_bytes()).map_err(|error| DataSetError::io("write", path, error))
}

/// Brings a file to the disk; its size and SHA-256.
fn digest(path: &Path) -> io::Result<(u64, String)> {
    let mut file = File::open(path)?;
    sync_file(&file)?;
    digest_of(&mut file)
}

#[cfg(test)]
mod tests;
