//! `sonard collect`.

mod adopt;
mod load;
mod local_device;
mod observer;
mod preview;
mod report;
mod terminal;

use std::{
    io::Write as _,
    path::{Path, PathBuf},
};

use indicatif::ProgressBar;
use rustix::process::Signal;
use tokio::signal::unix::{SignalKind, signal};

use super::{
    Failure, Outcome,
    daemon::{DaemonArgs, check_scene},
    interruptible,
    mock_world::{self, MockWorldArgs},
    output::OutPath,
    runtime::Interrupts,
};
use crate::{
    collect::{
        CollectError, CollectionFolder, CollectionJournal, CollectionKeys, CollectionManifest,
        CollectionPlan, FolderError, JOURNAL, RemoteDevice, RunOptions, ScanDevice,
        verify_collection,
    },
    config::document,
};
use load::{describe, load};
use local_device::LocalDevice;
use observer::TerminalObserver;

/// Options of `sonard collect`.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
#[command(group(clap::ArgGroup::new("device").args(["port", "mock", "emulator", "daemon"])))]
#[command(group(clap::ArgGroup::new("instead").args(["example", "check", "plan_only", "verify", "report"])))]
pub(super) struct Args {
    /// The plan, a TOML file; `sonard collect --example` prints one with all keys explained
    #[arg(value_name = "PLAN.toml", required_unless_present_any = ["example", "verify", "report"])]
    plan: Option<PathBuf>,
    /// Output folder; instead of the one in the plan
    #[arg(long, value_name = "DIR")]
    out: Option<OutPath>,
    /// Override a key of the file (repeatable)
    #[arg(long, value_name = "SECTION.KEY=VALUE")]
    set: Vec<String>,
    /// Print an example file with all keys explained, and exit; a plan, with ranges and defaults
    #[arg(long)]
    example: bool,
    /// Validate the file and all that it names, and exit
    #[arg(long)]
    check: bool,
    /// Estimate duration and disk use, and exit
    #[arg(long)]
    plan_only: bool,
    /// JSON instead of text; one object, with --plan-only
    #[arg(long, requires = "plan_only")]
    json: bool,
    /// Check files against their digests, and exit; those of a collection's folder
    #[arg(long, value_name = "DIR", conflicts_with = "plan")]
    verify: Option<PathBuf>,
    /// Regenerate report and manifest of a collection's folder, and exit
    #[arg(long, value_name = "DIR", conflicts_with = "plan")]
    report: Option<PathBuf>,
    /// Continue although plan, scene or ranger have changed since the start
    #[arg(long)]
    accept_changed_plan: bool,
    /// Retry the scans that failed
    #[arg(long)]
    retry_failed: bool,
    /// Serial port of the ranger: a path, a name in /dev/serial/by-id, or a USB serial number
    #[arg(long, value_name = "PATH|ID")]
    port: Option<String>,
    /// Use a mock ranger instead of a real one; it is placed at each pose
    #[arg(long)]
    mock: bool,
    /// Run the firmware's machine code in an emulated board (starts sonard-emulator); one board per
    /// pose
    #[arg(long)]
    emulator: bool,
    /// Let a running daemon take the scans; with its ranger, sensor and motion, and its own scans
    /// paused meanwhile
    #[arg(long, conflicts_with_all = mock_world::OPTIONS)]
    daemon: bool,
    #[command(flatten)]
    at: DaemonArgs,
    #[command(flatten)]
    world: MockWorldArgs,
}

pub(super) const ABOUT: &str = "\
Take scans by a plan, over days: poses, repeats, checks, a report.

Each scan is a log of its own; it counts once it is complete and passes the plan's checks. \
Interrupted or rejected scans are kept separately and repeated. An interrupted collection (signal, \
crash, power failure, lost ranger) resumes when it is started again. At the end there is a report \
with pictures and a manifest with checksums.

With --daemon, a running `sonard run` takes the scans, and logs them too. Motion, sensor and air \
that the plan does not specify are the daemon's; a conflicting plan is rejected with the key to \
change. The daemon's own scans are paused meanwhile and resume at the end.";

const EXAMPLES: &str = "\
Examples:
  sonard collect --example > plan.toml
  sonard collect plan.toml --plan-only
  sonard collect plan.toml --mock --out trial
  sonard collect plan.toml --port /dev/ttyACM0
  sonard collect plan.toml --daemon
  sonard collect --verify collection
  sonard compare collection/scans/*.jsonl

In the folder: scans/ (valid scans), rejected/ (interrupted or rejected), journal.jsonl, manifest.json,
report.md with report/, inputs/ (plan, scene and sensor as used).

Exit codes: 0 all scans are complete, 1 interrupted, some scans failed, or --verify found a fault, 2 wrong
plan or input, 3 device, link or disk error.";

pub(super) fn run(args: &Args) -> Outcome {
    if args.example {
        return print(&document::<CollectionKeys>());
    }
    if let Some(root) = &args.verify {
        return verify_folder(root);
    }
    if let Some(root) = &args.report {
        return write_report(root);
    }
    let mut plan = load(args)?;
    interruptible::run_interruptible(async |interrupts| {
        let daemon = match args.daemon {
            true => Some(find_daemon(args, &mut plan, interrupts.clone()).await?),
            false => None,
        };
        if args.check {
            return print(&describe(&plan));
        }
        if args.plan_only {
            return print(&preview::render(&plan, args)?);
        }
        // With a handler, exceeding the file-size limit is an error of the write instead of the end
        // of the process.
        let _too_large = signal(SignalKind::from_raw(Signal::XFSZ.as_raw()));
        match daemon {
            Some(daemon) => collect(args, plan, daemon, interrupts).await,
            None => {
                let device = LocalDevice::new(args, &plan, interrupts.clone());
                collect(args, plan, device, interrupts).await
            }
        }
    })
}

async fn collect(
    args: &Args,
    plan: CollectionPlan,
    device: impl ScanDevice,
    interrupts: Interrupts,
) -> Outcome {
    let choices = RunOptions {
        accept_changed_plan: args.accept_changed_plan,
        retry_given_up: args.retry_failed,
    };
    let observer = TerminalObserver::new(plan.azimuths.beams());
    Ok(crate::collect::collect(plan, choices, device, observer, interrupts).await?)
}

/// Finds the daemon, and checks that it can take the plan's scans.
async fn find_daemon(
    args: &Args,
    plan: &mut CollectionPlan,
    interrupts: Interrupts,
) -> Result<RemoteDevice, Failure> {
    let notify = |line: &str| notice!("{line}");
    let (daemon, status) = RemoteDevice::open(args.at.client()?, interrupts, notify).await?;
    let is_unknown = plan.keys.place.scene.is_empty() && status.scene.is_none();
    if !is_unknown {
        check_scene(status.scene.as_ref(), &plan.scene)?;
    }
    adopt::adopt(plan, &daemon, &status)?;
    Ok(daemon)
}

fn verify_folder(root: &Path) -> Outcome {
    let files =
        CollectionManifest::read(root).map_err(|error| missing_manifest(root, &error))?.files.len();
    let bar = ProgressBar::new(files as u64);
    let verified = verify_collection(root, || bar.inc(1)).map_err(|error| failure_from(&error));
    bar.finish_and_clear();
    let verified = verified?;
    let counts = &verified.manifest.counts;
    let mut text = format!(
        "{}: {} of {} scans, {} rejected, {} failed; {files} files\n",
        verified.manifest.name, counts.accepted, counts.wanted, counts.set_aside, counts.given_up,
    );
    for problem in &verified.problems {
        text += &format!("  {problem}\n");
    }
    if verified.problems.is_empty() {
        text += "all digests match\n";
    }
    print(&text)?;
    if verified.problems.is_empty() { Ok(()) } else { Err(Failure::Found(None)) }
}

fn missing_manifest(root: &Path, error: &FolderError) -> Failure {
    let help = if root.join(JOURNAL).exists() {
        "no scan was completed, or the manifest was removed: continue the collection, or \
         run `sonard collect --report DIR`"
    } else {
        "give the folder of a collection"
    };
    Failure::input(error, help)
}

/// Writes report and manifest of a folder, unless a collection is running in it.
fn write_report(root: &Path) -> Outcome {
    let folder = CollectionFolder::existing(root);
    if !folder.journal().exists() {
        return Err(Failure::input(
            format!("{} is not a collection: it has no {JOURNAL}", root.display()),
            "give the folder of a collection",
        ));
    }
    let journal =
        CollectionJournal::open(&folder.journal()).map_err(|error| failure_from(&error))?;
    report::write(&folder, journal.history())?;
    let manifest = CollectionManifest::from_history(&folder, journal.history())
        .map_err(|error| failure_from(&error))?;
    manifest.write(&folder).map_err(|error| failure_from(&error))
}

fn failure_from(error: &FolderError) -> Failure {
    Failure::device(error, error.help())
}

fn print(text: &str) -> Outcome {
    let written = std::io::stdout().lock().write_all(text.as_bytes());
    written.or_else(|error| Failure::from_write("standard output", &error))
}

impl From<CollectError> for Failure {
    fn from(halt: CollectError) -> Self {
        match halt {
            CollectError::Stopped(why) => Self::Found(Some(why)),
            CollectError::Invalid { message, help } => Self::input(message, help),
            CollectError::Failed { message, help } => Self::device(message, help),
        }
    }
}

/// Errors of verbs used by a collection.
impl From<Failure> for CollectError {
    fn from(failure: Failure) -> Self {
        match failure {
            Failure::Found(why) => Self::Stopped(why.unwrap_or_default()),
            Failure::Input(diagnostic) => Self::invalid(&diagnostic, diagnostic.help()),
            Failure::Device(diagnostic) => Self::failed(&diagnostic, diagnostic.help()),
        }
    }
}
