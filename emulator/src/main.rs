//! `sonard-emulator`: plays the firmware on a pty, at the pace of the wall clock.

use std::{
    error::Error,
    io,
    path::PathBuf,
    process::ExitCode,
    sync::Arc,
    time::{Duration, Instant},
};

use board_config::{ALWAYS, Config};
use clap::Parser;
use firmware_protocol::messages::Capabilities;
use sonard::{
    acoustics::{Air, Sensor},
    mock::{Noise, Pty, Soundings, World},
    model::{Options, Simulator},
    scene::{Scene, shipped},
};
use sonard_emulator::{Emulator, HZ};

/// How much device time passes between two looks at the pty.
const SLICE: Duration = Duration::from_micros(500);

/// Run the firmware's machine code in an emulated Arduino Uno, with its serial line on a pty.
///
/// The ranger hears what the model says for the scene. The board says of itself that it is
/// emulated, so every log taken from it does too. It runs until it is interrupted.
#[derive(Debug, Parser)]
#[command(version, after_help = EXAMPLE)]
struct Args {
    /// Scene file, or the name of a shipped scene
    #[arg(long, value_name = "SCENE")]
    scene: String,
    /// Where the ranger stands: X,Y,DEG (metres, degrees) or the name of a pose in the scene
    #[arg(long, value_name = "POSE", allow_hyphen_values = true)]
    pose: String,
    /// Make this symbolic link to the pty
    #[arg(long, value_name = "PATH")]
    link: Option<PathBuf>,
    /// The firmware
    #[arg(
        long,
        value_name = "ELF",
        default_value = "firmware/target/avr-none/release/sonard-firmware.elf"
    )]
    elf: PathBuf,
    /// Standard deviation of the range noise, millimetres
    #[arg(long, value_name = "MM", default_value_t = 0.5)]
    noise_mm: f64,
    /// Seed of the noise
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Motor steps a revolution
    #[arg(long, value_name = "N", default_value_t = 400, value_parser = clap::value_parser!(u16).range(4..=12_800))]
    steps_per_revolution: u16,
}

const EXAMPLE: &str = "\
Example:
  sonard-emulator --scene simple-room --pose fig9 --link /tmp/ranger
  sonard scan --port /tmp/ranger --scene simple-room --pose fig9 --out out";

fn main() -> ExitCode {
    let args = Args::parse();
    match play(&args) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("sonard-emulator: {error}");
            ExitCode::from(2)
        }
    }
}

fn play(args: &Args) -> Result<(), Box<dyn Error>> {
    let mut emulator = Emulator::new(&args.elf, &config(args), Box::new(world(args)?))?;
    let pty = Pty::open(args.link.as_deref())?;
    println!("listening on {} (interrupt to stop)", pty.path().display());
    let started = Instant::now();
    loop {
        emulator.run(HZ * SLICE.as_micros() as u64 / 1_000_000)?;
        let mut buffer = [0; 256];
        match pty.read(&mut buffer) {
            Ok(count) => emulator.send(&buffer[..count]),
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
            Err(error) => return Err(error.into()),
        }
        speak(&pty, &emulator.received())?;
        let ahead = Duration::from_micros(emulator.now_us()).saturating_sub(started.elapsed());
        if !ahead.is_zero() {
            pty.clear_exclusive();
            std::thread::sleep(ahead);
        }
    }
}

/// A serial line loses what nobody reads; so does a full pty.
fn speak(pty: &Pty, bytes: &[u8]) -> io::Result<()> {
    if bytes.is_empty() {
        return Ok(());
    }
    match pty.write(bytes) {
        Err(error) if error.kind() != io::ErrorKind::WouldBlock => Err(error),
        _ => Ok(()),
    }
}

fn config(args: &Args) -> Config {
    Config {
        serial: *b"EMU-000001",
        steps_per_revolution: args.steps_per_revolution,
        capabilities: ALWAYS.with(Capabilities::INDEX_SENSOR).with(Capabilities::EMULATED),
        options: 0,
    }
}

fn world(args: &Args) -> Result<World, Box<dyn Error>> {
    let text = match std::fs::read_to_string(&args.scene) {
        Ok(text) => text,
        Err(error) => shipped::text(&args.scene)
            .ok_or_else(|| format!("{}: {error}, and no shipped scene of that name", args.scene))?
            .to_owned(),
    };
    let scene = Scene::from_json(&text).map_err(|error| format!("{}: {error}", args.scene))?;
    let pose = scene.pose(&args.pose)?;
    scene.check_pose(&pose)?;
    let sensor = Sensor::preset("senscomp-6500")?;
    let air = Air::default();
    let noise = Noise::of_range_mm(args.noise_mm, air.sound_speed_m_s());
    let scene = Arc::new(scene.with_robot_at(&pose));
    let simulator = Simulator::new(scene, sensor, air, Options::default())?;
    let soundings = Soundings::of(&simulator, &pose, args.steps_per_revolution, 0.0);
    Ok(World::new(soundings, noise, 0.0, args.seed))
}
