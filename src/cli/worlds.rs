//! Sweeps of logs with the worlds that they were taken in.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use super::{Failure, logs::for_each_scan, predictor::conditions, scene_file, what_if::WhatIf};
use crate::{
    inverse::{Sweep, World},
    scan::{ScanView, Session},
    scene::Scene,
};

/// Finds the world of each scan: the scene given, or the log's own; the session's sensor, air and model, or what is
/// supposed in their place.
pub(super) struct Worlds<'a> {
    given: Option<Arc<Scene>>,
    what_if: &'a WhatIf,
    /// Of the session of the scan before.
    known: Option<(Arc<Session>, Arc<World>)>,
}

impl<'a> Worlds<'a> {
    /// With a scene in place of those that logs hold.
    ///
    /// # Errors
    /// No such scene, or a fault in it.
    pub(super) fn new(scene: Option<&Path>, what_if: &'a WhatIf) -> Result<Self, Failure> {
        let given = scene.map(scene_file::load).transpose()?.map(Arc::new);
        Ok(Self { given, what_if, known: None })
    }

    /// Hands over each sweep of some logs with its world; says which scans are none.
    ///
    /// # Errors
    /// A log that can't be read, a scene that is not known, or what `take` refuses.
    pub(super) fn for_each_sweep(
        &mut self,
        logs: &[PathBuf],
        mut take: impl FnMut(&Path, &ScanView, Sweep, &Arc<World>) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        for log in logs {
            for_each_scan(log, |mut scan| {
                self.what_if.change(&mut scan);
                let sweep = match Sweep::of(&scan) {
                    Ok(sweep) => sweep,
                    Err(error) => {
                        anstream::eprintln!("warning: {}: {error}; it is left out", log.display());
                        return Ok(());
                    }
                };
                let world = self.world(log, &scan)?;
                take(log, &scan, sweep, &world)
            })?;
        }
        Ok(())
    }

    fn world(&mut self, log: &Path, scan: &ScanView) -> Result<Arc<World>, Failure> {
        // A sweep has its session.
        let Some(session) = &scan.session else {
            return Err(Failure::input("a scan lacks its session", "give a whole log"));
        };
        if let Some((of, world)) = &self.known
            && **of == **session
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
