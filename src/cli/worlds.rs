//! Sweeps of logs with sensor, scene and air.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use super::{
    Failure,
    logs::for_each_scan,
    predictor::conditions,
    scene_file,
    what_if::{AssumptionFilter, WhatIf},
};
use crate::{
    inverse::{FitSweep, World},
    scan::{Provenance, ScanView, Session},
    scene::Scene,
};

/// Options of verbs that estimate parameters from sweeps.
#[derive(Debug, clap::Args)]
pub(super) struct SweepArgs {
    /// Logs of sweeps; - for standard input
    #[arg(required = true, value_name = "LOG")]
    logs: Vec<PathBuf>,
    /// Scene file, or the name of a shipped scene (`sonard scene list`); used for predictions,
    /// instead of the log's
    #[arg(long, value_name = "SCENE")]
    scene: Option<PathBuf>,
}

impl SweepArgs {
    /// Loads the scene given instead of the logs' own.
    ///
    /// # Errors
    ///
    /// An unreadable or unknown scene.
    pub(super) fn scene(&self) -> Result<Option<Arc<Scene>>, Failure> {
        Ok(self.scene.as_deref().map(scene_file::load).transpose()?.map(Arc::new))
    }

    /// Passes each sweep of the logs with its world and provenance to `take`; reports scans that
    /// are not sweeps.
    ///
    /// # Errors
    ///
    /// An unreadable log or scene, an unknown scene, or a failure of `take`.
    pub(super) fn for_each(
        &self,
        what_if: &WhatIf,
        mut take: impl FnMut(&Path, FitSweep, &Arc<World>, Provenance) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        let mut worlds = WorldCache { given: self.scene()?, current: None };
        let mut assumptions = AssumptionFilter::new(what_if);
        for log in &self.logs {
            for_each_scan(log, |mut scan| {
                assumptions.apply(&mut scan);
                match FitSweep::from_scan(&scan) {
                    Ok(sweep) => {
                        let world = worlds.world(log, &scan)?;
                        let session = scan.session.as_ref();
                        let provenance =
                            session.map_or(Provenance::Imported, |session| session.provenance);
                        take(log, sweep, &world, provenance)
                    }
                    Err(error) => {
                        notice!("warning: {}: {error}; scan skipped", log.display());
                        Ok(())
                    }
                }
            })?;
        }
        Ok(())
    }
}

/// Finds the world of each scan: the given scene or the log's own, and the session's sensor, air
/// and model.
struct WorldCache {
    given: Option<Arc<Scene>>,
    /// World of the previous scan's session.
    current: Option<(Arc<Session>, Arc<World>)>,
}

impl WorldCache {
    fn world(&mut self, log: &Path, scan: &ScanView) -> Result<Arc<World>, Failure> {
        // Every sweep has a session.
        let Some(session) = &scan.session else {
            return Err(Failure::input("a scan has no session", "give a complete log"));
        };
        if let Some((of, world)) = &self.current
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
                format!("{}: the log contains no scene", log.display()),
                "give its scene with --scene",
            )
        })?;
        let (air, options) = conditions(log, session)?;
        let world = Arc::new(World::new(scene, session.sensor.clone(), air, options));
        self.current = Some((Arc::clone(session), Arc::clone(&world)));
        Ok(world)
    }
}
