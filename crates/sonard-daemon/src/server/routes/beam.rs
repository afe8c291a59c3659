//! One beam of a scan: what was heard, what the model hears, and the paths of the sound.

use std::sync::Arc;

use sonard_api::{Beam, Echo, JudgedPing, PeakLine, PlanPoint, TraceLine};
use sonard_model::{
    acoustics::Air,
    geometry::Pose,
    model::{Options, Simulator, TooCostly},
    scene::Scene,
};
use sonard_records::{Ping, ScanView, Session};

/// The model is asked so far beyond what was heard or predicted, metres.
const BEYOND_M: f64 = 0.5;
/// Spacing of the samples that find an envelope peak, microseconds.
const STEP_US: f64 = 20.0;

/// Everything about a reading of a scan. The model is asked if `scene` is the one that the scan
/// was taken in.
pub(super) fn look(view: &ScanView, ping: Ping, scene: Option<&Scene>) -> Beam {
    let session = view.session.as_deref();
    let echoes = echoes(view, session, &ping);
    let (peaks, trace, lacks) = match ask_model(view, session, &ping, scene) {
        Ok((peaks, trace)) => (Some(peaks), Some(trace), None),
        Err(lacks) => (None, None, Some(lacks)),
    };
    let polyline = ping.sound_path().and_then(|path| view.polyline(&ping, path));
    let polyline = polyline.map(|points| points.into_iter().map(PlanPoint::from).collect());
    Beam { reading: JudgedPing::of(ping, view), echoes, polyline, peaks, trace, lacks }
}

fn echoes(view: &ScanView, session: Option<&Session>, ping: &Ping) -> Vec<Echo> {
    let tick_hz = session.and_then(|session| session.device.as_ref()).map(|device| device.tick_hz);
    let air = view.start.as_ref().and_then(|start| start.air);
    let sound_speed_m_s = air
        .map(|air| air.sound_speed_m_s)
        .or_else(|| session.map(|session| session.air.sound_speed_m_s));
    let echo = |&ticks: &u32| {
        let tof_us = tick_hz.map(|tick_hz| f64::from(ticks) / f64::from(tick_hz) * 1e6);
        let range_m = tof_us.zip(sound_speed_m_s).map(|(tof_us, c)| tof_us * 1e-6 * c / 2.0);
        Echo { ticks, tof_us, range_m }
    };
    ping.echo_ticks.iter().map(echo).collect()
}

fn ask_model(
    view: &ScanView,
    session: Option<&Session>,
    ping: &Ping,
    scene: Option<&Scene>,
) -> Result<(Vec<PeakLine>, TraceLine), String> {
    let (session, pose) = session.zip(view.pose()).ok_or("the log lacks the scan's session")?;
    let scene = scene.ok_or("there is no scene in force")?;
    let taken_in = session.scene.as_ref().ok_or("the scan was taken without a scene")?;
    if taken_in.sha256 != scene.sha256 {
        return Err(format!("the scan was taken in another scene, {}", taken_in.name));
    }
    let model = session.model.as_ref().ok_or("the scan was taken without a model")?;
    let options = model.options().ok_or("the scan's model is unknown here")?;
    let air = air(view, session).map_err(|error| error.to_string())?;
    let axis = ping.axis(Some(session), &pose).ok_or("the log's array has no such ranger")?;
    let scene = Arc::new(session.scene_around(scene, &ping.pose.unwrap_or(pose)));
    let sensor = session.sensor_of(ping);
    let heard_m = [ping.range_m, ping.sim.as_ref().and_then(|sim| sim.range_m)];
    let heard_m = heard_m.into_iter().flatten().fold(0.0, f64::max);
    let until_m = options.max_range_m.unwrap_or(sensor.max_range_m);
    let until_m = if heard_m > 0.0 { until_m.min(heard_m + BEYOND_M) } else { until_m };
    let options = Options { max_range_m: Some(until_m), ..options };
    let simulator = Simulator::new(Arc::clone(&scene), sensor, air, options)
        .map_err(|error| error.to_string())?;
    listen(&simulator, &axis, until_m).map_err(|error| error.to_string())
}

/// The session's air, at the temperature that was known when the scan began.
fn air(view: &ScanView, session: &Session) -> Result<Air, sonard_model::acoustics::AirError> {
    match view.start.as_ref().and_then(|start| start.air) {
        Some(scan) => {
            Air::new(scan.temperature_c, session.air.humidity_percent, session.air.pressure_kpa)
        }
        None => Air::try_from(&session.air),
    }
}

fn listen(
    simulator: &Simulator,
    axis: &Pose,
    until_m: f64,
) -> Result<(Vec<PeakLine>, TraceLine), TooCostly> {
    let point = simulator.at(axis.position());
    let trace = point.trace(axis.direction_rad(0.0), until_m, STEP_US)?;
    let peaks = PeakLine::of_trace(simulator, &point, axis, &trace)?;
    Ok((peaks, TraceLine::of(simulator, &trace, STEP_US)))
}
