//! `sonard mock`.

mod replay;

use std::{path::PathBuf, sync::Arc};

use super::{
    Failure, Outcome,
    array::NoArray,
    interruptible,
    mock_world::{AssumedModel, MockWorldArgs},
    options::{AirArgs, SensorArgs, engine_options},
    output::OutPath,
    scene_file,
};
use crate::{
    mock::{MockBoard, MockPort, Note},
    model::OptionKeys,
};

/// Pings between two lines of output.
const PINGS_PER_LINE: u64 = 100;

/// Options of `sonard mock`.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Scene file, or the name of a shipped scene (`sonard scene list`); used for predictions
    #[arg(long, value_name = "SCENE", required_unless_present = "replay")]
    scene: Option<PathBuf>,
    /// Pose of the ranger: X,Y,DEG (metres, degrees) or the name of a pose in the scene
    #[arg(
        long,
        value_name = "POSE",
        allow_hyphen_values = true,
        required_unless_present = "replay"
    )]
    pose: Option<String>,
    /// Log whose readings are reported instead of echoes from the model, scan after scan
    #[arg(long, value_name = "LOG", conflicts_with_all = WITHOUT_REPLAY)]
    replay: Option<PathBuf>,
    /// Make this symbolic link to the pty
    #[arg(long, value_name = "PATH")]
    link: Option<OutPath>,
    #[command(flatten)]
    world: MockWorldArgs,
    #[command(flatten)]
    sensor: SensorArgs,
    #[command(flatten)]
    air: AirArgs,
    #[command(flatten)]
    engine: OptionKeys,
    #[command(flatten)]
    no_array: NoArray,
}

/// Options of the model and its world, which a replayed log replaces.
const WITHOUT_REPLAY: [&str; 10] = [
    "scene",
    "pose",
    "sensor",
    "engine",
    "truth",
    "truth_temperature_c",
    "noise_mm",
    "missed_steps",
    "mounting_offset_deg",
    "steps_per_revolution",
];

pub(super) const ABOUT: &str = "\
Run a mock ranger on a pty, with echoes from the model.

The firmware's protocol code runs on a pseudo-terminal, in a simulated world made from a scene. \
Any program that implements the protocol can open the port, such as `sonard scan --port`. It runs \
until it is interrupted. The device identifies itself as simulated, and its logs are marked \
accordingly.

With --replay the device reports the readings of a log, imported ones included, each at its \
azimuth: a scan of it goes through protocol, daemon, page and export as if it were measured again. \
The motor's steps are chosen so that the log's azimuths are on them. Each new scan of the host \
gets the next scan of the log, and after the last one the first again. Where the log has no \
reading, the device reports that its module did not fire.";

const EXAMPLES: &str = "\
Examples:
  sonard mock --scene simple-room --pose fig9 --link /tmp/ranger --realtime
  sonard scan --port /tmp/ranger --scene simple-room --pose fig9 --out out

  sonard mock --scene simple-room --pose fig9 --link /tmp/ranger --seed 7 \\
      --faults flip=0.001,drop=0.001,double=0.001,reset=0.005

  sonard mock --replay out/scan.jsonl --link /tmp/ranger";

pub(super) fn run(args: &Args) -> Outcome {
    let board = match &args.replay {
        Some(log) => replay::board(log, &args.world)?,
        None => modelled_board(args)?,
    };
    interruptible::run_interruptible(async move |interrupts| {
        let port = MockPort::open(board, args.link.as_deref()).map_err(|error| {
            Failure::input(
                format!("cannot make the port: {error}"),
                "give --link a path that does not exist yet, in a folder that you may write to",
            )
        })?;
        print_line!("listening on {} (interrupt to stop)", port.path().display());
        let played = port.run(interrupts.wait(), |note| print(&note)).await;
        print_line!("stopped");
        played.map_err(|error| {
            Failure::device(format!("the pty failed: {error}"), "start the mock again")
        })
    })
}

/// Creates the board with echoes from the model.
fn modelled_board(args: &Args) -> Result<MockBoard, Failure> {
    // clap requires both without --replay.
    let scene = scene_file::load(args.scene.clone().unwrap_or_default())?;
    let pose = scene_file::pose(&scene, args.pose.as_deref().unwrap_or_default())?;
    let scene = Arc::new(scene);
    let (sensor, air, options) =
        (args.sensor.sensor()?, args.air.air()?, engine_options(&args.engine)?);
    let assumed =
        AssumedModel { scene: &scene, pose: &pose, sensor: &sensor, air: &air, options: &options };
    args.world.board(&assumed)
}

fn print(note: &Note) {
    match note {
        Note::Fired(count) if count % PINGS_PER_LINE != 0 => {}
        note => print_line!("{note}"),
    }
}
