//! Figures for Prometheus.

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
    server::{Api, answer::Failed, openapi::Endpoint},
};
use format::Format;

pub(super) fn endpoints() -> Vec<Endpoint> {
    let about = "Figures for Prometheus, in the format that Accept prefers";
    vec![
        Endpoint::get("/metrics", metrics, about)
            .answers_text(200, Format::OpenMetrics.media_type(), "OpenMetrics text")
            .answers_text(200, Format::Text.media_type(), "Prometheus text"),
    ]
}

async fn metrics(State(api): State<Api>, headers: HeaderMap) -> Result<Response, Failed> {
    let accept = headers.get_all(header::ACCEPT).iter().filter_map(|value| value.to_str().ok());
    let format = Format::negotiate(&accept.collect::<Vec<_>>().join(","));
    // A disk may keep its answer back: that of the log is asked how much room it has.
    let written = tokio::task::spawn_blocking(move || {
        let mut text = String::new();
        encode(&mut text, &registry(&api.daemon)).map(|()| text)
    });
    let fault = |error: &dyn std::fmt::Display| {
        Failed::new(
            StatusCode::INTERNAL_SERVER_ERROR,
            error.to_string(),
            "this is a fault of the program",
        )
    };
    let text = written.await.map_err(|error| fault(&error))?.map_err(|error| fault(&error))?;
    let head = [(header::CONTENT_TYPE, format.media_type()), (header::VARY, "Accept")];
    Ok((head, format.render(text)).into_response())
}

/// A mock measures as little as the model does: only hardware is no simulation.
fn is_made_up(status: &Status) -> bool {
    status.provenance.is_some_and(|provenance| provenance != Provenance::Hardware)
        || status.simulation.is_some()
}

fn registry(daemon: &Handle) -> Registry {
    let (status, health) = (daemon.status(), daemon.health());
    let mut registry = Registry::with_prefix("sonard");
    let robot = Info::new([("robot", status.robot.clone()), ("version", status.sonard.clone())]);
    registry.register("robot", "Which robot it is, and of which version", robot);
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

/// How it goes with ROS 2, where that is told.
fn register_ros(registry: &mut Registry, report: &RosReport) {
    for (name, help, value) in [
        ("ros_messages", "Messages to ROS 2", report.messages),
        ("ros_left_out_messages", "Messages to ROS 2 that were left out", report.left_out),
        ("ros_commands", "Services of ROS 2 that did what was asked", report.commands),
        ("ros_refused_commands", "Services of ROS 2 that refused", report.refused),
    ] {
        registry.register(name, help, ConstCounter::new(value));
    }
    let up = f64::from(u8::from(report.up));
    registry.register("ros_up", "Whether ROS 2 is told", ConstGauge::new(up));
    let subscriptions = ConstGauge::new(report.subscriptions as f64);
    registry.register("ros_subscriptions", "Subscriptions of ROS 2 to topics", subscriptions);
}

/// How it goes with an MQTT broker, where one is named.
fn register_mqtt(registry: &mut Registry, report: &MqttReport) {
    for (name, help, value) in [
        ("mqtt_connections", "Connections with the MQTT broker", report.connections),
        ("mqtt_acknowledged_records", "Records that the MQTT broker has", report.acknowledged),
        ("mqtt_commands", "Commands taken through the MQTT broker", report.commands),
        ("mqtt_refused_commands", "Commands refused", report.refused),
    ] {
        registry.register(name, help, ConstCounter::new(value));
    }
    for (name, help, value) in [
        (
            "mqtt_connected",
            "Whether the MQTT broker is there",
            f64::from(u8::from(report.connected)),
        ),
        (
            "mqtt_waiting_records",
            "Records under way that the MQTT broker did not acknowledge",
            report.waiting as f64,
        ),
        (
            "mqtt_behind_bytes",
            "What of the log the MQTT broker does not have",
            report.behind_bytes as f64,
        ),
    ] {
        registry.register(name, help, ConstGauge::new(value));
    }
}

/// What only ever grows: name, meaning, value.
fn counters(status: &Status, health: &Health) -> [(&'static str, &'static str, u64); 22] {
    [
        ("line_sent_bytes", "Bytes sent to the device", health.line.bytes_sent),
        ("line_received_bytes", "Bytes received from the device", health.line.bytes_received),
        ("line_frames", "Frames received whole", health.line.frames_received),
        ("line_crc_errors", "Frames with a wrong checksum", health.line.crc_errors),
        ("line_framing_errors", "Frames damaged otherwise", health.line.framing_errors),
        ("line_retries", "Requests sent again", health.line.retries),
        ("line_repaired_readings", "Readings fetched again", health.line.repaired),
        ("line_refused_readings", "Readings and answers without sense", health.line.refused),
        ("link_losses", "Times that the device was lost from use", health.line.losses),
        ("scans_completed", "Scans with every beam", health.scans.completed),
        ("scans_stopped", "Scans stopped on request", health.scans.stopped),
        ("scans_failed", "Scans given up", health.scans.failed),
        ("beams_measured", "Beams measured", health.scans.beams),
        ("beams_missing", "Beams that scans lacked at their end", health.scans.missing),
        ("device_restarts", "Restarts of the device that scans survived", health.scans.restarts),
        ("clock_steps", "Times that the wall clock was set", health.clock.steps),
        ("log_records", "Records written to the log", status.log.written),
        ("log_synced_records", "Of those, records confirmed to be on the disk", status.log.synced),
        (
            "log_uncertain_records",
            "Of those, records that will never be confirmed",
            status.log.uncertain,
        ),
        (
            "dropped_messages",
            "Messages dropped because standard error was blocked or gone",
            health.dropped_messages,
        ),
        (
            "dropped_readings",
            "Readings that slow subscribers missed",
            status.subscribers.dropped_readings,
        ),
        (
            "cut_off_clients",
            "Clients cut off because they took nothing",
            status.subscribers.cut_off,
        ),
    ]
}

/// What goes up and down, as far as it is known.
fn gauges(status: &Status, health: &Health) -> Vec<(&'static str, &'static str, f64)> {
    let known = gauges_if_known(status, health);
    let known = known.iter().filter_map(|&(name, help, value)| Some((name, help, value?)));
    state_gauges(status, health).into_iter().chain(known).collect()
}

fn state_gauges(status: &Status, health: &Health) -> [(&'static str, &'static str, f64); 11] {
    [
        ("healthy", "Whether all is well", f64::from(u8::from(health.healthy))),
        (
            "link_up",
            "Whether the device can be used",
            f64::from(u8::from(status.link.state.is_up())),
        ),
        (
            "simulated",
            "Whether readings are made up: by a mock, or by the model; 0 also before a device tells",
            f64::from(u8::from(is_made_up(status))),
        ),
        (
            "simulation_skipped_turns",
            "Turns of a simulated array left out because the model was not ready",
            status.simulation.as_ref().map_or(0.0, |told| told.skipped as f64),
        ),
        (
            "log_failing",
            "Whether records can't be written: no scan is taken until they can",
            f64::from(u8::from(status.log.error.is_some())),
        ),
        ("log_waiting_records", "Records that could not be written yet", status.log.waiting as f64),
        ("subscribers", "Live streams", status.subscribers.now as f64),
        ("air_temperature_celsius", "Air temperature", status.air.temperature_c),
        (
            "thermometer_failing",
            "Whether the thermometer has no valid temperature: the last valid one is in use",
            f64::from(u8::from(status.air.error.is_some())),
        ),
        ("sound_speed_meters_per_second", "Speed of sound", status.air.sound_speed_m_s),
        ("uptime_seconds", "How long the daemon runs", status.uptime_s),
    ]
}

/// Those of what need not have been told or taken yet.
fn gauges_if_known(
    status: &Status,
    health: &Health,
) -> [(&'static str, &'static str, Option<f64>); 11] {
    let fit = health.fit.as_ref();
    [
        ("log_free_bytes", "Room on the disk of the log", free_bytes(status)),
        ("last_scan_age_seconds", "Since the last scan ended", health.last_scan_age_s),
        (
            "last_scan_compared_beams",
            "Beams of the last scan with an echo, measured and predicted",
            fit.map(|fit| f64::from(fit.both_echo)),
        ),
        (
            "last_scan_missing_beams",
            "Beams that the last scan lacked at its end",
            fit.map(|fit| f64::from(fit.missing)),
        ),
        (
            "last_scan_agreement_ratio",
            "Share of the compared beams whose ranges agree with the model",
            fit.and_then(|fit| fit.agree_fraction),
        ),
        (
            "last_scan_residual_median_meters",
            "Median distance between measured and predicted range",
            fit.and_then(|fit| fit.median_abs_residual_m),
        ),
        (
            "last_scan_bias_meters",
            "Median of measured minus predicted range",
            fit.and_then(|fit| fit.median_residual_m),
        ),
        (
            "reading_lateness_seconds",
            "How long after its firing the last reading came in",
            health.reading_lateness_s,
        ),
        ("air_age_seconds", "Age of the air temperature", status.air.age_s),
        ("clock_drift_ppm", "Drift of the device's clock", health.clock.drift_ppm),
        ("clock_sigma_microseconds", "Standard deviation of times", health.clock.sigma_us),
    ]
}

/// What may still be written to the disk of the log, if there is one.
fn free_bytes(status: &Status) -> Option<f64> {
    let folder = status.log.file.as_deref()?.parent()?;
    let disk = rustix::fs::statvfs(folder).ok()?;
    Some(disk.f_bavail as f64 * disk.f_frsize as f64)
}
