//! `sonard board`.

use std::sync::{
    Arc,
    atomic::{AtomicBool, Ordering},
};

use rand::RngExt as _;

use super::{Failure, Outcome, output::OutPath, runtime};
use crate::{
    link::Pty,
    pi::{GpioPins, PiBoard, PiSettings, PinNumbers, serve},
};

/// Options of `sonard board`.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Make this symbolic link to the pty
    #[arg(long, value_name = "PATH")]
    link: Option<OutPath>,
    /// Motor steps a revolution, including microsteps and gears
    #[arg(long, value_name = "N", default_value_t = 400, value_parser = clap::value_parser!(u16).range(4..))]
    steps_per_revolution: u16,
    /// Serial number: up to ten characters
    #[arg(long, value_name = "TEXT", default_value = "PI-NO-SER", value_parser = serial)]
    serial: [u8; 10],
    #[command(flatten)]
    pins: PinNumbers,
}

pub(super) const ABOUT: &str = "\
Act as a ranger: drive module and stepper from this Raspberry Pi's own pins.

The device's own protocol code runs here and speaks on a pty as a board with the firmware does on its serial \
port. Linux adds latency: readings are some 5 to 50 us (1 to 9 mm) too long and scatter with the load of the \
computer, and a motor above some 1,000 steps/s does not run smoothly. A board with a microcontroller times \
echoes to 0.5 us.";

const EXAMPLES: &str = "\
Example:
  sonard board --link /tmp/ranger &
  sonard scan --port /tmp/ranger --scene my-room.json --pose 1.2,0.8,90 --out out

Exit codes: 0 stopped on request, 2 wrong usage, 3 no Raspberry Pi, or its pins can't be used.";

pub(super) fn run(args: &Args) -> Outcome {
    let pins = GpioPins::open(&args.pins).map_err(|error| Failure::device(&error, error.help()))?;
    let settings = PiSettings {
        // A counter would need a place to be kept in; two starts in a row hardly ever collide.
        boot: rand::rng().random_range(1..=u16::MAX),
        serial: args.serial,
        steps_per_revolution: args.steps_per_revolution,
    };
    let mut board = PiBoard::new(pins, settings);
    let pty = Pty::open(args.link.as_deref()).map_err(|error| {
        Failure::input(
            format!("cannot make the port: {error}"),
            "give --link a path that does not exist yet, in a folder that you may write to",
        )
    })?;
    print_line!("listening on {} (interrupt to stop)", pty.path().display());
    let stop = Arc::new(AtomicBool::new(false));
    runtime::run_interruptible(async move |interrupts| {
        let stopping = Arc::clone(&stop);
        let mut serving = tokio::task::spawn_blocking(move || serve(&mut board, &pty, &stop));
        let served = tokio::select! {
            served = &mut serving => served,
            () = interrupts.wait() => {
                stopping.store(true, Ordering::Relaxed);
                serving.await
            }
        };
        match served {
            Ok(Ok(())) => Ok(()),
            Ok(Err(error)) => {
                Err(Failure::device(format!("the pty failed: {error}"), "start the board again"))
            }
            Err(error) => Err(Failure::device(error, "this is a fault of the program: report it")),
        }
    })
}

fn serial(text: &str) -> Result<[u8; 10], String> {
    let mut bytes = [0; 10];
    if !text.chars().all(|c| c.is_ascii_graphic()) || text.is_empty() || text.len() > bytes.len() {
        return Err("one to ten printable characters".into());
    }
    for (slot, byte) in bytes.iter_mut().zip(text.bytes()) {
        *slot = byte;
    }
    Ok(bytes)
}
