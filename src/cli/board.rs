//! `sonard board`.

use std::sync::{
    Arc,
    atomic::{AtomicBool, Ordering},
};

use rand::{RngExt as _, rand_core::UnwrapErr, rngs::SysRng};

use super::{Failure, Outcome, interruptible, output::OutPath};
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
    /// Motor steps per revolution, including microsteps and gears
    #[arg(long, value_name = "N", default_value_t = 400, value_parser = clap::value_parser!(u16).range(4..))]
    steps_per_revolution: u16,
    /// Serial number: up to ten characters
    #[arg(long, value_name = "TEXT", default_value = "PI-NO-SER", value_parser = parse_serial)]
    serial: [u8; 10],
    #[command(flatten)]
    pins: PinNumbers,
}

pub(super) const ABOUT: &str = "\
Drive the ranger from Raspberry Pi GPIO.

The firmware's protocol code runs on this computer and serves a pty in the same way as a board \
serves its serial port. Linux adds latency: readings are 5 to 50 us (1 to 9 mm) too long, with \
scatter that depends on the computer's load, and the motor runs smoothly only up to about 1,000 \
steps/s. A microcontroller board times echoes to 0.5 us.";

const EXAMPLES: &str = "\
Example:
  sonard board --link /tmp/ranger &
  sonard scan --port /tmp/ranger --scene my-room.json --pose 1.2,0.8,90 --out out

Exit codes: 0 stopped on request, 2 wrong usage, 3 not a Raspberry Pi, or its pins are not usable.";

pub(super) fn run(args: &Args) -> Outcome {
    let pins = GpioPins::open(&args.pins).map_err(|error| Failure::device(&error, error.help()))?;
    let settings = PiSettings {
        // A counter would need storage; two consecutive random numbers hardly ever collide.
        boot: UnwrapErr(SysRng).random_range(1..=u16::MAX),
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
    interruptible::run_interruptible(async move |interrupts| {
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
            Err(error) => Err(Failure::device(error, "this is a bug: report it")),
        }
    })
}

fn parse_serial(text: &str) -> Result<[u8; 10], String> {
    let mut bytes = [0; 10];
    if !text.chars().all(|c| c.is_ascii_graphic()) || text.is_empty() || text.len() > bytes.len() {
        return Err("give one to ten printable characters".into());
    }
    for (slot, byte) in bytes.iter_mut().zip(text.bytes()) {
        *slot = byte;
    }
    Ok(bytes)
}
