//! `sonard status` of several daemons.

use std::io::Write as _;

use comfy_table::Table;
use serde::Serialize;
use tokio::task::JoinSet;

use crate::{
    api::{FleetState, Health, Status},
    cli::{
        Failure, Outcome, runtime,
        table::{fit, ruled},
    },
    fleet::{Observation, PolledDaemon, observe, poll},
};

/// Object of `--json` for a daemon.
#[derive(Serialize)]
struct FleetRow<'a> {
    robot: Option<&'a str>,
    address: String,
    state: FleetState,
    problems: &'a [String],
    status: Option<&'a Status>,
    health: Option<&'a Health>,
}

/// Queries all daemons in parallel, and prints the results in their order.
pub(super) fn run(daemons: &[PolledDaemon], json: bool) -> Outcome {
    let seen = runtime::new()?.block_on(query_all(daemons));
    let rows: Vec<_> = daemons.iter().zip(&seen).map(|(of, seen)| fleet_row(of, seen)).collect();
    let mut text = match json {
        true => json_lines(&rows)?,
        false => fit(table(&rows)),
    };
    text.push('\n');
    let written = std::io::stdout().lock().write_all(text.as_bytes());
    written.or_else(|error| Failure::from_write("to standard output", &error))?;
    let missing = rows.iter().filter(|row| row.status.is_none()).count();
    if missing > 0 {
        let message = format!("{missing} of {} daemons did not respond", rows.len());
        return Err(Failure::device(message, "see the reasons in the table"));
    }
    let well = rows.iter().all(|row| row.state == FleetState::Healthy);
    if well { Ok(()) } else { Err(Failure::Found(None)) }
}

async fn query_all(daemons: &[PolledDaemon]) -> Vec<Observation> {
    let mut tasks = JoinSet::new();
    for (number, PolledDaemon { member, client }) in daemons.iter().enumerate() {
        let (robot, client) = (member.robot.clone(), client.clone());
        tasks.spawn(async move { (number, observe(robot.as_deref(), poll(&client).await)) });
    }
    let mut seen = tasks.join_all().await;
    seen.sort_by_key(|(number, _)| *number);
    seen.into_iter().map(|(_, seen)| seen).collect()
}

fn fleet_row<'a>(of: &'a PolledDaemon, seen: &'a Observation) -> FleetRow<'a> {
    let report = seen.report.as_ref();
    FleetRow {
        robot: report.map(|report| &*report.status.robot).or(of.member.robot.as_deref()),
        address: of.member.address(),
        state: seen.state,
        problems: &seen.problems,
        status: report.map(|report| &report.status),
        health: report.map(|report| &report.health),
    }
}

fn json_lines(rows: &[FleetRow]) -> Result<String, Failure> {
    let json_lines: Result<Vec<_>, _> = rows.iter().map(serde_json::to_string).collect();
    let fault = |error| Failure::device(error, "this is a bug: please report it");
    Ok(json_lines.map_err(fault)?.join("\n"))
}

fn table(rows: &[FleetRow]) -> Table {
    let mut table =
        ruled(["robot", "state", "scan", "last reading", "agreement", "missing", "problems"]);
    for row in rows {
        let fit = row.health.and_then(|health| health.fit.as_ref());
        let or_dash = |text: Option<String>| text.unwrap_or_else(|| "-".into());
        let scan = row.status.and_then(|status| status.scan.as_ref());
        let age_s = row.status.and_then(|status| status.last_reading_age_s);
        let share = fit.and_then(|fit| fit.agree_fraction);
        table.add_row([
            row.robot.map_or_else(|| row.address.clone(), str::to_owned),
            describe_state(row),
            or_dash(scan.map(|scan| format!("{} of {}", scan.done, scan.beams))),
            or_dash(age_s.map(|age_s| format!("{age_s:.1} s ago"))),
            or_dash(share.map(|share| format!("{:.0} %", 100.0 * share))),
            or_dash(fit.map(|fit| fit.missing.to_string())),
            row.problems.join("; "),
        ]);
    }
    table
}

/// Describes the state, or why it is unknown.
fn describe_state(row: &FleetRow) -> String {
    match (row.status, row.state) {
        (Some(status), _) => status.link.state.name().replace('_', " "),
        (None, FleetState::NoResponse) => "OFFLINE".into(),
        (None, FleetState::Rejected) => "REJECTED".into(),
        (None, FleetState::OtherRobot) => "OTHER ROBOT".into(),
        (None, _) => "NO DAEMON".into(),
    }
}
