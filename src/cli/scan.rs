//! `sonard scan`.

mod daemon;
pub(super) mod emulator;
mod output;
pub(super) mod setup;
mod summary;

use std::path::{Path, PathBuf};

use firmware_protocol::host::{HostError, LinkStats};
use tokio::sync::{mpsc, oneshot};
use tokio_serial::SerialStream;
use uuid::Uuid;

use super::{
    Failure, Outcome,
    array::NoArray,
    daemon::DaemonArgs,
    interruptible,
    mock_world::{self, MockWorldArgs},
    numbers::within,
    options::{AirArgs, SensorArgs},
    output::OutPath,
    place::{AzimuthArgs, PlaceArgs},
    runtime::Interrupts,
};
use crate::{
    link::{self, PortOpener},
    mock::{EchoTable, MockBoard, MockPort},
    model::OptionKeys,
    ranger::{DriveError, Driver, Motion, PreparedScan, Ranger, ScanError, ScanSummary},
    scan::{Record, text::format_count},
};
use emulator::Emulator;
use output::Output;
use setup::{assumed, prepare};

/// Maximum number of attempts per request: about nine seconds, enough for a board that resets when
/// its port is opened.
pub(super) const ATTEMPTS: u8 = 7;

/// Options that a daemon determines itself, which conflict with --daemon.
const DAEMON_OPTIONS: [&str; 26] = [
    "sensor",
    "short_blanking",
    "blanking_us",
    "sensor_z",
    "tilt_deg",
    "temperature_c",
    "humidity_percent",
    "pressure_kpa",
    "sound_speed",
    "engine",
    "max_range_m",
    "threshold",
    "response",
    "ideal_receiver",
    "lossless",
    "max_order",
    "edge_law",
    "double_diffraction",
    "ray_spacing_deg",
    "aperture_deg",
    "window_ms",
    "settle_ms",
    "min_interval_ms",
    "max_echoes",
    "speed",
    "acceleration",
];

/// Options of `sonard scan`.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
#[command(group(clap::ArgGroup::new("device").required(true).args(["port", "mock", "emulator", "daemon"])))]
pub(super) struct Args {
    /// Serial port of the ranger: a path, a name in /dev/serial/by-id, or a USB serial number
    #[arg(long, value_name = "PATH|ID")]
    port: Option<String>,
    /// Use a mock ranger instead of a real one
    #[arg(long)]
    mock: bool,
    /// Run the firmware's machine code in an emulated board (starts sonard-emulator)
    #[arg(long)]
    emulator: bool,
    /// Let a running daemon take the scans; with its own ranger, sensor, air and model
    #[arg(long, conflicts_with_all = DAEMON_OPTIONS, conflicts_with_all = mock_world::OPTIONS)]
    daemon: bool,
    #[command(flatten)]
    at: DaemonArgs,
    #[command(flatten)]
    place: PlaceArgs,
    /// Output folder; scan.jsonl, scan.svg and scan.png. Without it records go to standard output.
    /// An existing log of the same setup is appended to
    #[arg(long, value_name = "DIR")]
    out: Option<OutPath>,
    /// Number of scans
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    repeat: u32,
    #[command(flatten)]
    azimuths: AzimuthArgs,
    /// Pings per step
    #[arg(long, value_name = "N", default_value_t = 1)]
    pings_per_stop: u32,
    #[command(flatten)]
    motion: MotionArgs,
    #[command(flatten)]
    sensor: SensorArgs,
    #[command(flatten)]
    air: AirArgs,
    #[command(flatten)]
    engine: OptionKeys,
    #[command(flatten)]
    world: MockWorldArgs,
    #[command(flatten)]
    no_array: NoArray,
}

/// Options of motor and receiver.
#[derive(Debug, Clone, Copy, clap::Args)]
#[command(next_help_heading = "Motion and reception")]
struct MotionArgs {
    /// Receive window after each ping, milliseconds, instead of the time to the maximum range
    #[arg(long, value_name = "MS", value_parser = within(0.0..=8_000.0))]
    window_ms: Option<f64>,
    /// Settling time between the end of a motor step and the ping, milliseconds
    #[arg(long, value_name = "MS", default_value_t = 5.0, value_parser = within(0.0..=8_000.0))]
    settle_ms: f64,
    /// Minimum time between pings, milliseconds, which protects the module
    #[arg(long, value_name = "MS", default_value_t = 20.0, value_parser = within(0.0..=8_000.0))]
    min_interval_ms: f64,
    /// Maximum number of recorded echoes per ping
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u8).range(1..=8))]
    max_echoes: u8,
    /// Maximum motor speed, steps per second
    #[arg(long, value_name = "STEPS/S", default_value_t = 800, value_parser = clap::value_parser!(u16).range(1..=10_000))]
    speed: u16,
    /// Motor acceleration, steps per second squared
    #[arg(long, value_name = "STEPS/S2", default_value_t = 40_000, value_parser = clap::value_parser!(u32).range(1..=200_000))]
    acceleration: u32,
}

impl MotionArgs {
    const fn motion(&self) -> Motion {
        let Self { window_ms, settle_ms, min_interval_ms, max_echoes, speed, acceleration } = *self;
        Motion { window_ms, settle_ms, min_interval_ms, max_echoes, speed, acceleration }
    }
}

pub(super) const ABOUT: &str = "\
Take one or more scans and log each reading with the model's prediction.

The device homes and then executes the plan on its own: step, ping, receive. Readings lost on the \
serial line are requested again. Records go to standard output, or with --out to a folder that \
also gets a picture. An interrupt stops the motor and closes the log.";

const EXAMPLES: &str = "\
Examples:
  sonard scan --mock --scene simple-room --pose fig9 --out out/fig9
  sonard scan --port /dev/ttyACM0 --scene my-room.json --pose 1.2,0.8,90 --max-range 4 --out out
  sonard scan --emulator --scene simple-room --pose fig9 --max-range 4 --out out/emulated
  sonard scan --daemon --socket /tmp/sonard.sock --scene simple-room --pose fig9 --out out
  sonard scan --mock --scene corridor --pose beside-wall --to-deg 45 | sonard compare -
  sonard scan --mock --scene simple-room --pose fig9 --faults flip=0.001,reset=0.005 --out noisy

Exit codes: 0 every beam measured, 1 interrupted, or beams are missing, 2 wrong usage or input, 3 \
device or link error.";

pub(super) fn run(args: &Args) -> Outcome {
    if args.daemon {
        return daemon::run(args);
    }
    let setup = prepare(args)?;
    let mut output = Output::open(args.out.as_deref())?;
    let measured = interruptible::run_interruptible(async |interrupts| {
        measure(args, &setup, &mut output, &interrupts).await
    });
    // After any outcome, the log is closed and the measured scan is drawn.
    let closed = output.close(&setup.scene);
    measured?;
    closed
}

/// Opens the port, identifies the device, and takes the scans.
async fn measure(
    args: &Args,
    setup: &PreparedScan,
    output: &mut Output,
    interrupts: &Interrupts,
) -> Outcome {
    let mock = match args.mock {
        true => Some(Mock::start(args.world.board(&assumed(setup))?, None)?),
        false => None,
    };
    let emulator = match args.emulator {
        true => Some(Emulator::start(&emulator_options(args, setup)?)?),
        false => None,
    };
    let port = mock
        .as_ref()
        .map(Mock::port)
        .or_else(|| emulator.as_ref().map(Emulator::port))
        .or_else(|| args.port.clone())
        .unwrap_or_default();
    let mut ranger = identify(&mut PortOpener::default(), &port, interrupts).await?;
    let job = setup.job(ranger.identity()).map_err(|error| scan_failure(error.into()))?;
    let session = setup.session(ranger.identity());
    output.check_same_setup(&session, job.pose, job.plan)?;
    output.record(&Record::Session(Box::new(session)))?;
    let (mut missing, mut link) = (0, LinkStats::default());
    for number in 1..=args.repeat {
        output.begin_scan(number, args.repeat, job.plan.beams());
        let summary = ranger.scan(&job, output, interrupts.clone().reason()).await;
        output.end_scan();
        let summary = summary.map_err(scan_failure)?;
        let before = std::mem::replace(&mut link, *ranger.link_stats());
        summary::print(setup, &summary, ranger.identity(), &[before, link], output);
        if interrupts.happened() {
            return Err(interrupted_failure(&summary));
        }
        missing += summary.end.missing;
    }
    if args.repeat > 1 {
        summary::print_total(args.repeat, &link);
    }
    if let Some(mock) = mock {
        mock.stop().await;
    }
    if missing > 0 {
        return Err(Failure::Found(Some(format!("{} missing", format_count(missing, "beam")))));
    }
    Ok(())
}

/// Returns the options of `sonard-emulator` for the mock's world.
fn emulator_options(args: &Args, setup: &PreparedScan) -> Result<Vec<String>, Failure> {
    let mut options = args.world.emulator(&args.place.scene)?;
    options.push(format!("--pose={}", setup.pose_argument()));
    options.extend(args.sensor.emulator(&setup.sensor));
    options.extend(args.air.emulator());
    Ok(options)
}

pub(super) async fn identify(
    ports: &mut PortOpener,
    port: &str,
    interrupts: &Interrupts,
) -> Result<Ranger<SerialStream>, Failure> {
    let line = ports.open(port).map_err(|error| Failure::device(&error, error.help()))?;
    if let Some(change) = ports.take_change() {
        notice!("{change}");
    }
    tokio::select! {
        identified = Ranger::identify(Driver::new(line, link::host_config(ATTEMPTS))) => identified.map_err(|error| match &error {
            DriveError::Host(HostError::NoAnswer { .. } | HostError::NotADevice { .. }) => {
                let help = link::describe_contention(port);
                Failure::device(error, help.unwrap_or_else(|| error.help().to_owned()))
            }
            _ => device_failure(&error),
        }),
        () = interrupts.clone().wait() => {
            Err(Failure::Found(Some("interrupted before the device replied".into())))
        }
    }
}

/// Path of a link to a mock's port, behind which it reopens after a hangup.
///
/// The name is unique for all time: a link that a killed program of another user left in the shared
/// folder could not be replaced.
pub(super) fn mock_link() -> PathBuf {
    std::env::temp_dir().join(format!("sonard-mock-{}", Uuid::new_v4()))
}

/// Mock ranger running alongside a scan.
pub(super) struct Mock {
    port: PathBuf,
    soundings: mpsc::UnboundedSender<EchoTable>,
    stop: oneshot::Sender<()>,
    playing: tokio::task::JoinHandle<std::io::Result<()>>,
}

impl Mock {
    /// Starts the mock; behind `link`, it reopens after a hangup.
    pub(super) fn start(board: MockBoard, link: Option<&Path>) -> Result<Self, Failure> {
        let port = MockPort::open(board, link).map_err(|error| {
            let help = "check that /dev/pts is mounted";
            Failure::device(format!("cannot make a pty for the mock: {error}"), help)
        })?;
        let path = link.map_or_else(|| port.path().to_path_buf(), Path::to_path_buf);
        let (soundings, moves) = mpsc::unbounded_channel();
        let (stop, stopped) = oneshot::channel::<()>();
        let port = port.with_moves(moves);
        #[allow(
            clippy::disallowed_methods,
            reason = "a mock that ends closes its line, which ends the scan"
        )]
        let playing = tokio::spawn(port.run(async move { drop(stopped.await) }, |_note| {}));
        Ok(Self { port: path, soundings, stop, playing })
    }

    pub(super) fn port(&self) -> String {
        self.port.display().to_string()
    }

    /// Moves the mock to another pose, by its echoes there.
    pub(super) fn carry_to(&self, soundings: EchoTable) {
        // The mock may have ended already.
        drop(self.soundings.send(soundings));
    }

    pub(super) async fn stop(self) {
        // The mock may have ended already.
        let _ = self.stop.send(());
        let _ = self.playing.await;
    }
}

fn interrupted_failure(summary: &ScanSummary) -> Failure {
    let planned = summary.end.beams + summary.end.missing;
    Failure::Found(Some(format!("interrupted after {} of {planned} beams", summary.end.beams)))
}

pub(super) fn scan_failure(error: ScanError) -> Failure {
    match error {
        ScanError::Plan(error) => {
            Failure::input(error, "give --from-deg and --step-deg on the motor's steps")
        }
        ScanError::Device(error) => device_failure(&error),
        ScanError::Sink(error) if error.is_broken_pipe() => Failure::Found(None),
        ScanError::Sink(error) => Failure::device(&error, error.help()),
    }
}

pub(super) fn device_failure(error: &DriveError) -> Failure {
    Failure::device(error, error.help())
}
