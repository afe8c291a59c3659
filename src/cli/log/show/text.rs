//! Contents of a log as text.

use std::io::{self, Write};

use comfy_table::Table;
use uuid::Uuid;

use super::{
    readings::Readings,
    summary::{Item, Scan, Summary},
};
use crate::{
    cli::{
        compare::describe_path,
        table::{align_right, fit, ruled},
    },
    scan::{Ping, PingStatus, Record, Session, text::format_count},
    store::Line,
};

/// Prints sessions with a table of their scans and events, and with `pings` every reading.
pub(super) fn print(
    out: &mut impl Write,
    summary: &Summary,
    mut pings: Option<Readings>,
) -> io::Result<()> {
    if summary.items.is_empty() {
        writeln!(out, "the log is empty")?;
    }
    let mut scans = Vec::new();
    for item in &summary.items {
        if let Item::Scan(scan) = item {
            scans.push(&**scan);
            continue;
        }
        print_scans(out, &mut scans, pings.as_mut())?;
        match item {
            Item::Session(session) => print_session(out, session)?,
            Item::Event(event) => print_event(out, event)?,
            Item::Damaged { line, fault } => writeln!(out, "damaged   line {line}: {fault}")?,
            Item::MoreDamaged { lines } => {
                writeln!(
                    out,
                    "damaged   {}; `sonard log verify --all` lists them",
                    format_count(*lines, "more line")
                )?;
            }
            Item::Scan(_) => {}
        }
    }
    print_scans(out, &mut scans, pings.as_mut())
}

/// Prints a line of a log as it arrives.
pub(super) fn print_line(out: &mut impl Write, line: &Line, pings: bool) -> io::Result<()> {
    match &line.record {
        Ok(Record::Session(session)) => print_session(out, session),
        Ok(Record::ScanStart(start)) => {
            let pose = format_pose(start.pose);
            let beams = start.plan.check().map_or(0, |()| start.plan.beams());
            let (time, id) = (seconds(start.time), short_id(start.scan));
            writeln!(out, "scan      {time}  {id} starts at {pose}, {beams} beams")
        }
        Ok(Record::Ping(ping)) if pings => writeln!(out, "{}", format_ping(ping)),
        Ok(Record::Ping(_)) => Ok(()),
        Ok(Record::ScanEnd(end)) => {
            let (time, id, beams) = (seconds(end.time), short_id(end.scan), end.beams);
            let (missing, repaired, took_s) = (end.missing, end.repaired, end.duration_s);
            writeln!(
                out,
                "scan      {time}  {id} ends after {took_s:.1} s: {beams} beams, {missing} \
                 missing, {repaired} repaired"
            )
        }
        Ok(Record::Event(event)) => print_event(out, event),
        Err(error) => writeln!(out, "damaged   {error}"),
    }
}

fn print_session(out: &mut impl Write, session: &Session) -> io::Result<()> {
    let Session { started, sonard, provenance, device, sensor, array, air, scene, model, .. } =
        session;
    let build = session.build.as_ref().map(|build| format!(" ({})", build.commit));
    let build = build.unwrap_or_default();
    let provenance = format!("{provenance:?}").to_lowercase();
    writeln!(out, "session   {}  {provenance}, sonard {sonard}{build}", seconds(*started))?;
    if let Some(robot) = &session.robot {
        writeln!(out, "  robot   {robot}")?;
    }
    if let Some(device) = device {
        let (serial, firmware, boot) = (&device.serial, &device.firmware, &device.boot);
        let steps = device.steps_per_revolution;
        writeln!(
            out,
            "  device  {serial}, firmware {firmware}, boot {boot}, {steps} steps per revolution"
        )?;
    }
    if let Some(of) = &session.collection {
        let pose = of.pose_name.as_ref().map_or_else(String::new, |name| format!(" ({name})"));
        writeln!(out, "  collected for {}, pose {}{pose}, repeat {}", of.name, of.pose, of.repeat)?;
    }
    let (celsius, humidity, speed) = (air.temperature_c, air.humidity_percent, air.sound_speed_m_s);
    writeln!(out, "  sensor  {}; air {celsius} C, {humidity} %, {speed:.2} m/s", sensor.name)?;
    if let Some(array) = array {
        let (name, count) = (&array.name, array.rangers.len());
        writeln!(out, "  array   {name}: {count} rangers, one every {} ms", array.interval_ms)?;
    }
    let scene = scene.as_ref().map_or("no scene", |scene| &scene.name);
    let model = model.as_ref().map_or("none", |model| &model.engine);
    writeln!(out, "  scene   {scene}; model {model}")
}

fn print_event(out: &mut impl Write, event: &crate::scan::Event) -> io::Result<()> {
    let kind = match serde_json::to_value(event.kind) {
        Ok(serde_json::Value::String(name)) => name,
        _ => String::new(),
    };
    writeln!(out, "event     {}  {kind}: {}", seconds(event.time), event.detail)
}

/// Prints the scans collected so far and empties the list.
fn print_scans(
    out: &mut impl Write,
    scans: &mut Vec<&Scan>,
    pings: Option<&mut Readings>,
) -> io::Result<()> {
    if scans.is_empty() {
        return Ok(());
    }
    writeln!(out, "{}", fit(scan_table(scans)))?;
    let scans = scans.drain(..);
    let Some(pings) = pings else { return Ok(()) };
    for scan in scans {
        writeln!(out, "scan {}", scan.scan)?;
        writeln!(out, "{PING_HEADER}")?;
        for ping in pings.take(scan.scan) {
            writeln!(out, "{}", format_ping(&ping))?;
        }
    }
    Ok(())
}

fn scan_table(scans: &[&Scan]) -> Table {
    let mut table = ruled([
        "scan",
        "started",
        "pose",
        "beams",
        "echo",
        "min",
        "none",
        "lost",
        "uncertain",
        "repaired",
        "|res| mm",
        "time/limit s",
    ]);
    for scan in scans {
        let planned = scan.planned.map_or("?".into(), |planned| planned.to_string());
        let took = match &scan.end {
            Some(end) => format!("{:.1}/{:.1}", end.duration_s, end.acoustic_limit_s),
            None => "incomplete".into(),
        };
        table.add_row([
            short_id(scan.scan),
            scan.time.map_or("?".into(), seconds),
            scan.pose.map_or("?".into(), format_pose),
            format!("{}/{planned}", scan.pings),
            scan.echo.to_string(),
            scan.min_range.to_string(),
            scan.no_echo.to_string(),
            scan.link_lost.to_string(),
            scan.step_uncertain.to_string(),
            scan.end.as_ref().map_or("?".into(), |end| end.repaired.to_string()),
            scan.median_abs_residual_m.map_or("-".into(), |m| format!("{:.1}", m * 1e3)),
            took,
        ]);
    }
    align_right(&mut table, 3..12);
    table
}

const PING_HEADER: &str =
    " beam  azimuth  status     range m    sim m   res mm  margin dB  predicted path";

/// Formats a reading as a line below [`PING_HEADER`].
fn format_ping(ping: &Ping) -> String {
    let number = |value: Option<f64>, scale: f64, digits: usize| match value {
        Some(value) => format!("{:.digits$}", value * scale),
        None => "-".into(),
    };
    let status = match ping.status {
        PingStatus::Echo => "echo",
        PingStatus::NoEcho => "no echo",
        PingStatus::MinRange => "min range",
        PingStatus::LinkLost => "link lost",
        PingStatus::StepUncertain => "uncertain",
        PingStatus::ModuleFault => "not fired",
    };
    let sim = ping.sim.as_ref();
    let path = sim.and_then(|sim| sim.path.as_ref()).or(ping.path.as_ref());
    let path = path.map_or(String::new(), describe_path);
    format!(
        "{:5}  {:7.1}  {status:9}  {:>7}  {:>7}  {:>7}  {:>9}  {path}{}",
        ping.index,
        ping.azimuth_deg,
        number(ping.range_m, 1.0, 4),
        number(sim.and_then(|sim| sim.range_m), 1.0, 4),
        number(ping.residual_m, 1e3, 1),
        number(sim.and_then(|sim| sim.margin_db).or(ping.margin_db), 1.0, 1),
        match (ping.repaired, &ping.ranger) {
            (true, _) => "  (repaired)".to_owned(),
            (false, Some(ranger)) => format!("  (ranger {ranger})"),
            (false, None) => String::new(),
        },
    )
}

fn short_id(scan: Uuid) -> String {
    scan.to_string()[..8].to_owned()
}

fn seconds(time: jiff::Timestamp) -> String {
    format!("{time:.0}")
}

fn format_pose(pose: crate::geometry::Pose) -> String {
    format!("{},{},{}", pose.x_m, pose.y_m, pose.heading_deg)
}
