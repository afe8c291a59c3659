//! Generation of a shard: its scenes, and the tables of their readings.

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
    scan_plan::ScanPlan,
};
use thiserror::Error;

use crate::{
    sample::{self, RejectedDraws, SampledScene},
    spec::{LoadedSpec, Spec, SpecError, from_json, from_toml},
    summary::ShardIdentity,
    table::ShardTable,
};
use rows::PoseReadings;
use writer::TableWriter;

/// Generator of the shards of a set.
#[derive(Debug)]
pub struct Generator {
    loaded: LoadedSpec,
    plan: ScanPlan,
    options: Options,
}

/// Numbers of rows and rejected draws of a generated shard.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ShardCounts {
    rows: BTreeMap<ShardTable, u64>,
    /// Numbers of rejected draws.
    pub redrawn: RejectedDraws,
}

impl ShardCounts {
    /// Returns the number of rows of a table.
    #[must_use]
    pub fn rows(&self, table: ShardTable) -> u64 {
        self.rows.get(&table).copied().unwrap_or_default()
    }
}

/// Error of generating a shard.
#[derive(Debug, Error)]
pub enum ShardError {
    /// Shard number outside of the set.
    #[error("there is no shard {number}: the set has {of} shards")]
    Number {
        /// Requested number of the shard.
        number: u32,
        /// Number of shards in the set.
        of: u32,
    },
    /// Scene for which all draws were rejected.
    #[error("scene {scene} of the set: {why}")]
    DoesNotFit {
        /// Number of the scene in the set.
        scene: u64,
        /// Reason, with advice for the specification.
        why: String,
    },
    /// Sampled scene that the model rejects.
    #[error("scene {scene} of the set: {error}")]
    Model {
        /// Number of the scene in the set.
        scene: u64,
        /// Error of the model.
        error: ModelError,
    },
    /// Write error of a table.
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

/// Maximum number of poses per scene position that are rejected for too many paths.
const MAX_COSTLY: u32 = 100;

impl Generator {
    /// Loads a specification from TOML; `file` names it in errors, `read` returns the texts of
    /// scenes and sensors that are not shipped.
    ///
    /// # Errors
    /// Returns the first fault with its position and valid values.
    pub fn from_toml(
        file: &str,
        text: &str,
        read: &dyn Fn(&str) -> io::Result<String>,
    ) -> Result<Self, SpecError> {
        from_toml(file, text, read).map(Self::new)
    }

    /// Loads a specification from [`text`](Self::text).
    ///
    /// # Errors
    /// Returns the first fault.
    pub fn from_json(file: &str, text: &str) -> Result<Self, SpecError> {
        from_json(file, text).map(Self::new)
    }

    fn new(loaded: LoadedSpec) -> Self {
        let (plan, options) =
            (ScanPlan::from(&loaded.spec.plan), loaded.spec.model.engine_options());
        Self { loaded, plan, options }
    }

    /// Returns the specification of the set.
    #[must_use]
    pub const fn spec(&self) -> &Spec {
        &self.loaded.spec
    }

    /// Returns the specification and all referenced files as JSON, sufficient to regenerate the
    /// set.
    #[must_use]
    pub fn text(&self) -> &str {
        &self.loaded.text
    }

    /// Returns the SHA-256 of [`text`](Self::text), hexadecimal, by which shards identify their
    /// specification.
    #[must_use]
    pub fn sha256(&self) -> &str {
        &self.loaded.sha256
    }

    pub(crate) fn summary(&self, shard: u32) -> ShardIdentity {
        ShardIdentity::new(&self.loaded, shard)
    }

    /// Returns the tables of each shard.
    #[must_use]
    pub fn tables(&self) -> Vec<ShardTable> {
        ShardTable::for_spec(self.spec())
    }

    /// Returns the number of readings per shard, for progress reports.
    #[must_use]
    pub fn readings(&self) -> u64 {
        let set = &self.spec().set;
        u64::from(set.scenes) * u64::from(set.poses) * u64::from(self.plan.beams())
    }

    /// Writes the tables of a shard, from 1, each to the output that `create` returns; calls
    /// `progress` with the number of readings since the last call.
    ///
    /// # Errors
    /// Returns an error for an invalid number, if all draws of a scene are rejected (which is
    /// reproducible), or if writing fails.
    pub fn shard(
        &self,
        number: u32,
        create: &mut dyn FnMut(ShardTable) -> io::Result<Box<dyn Write + Send>>,
        progress: &dyn Fn(u64),
    ) -> Result<ShardCounts, ShardError> {
        let set = &self.spec().set;
        if !(1..=set.shards).contains(&number) {
            return Err(ShardError::Number { number, of: set.shards });
        }
        let mut tables = TableWriter::create(self.spec(), &self.summary(number).to_json(), create)?;
        let (mut redrawn, mut last) = (RejectedDraws::default(), None);
        let before = u64::from(number - 1) * u64::from(set.scenes);
        for scene in (1..=u64::from(set.scenes)).map(|scene| before + scene) {
            let mut drawn = sample::scene(&self.loaded, scene)
                .map_err(|why| ShardError::DoesNotFit { scene, why: why.to_owned() })?;
            let simulator = self.simulator(&drawn, &mut last)?;
            self.write_scene(&mut drawn, simulator, &mut tables, progress)?;
            redrawn += drawn.rejected_draws;
        }
        Ok(ShardCounts { rows: tables.finish()?, redrawn })
    }

    /// Returns the simulator of a sampled scene; reuses the parts of the last simulator that did
    /// not change.
    fn simulator<'a>(
        &self,
        drawn: &SampledScene,
        last: &'a mut Option<Simulator>,
    ) -> Result<&'a Simulator, ShardError> {
        let mut sensor = self.loaded.sensors[drawn.sensor].clone();
        if drawn.sensor_z_m.is_some() {
            sensor.mounting.z_m = drawn.sensor_z_m;
        }
        let scene = Arc::clone(&drawn.scene);
        let made = match last.take() {
            Some(last) if *last.sensor() == sensor && *last.air() == drawn.air => {
                last.in_scene(scene)
            }
            _ => Simulator::new(scene, sensor, drawn.air, self.options),
        };
        let made = made.map_err(|error| ShardError::Model { scene: drawn.number, error })?;
        Ok(last.insert(made))
    }

    fn write_scene(
        &self,
        drawn: &mut SampledScene,
        simulator: &Simulator,
        tables: &mut TableWriter,
        progress: &dyn Fn(u64),
    ) -> Result<(), ShardError> {
        tables.scene(drawn, simulator)?;
        let mut positions = Vec::with_capacity(drawn.poses.len());
        for number in 1..=drawn.poses.len() as u32 {
            let at = self.simulate(drawn, number, simulator)?;
            tables.pose(simulator, &at)?;
            progress(at.firings.len() as u64);
            positions.push(at.pose.position());
        }
        tables.truth(drawn, &positions)
    }

    /// Simulates the readings at a pose of a scene; replaces poses with too many paths.
    fn simulate(
        &self,
        drawn: &mut SampledScene,
        number: u32,
        simulator: &Simulator,
    ) -> Result<PoseReadings, ShardError> {
        let mut pose: Pose = drawn.poses[number as usize - 1];
        let mut last: Option<TooCostly> = None;
        for _ in 0..=MAX_COSTLY {
            let of = (drawn.number, number);
            match PoseReadings::simulate(
                &self.loaded,
                of,
                &drawn.noise,
                simulator,
                pose,
                &self.plan,
            ) {
                Ok(at) => return Ok(at),
                Err(error) => last = Some(error),
            }
            drawn.rejected_draws.costly += 1;
            match sample::replacement_pose(&self.loaded, drawn) {
                Some(other) => pose = other,
                None => break,
            }
        }
        let why = last.map_or_else(String::new, |error| error.to_string());
        Err(ShardError::DoesNotFit { scene: drawn.number, why })
    }
}
