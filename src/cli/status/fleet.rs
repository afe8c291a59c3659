//! `sonard status` of several daemons.

use std::io::Write as _;

use comfy_table::Table;
use serde::Serialize;
use tokio::task::JoinSet;

use crate::{
    api::{FleetState, Health, Status},
    cli::{Failure, Outcome, compare::RULED, runtime},
    fleet::{Asked, Seen, ask, judge},
};

/// What is told of a daemon with `--json`.
#[derive(Serialize)]
struct Told<'a> {
    robot: Option<&'a str>,
    address: String,
    state: FleetState,
    wrong: &'a [String],
    status: Option<&'a Status>,
    health: Option<&'a Health>,
}

/// Asks all at once, each in its own time, and tells of them in their order.
pub(super) fn run(daemons: &[Asked], json: bool) -> Outcome {
    let seen = runtime::new()?.block_on(look(daemons));
    let rows: Vec<_> = daemons.iter().zip(&seen).map(|(of, seen)| told(of, seen)).collect();
    let mut text = match json {
        true => lines(&rows)?,
        false => table(&rows).to_string(),
    };
    text.push('\n');
    let written = std::io::stdout().lock().write_all(text.as_bytes());
    written.or_else(|error| Failure::from_write("to standard output", &error))?;
    let silent = rows.iter().filter(|row| row.status.is_none()).count();
    if silent > 0 {
        let message = format!("{silent} of {} daemons did not say how they are", rows.len());
        return Err(Failure::device(message, "the table says why, for each"));
    }
    let well = rows.iter().all(|row| row.state == FleetState::Well);
    if well { Ok(()) } else { Err(Failure::Found(None)) }
}

async fn look(daemons: &[Asked]) -> Vec<Seen> {
    let mut asking = JoinSet::new();
    for (number, Asked { member, client }) in daemons.iter().enumerate() {
        let (robot, client) = (member.robot.clone(), client.clone());
        asking.spawn(async move { (number, judge(robot.as_deref(), ask(&client).await)) });
    }
    let mut seen = asking.join_all().await;
    seen.sort_by_key(|(number, _)| *number);
    seen.into_iter().map(|(_, seen)| seen).collect()
}

fn told<'a>(of: &'a Asked, seen: &'a Seen) -> Told<'a> {
    let said = seen.told.as_ref();
    Told {
        robot: said.map(|told| &*told.status.robot).or(of.member.robot.as_deref()),
        address: of.member.address(),
        state: seen.state,
        wrong: &seen.wrong,
        status: said.map(|told| &told.status),
        health: said.map(|told| &told.health),
    }
}

fn lines(rows: &[Told]) -> Result<String, Failure> {
    let lines: Result<Vec<_>, _> = rows.iter().map(serde_json::to_string).collect();
    let fault = |error| Failure::device(error, "this is a fault of the program");
    Ok(lines.map_err(fault)?.join("\n"))
}

fn table(rows: &[Told]) -> Table {
    let mut table = Table::new();
    table.load_style(RULED).set_header([
        "robot",
        "state",
        "scan",
        "last reading",
        "agreement",
        "missing",
        "what is wrong",
    ]);
    for row in rows {
        let fit = row.health.and_then(|health| health.fit.as_ref());
        let or_dash = |text: Option<String>| text.unwrap_or_else(|| "-".into());
        let scan = row.status.and_then(|status| status.scan.as_ref());
        let age_s = row.status.and_then(|status| status.last_reading_age_s);
        let share = fit.and_then(|fit| fit.agree_fraction);
        table.add_row([
            row.robot.map_or_else(|| row.address.clone(), str::to_owned),
            state(row),
            or_dash(scan.map(|scan| format!("{} of {}", scan.done, scan.beams))),
            or_dash(age_s.map(|age_s| format!("{age_s:.1} s ago"))),
            or_dash(share.map(|share| format!("{:.0} %", 100.0 * share))),
            or_dash(fit.map(|fit| fit.missing.to_string())),
            row.wrong.join("; "),
        ]);
    }
    table
}

/// What it is doing, or why it does not say so.
fn state(row: &Told) -> String {
    match (row.status, row.state) {
        (Some(status), _) => status.link.state.name().replace('_', " "),
        (None, FleetState::Silent) => "SILENT".into(),
        (None, FleetState::Refusing) => "REFUSES".into(),
        (None, FleetState::OtherRobot) => "OTHER ROBOT".into(),
        (None, _) => "NO DAEMON".into(),
    }
}
