//! Predictions computed again, for a scene given.

use std::{path::Path, sync::Arc};

use crate::{
    acoustics::Air,
    cli::Failure,
    model::{EngineKind, Options, Simulator},
    scan::{ScanView, Session},
    scene::Scene,
};

/// Puts the model's reading in `scene` beside each reading of `scans`, in place of what the log
/// has there. Sensor, air and model are those of the scan's session.
///
/// # Errors
/// When the ranger can't stand in the scene where it stood, or the session's figures make no
/// sense.
pub(super) fn predict(log: &Path, scans: &mut [ScanView], scene: &Scene) -> Result<(), Failure> {
    for scan in scans {
        for ping in &mut scan.pings {
            (ping.sim, ping.residual_m) = (None, None);
        }
        let (Some(pose), Some(session)) = (scan.pose(), scan.session.clone()) else {
            let (log, id) = (log.display(), scan.scan);
            anstream::eprintln!("{log}: scan {id} lacks its pose or session: no prediction");
            continue;
        };
        scene.check_pose(&pose).map_err(|error| Failure::input(&error, error.help()))?;
        let simulator = simulator(log, scene.with_robot_at(&pose), &session)?;
        let station = simulator.station(pose.position());
        for ping in &mut scan.pings {
            let prediction = station.ping(pose.direction_rad(ping.azimuth_deg));
            let sim = simulator.record(&prediction);
            ping.residual_m = ping.range_m.zip(sim.range_m).map(|(measured, sim)| measured - sim);
            ping.sim = Some(sim);
        }
    }
    Ok(())
}

fn simulator(log: &Path, scene: Scene, session: &Session) -> Result<Simulator, Failure> {
    let refuse = |error: String| {
        Failure::input(
            format!("{}: no prediction with the session's sensor and air: {error}", log.display()),
            "correct the session's record, or compare without --scene",
        )
    };
    let air = Air::from_record(&session.air).map_err(|error| refuse(error.to_string()))?;
    let options = session.model.as_ref().map_or_else(Options::default, |model| {
        Options::from_record(model).unwrap_or_else(|| {
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
    Simulator::new(Arc::new(scene), session.sensor.clone(), air, options)
        .map_err(|error| refuse(error.to_string()))
}
