//! `sonard watch`.

mod fleet;

use std::{
    io::{self, Write as _},
    time::Duration,
};

use tokio::time::sleep;

use super::{
    Failure, Outcome,
    daemon::{Daemons, DaemonsArgs, refuse},
    runtime,
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
    /// Only readings that moved by more than this, metres, or whose status changed
    #[arg(long, value_name = "M", conflicts_with = "scans")]
    moved: Option<f64>,
    /// Whole scans when they are over, as JSON
    #[arg(long)]
    scans: bool,
    /// JSON instead of text; the records themselves, one a line, of several daemons each as `record`
    /// beside its `robot`
    #[arg(long)]
    json: bool,
    /// Wait for a daemon that goes away, and go on when it is back; what it measures meanwhile is not
    /// shown; of several, each is waited for anyway
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

Exit codes: 0 interrupted, or nobody reads its output any more; 2 wrong usage; 3 no daemon answers, or
it ended the stream (with --reconnect: it refused to go on).";

pub(super) fn run(args: &Args) -> Outcome {
    let path = match (args.scans, args.moved) {
        (true, _) => "/v1/live/scans".to_owned(),
        (false, Some(moved_m)) => format!("/v1/live/records?moved_m={moved_m}"),
        (false, None) => "/v1/live/records".to_owned(),
    };
    runtime::run_interruptible(async |interrupts| {
        tokio::select! {
            watched = watched(args, &path) => watched,
            () = interrupts.wait() => Ok(()),
        }
    })
}

/// One daemon, or several at a time.
async fn watched(args: &Args, path: &str) -> Outcome {
    match args.daemon.daemons()? {
        Daemons::One(client) => watch(args, client, path).await,
        Daemons::Several(daemons) => fleet::watch(daemons, path, args.json || args.scans).await,
    }
}

/// Why a stream is over.
enum Over {
    /// Nobody reads what is written here.
    Reader(Outcome),
    /// The daemon ended it, or broke off.
    Daemon(String),
}

async fn watch(args: &Args, client: Client, path: &str) -> Outcome {
    let mut lines = client.live(path).await.map_err(|error| refuse(&error))?;
    loop {
        let why = match follow(args, lines).await {
            Over::Reader(outcome) => return outcome,
            Over::Daemon(why) => why,
        };
        if !args.reconnect {
            return Err(Failure::device(
                why,
                "it was stopped, hangs, or this client was too slow for it; lines that came are whole. \
                 --reconnect waits for it and goes on",
            ));
        }
        notice!("{why}: waiting for it");
        lines = again(&client, path).await?;
        notice!("the daemon answers again; its log has what was measured meanwhile");
    }
}

/// Asks until the daemon answers; only a refusal ends that.
async fn again(client: &Client, path: &str) -> Result<LiveLines, Failure> {
    let mut backoff = RECONNECT;
    loop {
        sleep(backoff.next_wait()).await;
        match client.live(path).await {
            Ok(lines) => return Ok(lines),
            Err(error) if error.is_final() => return Err(refuse(&error)),
            Err(_not_yet) => {}
        }
    }
}

/// Writes lines as they come, each only when it is whole.
async fn follow(args: &Args, mut lines: LiveLines) -> Over {
    loop {
        let line = match lines.next().await {
            Ok(Some(line)) => line,
            Ok(None) => return Over::Daemon("the daemon ended the stream".into()),
            Err(ClientError::Http(error)) => {
                return Over::Daemon(format!("the daemon broke off: {error}"));
            }
            Err(error) => return Over::Daemon(error.to_string()),
        };
        let text = match args.json || args.scans {
            true => line,
            false => words(&line).into_bytes(),
        };
        let mut out = io::stdout().lock();
        if let Err(error) = out.write_all(&text).and_then(|()| out.flush()) {
            return Over::Reader(Failure::from_write("to standard output", &error));
        }
    }
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
