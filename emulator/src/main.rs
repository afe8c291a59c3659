//! `sonard-emulator`: serves the emulated board on a pty in real time.

use std::{
    error::Error,
    io::{self, Write as _},
    path::{Path, PathBuf},
    process::ExitCode,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
};

use board_config::{BASE_CAPABILITIES, Config};
use clap::Parser;
use firmware_protocol::messages::Capabilities;
use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64;
use sonard_device::link::Pty;
use sonard_emulator::{Emulator, MotorLimits, serve};
use sonard_mock::{EchoTable, World};
use sonard_model::{
    acoustics::{Air, Sensor, TofNoise},
    model::{Options, Simulator},
    scene::{Scene, shipped},
};

/// Text of `--version` after the name.
const LONG_VERSION: &str = concat!(
    env!("CARGO_PKG_VERSION"),
    "\ncommit ",
    env!("SONARD_COMMIT"),
    "\nfeatures ",
    env!("SONARD_FEATURES")
);

/// Run the firmware's machine code in an emulated Arduino Uno, with its serial line on a pty.
///
/// The echoes come from the model of the scene. The board identifies itself as emulated, so every
/// log recorded from it is marked accordingly. Runs until interrupted.
#[derive(Debug, Parser)]
#[command(version, long_version = LONG_VERSION, after_help = EXAMPLE)]
struct Args {
    /// Scene file, or the name of a shipped scene
    #[arg(long, value_name = "SCENE")]
    scene: String,
    /// Pose of the ranger: X,Y,DEG (metres, degrees) or the name of a pose in the scene
    #[arg(long, value_name = "POSE", allow_hyphen_values = true)]
    pose: String,
    /// Create this symbolic link to the pty
    #[arg(long, value_name = "PATH")]
    link: Option<PathBuf>,
    /// Firmware file [default: firmware/target/avr-none/release/sonard-firmware.elf, here or in a
    /// folder above this program]
    #[arg(long, value_name = "ELF", env = "SONARD_FIRMWARE")]
    elf: Option<PathBuf>,
    /// Sensor preset, or a sensor file
    #[arg(long, value_name = "NAME|FILE", default_value = "senscomp-6500")]
    sensor: String,
    /// Time from firing to the end of the receiver's blanking, microseconds [default: the sensor's]
    #[arg(long, value_name = "US")]
    blanking_us: Option<f64>,
    /// Air temperature, degrees Celsius
    #[arg(long, value_name = "C", default_value_t = 20.0, allow_negative_numbers = true)]
    temperature_c: f64,
    /// Air temperature, degrees Celsius, in place of --temperature-c
    #[arg(long, value_name = "C", allow_negative_numbers = true, hide = true)]
    truth_temperature_c: Option<f64>,
    /// Relative humidity, percent
    #[arg(long, value_name = "PERCENT", default_value_t = 50.0)]
    humidity_percent: f64,
    /// Static pressure, kilopascals
    #[arg(long, value_name = "KPA", default_value_t = 101.325)]
    pressure_kpa: f64,
    /// Mounting offset of the transducer on the motor's shaft, degrees
    #[arg(long, value_name = "DEG", default_value_t = 0.0, allow_negative_numbers = true)]
    mounting_offset_deg: f64,
    /// Let the motor follow every pulse, instead of missing steps beyond its torque
    #[arg(long)]
    tireless_motor: bool,
    /// Probability of a supply dip at each firing, which restarts the chip
    #[arg(long, value_name = "P", default_value_t = 0.0, value_parser = probability)]
    dips: f64,
    /// End when standard input closes: together with the program that started this one
    #[arg(long)]
    attached: bool,
    /// Duration of a supply dip, milliseconds
    #[arg(long, value_name = "MS", default_value_t = 20)]
    dip_ms: u64,
    /// Standard deviation of the range noise, millimetres
    #[arg(long, value_name = "MM", default_value_t = 0.5)]
    noise_mm: f64,
    /// Seed of the noise
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Motor steps per revolution
    #[arg(long, value_name = "N", default_value_t = 400, value_parser = clap::value_parser!(u16).range(4..=12_800))]
    steps_per_revolution: u16,
}

const EXAMPLE: &str = "\
Example:
  sonard-emulator --scene simple-room --pose fig9 --link /tmp/ranger
  sonard scan --port /tmp/ranger --scene simple-room --pose fig9 --out out";

fn main() -> ExitCode {
    let args = Args::parse();
    match run(&args) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("sonard-emulator: {error}");
            ExitCode::from(2)
        }
    }
}

fn run(args: &Args) -> Result<(), Box<dyn Error>> {
    let mut emulator = Emulator::new(&elf(args)?, &config(args), Box::new(world(args)?))?;
    emulator.set_motor((!args.tireless_motor).then(MotorLimits::typical));
    let pty = Pty::open(args.link.as_deref())?;
    println!("listening on {} (interrupt to stop)", pty.path().display());
    let mut firings = 0;
    let mut random = Pcg64::seed_from_u64(args.seed ^ 0x0d1b);
    let stop = Arc::new(AtomicBool::new(false));
    if args.attached {
        let stop = Arc::clone(&stop);
        std::thread::spawn(move || {
            // No input is expected, only its end.
            drop(io::copy(&mut io::stdin(), &mut io::sink()));
            stop.store(true, Ordering::Relaxed);
        });
    }
    serve(&mut emulator, &pty, &stop, |emulator| {
        let fired = emulator.take_init_rises().len();
        emulator.take_pulses();
        firings += fired;
        if (0..fired).any(|_| random.random_bool(args.dips)) {
            // Standard output may be closed.
            drop(writeln!(io::stdout(), "supply dip at firing {firings}"));
            emulator.dip(args.dip_ms);
        }
    })
    .map_err(|error| error as Box<dyn Error>)
}

/// Path of the firmware: the option, or the output of the firmware's build, relative to the current
/// folder or to a folder above this program.
fn elf(args: &Args) -> Result<PathBuf, String> {
    if let Some(elf) = &args.elf {
        return Ok(elf.clone());
    }
    let built = Path::new("firmware/target/avr-none/release/sonard-firmware.elf");
    let program = std::env::current_exe().unwrap_or_default();
    let above = program.ancestors().map(|folder| folder.join(built));
    std::iter::once(built.to_path_buf()).chain(above).find(|elf| elf.exists()).ok_or_else(|| {
        format!("{} is missing: build it with firmware/test.sh, or use --elf", built.display())
    })
}

fn config(args: &Args) -> Config {
    Config {
        serial: *b"EMU-000001",
        steps_per_revolution: args.steps_per_revolution,
        capabilities: BASE_CAPABILITIES
            .with(Capabilities::INDEX_SENSOR)
            .with(Capabilities::EMULATED),
        options: 0,
    }
}

fn world(args: &Args) -> Result<World, Box<dyn Error>> {
    let text = match std::fs::read_to_string(&args.scene) {
        Ok(text) => text,
        Err(error) => shipped::text(&args.scene)
            .ok_or_else(|| {
                format!("{}: {error}, and there is no shipped scene of that name", args.scene)
            })?
            .to_owned(),
    };
    let scene = Scene::from_json(&text).map_err(|error| format!("{}: {error}", args.scene))?;
    let pose = scene.pose(&args.pose)?;
    scene.check_pose(&pose)?;
    let mut sensor = match std::fs::read_to_string(&args.sensor) {
        Ok(text) => Sensor::from_json(&text)?,
        Err(_) => Sensor::preset(&args.sensor)?,
    };
    sensor.blanking_us = args.blanking_us.unwrap_or(sensor.blanking_us);
    sensor.check()?;
    let air = Air::new(
        args.truth_temperature_c.unwrap_or(args.temperature_c),
        args.humidity_percent,
        args.pressure_kpa,
    )?;
    let noise = TofNoise::from_range_sigma_mm(args.noise_mm, air.sound_speed_m_s());
    let scene = Arc::new(scene.with_robot_at(&pose));
    let simulator = Simulator::new(scene, sensor, air, Options::default())?;
    let soundings = EchoTable::from_model(
        &simulator,
        &pose,
        args.steps_per_revolution,
        args.mounting_offset_deg,
    )?;
    Ok(World::new(soundings, noise, 0.0, args.seed))
}

fn probability(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "must be a probability, 0 to 1".to_owned())?;
    if (0.0..=1.0).contains(&value) {
        Ok(value)
    } else {
        Err("must be a probability, 0 to 1".into())
    }
}
