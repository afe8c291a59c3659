//! Predictions computed again: in a scene given, or for a pose, a sensor or air that the log does not say.

use std::{path::Path, sync::Arc};

use crate::{
    acoustics::Air,
    array::{ArrayPoseError, RangerArray},
    cli::{
        Failure, scene_file,
        what_if::{Supposer, WhatIf},
    },
    geometry::Pose,
    model::{ArrayModel, EngineKind, ModelError, Options, Simulator, TooCostly},
    scan::{Ping, Provenance, ScanView, Session, SimRecord},
    scene::Scene,
    store::logged_scene,
};

/// Puts the model's reading in a scene beside each reading. Sensor, array, air and model are those of
/// the scan's session.
pub(super) struct Predictor<'a> {
    log: &'a Path,
    /// The scene to predict in, in place of what the log has.
    given: Option<&'a Arc<Scene>>,
    what_if: &'a WhatIf,
    supposer: Supposer<'a>,
    /// The scene of the session of the scan before.
    logged: Option<(Arc<Session>, Option<Arc<Scene>>)>,
    /// An array's scans are many and short, and a session's share their model.
    made: Option<(Arc<Session>, ArrayModel)>,
}

impl<'a> Predictor<'a> {
    /// For the scans of a log.
    pub(super) const fn new(
        log: &'a Path,
        given: Option<&'a Arc<Scene>>,
        what_if: &'a WhatIf,
    ) -> Self {
        let supposer = Supposer::new(what_if);
        Self { log, given, what_if, supposer, logged: None, made: None }
    }

    /// Predicts a scan again in the scene given; without one, in the log's own scene what has no
    /// prediction.
    ///
    /// # Errors
    /// When the ranger can't stand in the scene where it stood, or the session's figures make no
    /// sense.
    pub(super) fn predict(&mut self, scan: &mut ScanView) -> Result<(), Failure> {
        self.supposer.suppose(scan);
        let (Some(pose), Some(session)) = (scan.pose(), scan.session.clone()) else {
            if self.given.is_some() {
                let (log, id) = (self.log.display(), scan.scan);
                notice!("{log}: scan {id} lacks its pose or session: no prediction");
                forget(scan);
            }
            return Ok(());
        };
        let scene = match self.given {
            Some(scene) => Some(Arc::clone(scene)),
            None => self.own_scene(scan, &session)?,
        };
        let Some(scene) = scene else { return Ok(()) };
        forget(scan);
        let Some(array) = &session.array else {
            return predict_stepper(self.log, scan, &pose, &scene, &session);
        };
        let model = match self.made.take() {
            Some((of, model)) if Arc::ptr_eq(&of, &session) => model,
            _ => array_model(self.log, array, &scene, &session)?,
        };
        predict_array(scan, &pose, &model)?;
        self.made = Some((session, model));
        Ok(())
    }

    /// The scene that the log holds, for measured scans without predictions, and for all where something else is
    /// supposed. A simulated scan beside itself would say nothing.
    fn own_scene(
        &mut self,
        scan: &ScanView,
        session: &Arc<Session>,
    ) -> Result<Option<Arc<Scene>>, Failure> {
        let has_model = session.model.is_some() || session.provenance == Provenance::Imported;
        let measured = session.provenance != Provenance::Simulated && has_model;
        let is_left_alone = !measured || scan.pings.iter().any(|ping| ping.sim.is_some());
        if is_left_alone && self.what_if.is_nothing() {
            return Ok(None);
        }
        if let Some((of, scene)) = &self.logged
            && Arc::ptr_eq(of, session)
        {
            return Ok(scene.clone());
        }
        let scene = match self.what_if.is_nothing() {
            true => logged_scene(session, self.log).ok().flatten(),
            false => scene_file::of_session(self.log, session)?,
        };
        let scene = scene.map(Arc::new);
        self.logged = Some((Arc::clone(session), scene.clone()));
        Ok(scene)
    }
}

fn forget(scan: &mut ScanView) {
    for ping in &mut scan.pings {
        (ping.sim, ping.residual_m) = (None, None);
    }
}

/// Predicts the scan of a ranger on a stepper, each reading from where the robot stood then.
fn predict_stepper(
    log: &Path,
    scan: &mut ScanView,
    pose: &Pose,
    scene: &Scene,
    session: &Session,
) -> Result<(), Failure> {
    for pings in scan.pings.chunk_by_mut(|one, next| one.pose == next.pose) {
        let robot = pings[0].pose.unwrap_or(*pose);
        scene.check_pose(&robot).map_err(|error| Failure::input(&error, error.help()))?;
        let simulator = simulator(log, scene.with_robot_at(&robot), session)?;
        let point = simulator.at(robot.position());
        for ping in pings {
            let Some(axis) = ping.axis(Some(session), pose) else { continue };
            let prediction =
                point.ping(axis.direction_rad(0.0)).map_err(|error| too_costly(log, &error))?;
            set_beside(ping, SimRecord::of(&simulator, &prediction));
        }
    }
    Ok(())
}

/// The same for the scan of an array; a reading of a ranger that it does not have stays alone.
fn predict_array(scan: &mut ScanView, pose: &Pose, model: &ArrayModel) -> Result<(), Failure> {
    let refuse_pose = |error: ArrayPoseError| Failure::input(&error, error.help());
    let refuse = |error: ModelError| Failure::input(error, "compare without --scene");
    let round: Vec<usize> = model.array().round().collect();
    for ping in &mut scan.pings {
        let Some(ranger) = ping.ranger.as_ref().and_then(|id| model.array().index_of(id)) else {
            continue;
        };
        // Imported readings may have another order than the array's own.
        let firing = ping.index as usize % round.len().max(1);
        let in_round = (round.get(firing) == Some(&ranger)).then_some(firing);
        let pose = ping.pose.unwrap_or(*pose);
        model.array().check_pose(model.scene(), &pose).map_err(refuse_pose)?;
        let stand = model.at(pose).map_err(refuse)?;
        let prediction =
            in_round.map_or_else(|| stand.ping(ranger), |firing| stand.ping_in_round(firing));
        let prediction = prediction.map_err(|error| refuse(error.into()))?;
        set_beside(ping, SimRecord::of_array(&stand, ranger, &prediction));
    }
    Ok(())
}

fn set_beside(ping: &mut Ping, sim: SimRecord) {
    ping.residual_m = ping.range_m.zip(sim.range_m).map(|(measured, sim)| measured - sim);
    ping.sim = Some(sim);
}

fn simulator(log: &Path, scene: Scene, session: &Session) -> Result<Simulator, Failure> {
    let (air, options) = conditions(log, session)?;
    Simulator::new(Arc::new(scene), session.sensor.clone(), air, options)
        .map_err(|error| refuse(log, &error))
}

fn array_model(
    log: &Path,
    array: &RangerArray,
    scene: &Scene,
    session: &Session,
) -> Result<ArrayModel, Failure> {
    array.check().map_err(|error| refuse(log, &error))?;
    let (air, options) = conditions(log, session)?;
    ArrayModel::new(Arc::new(array.clone()), scene, &session.sensor, air, options)
        .map_err(|error| refuse(log, &error))
}

fn too_costly(log: &Path, error: &TooCostly) -> Failure {
    Failure::input(
        format!("{}: no prediction: {error}", log.display()),
        "give a simpler scene, or settings in the session's record",
    )
}

fn refuse(log: &Path, error: &dyn std::fmt::Display) -> Failure {
    Failure::input(
        format!("{}: no prediction with the session's sensor and air: {error}", log.display()),
        "correct the session's record, or compare without --scene",
    )
}

/// The air and the settings of the model that a session's readings were predicted with.
///
/// # Errors
/// Air that there is not.
pub(super) fn conditions(log: &Path, session: &Session) -> Result<(Air, Options), Failure> {
    let (air, options) = session.conditions().map_err(|error| refuse(log, &error))?;
    let options = options.unwrap_or_else(|| {
        let engine = EngineKind::default().name();
        let had = session.model.as_ref().map_or("", |model| &model.engine);
        notice!(
            "{}: the log's model ({had}) can't be set up again: {engine} with its defaults is used",
            log.display()
        );
        Options::default()
    });
    Ok((air, options))
}
