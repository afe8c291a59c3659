//! Details of one beam of a scan: measured echoes, predicted arrivals and propagation paths.

use std::sync::Arc;

use sonard_api::{AnnotatedPing, Beam, Echo, PeakLine, PlanPoint, TraceLine};
use sonard_model::{
    acoustics::Air,
    geometry::Pose,
    model::{Options, Simulator, TooCostly},
    scene::Scene,
};
use sonard_records::{Ping, ScanView, Session};

/// Length of the trace beyond the last measured or predicted echo, metres.
const MARGIN_M: f64 = 0.5;
/// Spacing of the samples that find an envelope peak, microseconds.
const STEP_US: f64 = 20.0;

/// Assembles the details of a reading. A prediction is computed only if `scene` is the scene of the
/// scan.
pub(super) fn describe_beam(view: &ScanView, ping: Ping, scene: Option<&Scene>) -> Beam {
    let session = view.session.as_deref();
    let echoes = echoes(view, session, &ping);
    let measured_m = echoes.iter().filter_map(|echo| echo.range_m).fold(0.0, f64::max);
    let (peaks, trace, lacks) = match predict(view, session, &ping, scene, measured_m) {
        Ok((peaks, trace)) => (Some(peaks), Some(trace), None),
        Err(lacks) => (None, None, Some(lacks)),
    };
    let polyline = ping.sound_path().and_then(|path| view.polyline(&ping, path));
    let polyline = polyline.map(|points| points.into_iter().map(PlanPoint::from).collect());
    Beam {
        reading: AnnotatedPing::new(ping, view),
        echoes,
        polyline,
        peaks,
        trace,
        unavailable_reason: lacks,
    }
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

fn predict(
    view: &ScanView,
    session: Option<&Session>,
    ping: &Ping,
    scene: Option<&Scene>,
    measured_m: f64,
) -> Result<(Vec<PeakLine>, TraceLine), String> {
    let (session, pose) =
        session.zip(view.pose()).ok_or("the log does not contain the scan's session")?;
    let scene = scene.ok_or("no scene is configured")?;
    let logged_scene = session.scene.as_ref().ok_or("the scan has no scene")?;
    if logged_scene.sha256 != scene.sha256 {
        return Err(format!("the scan belongs to another scene, {}", logged_scene.name));
    }
    let model = session.model.as_ref().ok_or("the scan has no model")?;
    let options = model.options().ok_or("the scan's model is not supported by this version")?;
    let air = air(view, session).map_err(|error| error.to_string())?;
    let axis = ping.axis(Some(session), &pose).ok_or("the logged array has no such ranger")?;
    let scene = Arc::new(session.scene_with_robot(scene, &ping.pose.unwrap_or(pose)));
    let sensor = session.sensor_for(ping);
    let last_echo_m = [ping.range_m, ping.sim.as_ref().and_then(|sim| sim.range_m)];
    let last_echo_m = last_echo_m.into_iter().flatten().fold(measured_m, f64::max);
    let until_m = options.max_range_m.unwrap_or(sensor.max_range_m);
    let until_m = if last_echo_m > 0.0 { until_m.min(last_echo_m + MARGIN_M) } else { until_m };
    let options = Options { max_range_m: Some(until_m), ..options };
    let simulator = Simulator::new(Arc::clone(&scene), sensor, air, options)
        .map_err(|error| error.to_string())?;
    predict_arrivals(&simulator, &axis, until_m).map_err(|error| error.to_string())
}

/// Returns the session's air at the temperature of the scan's start.
fn air(view: &ScanView, session: &Session) -> Result<Air, sonard_model::acoustics::AirError> {
    match view.start.as_ref().and_then(|start| start.air) {
        Some(scan) => {
            Air::new(scan.temperature_c, session.air.humidity_percent, session.air.pressure_kpa)
        }
        None => Air::try_from(&session.air),
    }
}

fn predict_arrivals(
    simulator: &Simulator,
    axis: &Pose,
    until_m: f64,
) -> Result<(Vec<PeakLine>, TraceLine), TooCostly> {
    let point = simulator.at(axis.position());
    let trace = point.trace(axis.direction_rad(0.0), until_m, STEP_US)?;
    let peaks = PeakLine::from_trace(simulator, &point, axis, &trace)?;
    Ok((peaks, TraceLine::from_trace(simulator, &trace, STEP_US)))
}
