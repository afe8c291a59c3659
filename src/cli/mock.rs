//! `sonard mock`.

use std::sync::Arc;

use super::{
    Failure, Outcome,
    array::NoArray,
    mock_world::{AssumedModel, MockWorldArgs},
    options::{AirArgs, SensorArgs, engine_options},
    output::OutPath,
    place::PlaceArgs,
    runtime,
};
use crate::{
    mock::{MockPort, Note},
    model::OptionKeys,
};

/// Pings between two lines of output.
const PINGS_PER_LINE: u64 = 100;

/// Options of `sonard mock`.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    #[command(flatten)]
    place: PlaceArgs,
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

pub(super) const ABOUT: &str = "\
Run a mock ranger on a pty, with echoes from the model.

The firmware's protocol code runs on a pseudo-terminal, in a simulated world made from a scene. \
Any program that implements the protocol can open the port, such as `sonard scan --port`. It runs \
until it is interrupted. The device identifies itself as simulated, and its logs are marked \
accordingly.";

const EXAMPLES: &str = "\
Examples:
  sonard mock --scene simple-room --pose fig9 --link /tmp/ranger --realtime
  sonard scan --port /tmp/ranger --scene simple-room --pose fig9 --out out

  sonard mock --scene simple-room --pose fig9 --link /tmp/ranger --seed 7 \\
      --faults flip=0.001,drop=0.001,double=0.001,reset=0.005";

pub(super) fn run(args: &Args) -> Outcome {
    let (scene, pose) = args.place.load()?;
    let scene = Arc::new(scene);
    let (sensor, air, options) =
        (args.sensor.sensor()?, args.air.air()?, engine_options(&args.engine)?);
    let assumed =
        AssumedModel { scene: &scene, pose: &pose, sensor: &sensor, air: &air, options: &options };
    let board = args.world.board(&assumed)?;
    runtime::run_interruptible(async move |interrupts| {
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

fn print(note: &Note) {
    match note {
        Note::Fired(count) if count % PINGS_PER_LINE != 0 => {}
        note => print_line!("{note}"),
    }
}
