//! `sonard status`.

use std::io::Write as _;

use jiff::Timestamp;
use serde_json::{Value, json};

use super::{
    Failure, Outcome,
    daemon::{DaemonArgs, refuse},
    runtime,
};

/// Options of `sonard status`.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(super) struct Args {
    #[command(flatten)]
    daemon: DaemonArgs,
    /// One JSON object: status and health as the API gives them
    #[arg(long)]
    json: bool,
}

const HELP: &str = "\
Examples:
  sonard status
  sonard status --socket /tmp/sonard.sock --json

Exit codes: 0 all is well, 1 something is not, 3 no daemon answers.";

pub(super) fn run(args: &Args) -> Outcome {
    let client = args.daemon.client()?;
    let (status, health): (Value, Value) = runtime::new()?
        .block_on(async {
            Ok((client.get_json("/v1/status").await?, client.get_json("/v1/health").await?))
        })
        .map_err(|error| refuse(&error))?;
    let text = match args.json {
        true => format!("{}\n", json!({ "status": status, "health": health })),
        false => screen(&status, &health),
    };
    let written = std::io::stdout().lock().write_all(text.as_bytes());
    written.or_else(|error| Failure::from_write("to standard output", &error))?;
    if health["healthy"] == true { Ok(()) } else { Err(Failure::Found(None)) }
}

/// One screen for a person.
fn screen(status: &Value, health: &Value) -> String {
    let mut lines = match status["simulation"].is_null() {
        true => device(status, health),
        false => simulation(status),
    };
    lines.push(format!(
        "  scans    {} completed, {} stopped, {} failed; {} beams, {} missing; mode {}{}",
        health["scans"]["completed"],
        health["scans"]["stopped"],
        health["scans"]["failed"],
        health["scans"]["beams"],
        health["scans"]["missing"],
        word(&status["scanning"]["mode"]),
        if status["scanning"]["paused"] == true { " (stopped)" } else { "" },
    ));
    if let Some(scan) = status["scan"].as_object() {
        lines.push(format!("  scan     {} of {} beams", scan["done"], scan["beams"]));
    }
    lines.extend([
        format!(
            "  air      {} C ({}), sound {} m/s",
            figure(&status["air"]["temperature_c"]),
            word(&status["air"]["source"]),
            figure(&status["air"]["sound_speed_m_s"]),
        ),
        format!(
            "  log      {} ({} records, {} synced)",
            word(&status["log"]["file"]),
            status["log"]["written"],
            status["log"]["synced"],
        ),
        format!(
            "  clients  {} live; {} readings dropped, {} cut off",
            status["subscribers"]["now"],
            status["subscribers"]["dropped_readings"],
            status["subscribers"]["cut_off"],
        ),
    ]);
    lines.extend(pending(&status["pending"]));
    let reasons = health["reasons"].as_array().into_iter().flatten();
    lines.extend(reasons.map(|reason| format!("  not well: {}", word(reason))));
    if let Some(error) = status["air"]["error"].as_str() {
        lines.push(format!("  the thermometer can't be read: {error}"));
    }
    if let Some(error) = status["configuration"]["error"].as_str() {
        lines.push(format!("  the last change of the configuration was refused: {error}"));
    }
    lines.join("\n") + "\n"
}

/// What counts from the next scan on.
fn pending(pending: &Value) -> Option<String> {
    let (plan, pose) = (&pending["plan"], &pending["pose"]);
    let parts = [
        (!plan.is_null()).then(|| {
            format!(
                "plan {} to {} degrees, every {}, {} pings",
                plan["from_deg"], plan["to_deg"], plan["step_deg"], plan["pings_per_stop"]
            )
        }),
        (!pose.is_null())
            .then(|| format!("pose {},{},{}", pose["x_m"], pose["y_m"], pose["heading_deg"])),
        pending["scene"]["name"].as_str().map(|scene| format!("scene {scene}")),
        pending["air"]["temperature_c"].as_f64().map(|c| format!("air {c:.1} C")),
        (!pending["setup"].is_null()).then(|| "sensor, model or motion".into()),
    ];
    let parts: Vec<String> = parts.into_iter().flatten().collect();
    (!parts.is_empty()).then(|| format!("  pending  from the next scan on: {}", parts.join("; ")))
}

/// The ranger and its line.
fn device(status: &Value, health: &Value) -> Vec<String> {
    vec![
        format!(
            "{} on {}; the daemon runs for {} s",
            state(status),
            word(&status["link"]["port"]),
            figure(&status["uptime_s"]),
        ),
        format!(
            "  device   {} firmware {} ({})",
            word(&status["device"]["serial"]),
            word(&status["device"]["firmware"]),
            word(&status["provenance"]),
        ),
        format!(
            "  line     {} CRC errors, {} requests repeated, {} readings repaired, {} refused, lost {} \
             times",
            health["line"]["crc_errors"],
            health["line"]["retries"],
            health["line"]["repaired"],
            health["line"]["refused"],
            health["line"]["losses"],
        ),
    ]
}

/// The array that the model plays, and what it reads.
fn simulation(status: &Value) -> Vec<String> {
    let told = &status["simulation"];
    let driving = if told["driving"] == true { ", driving" } else { "" };
    let pose = &status["pose"];
    let metres = |value: &Value| value.as_f64().map_or("-".into(), |m| format!("{m:.2}"));
    let readings = told["readings"].as_array().into_iter().flatten().map(|reading| {
        let (id, range) = (word(&reading["id"]), metres(&reading["range_m"]));
        format!("{id} {range}")
    });
    vec![
        format!(
            "SIMULATED, nothing measured: {}; the daemon runs for {} s",
            state(status),
            figure(&status["uptime_s"]),
        ),
        format!(
            "  array    {}, one ranger each {} ms, {} turns left out",
            word(&told["array"]),
            figure(&told["interval_ms"]),
            told["skipped"],
        ),
        format!(
            "  robot    at {}, {} m, heading {} degrees{driving}",
            metres(&pose["x_m"]),
            metres(&pose["y_m"]),
            figure(&pose["heading_deg"]),
        ),
        format!("  ranges   {} m", readings.collect::<Vec<_>>().join(", ")),
    ]
}

/// What it is doing or suffering, and for how long.
fn state(status: &Value) -> String {
    let link = &status["link"];
    let since = link["since"].as_str().and_then(|time| time.parse::<Timestamp>().ok());
    let seconds = since.map(|since| Timestamp::now().duration_since(since).as_secs_f64());
    format!("{} for {} s", word(&link["state"]).replace('_', " "), figure(&seconds.into()))
}

fn word(value: &Value) -> String {
    value.as_str().unwrap_or("-").to_owned()
}

fn figure(value: &Value) -> String {
    value.as_f64().map_or_else(|| "-".into(), |figure| format!("{figure:.1}"))
}
