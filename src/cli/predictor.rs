//! Recomputed predictions, with another scene, pose, sensor or air than the log's.

use std::{path::Path, sync::Arc};

use crate::{
    acoustics::Air,
    array::{ArrayPoseError, RangerArray},
    cli::{
        Failure, scene_file,
        what_if::{AssumptionFilter, WhatIf},
    },
    geometry::Pose,
    model::{ArrayModel, EngineKind, ModelError, Options, Simulator, TooCostly},
    scan::{Ping, Provenance, ScanView, Session, SimRecord},
    scene::Scene,
    store::logged_scene,
};

/// Adds the model's predictions in a scene to readings. Sensor, array, air and model are those of
/// the scan's session.
pub(super) struct Predictor<'a> {
    log: &'a Path,
    /// Scene for predictions, instead of the log's.
    given: Option<&'a Arc<Scene>>,
    what_if: &'a WhatIf,
    assumptions: AssumptionFilter<'a>,
    /// Session of the previous scan, and its scene.
    logged: Option<(Arc<Session>, Option<Arc<Scene>>)>,
    /// Model of the previous scan of an array; a session has many short scans with the same model.
    model_of_session: Option<(Arc<Session>, ArrayModel)>,
}

impl<'a> Predictor<'a> {
    /// Creates a predictor for the scans of a log.
    pub(super) const fn new(
        log: &'a Path,
        given: Option<&'a Arc<Scene>>,
        what_if: &'a WhatIf,
    ) -> Self {
        let assumptions = AssumptionFilter::new(what_if);
        Self { log, given, what_if, assumptions, logged: None, model_of_session: None }
    }

    /// Replaces the predictions of a scan by those in the given scene; without one, adds missing
    /// predictions in the log's own scene.
    ///
    /// # Errors
    ///
    /// The pose is not free in the scene, or the session has invalid values.
    pub(super) fn predict(&mut self, scan: &mut ScanView) -> Result<(), Failure> {
        self.assumptions.apply(scan);
        let (Some(pose), Some(session)) = (scan.pose(), scan.session.clone()) else {
            if self.given.is_some() {
                let (log, id) = (self.log.display(), scan.scan);
                notice!("{log}: scan {id} lacks its pose or session: no prediction");
                clear_predictions(scan);
            }
            return Ok(());
        };
        let scene = match self.given {
            Some(scene) => Some(Arc::clone(scene)),
            None => self.own_scene(scan, &session)?,
        };
        let Some(scene) = scene else { return Ok(()) };
        clear_predictions(scan);
        let Some(array) = &session.array else {
            return predict_stepper(self.log, scan, &pose, &scene, &session);
        };
        let model = match self.model_of_session.take() {
            Some((of, model)) if Arc::ptr_eq(&of, &session) => model,
            _ => array_model(self.log, array, &scene, &session)?,
        };
        predict_array(scan, &pose, &model)?;
        self.model_of_session = Some((session, model));
        Ok(())
    }

    /// Returns the log's scene for measured scans without predictions, and for all scans with other
    /// assumptions. Simulated scans already are predictions.
    fn own_scene(
        &mut self,
        scan: &ScanView,
        session: &Arc<Session>,
    ) -> Result<Option<Arc<Scene>>, Failure> {
        let has_model = session.model.is_some() || session.provenance == Provenance::Imported;
        let measured = session.provenance != Provenance::Simulated && has_model;
        let keeps_predictions = !measured || scan.pings.iter().any(|ping| ping.sim.is_some());
        if keeps_predictions && self.what_if.is_empty() {
            return Ok(None);
        }
        if let Some((of, scene)) = &self.logged
            && Arc::ptr_eq(of, session)
        {
            return Ok(scene.clone());
        }
        let scene = match self.what_if.is_empty() {
            true => logged_scene(session, self.log).ok().flatten(),
            false => scene_file::of_session(self.log, session)?,
        };
        let scene = scene.map(Arc::new);
        self.logged = Some((Arc::clone(session), scene.clone()));
        Ok(scene)
    }
}

fn clear_predictions(scan: &mut ScanView) {
    for ping in &mut scan.pings {
        (ping.sim, ping.residual_m) = (None, None);
    }
}

/// Predicts the scan of a ranger on a stepper, with the robot's pose at each reading.
fn predict_stepper(
    log: &Path,
    scan: &mut ScanView,
    pose: &Pose,
    scene: &Scene,
    session: &Session,
) -> Result<(), Failure> {
    for pings in scan.pings.chunk_by_mut(|a, b| a.pose == b.pose) {
        let robot = pings[0].pose.unwrap_or(*pose);
        scene.check_pose(&robot).map_err(|error| Failure::input(&error, error.help()))?;
        let simulator = simulator(log, scene.with_robot_at(&robot), session)?;
        let point = simulator.at(robot.position());
        for ping in pings {
            let Some(axis) = ping.axis(Some(session), pose) else { continue };
            let prediction =
                point.ping(axis.direction_rad(0.0)).map_err(|error| too_costly(log, &error))?;
            set_prediction(ping, SimRecord::from_prediction(&simulator, &prediction));
        }
    }
    Ok(())
}

/// Predicts the scan of an array; readings of unknown rangers get no prediction.
fn predict_array(scan: &mut ScanView, pose: &Pose, model: &ArrayModel) -> Result<(), Failure> {
    let refuse_pose = |error: ArrayPoseError| Failure::input(&error, error.help());
    let failure_from = |error: ModelError| Failure::input(error, "compare without --scene");
    let round: Vec<usize> = model.array().round().collect();
    for ping in &mut scan.pings {
        let Some(ranger) = ping.ranger.as_ref().and_then(|id| model.array().index_of(id)) else {
            continue;
        };
        // Imported readings may be in another order than the array's own.
        let firing = ping.index as usize % round.len().max(1);
        let in_round = (round.get(firing) == Some(&ranger)).then_some(firing);
        let pose = ping.pose.unwrap_or(*pose);
        model.array().check_pose(model.scene(), &pose).map_err(refuse_pose)?;
        let at_pose = model.at(pose).map_err(failure_from)?;
        let prediction =
            in_round.map_or_else(|| at_pose.ping(ranger), |firing| at_pose.ping_in_round(firing));
        let prediction = prediction.map_err(|error| failure_from(error.into()))?;
        set_prediction(ping, SimRecord::for_array(&at_pose, ranger, &prediction));
    }
    Ok(())
}

fn set_prediction(ping: &mut Ping, sim: SimRecord) {
    ping.residual_m = ping.range_m.zip(sim.range_m).map(|(measured, sim)| measured - sim);
    ping.sim = Some(sim);
}

fn simulator(log: &Path, scene: Scene, session: &Session) -> Result<Simulator, Failure> {
    let (air, options) = conditions(log, session)?;
    Simulator::new(Arc::new(scene), session.sensor.clone(), air, options)
        .map_err(|error| failure_from(log, &error))
}

fn array_model(
    log: &Path,
    array: &RangerArray,
    scene: &Scene,
    session: &Session,
) -> Result<ArrayModel, Failure> {
    array.check().map_err(|error| failure_from(log, &error))?;
    let (air, options) = conditions(log, session)?;
    ArrayModel::new(Arc::new(array.clone()), scene, &session.sensor, air, options)
        .map_err(|error| failure_from(log, &error))
}

fn too_costly(log: &Path, error: &TooCostly) -> Failure {
    Failure::input(
        format!("{}: no prediction: {error}", log.display()),
        "give a simpler scene, or settings in the session's record",
    )
}

fn failure_from(log: &Path, error: &dyn std::fmt::Display) -> Failure {
    Failure::input(
        format!("{}: no prediction with the session's sensor and air: {error}", log.display()),
        "correct the session's record, or compare without --scene",
    )
}

/// Returns air and model options of a session's predictions.
///
/// # Errors
///
/// Invalid properties of the air.
pub(super) fn conditions(log: &Path, session: &Session) -> Result<(Air, Options), Failure> {
    let (air, options) = session.model_conditions().map_err(|error| failure_from(log, &error))?;
    let options = options.unwrap_or_else(|| {
        let engine = EngineKind::default().name();
        let had = session.model.as_ref().map_or("", |model| &model.engine);
        notice!(
            "{}: the log's model ({had}) is not available: using {engine} with its defaults",
            log.display()
        );
        Options::default()
    });
    Ok((air, options))
}
