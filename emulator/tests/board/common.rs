//! Helpers shared by the tests.

use std::path::PathBuf;

use board_config::{BASE_CAPABILITIES, Config};
/// Settings of the conformance scenarios.
pub use firmware_protocol::conformance::scenarios::SETTINGS;
use firmware_protocol::host::{Command, HostEvent};
use firmware_protocol::messages::{Capabilities, Reading, Settings};
use sonard_emulator::{Bench, Emulator, Environment, ScriptedEnvironment};

/// Path of the firmware built by `firmware/test.sh`.
pub fn elf() -> PathBuf {
    let path = std::env::var_os("SONARD_FIRMWARE").map_or_else(
        || {
            PathBuf::from(env!("CARGO_MANIFEST_DIR"))
                .join("../firmware/target/avr-none/release/sonard-firmware.elf")
        },
        PathBuf::from,
    );
    assert!(path.exists(), "{} is missing: run firmware/test.sh", path.display());
    path
}

/// Configuration of a board with everything fitted.
pub fn config() -> Config {
    Config {
        serial: *b"EMU-000001",
        steps_per_revolution: 400,
        capabilities: BASE_CAPABILITIES
            .with(Capabilities::INDEX_SENSOR)
            .with(Capabilities::EMERGENCY_STOP)
            .with(Capabilities::EMULATED),
        options: 0,
    }
}

pub fn scripted(echoes: &[u64]) -> ScriptedEnvironment {
    ScriptedEnvironment { echoes: echoes.to_vec(), step: 0 }
}

/// Booted board and a host that has not sent anything.
pub fn bench(environment: impl Environment + 'static) -> Bench {
    let emulator = Emulator::new(&elf(), &config(), Box::new(environment)).expect("a firmware");
    let mut bench = Bench::new(emulator);
    // Bytes sent before the receiver is enabled are lost, as on the board.
    bench.run(0.05).expect("boots");
    bench
}

/// Booted board that is identified, configured and homed.
pub fn ready(environment: impl Environment + 'static, settings: Settings) -> Bench {
    let mut bench = bench(environment);
    for command in [Command::Identify, Command::Configure(settings), Command::Home] {
        bench.perform(command, 20.0).expect("gets ready");
    }
    bench
}

pub fn readings(events: &[HostEvent]) -> Vec<Reading> {
    events
        .iter()
        .filter_map(|event| match event {
            HostEvent::Reading { reading, .. } => Some(*reading),
            _ => None,
        })
        .collect()
}
