//! `sonard watch`.

use std::io::{self, Write as _};

use http_body_util::BodyExt as _;

use super::{
    Failure, Outcome,
    daemon::{DaemonArgs, refuse},
    runtime::{self, Interrupts},
};
use crate::scan::{PingStatus, Provenance, Record, decode_line};

/// Options of `sonard watch`.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(super) struct Args {
    #[command(flatten)]
    daemon: DaemonArgs,
    /// Only readings that moved by more than this, metres, or whose status changed
    #[arg(long, value_name = "M", conflicts_with = "scans")]
    moved: Option<f64>,
    /// Whole scans when they are over, as JSON
    #[arg(long)]
    scans: bool,
    /// The records themselves, one a line
    #[arg(long)]
    json: bool,
}

const HELP: &str = "\
Examples:
  sonard watch
  sonard watch --moved 0.05
  sonard watch --json | jq 'select(.type == \"ping\") | .range_m'

Ends with the daemon, or when interrupted.
Exit codes: 0 done, 2 wrong usage, 3 no daemon answers.";

pub(super) fn run(args: &Args) -> Outcome {
    let path = match (args.scans, args.moved) {
        (true, _) => "/v1/live/scans".to_owned(),
        (false, Some(moved_m)) => format!("/v1/live/records?moved_m={moved_m}"),
        (false, None) => "/v1/live/records".to_owned(),
    };
    runtime::new()?.block_on(async {
        let interrupts = Interrupts::listen();
        tokio::select! {
            watched = watch(args, &path) => watched,
            () = interrupts.wait() => Ok(()),
        }
    })
}

async fn watch(args: &Args, path: &str) -> Outcome {
    let client = args.daemon.client()?;
    let mut body = client.get(path).await.map_err(|error| refuse(&error))?.into_body();
    let mut rest = Vec::new();
    while let Some(frame) = body.frame().await {
        let frame = frame.map_err(|error| refuse(&error.into()))?;
        rest.extend_from_slice(frame.data_ref().map_or(&[][..], |data| data));
        while let Some(end) = rest.iter().position(|&byte| byte == b'\n') {
            let line: Vec<u8> = rest.drain(..=end).collect();
            let text = match args.json || args.scans {
                true => line,
                false => words(&line).into_bytes(),
            };
            let mut out = io::stdout().lock();
            if let Err(error) = out.write_all(&text).and_then(|()| out.flush()) {
                return Failure::from_write("to standard output", &error);
            }
        }
    }
    Ok(())
}

/// A record as a line for a person.
fn words(line: &[u8]) -> String {
    let line = line.strip_suffix(b"\n").unwrap_or(line);
    match decode_line(line) {
        Ok(Record::Ping(ping)) => {
            let length =
                |metres: Option<f64>| metres.map_or_else(|| "-".into(), |m| format!("{m:.3} m"));
            let status = match ping.status {
                PingStatus::Echo => "echo",
                PingStatus::NoEcho => "silent",
                PingStatus::MinRange => "minimum range",
                PingStatus::LinkLost => "link lost",
                PingStatus::StepDoubtful => "step doubtful",
                PingStatus::ModuleFault => "module fault",
            };
            let model = ping
                .sim
                .as_ref()
                .map_or_else(String::new, |sim| format!("  model {}", length(sim.range_m)));
            let ranger = ping.ranger.map_or_else(String::new, |id| format!("{id:>4} "));
            let made_up = match ping.provenance {
                Some(Provenance::Simulated) => "  (simulated)",
                _ => "",
            };
            format!(
                "{ranger}{:>6.1} deg  {:>9}  {status}{model}{made_up}\n",
                ping.azimuth_deg,
                length(ping.range_m)
            )
        }
        Ok(Record::ScanStart(start)) => {
            format!("scan {} of {} beams\n", start.scan, start.plan.beams())
        }
        Ok(Record::ScanEnd(end)) => {
            format!(
                "scan over: {} beams, {} missing, {:.1} s\n",
                end.beams, end.missing, end.duration_s
            )
        }
        Ok(Record::Event(event)) => format!("{}\n", event.detail),
        Ok(Record::Session(session)) => match &session.array {
            Some(array) => format!("a new session: array {}, simulated\n", array.name),
            None => "a new session\n".into(),
        },
        // What the daemon says about the stream itself.
        Err(_) => format!("{}\n", String::from_utf8_lossy(line)),
    }
}
