//! Prometheus metrics of the daemon.

mod format;

use axum::{
    extract::State,
    http::{HeaderMap, StatusCode, header},
    response::{IntoResponse, Response},
};
use prometheus_client::{
    encoding::text::encode,
    metrics::{counter::ConstCounter, gauge::ConstGauge, info::Info},
    registry::Registry,
};
use sonard_api::{Health, MqttReport, RosReport, Status};
use sonard_records::Provenance;

use crate::{
    Handle,
    server::{Api, openapi::Route, response::ApiError},
};
use format::ExpositionFormat;

pub(super) fn endpoints() -> Vec<Route> {
    let about = "Prometheus metrics, in the format that Accept prefers";
    vec![
        Route::get("/metrics", metrics, about)
            .responds_text(200, ExpositionFormat::OpenMetrics.media_type(), "OpenMetrics text")
            .responds_text(200, ExpositionFormat::Text.media_type(), "Prometheus text"),
    ]
}

async fn metrics(State(api): State<Api>, headers: HeaderMap) -> Result<Response, ApiError> {
    let accept = headers.get_all(header::ACCEPT).iter().filter_map(|value| value.to_str().ok());
    let format = ExpositionFormat::negotiate(&accept.collect::<Vec<_>>().join(","));
    // Querying the free space of the log's disk can block.
    let encoded = tokio::task::spawn_blocking(move || {
        let mut text = String::new();
        encode(&mut text, &registry(&api.daemon)).map(|()| text)
    });
    let internal_error = |error: &dyn std::fmt::Display| {
        ApiError::new(
            StatusCode::INTERNAL_SERVER_ERROR,
            error.to_string(),
            "this is a bug: see the log messages of the daemon",
        )
    };
    let text = encoded
        .await
        .map_err(|error| internal_error(&error))?
        .map_err(|error| internal_error(&error))?;
    let head = [(header::CONTENT_TYPE, format.media_type()), (header::VARY, "Accept")];
    Ok((head, format.render(text)).into_response())
}

/// Returns `true` unless readings come from hardware: mock devices are simulations, too.
fn is_simulated(status: &Status) -> bool {
    status.provenance.is_some_and(|provenance| provenance != Provenance::Hardware)
        || status.simulation.is_some()
}

fn registry(daemon: &Handle) -> Registry {
    let (status, health) = (daemon.status(), daemon.health());
    let mut registry = Registry::with_prefix("sonard");
    let robot = Info::new([("robot", status.robot.clone()), ("version", status.sonard.clone())]);
    registry.register("robot", "Name of the robot and version of the program", robot);
    for (name, help, value) in counters(&status, &health) {
        registry.register(name, help, ConstCounter::new(value));
    }
    for (name, help, value) in gauges(&status, &health) {
        registry.register(name, help, ConstGauge::new(value));
    }
    if let Some(report) = &status.ros {
        register_ros(&mut registry, report);
    }
    if let Some(report) = &status.mqtt {
        register_mqtt(&mut registry, report);
    }
    registry
}

/// Registers the metrics of the ROS 2 output.
fn register_ros(registry: &mut Registry, report: &RosReport) {
    for (name, help, value) in [
        ("ros_messages", "Messages published to ROS 2", report.messages),
        ("ros_dropped_messages", "Messages to ROS 2 that were dropped", report.dropped),
        ("ros_commands", "Accepted commands of ROS 2", report.commands),
        ("ros_rejected_commands", "Rejected commands of ROS 2", report.rejected),
    ] {
        registry.register(name, help, ConstCounter::new(value));
    }
    let up = f64::from(u8::from(report.up));
    registry.register("ros_up", "1 while messages are published to ROS 2", ConstGauge::new(up));
    let subscriptions = ConstGauge::new(report.subscriptions as f64);
    registry.register("ros_subscriptions", "Subscriptions of ROS 2 nodes to topics", subscriptions);
}

/// Registers the metrics of the MQTT output.
fn register_mqtt(registry: &mut Registry, report: &MqttReport) {
    for (name, help, value) in [
        ("mqtt_connections", "Connections to the MQTT broker", report.connections),
        (
            "mqtt_acknowledged_records",
            "Records acknowledged by the MQTT broker",
            report.acknowledged,
        ),
        ("mqtt_commands", "Commands accepted through the MQTT broker", report.commands),
        ("mqtt_rejected_commands", "Commands rejected through the MQTT broker", report.rejected),
    ] {
        registry.register(name, help, ConstCounter::new(value));
    }
    for (name, help, value) in [
        (
            "mqtt_connected",
            "1 while the MQTT broker is connected",
            f64::from(u8::from(report.connected)),
        ),
        (
            "mqtt_waiting_records",
            "Records sent but not acknowledged by the MQTT broker",
            report.waiting as f64,
        ),
        (
            "mqtt_behind_bytes",
            "Log data not acknowledged by the MQTT broker",
            report.lag_bytes as f64,
        ),
    ] {
        registry.register(name, help, ConstGauge::new(value));
    }
}

/// Returns the counters: name, description, value.
fn counters(status: &Status, health: &Health) -> [(&'static str, &'static str, u64); 22] {
    [
        ("line_sent_bytes", "Bytes sent to the device", health.line.bytes_sent),
        ("line_received_bytes", "Bytes received from the device", health.line.bytes_received),
        ("line_frames", "Frames received intact", health.line.frames_received),
        ("line_crc_errors", "Frames with a wrong checksum", health.line.crc_errors),
        ("line_framing_errors", "Frames with other damage", health.line.framing_errors),
        ("line_retries", "Retransmitted requests", health.line.retries),
        ("line_repaired_readings", "Readings fetched again", health.line.repaired),
        (
            "line_rejected_readings",
            "Readings and responses rejected as invalid",
            health.line.rejected,
        ),
        ("link_losses", "Lost connections to a device in use", health.line.losses),
        ("scans_completed", "Scans with all beams measured", health.scans.completed),
        ("scans_stopped", "Scans stopped on request", health.scans.stopped),
        ("scans_failed", "Failed scans", health.scans.failed),
        ("beams_measured", "Beams measured", health.scans.beams),
        ("beams_missing", "Beams without a reading at the end of their scan", health.scans.missing),
        ("device_restarts", "Restarts of the device that scans survived", health.scans.restarts),
        ("clock_steps", "Steps of the wall clock", health.clock.steps),
        ("log_records", "Records written to the log", status.log.written),
        ("log_synced_records", "Written records confirmed to be on the disk", status.log.synced),
        (
            "log_uncertain_records",
            "Written records that will never be confirmed",
            status.log.uncertain,
        ),
        (
            "dropped_messages",
            "Messages dropped because standard error was blocked or gone",
            health.dropped_messages,
        ),
        (
            "dropped_readings",
            "Readings dropped for slow subscribers",
            status.subscribers.dropped_readings,
        ),
        (
            "cut_off_clients",
            "Clients disconnected because they stopped reading",
            status.subscribers.cut_off,
        ),
    ]
}

/// Returns the gauges with known values.
fn gauges(status: &Status, health: &Health) -> Vec<(&'static str, &'static str, f64)> {
    let known = gauges_if_known(status, health);
    let known = known.iter().filter_map(|&(name, help, value)| Some((name, help, value?)));
    state_gauges(status, health).into_iter().chain(known).collect()
}

fn state_gauges(status: &Status, health: &Health) -> [(&'static str, &'static str, f64); 11] {
    [
        ("healthy", "1 if the daemon is healthy", f64::from(u8::from(health.healthy))),
        ("link_up", "1 if the device is usable", f64::from(u8::from(status.link.state.is_up()))),
        (
            "simulated",
            "1 if readings are simulated, by a mock or by the model; 0 also before a device is identified",
            f64::from(u8::from(is_simulated(status))),
        ),
        (
            "simulation_skipped_turns",
            "Firing slots of a simulated array skipped because the simulation was late",
            status.simulation.as_ref().map_or(0.0, |array| array.skipped as f64),
        ),
        (
            "log_failing",
            "1 if records can't be written; no scan is taken until they can",
            f64::from(u8::from(status.log.error.is_some())),
        ),
        ("log_waiting_records", "Records not written yet", status.log.waiting as f64),
        ("subscribers", "Live stream subscribers", status.subscribers.now as f64),
        ("air_temperature_celsius", "Air temperature", status.air.temperature_c),
        (
            "thermometer_failing",
            "1 if the thermometer has no valid temperature; the last valid one is in use",
            f64::from(u8::from(status.air.error.is_some())),
        ),
        ("sound_speed_meters_per_second", "Speed of sound", status.air.sound_speed_m_s),
        ("uptime_seconds", "Time since the start of the daemon", status.uptime_s),
    ]
}

/// Returns the gauges whose values can be unknown.
fn gauges_if_known(
    status: &Status,
    health: &Health,
) -> [(&'static str, &'static str, Option<f64>); 11] {
    let fit = health.fit.as_ref();
    [
        ("log_free_bytes", "Free space on the disk of the log", free_bytes(status)),
        ("last_scan_age_seconds", "Time since the end of the last scan", health.last_scan_age_s),
        (
            "last_scan_compared_beams",
            "Beams of the last scan with both a measured and a predicted echo",
            fit.map(|fit| f64::from(fit.both_echo)),
        ),
        (
            "last_scan_missing_beams",
            "Beams of the last scan without a reading at its end",
            fit.map(|fit| f64::from(fit.missing)),
        ),
        (
            "last_scan_agreement_ratio",
            "Fraction of the compared beams whose ranges agree with the model",
            fit.and_then(|fit| fit.agree_fraction),
        ),
        (
            "last_scan_residual_median_meters",
            "Median of |measured - predicted range|",
            fit.and_then(|fit| fit.median_abs_residual_m),
        ),
        (
            "last_scan_bias_meters",
            "Median of measured minus predicted range",
            fit.and_then(|fit| fit.median_residual_m),
        ),
        (
            "reading_lateness_seconds",
            "Delay from firing to arrival of the last reading",
            health.reading_lateness_s,
        ),
        ("air_age_seconds", "Age of the air temperature", status.air.age_s),
        ("clock_drift_ppm", "Drift of the device's clock", health.clock.drift_ppm),
        ("clock_sigma_microseconds", "Standard deviation of timestamps", health.clock.sigma_us),
    ]
}

/// Free space on the disk of the log, bytes.
fn free_bytes(status: &Status) -> Option<f64> {
    let folder = status.log.file.as_deref()?.parent()?;
    let disk = rustix::fs::statvfs(folder).ok()?;
    Some(disk.f_bavail as f64 * disk.f_frsize as f64)
}
