//! `sonard gather`.

use std::{
    collections::BTreeMap,
    io::Write as _,
    sync::{Arc, Mutex, PoisonError},
    time::Duration,
};

use indicatif::ProgressBar;
use jiff::{SignedDuration, Timestamp, civil::Date, tz::TimeZone};
use serde::Serialize;
use tokio::time::sleep;

use super::{
    Failure, Outcome,
    daemon::DaemonsArgs,
    output::OutPath,
    progress,
    runtime::{self, Interrupts},
};
use crate::{
    api::FleetState,
    fleet::plain,
    gather::{Choices, Crew, Refusal, Report, Watcher},
};

/// From round to round.
const EVERY: Duration = Duration::from_secs(2);
/// How long a daemon may keep the others waiting for the next round.
const TURN: Duration = Duration::from_secs(20);
/// Refused records of a log that are named; of more only the number is told.
const SHOWN: u64 = 5;

/// Options of `sonard gather`.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(super) struct Args {
    #[command(flatten)]
    daemon: DaemonsArgs,
    /// Output folder; made if it is not there
    #[arg(long, value_name = "DIR", required = true)]
    out: OutPath,
    /// Leave out logs that ended before: a time (2026-03-01T08:00Z), a day (UTC), or how long ago (36h)
    #[arg(long, value_name = "TIME", value_parser = since)]
    since: Option<Timestamp>,
    /// Go on as records are added; until interrupted, and with daemons that come back
    #[arg(long)]
    follow: bool,
    /// JSON instead of text; one object a daemon
    #[arg(long)]
    json: bool,
}

pub(super) const ABOUT: &str = "\
Collect the logs of many daemons in one folder, which `sonard export` takes as one data set.

Each robot has a folder DIR/ROBOT with its logs, record by record as on its daemon, and gathered.json, which \
records how far each was copied. Run again, it copies what is new; killed at any moment, it continues where it \
stopped, without duplicates or gaps. Daemons are queried in parallel; an unreachable one delays no other.

Invalid records (no record, too long, or of a scan that is not in progress) are left out and reported with \
robot, log and scan. Robots are identified by name (fleet.robot): two with the same name, another one than was \
named or answered there before, and logs that differ from those copied before are refused and never mixed.";

const HELP: &str = "\
Examples:
  sonard gather --out history                          # the daemon of this computer
  sonard gather --fleet fleet.toml --out history
  sonard gather --address kiwi=10.0.0.7:8765 --address 10.0.0.8:8765 --token-file fleet-token --out history
  sonard gather --fleet fleet.toml --out history --since 7d
  sonard gather --fleet fleet.toml --out history --follow
  sonard export history -o all.parquet
  sonard compare history/*/*.jsonl

A log counts for --since as a whole: records of the same log from before that time come too.

Exit codes: 0 all is gathered, or --follow was interrupted, 1 some records were refused, or it was interrupted, 2 wrong \
usage, or a folder that must not be written to, 3 a daemon was away or not the right one, or the disk gave up; the \
others are gathered.";

pub(super) fn run(args: &Args) -> Outcome {
    let daemons = args.daemon.each()?;
    let turn = args.follow.then_some(TURN);
    let choices = Choices { root: args.out.to_path_buf(), since: args.since, turn };
    let mut crew =
        Crew::new(choices, daemons).map_err(|error| Failure::input(&error, &error.help))?;
    runtime::new()?.block_on(async {
        let interrupts = Interrupts::listen();
        tokio::select! {
            gathered = gather(args, &mut crew) => gathered,
            () = interrupts.wait() => match args.follow {
                true => Ok(()),
                false => Err(Failure::Found(Some("stopped on request: what came is kept".into()))),
            },
        }
    })
}

async fn gather(args: &Args, crew: &mut Crew) -> Outcome {
    let bar = if args.follow { ProgressBar::hidden() } else { progress::bytes() };
    let teller = Arc::new(Teller { bar: bar.clone(), refused: Mutex::default() });
    let watcher: Arc<dyn Watcher> = Arc::clone(&teller) as _;
    let mut told = BTreeMap::new();
    loop {
        let reports = crew.round(&watcher).await;
        teller.sum_up();
        bar.suspend(|| reports.iter().try_for_each(|report| tell(report, args.json, &mut told)))?;
        if !args.follow {
            bar.finish_and_clear();
            return judge(&reports);
        }
        sleep(EVERY).await;
    }
}

/// What it came to, of one round.
fn judge(reports: &[Report]) -> Outcome {
    let wrong = reports.iter().filter(|report| report.wrong.is_some()).count();
    if wrong > 0 {
        let message = format!("of {wrong} of {} daemons not all was gathered", reports.len());
        return Err(Failure::device(
            message,
            "each is told with its reason; run it again for the rest",
        ));
    }
    match reports.iter().map(|report| report.tally.refused).sum() {
        0 => Ok(()),
        refused => Err(Failure::Found(Some(format!("{refused} records were refused")))),
    }
}

/// What is told of a daemon with `--json`.
#[derive(Serialize)]
struct Told<'a> {
    robot: Option<&'a str>,
    address: &'a str,
    state: FleetState,
    wrong: Option<&'a str>,
    logs: u64,
    scans: u64,
    records: u64,
    refused: u64,
    bytes: u64,
}

/// Tells how it went with a daemon, unless nothing is new there since it was told last.
fn tell(report: &Report, json: bool, told: &mut BTreeMap<String, Option<String>>) -> Outcome {
    let Report { robot, address, state, tally, wrong } = report;
    let why = wrong.as_ref().map(|(why, _)| why.clone());
    let before = told.insert(address.clone(), why.clone());
    if before == Some(why) && tally.bytes == 0 {
        return Ok(());
    }
    let name = robot.as_deref().unwrap_or(address);
    let line = match (json, wrong) {
        (true, _) => {
            let told = Told {
                robot: robot.as_deref(),
                address,
                state: *state,
                wrong: wrong.as_ref().map(|(why, _)| &**why),
                logs: tally.logs,
                scans: tally.scans,
                records: tally.records,
                refused: tally.refused,
                bytes: tally.bytes,
            };
            let fault = |error| Failure::device(error, "this is a fault of the program");
            serde_json::to_string(&told).map_err(fault)?
        }
        (false, _) => {
            let refused = match tally.refused {
                0 => String::new(),
                count => format!(", {count} refused"),
            };
            let (records, scans, logs) = (tally.records, tally.scans, tally.logs);
            format!("{name}: {records} records more{refused}, {scans} scans, of {logs} logs")
        }
    };
    let written = writeln!(std::io::stdout().lock(), "{line}");
    if let Some((why, help)) = wrong {
        let dash = if help.is_empty() { "" } else { " - " };
        notice!("{name} ({address}): {why}{dash}{help}");
    }
    written.or_else(|error| Failure::from_write("to standard output", &error))
}

/// A robot's log.
type Log = (String, String);

/// Shows how it goes.
struct Teller {
    bar: ProgressBar,
    /// How many lines were refused, of each log.
    refused: Mutex<BTreeMap<Log, u64>>,
}

impl Watcher for Teller {
    fn expect(&self, bytes: u64) {
        self.bar.inc_length(bytes);
    }

    fn came(&self, bytes: u64) {
        self.bar.inc(bytes);
    }

    fn refused(&self, robot: &str, log: &str, refusal: &Refusal) {
        let mut refused = self.refused.lock().unwrap_or_else(PoisonError::into_inner);
        let count = refused.entry((robot.into(), log.into())).or_default();
        *count += 1;
        if *count <= SHOWN {
            let Refusal { at, scan, why } = refusal;
            let scan = scan.map(|scan| format!(", scan {scan}")).unwrap_or_default();
            let why = plain(why);
            self.bar.suspend(|| {
                notice!("warning: {robot}: {log}, byte {at}{scan}: refused: {why}");
            });
        }
    }
}

impl Teller {
    /// Says how many more were refused in this round.
    fn sum_up(&self) {
        let refused =
            std::mem::take(&mut *self.refused.lock().unwrap_or_else(PoisonError::into_inner));
        for ((robot, log), count) in refused {
            if let Some(more) = count.checked_sub(SHOWN).filter(|more| *more > 0) {
                self.bar.suspend(|| {
                    notice!("warning: {robot}: {log}: {more} more refused");
                });
            }
        }
    }
}

/// A time, a day (UTC), or how long ago.
fn since(text: &str) -> Result<Timestamp, String> {
    if let Ok(time) = text.parse::<Timestamp>() {
        return Ok(time);
    }
    if let Ok(day) = text.parse::<Date>() {
        return day.to_zoned(TimeZone::UTC).map(|day| day.timestamp()).map_err(|e| e.to_string());
    }
    let days = text.strip_suffix('d').and_then(|days| days.parse::<i64>().ok());
    let ago = match days {
        Some(days) => days.checked_mul(24).and_then(SignedDuration::try_from_hours),
        None => text.parse::<SignedDuration>().ok(),
    };
    let time =
        ago.filter(|ago| !ago.is_negative()).and_then(|ago| Timestamp::now().checked_sub(ago).ok());
    time.ok_or_else(|| {
        "give a time (2026-03-01T08:00Z), a day (2026-03-01), or how long ago (36h, 7d)".into()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_is_given_as_such_as_a_day_or_as_how_long_ago() {
        let time = |text: &str| since(text).expect(text);
        assert_eq!(time("2026-03-01T08:00Z").to_string(), "2026-03-01T08:00:00Z");
        assert_eq!(time("2026-03-01").to_string(), "2026-03-01T00:00:00Z");
        let hours = |text: &str| {
            (Timestamp::now().duration_since(time(text)).as_secs_f64() / 3600.0).round()
        };
        assert_eq!((hours("36h"), hours("7d")), (36.0, 168.0));
        for bad in ["", "yesterday", "-3h", "99999999999999999999d", "9223372036854775807d"] {
            assert!(since(bad).is_err(), "{bad:?}");
        }
    }
}
