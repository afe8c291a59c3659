//! `sonard watch`.

mod fleet;

use std::{
    io::{self, Write as _},
    time::Duration,
};

use tokio::time::sleep;

use super::{
    Failure, Outcome,
    daemon::{Daemons, DaemonsArgs, failure_from},
    interruptible,
};
use crate::{
    backoff::Backoff,
    client::{Client, ClientError, LiveLines},
    scan::{PingStatus, Provenance, Record, decode_line},
};

/// Wait between attempts to reconnect.
const RECONNECT: Backoff = Backoff::new(Duration::from_millis(200), Duration::from_secs(5));

/// Options of `sonard watch`.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(super) struct Args {
    #[command(flatten)]
    daemon: DaemonsArgs,
    /// Only readings whose range changed by more than this, metres, or whose status changed
    #[arg(long, value_name = "M", conflicts_with = "scans")]
    moved: Option<f64>,
    /// Complete scans, as JSON
    #[arg(long)]
    scans: bool,
    /// JSON instead of text; one record per line, for several daemons as `record` with its `robot`
    #[arg(long)]
    json: bool,
    /// Reconnect when the daemon restarts; readings in between are not shown; always on for several
    /// daemons
    #[arg(long)]
    reconnect: bool,
}

const HELP: &str = "\
Examples:
  sonard watch
  sonard watch --moved 0.05
  sonard watch --reconnect >>readings.txt
  sonard watch --fleet fleet.toml
  sonard watch --json | jq 'select(.type == \"ping\") | .range_m'

Exit codes: 0 interrupted or output closed, 2 wrong usage, 3 no daemon responds, or it ended the
stream (with --reconnect: it rejected the request).";

pub(super) fn run(args: &Args) -> Outcome {
    let path = match (args.scans, args.moved) {
        (true, _) => "/v1/live/scans".to_owned(),
        (false, Some(moved_m)) => format!("/v1/live/records?moved_m={moved_m}"),
        (false, None) => "/v1/live/records".to_owned(),
    };
    interruptible::run_interruptible(async |interrupts| {
        tokio::select! {
            watch_all = watch_all(args, &path) => watch_all,
            () = interrupts.wait() => Ok(()),
        }
    })
}

/// Watches one or more daemons.
async fn watch_all(args: &Args, path: &str) -> Outcome {
    match args.daemon.daemons()? {
        Daemons::One(client) => watch(args, client, path).await,
        Daemons::Several(daemons) => fleet::watch(daemons, path, args.json || args.scans).await,
    }
}

/// Reason for the end of a stream.
enum StreamEnd {
    /// The reader of the output closed it.
    Reader(Outcome),
    /// The daemon ended it, or the connection was lost.
    Daemon(String),
}

async fn watch(args: &Args, client: Client, path: &str) -> Outcome {
    let mut lines = client.live(path).await.map_err(|error| failure_from(&error))?;
    loop {
        let why = match follow(args, lines).await {
            StreamEnd::Reader(outcome) => return outcome,
            StreamEnd::Daemon(why) => why,
        };
        if !args.reconnect {
            return Err(Failure::device(
                why,
                "it was stopped, does not respond, or this client was too slow; received lines are complete. \
                 Use --reconnect to wait for it",
            ));
        }
        notice!("{why}: reconnecting");
        lines = reconnect(&client, path).await?;
        notice!("reconnected; readings in between are in the daemon's log");
    }
}

/// Retries until the daemon responds or rejects the request.
async fn reconnect(client: &Client, path: &str) -> Result<LiveLines, Failure> {
    let mut backoff = RECONNECT;
    loop {
        sleep(backoff.next_wait()).await;
        match client.live(path).await {
            Ok(lines) => return Ok(lines),
            Err(error) if error.is_final() => return Err(failure_from(&error)),
            Err(_not_yet) => {}
        }
    }
}

/// Prints complete lines as they arrive.
async fn follow(args: &Args, mut lines: LiveLines) -> StreamEnd {
    loop {
        let line = match lines.next().await {
            Ok(Some(line)) => line,
            Ok(None) => return StreamEnd::Daemon("the daemon ended the stream".into()),
            Err(ClientError::Closed(error)) => {
                return StreamEnd::Daemon(format!("connection lost: {error}"));
            }
            Err(error) => return StreamEnd::Daemon(error.to_string()),
        };
        let text = match args.json || args.scans {
            true => line,
            false => format_record(&line).into_bytes(),
        };
        let mut out = io::stdout().lock();
        if let Err(error) = out.write_all(&text).and_then(|()| out.flush()) {
            return StreamEnd::Reader(Failure::from_write("to standard output", &error));
        }
    }
}

/// Formats a record as a line of text.
fn format_record(line: &[u8]) -> String {
    let line = line.strip_suffix(b"\n").unwrap_or(line);
    match decode_line(line) {
        Ok(Record::Ping(ping)) => {
            let length =
                |metres: Option<f64>| metres.map_or_else(|| "-".into(), |m| format!("{m:.3} m"));
            let status = match ping.status {
                PingStatus::Echo => "echo",
                PingStatus::NoEcho => "no echo",
                PingStatus::MinRange => "minimum range",
                PingStatus::LinkLost => "link lost",
                PingStatus::StepUncertain => "step uncertain",
                PingStatus::ModuleFault => "module fault",
            };
            let model = ping
                .sim
                .as_ref()
                .map_or_else(String::new, |sim| format!("  model {}", length(sim.range_m)));
            let ranger = ping.ranger.map_or_else(String::new, |id| format!("{id:>4} "));
            let simulated = match ping.provenance {
                Some(Provenance::Simulated) => "  (simulated)",
                _ => "",
            };
            format!(
                "{ranger}{:>6.1} deg  {:>9}  {status}{model}{simulated}\n",
                ping.azimuth_deg,
                length(ping.range_m)
            )
        }
        Ok(Record::ScanStart(start)) => {
            format!("scan {} of {} beams\n", start.scan, start.plan.beams())
        }
        Ok(Record::ScanEnd(end)) => {
            format!(
                "scan complete: {} beams, {} missing, {:.1} s\n",
                end.beams, end.missing, end.duration_s
            )
        }
        Ok(Record::Event(event)) => format!("{}\n", event.detail),
        Ok(Record::Session(session)) => match &session.array {
            Some(array) => format!("new session: array {}, simulated\n", array.name),
            None => "new session\n".into(),
        },
        // Lines about the stream itself are printed as they are.
        Err(_) => format!("{}\n", String::from_utf8_lossy(line)),
    }
}
