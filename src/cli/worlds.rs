//! Sweeps of logs with the worlds that they were taken in.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use super::{
    Failure,
    logs::for_each_scan,
    predictor::conditions,
    scene_file,
    what_if::{Supposer, WhatIf},
};
use crate::{
    inverse::{Sweep, World},
    scan::{ScanView, Session},
    scene::Scene,
};

/// Options of verbs that explain sweeps.
#[derive(Debug, clap::Args)]
pub(super) struct SweepArgs {
    /// Logs of sweeps; - for standard input
    #[arg(required = true, value_name = "LOG")]
    logs: Vec<PathBuf>,
    /// Scene file, or the name of a shipped scene (`sonard scene list`); predicts in it, in place of the
    /// log's
    #[arg(long, value_name = "SCENE")]
    scene: Option<PathBuf>,
}

impl SweepArgs {
    /// Hands over each sweep of the logs with its world; says which scans are none.
    ///
    /// # Errors
    /// A log or a scene that can't be read, a scene that is not known, or what `take` refuses.
    pub(super) fn for_each(
        &self,
        what_if: &WhatIf,
        mut take: impl FnMut(&Path, Sweep, &Arc<World>) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        let given = self.scene.as_deref().map(scene_file::load).transpose()?.map(Arc::new);
        let mut worlds = Worlds { given, known: None };
        let mut supposer = Supposer::new(what_if);
        for log in &self.logs {
            for_each_scan(log, |mut scan| {
                supposer.suppose(&mut scan);
                match Sweep::of(&scan) {
                    Ok(sweep) => take(log, sweep, &worlds.world(log, &scan)?),
                    Err(error) => {
                        notice!("warning: {}: {error}; it is left out", log.display());
                        Ok(())
                    }
                }
            })?;
        }
        Ok(())
    }
}

/// Finds the world of each scan: the scene given, or the log's own; the session's sensor, air and model.
struct Worlds {
    given: Option<Arc<Scene>>,
    /// Of the session of the scan before.
    known: Option<(Arc<Session>, Arc<World>)>,
}

impl Worlds {
    fn world(&mut self, log: &Path, scan: &ScanView) -> Result<Arc<World>, Failure> {
        // A sweep has its session.
        let Some(session) = &scan.session else {
            return Err(Failure::input("a scan lacks its session", "give a whole log"));
        };
        if let Some((of, world)) = &self.known
            && Arc::ptr_eq(of, session)
        {
            return Ok(Arc::clone(world));
        }
        let scene = match &self.given {
            Some(scene) => Some(Arc::clone(scene)),
            None => scene_file::of_session(log, session)?.map(Arc::new),
        };
        let scene = scene.ok_or_else(|| {
            Failure::input(
                format!("{}: the log holds no scene", log.display()),
                "say where it was taken with --scene",
            )
        })?;
        let (air, options) = conditions(log, session)?;
        let world = Arc::new(World::new(scene, session.sensor.clone(), air, options));
        self.known = Some((Arc::clone(session), Arc::clone(&world)));
        Ok(world)
    }
}
