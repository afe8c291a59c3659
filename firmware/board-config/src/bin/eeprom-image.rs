//! Writes the EEPROM image of a board, as Intel HEX for avrdude, to standard output.

use std::process::ExitCode;

use board_config::{BASE_CAPABILITIES, Config, OPTION_INDEX_HIGH, OPTION_REVERSED};
use firmware_protocol::messages::Capabilities;

const USAGE: &str = "\
usage: eeprom-image SERIAL [steps=N] [index] [index-high] [emergency-stop] [reversed]

  SERIAL           serial number, 1 to 10 printable characters
  steps=N          steps per revolution, with microstepping and gears (default 400)
  index            an index sensor is fitted, low at the index
  index-high       an index sensor is fitted, high at the index
  emergency-stop   an emergency stop is fitted, closed to ground unless pressed
  reversed         the motor is mounted in the opposite direction";

fn main() -> ExitCode {
    match config(std::env::args().skip(1)) {
        Ok(config) => {
            print!("{}", intel_hex(&config.encode()));
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("eeprom-image: {error}\n\n{USAGE}");
            ExitCode::from(2)
        }
    }
}

fn config(mut words: impl Iterator<Item = String>) -> Result<Config, String> {
    let serial = words.next().ok_or("no serial number")?;
    let printable = serial.bytes().all(|byte| byte.is_ascii_graphic());
    if serial.is_empty() || serial.len() > 10 || !printable {
        return Err(format!("{serial:?} is not a serial number (1 to 10 printable characters)"));
    }
    let mut config = Config { serial: [0; 10], capabilities: BASE_CAPABILITIES, ..Config::UNSET };
    config.serial[..serial.len()].copy_from_slice(serial.as_bytes());
    for word in words {
        let fit = |config: &mut Config, capability| {
            config.capabilities = config.capabilities.with(capability)
        };
        match word.as_str() {
            "index" => fit(&mut config, Capabilities::INDEX_SENSOR),
            "index-high" => {
                fit(&mut config, Capabilities::INDEX_SENSOR);
                config.options |= OPTION_INDEX_HIGH;
            }
            "emergency-stop" => fit(&mut config, Capabilities::EMERGENCY_STOP),
            "reversed" => config.options |= OPTION_REVERSED,
            word => {
                let steps = word.strip_prefix("steps=").and_then(|steps| steps.parse().ok());
                config.steps_per_revolution = steps
                    .filter(|steps| (4..=12_800).contains(steps))
                    .ok_or(format!("unknown argument {word:?} (steps must be 4 to 12800)"))?;
            }
        }
    }
    Ok(config)
}

/// Encodes one record per 16 bytes, then the end record.
fn intel_hex(bytes: &[u8]) -> String {
    let mut text = String::new();
    for (line, chunk) in bytes.chunks(16).enumerate() {
        let address = u16::try_from(line * 16).unwrap_or_default().to_be_bytes();
        let length = u8::try_from(chunk.len()).unwrap_or_default();
        let mut record = vec![length, address[0], address[1], 0];
        record.extend(chunk);
        let sum = record.iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte));
        record.push(sum.wrapping_neg());
        text.push(':');
        text.extend(record.iter().map(|byte| format!("{byte:02X}")));
        text.push('\n');
    }
    text.push_str(":00000001FF\n");
    text
}
