//! Predictions computed again, for a scene given.

use std::{path::Path, sync::Arc};

use crate::{
    acoustics::Air,
    array::{ArrayPoseError, RangerArray},
    cli::Failure,
    geometry::Pose,
    model::{ArrayModel, EngineKind, ModelError, Options, Simulator},
    scan::{Ping, ScanView, Session, SimRecord},
    scene::Scene,
};

/// Puts the model's reading in `scene` beside each reading of `scans`, in place of what the log
/// has there. Sensor, array, air and model are those of the scan's session.
///
/// # Errors
/// When the ranger can't stand in the scene where it stood, or the session's figures make no
/// sense.
pub(super) fn predict(log: &Path, scans: &mut [ScanView], scene: &Scene) -> Result<(), Failure> {
    let mut made: Option<(Arc<Session>, ArrayModel)> = None;
    for scan in scans {
        for ping in &mut scan.pings {
            (ping.sim, ping.residual_m) = (None, None);
        }
        let (Some(pose), Some(session)) = (scan.pose(), scan.session.clone()) else {
            let (log, id) = (log.display(), scan.scan);
            anstream::eprintln!("{log}: scan {id} lacks its pose or session: no prediction");
            continue;
        };
        let Some(array) = &session.array else {
            scene.check_pose(&pose).map_err(|error| Failure::input(&error, error.help()))?;
            let simulator = simulator(log, scene.with_robot_at(&pose), &session)?;
            let station = simulator.station(pose.position());
            for ping in &mut scan.pings {
                let prediction = station.ping(pose.direction_rad(ping.azimuth_deg));
                set_beside(ping, SimRecord::of(&simulator, &prediction));
            }
            continue;
        };
        // An array's scans are many and short, and a session's share their model.
        let model = match made.take() {
            Some((of, model)) if Arc::ptr_eq(&of, &session) => model,
            _ => array_model(log, array, scene, &session)?,
        };
        predict_array(scan, &pose, &model)?;
        made = Some((session, model));
    }
    Ok(())
}

/// The same for the scan of an array; a reading of a ranger that it does not have stays alone.
fn predict_array(scan: &mut ScanView, pose: &Pose, model: &ArrayModel) -> Result<(), Failure> {
    let refuse_pose = |error: ArrayPoseError| Failure::input(&error, error.help());
    let refuse = |error: ModelError| Failure::input(error, "compare without --scene");
    for ping in &mut scan.pings {
        let Some(ranger) = ping.ranger.as_ref().and_then(|id| model.array().index_of(id)) else {
            continue;
        };
        let pose = ping.pose.unwrap_or(*pose);
        model.array().check_pose(model.scene(), &pose).map_err(refuse_pose)?;
        let stand = model.at(pose).map_err(refuse)?;
        set_beside(ping, SimRecord::of(stand.simulator(ranger), &stand.ping(ranger)));
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
    ArrayModel::new(Arc::new(array.clone()), scene, session.sensor.clone(), air, options)
        .map_err(|error| refuse(log, &error))
}

fn refuse(log: &Path, error: &dyn std::fmt::Display) -> Failure {
    Failure::input(
        format!("{}: no prediction with the session's sensor and air: {error}", log.display()),
        "correct the session's record, or compare without --scene",
    )
}

/// The air and the settings of the model that a session's readings were predicted with.
fn conditions(log: &Path, session: &Session) -> Result<(Air, Options), Failure> {
    let air = Air::try_from(&session.air).map_err(|error| refuse(log, &error))?;
    let options = session.model.as_ref().map_or_else(Options::default, |model| {
        model.options().unwrap_or_else(|| {
            let engine = EngineKind::default().name();
            let had = &model.engine;
            anstream::eprintln!(
                "{}: the log's model ({had}) can't be set up again: {engine} with its defaults \
                 is used",
                log.display()
            );
            Options::default()
        })
    });
    Ok((air, options))
}
