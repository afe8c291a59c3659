//! A shard: so many scenes of a set, and the tables that are made of them.

mod rows;
mod writer;

use std::{
    collections::BTreeMap,
    io::{self, Write},
    sync::Arc,
};

use sonard_export::ExportError;
use sonard_model::{
    geometry::Pose,
    model::{ModelError, Options, Simulator, TooCostly},
    plan::ScanPlan,
};
use thiserror::Error;

use crate::{
    draw::{self, Drawn, Redrawn},
    spec::{Loaded, Spec, SpecError, from_json, from_toml},
    summary::Summary,
    table::Table,
};
use rows::AtPose;
use writer::Tables;

/// Makes the shards of a set.
#[derive(Debug)]
pub struct Generator {
    loaded: Loaded,
    plan: ScanPlan,
    options: Options,
}

/// What a shard came to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Made {
    rows: BTreeMap<Table, u64>,
    /// What did not fit and was drawn again.
    pub redrawn: Redrawn,
}

impl Made {
    /// Rows of a table.
    #[must_use]
    pub fn rows(&self, table: Table) -> u64 {
        self.rows.get(&table).copied().unwrap_or_default()
    }
}

/// Why there is no shard.
#[derive(Debug, Error)]
pub enum ShardError {
    /// Beyond what the set has.
    #[error("there is no shard {number}: the set has {of}")]
    Number {
        /// The one asked for.
        number: u32,
        /// How many there are.
        of: u32,
    },
    /// Nothing that was drawn fits.
    #[error("scene {scene} of the set: {why}")]
    DoesNotFit {
        /// Number of the scene.
        scene: u64,
        /// In words, with what would be right.
        why: String,
    },
    /// What was drawn is nothing that the model takes.
    #[error("scene {scene} of the set: {error}")]
    Model {
        /// Number of the scene.
        scene: u64,
        /// Why.
        error: ModelError,
    },
    /// A table can't be written.
    #[error(transparent)]
    Write(#[from] io::Error),
}

impl From<ExportError> for ShardError {
    fn from(error: ExportError) -> Self {
        match error {
            ExportError::Write(error) => Self::Write(error),
            other => Self::Write(io::Error::other(other)),
        }
    }
}

/// Poses of a scene that are given up at most because their paths are too many.
const MOST_COSTLY: u32 = 100;

impl Generator {
    /// From a specification's text (TOML); `file` is what errors call it, `read` gives the texts of scenes and
    /// sensors that are no shipped ones.
    ///
    /// # Errors
    /// The first fault, with its place and what would be right.
    pub fn from_toml(
        file: &str,
        text: &str,
        read: &dyn Fn(&str) -> io::Result<String>,
    ) -> Result<Self, SpecError> {
        from_toml(file, text, read).map(Self::of)
    }

    /// From what [`text`](Self::text) gave.
    ///
    /// # Errors
    /// The first fault.
    pub fn from_json(file: &str, text: &str) -> Result<Self, SpecError> {
        from_json(file, text).map(Self::of)
    }

    fn of(loaded: Loaded) -> Self {
        let (plan, options) =
            (ScanPlan::from(&loaded.spec.plan), loaded.spec.model.options_of_engine());
        Self { loaded, plan, options }
    }

    /// The specification.
    #[must_use]
    pub const fn spec(&self) -> &Spec {
        &self.loaded.spec
    }

    /// The specification with everything that it names, as JSON: whoever has it has the set.
    #[must_use]
    pub fn text(&self) -> &str {
        &self.loaded.text
    }

    /// SHA-256 of that, hexadecimal: what shards name their specification by.
    #[must_use]
    pub fn sha256(&self) -> &str {
        &self.loaded.sha256
    }

    pub(crate) fn summary(&self, shard: u32) -> Summary {
        Summary::new(&self.loaded, shard)
    }

    /// The tables of each shard.
    #[must_use]
    pub fn tables(&self) -> Vec<Table> {
        Table::of(self.spec())
    }

    /// Readings of a shard, for whoever shows how far it is.
    #[must_use]
    pub fn readings(&self) -> u64 {
        let set = &self.spec().set;
        u64::from(set.scenes) * u64::from(set.poses) * u64::from(self.plan.beams())
    }

    /// Writes the tables of a shard, from 1, each to what `create` gives for it; `told` hears how many readings were
    /// made since it was told last.
    ///
    /// # Errors
    /// When there is no such shard, when nothing that is drawn fits (then it never does), and what the output refuses.
    pub fn shard(
        &self,
        number: u32,
        create: &mut dyn FnMut(Table) -> io::Result<Box<dyn Write + Send>>,
        told: &dyn Fn(u64),
    ) -> Result<Made, ShardError> {
        let set = &self.spec().set;
        if !(1..=set.shards).contains(&number) {
            return Err(ShardError::Number { number, of: set.shards });
        }
        let mut tables = Tables::create(self.spec(), &self.summary(number).remark(), create)?;
        let (mut redrawn, mut known) = (Redrawn::default(), None);
        let before = u64::from(number - 1) * u64::from(set.scenes);
        for scene in (1..=u64::from(set.scenes)).map(|scene| before + scene) {
            let mut drawn = draw::scene(&self.loaded, scene)
                .map_err(|why| ShardError::DoesNotFit { scene, why: why.to_owned() })?;
            let simulator = self.simulator(&drawn, &mut known)?;
            self.write_scene(&mut drawn, simulator, &mut tables, told)?;
            redrawn += drawn.redrawn;
        }
        Ok(Made { rows: tables.finish()?, redrawn })
    }

    /// The ranger in a drawn scene; what does not change from scene to scene is taken over from the last.
    fn simulator<'a>(
        &self,
        drawn: &Drawn,
        known: &'a mut Option<Simulator>,
    ) -> Result<&'a Simulator, ShardError> {
        let mut sensor = self.loaded.sensors[drawn.sensor].clone();
        if drawn.sensor_z_m.is_some() {
            sensor.mounting.z_m = drawn.sensor_z_m;
        }
        let scene = Arc::clone(&drawn.scene);
        let made = match known.take() {
            Some(known) if *known.sensor() == sensor && *known.air() == drawn.air => {
                known.in_scene(scene)
            }
            _ => Simulator::new(scene, sensor, drawn.air, self.options),
        };
        let made = made.map_err(|error| ShardError::Model { scene: drawn.number, error })?;
        Ok(known.insert(made))
    }

    fn write_scene(
        &self,
        drawn: &mut Drawn,
        simulator: &Simulator,
        tables: &mut Tables,
        told: &dyn Fn(u64),
    ) -> Result<(), ShardError> {
        tables.scene(drawn, simulator)?;
        let mut heard_at = Vec::with_capacity(drawn.poses.len());
        for number in 1..=drawn.poses.len() as u32 {
            let at = self.listen(drawn, number, simulator)?;
            tables.pose(simulator, &at)?;
            told(at.heard.len() as u64);
            heard_at.push(at.pose.position());
        }
        tables.truth(drawn, &heard_at)
    }

    /// What is heard at a pose of a scene, by its number; at another one if that has too many paths.
    fn listen(
        &self,
        drawn: &mut Drawn,
        number: u32,
        simulator: &Simulator,
    ) -> Result<AtPose, ShardError> {
        let mut pose: Pose = drawn.poses[number as usize - 1];
        let mut last: Option<TooCostly> = None;
        for _ in 0..=MOST_COSTLY {
            let of = (drawn.number, number);
            match AtPose::listen(&self.loaded, of, &drawn.noise, simulator, pose, &self.plan) {
                Ok(at) => return Ok(at),
                Err(error) => last = Some(error),
            }
            drawn.redrawn.costly += 1;
            match draw::another_pose(&self.loaded, drawn) {
                Some(other) => pose = other,
                None => break,
            }
        }
        let why = last.map_or_else(String::new, |error| error.to_string());
        Err(ShardError::DoesNotFit { scene: drawn.number, why })
    }
}
