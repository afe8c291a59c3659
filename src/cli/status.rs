//! `sonard status`.

use std::io::Write as _;

use serde::Serialize;

mod fleet;

use super::{
    Failure, Outcome,
    daemon::{Daemons, DaemonsArgs, failure_from},
    runtime,
};
use crate::{
    api::{Health, LinkReport, MqttReport, Pending, RosReport, ScanFit, SimulationReport, Status},
    scan::text::{format_count, format_length},
};

/// Options of `sonard status`.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(super) struct Args {
    #[command(flatten)]
    daemon: DaemonsArgs,
    /// JSON instead of text; one object per daemon, with status and health as in the API
    #[arg(long)]
    json: bool,
}

const HELP: &str = "\
Examples:
  sonard status
  sonard status --socket /tmp/sonard.sock --json
  sonard status --address kiwi=10.0.0.7:8765 --address 10.0.0.8:8765 --token-file fleet-token
  sonard status --fleet fleet.toml

With several daemons each has a line, including those that do not respond, reject the request, or are not the robot named before the `=`.
Exit codes: 0 healthy, 1 problems, 3 no daemon responds (of several: at least one does not).";

#[derive(Serialize)]
struct StatusAndHealth<'a> {
    status: &'a Status,
    health: &'a Health,
}

pub(super) fn run(args: &Args) -> Outcome {
    let client = match args.daemon.daemons()? {
        Daemons::One(client) => client,
        Daemons::Several(daemons) => return fleet::run(&daemons, args.json),
    };
    let (status, health): (Status, Health) = runtime::new()?
        .block_on(async {
            Ok((client.get_json("/v1/status").await?, client.get_json("/v1/health").await?))
        })
        .map_err(|error| failure_from(&error))?;
    let mut text = match args.json {
        true => serde_json::to_string(&StatusAndHealth { status: &status, health: &health })
            .map_err(|error| Failure::device(error, "this is a bug: please report it"))?,
        false => describe(&status, &health),
    };
    text.push('\n');
    let written = std::io::stdout().lock().write_all(text.as_bytes());
    written.or_else(|error| Failure::from_write("to standard output", &error))?;
    if health.healthy { Ok(()) } else { Err(Failure::Found(None)) }
}

/// Formats status and health as text.
fn describe(status: &Status, health: &Health) -> String {
    let mut lines = match &status.simulation {
        None => device(status, health),
        Some(simulation) => array(status, simulation),
    };
    let scans = &health.scans;
    let mode = json_name(&status.scanning.mode);
    let stopped = if status.scanning.paused { " (paused)" } else { "" };
    lines.push(format!(
        "  scans    {} completed, {} stopped, {} failed; {} beams, {} missing; mode {mode}{stopped}",
        scans.completed, scans.stopped, scans.failed, scans.beams, scans.missing,
    ));
    if let Some(scan) = &status.scan {
        lines.push(format!("  scan     {} of {} beams", scan.done, scan.beams));
    }
    lines.extend(health.fit.as_ref().and_then(agreement));
    let better = health.fit.as_ref().and_then(|fit| fit.explanations.first());
    lines.extend(better.map(|better| format!("  fit      better with {better}")));
    let (air, log, clients) = (&status.air, &status.log, &status.subscribers);
    let age = air.age_s.map_or_else(String::new, |age_s| format!(", {age_s:.0} s old"));
    let source = json_name(&air.source) + &age;
    let uncertain = match log.uncertain {
        0 => String::new(),
        count => format!(", {count} uncertain"),
    };
    let file = log.file.as_ref().map_or_else(|| "-".into(), |file| file.display().to_string());
    lines.extend([
        format!(
            "  air      {:.1} C ({source}), sound {:.1} m/s",
            air.temperature_c, air.sound_speed_m_s,
        ),
        format!("  log      {file} ({} records, {} synced{uncertain})", log.written, log.synced),
        format!(
            "  clients  {} live; {} readings dropped, {} disconnected as too slow",
            clients.now, clients.dropped_readings, clients.cut_off,
        ),
    ]);
    lines.extend(status.ros.as_ref().map(ros));
    lines.extend(status.mqtt.as_ref().map(broker));
    lines.extend(pending(&status.pending));
    lines.extend(health.reasons.iter().map(|reason| format!("  problem: {reason}")));
    if let Some(error) = &status.configuration.error {
        lines.push(format!("  the last configuration change was rejected: {error}"));
    }
    let waiting = &status.configuration.needs_restart;
    if !waiting.is_empty() {
        lines.push(format!("  changes that need a restart: {}", waiting.join(", ")));
    }
    lines.join("\n")
}

/// Describes the state of the ROS 2 node.
fn ros(report: &RosReport) -> String {
    let RosReport { domain, messages, dropped, subscriptions, .. } = report;
    let networks = report.networks.join(", ");
    if let Some(why) = &report.error {
        return format!("  ros      domain {domain} not connected: {why}");
    }
    let refusal = report.refusal.as_ref().map(|why| format!("; last rejected: {why}"));
    format!(
        "  ros      domain {domain} on {networks}; {subscriptions} subscriptions, {messages} messages, {dropped} \
         dropped{}",
        refusal.unwrap_or_default()
    )
}

/// Describes the state of the MQTT broker.
fn broker(report: &MqttReport) -> String {
    let MqttReport { broker, acknowledged, skipped, lag_bytes, .. } = report;
    let skipped = match skipped {
        0 => String::new(),
        count => format!("{count} skipped, "),
    };
    let connection = if report.connected { "connected" } else { "not connected" };
    let why = report.error.as_ref().map(|why| format!(" ({why})")).unwrap_or_default();
    let behind_kb = *lag_bytes as f64 / 1e3;
    format!(
        "  mqtt     {broker} {connection}{why}; {acknowledged} records acknowledged, {skipped}{behind_kb:.0} kB behind"
    )
}

/// Describes the agreement of the last scan with the model.
fn agreement(fit: &ScanFit) -> Option<String> {
    let (share, off_m) = (fit.agree_fraction?, fit.median_abs_residual_m?);
    Some(format!(
        "  model    {:.0} % of {} of the last scan agree, median |residual| {}",
        100.0 * share,
        format_count(fit.both_echo, "echo"),
        format_length(off_m),
    ))
}

/// Describes the changes that take effect with the next scan.
fn pending(pending: &Pending) -> Option<String> {
    let parts = [
        pending.plan.map(|plan| {
            format!(
                "sweep {:?} to {:?} degrees, step {:?}, {} pings",
                plan.from_deg, plan.to_deg, plan.step_deg, plan.pings_per_stop
            )
        }),
        pending.pose.map(|p| format!("pose {:?},{:?},{:?}", p.x_m, p.y_m, p.heading_deg)),
        pending.scene.as_ref().map(|scene| format!("scene {}", scene.name)),
        pending.air.as_ref().map(|air| format!("air {:.1} C", air.temperature_c)),
        pending.setup.as_ref().map(|_| "sensor, model or motion".into()),
    ];
    let parts: Vec<String> = parts.into_iter().flatten().collect();
    (!parts.is_empty()).then(|| format!("  pending  with the next scan: {}", parts.join("; ")))
}

/// Describes the ranger and its serial link.
fn device(status: &Status, health: &Health) -> Vec<String> {
    let (device, line) = (status.device.as_ref(), &health.line);
    let mut lines = vec![
        format!(
            "{} on {}; daemon up {}",
            link_state(&status.link),
            status.link.port,
            uptime(status.uptime_s),
        ),
        format!(
            "  device   {} firmware {} ({})",
            device.map_or("-", |device| &device.serial),
            device.map_or("-", |device| &device.firmware),
            json_name(&status.provenance),
        ),
        format!(
            "  link     {} CRC errors, {} requests repeated, {} readings re-requested, {} rejected, {} \
         disconnects",
            line.crc_errors, line.retries, line.repaired, line.rejected, line.losses,
        ),
    ];
    if let Some(ms) = status.link.latency_timer_ms {
        lines.push(format!(
            "  adapter  latency timer {ms} ms: times in records are up to {} ms late (remedy: sonard doctor)",
            f64::from(ms) / 2.0
        ));
    }
    lines
}

/// Describes the simulated array and its readings.
fn array(status: &Status, simulation: &SimulationReport) -> Vec<String> {
    let driving = if simulation.driving { ", driving" } else { "" };
    let pose = &status.pose;
    let readings = simulation.readings.iter().map(|reading| {
        let range = reading.range_m.map_or_else(|| "-".into(), |range_m| format!("{range_m:.2}"));
        format!("{} {range}", reading.id)
    });
    vec![
        format!("SIMULATED: {}; daemon up {}", link_state(&status.link), uptime(status.uptime_s),),
        format!(
            "  array    {}, one ranger every {:.1} ms, {} slots skipped",
            simulation.array, simulation.interval_ms, simulation.skipped,
        ),
        format!(
            "  robot    at {:.2}, {:.2} m, heading {:.1} degrees{driving}",
            pose.x_m, pose.y_m, pose.heading_deg,
        ),
        format!("  ranges   {} m", readings.collect::<Vec<_>>().join(", ")),
    ]
}

/// State of the link and its duration, measured by the daemon's monotonic clock.
fn link_state(link: &LinkReport) -> String {
    let state = link.state.name().replace('_', " ");
    link.for_s.map_or_else(|| state.clone(), |for_s| format!("{state} for {for_s:.1} s"))
}

/// Formats a value as its string in JSON.
fn json_name(value: &impl Serialize) -> String {
    match serde_json::to_value(value) {
        Ok(serde_json::Value::String(json_name)) => json_name,
        _ => "-".into(),
    }
}

/// Formats a duration in its largest unit, for example `42 s`, `11 min`, `3 h` or `5 days`.
fn uptime(seconds: f64) -> String {
    match seconds {
        ..120.0 => format!("{seconds:.0} s"),
        ..7_200.0 => format!("{:.0} min", seconds / 60.0),
        ..172_800.0 => format!("{:.0} h", seconds / 3_600.0),
        _ => format!("{:.0} days", seconds / 86_400.0),
    }
}
