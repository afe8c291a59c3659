//! Scratchpad registers of a DS18B20 and similar sensors.
//!
//! Datasheets DS18B20 (19-7487, Rev 6), table "Memory map", and DS18S20 (19-5474). Copies of the
//! sensor differ in the reserved registers.

use super::ThermometerFault;

/// Temperature register before the first conversion, thousandths of a degree.
pub(super) const POWER_ON_THOUSANDTHS: i32 = 85_000;

/// Registers and their checksum.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Scratchpad([u8; 9]);

impl Scratchpad {
    /// Reads the hexadecimal registers at the start of a line of `w1_slave`.
    pub(super) fn parse(line: &str) -> Result<Self, ThermometerFault> {
        let mut registers = [0; 9];
        let mut words = line.split_ascii_whitespace();
        for register in &mut registers {
            let word = words.next().filter(|word| word.len() == 2);
            *register = word
                .and_then(|word| u8::from_str_radix(word, 16).ok())
                .ok_or(ThermometerFault::CutOff("a register"))?;
        }
        Ok(Self(registers))
    }

    /// Checks the consistency of the registers with each other and with the driver's temperature.
    pub(super) fn check(&self, thousandths: i32) -> Result<(), ThermometerFault> {
        let Self(registers @ [low, high, _, _, configuration, reserved, _, per_degree, checksum]) =
            *self;
        if registers.iter().all(|register| *register == low) {
            return Err(ThermometerFault::StuckBus(low));
        }
        if crc8(&registers[..8]) != checksum {
            return Err(ThermometerFault::Checksum);
        }
        let impossible = |what: String| Err(ThermometerFault::ImpossibleRegisters(what));
        // A DS18S20 has no configuration: both registers are reserved.
        let is_ds18s20 = configuration == 0xff && reserved == 0xff && per_degree == 0x10;
        if !is_ds18s20 && configuration & 0x90 != 0x10 {
            return impossible(format!("configuration {configuration:02x}"));
        }
        let counts = f64::from(i16::from_le_bytes([low, high]));
        let temperature_c = f64::from(thousandths) / 1e3;
        let fits = |per_degree: f64, tolerance: f64| {
            (temperature_c - counts / per_degree).abs() <= tolerance
        };
        // The driver refines half degrees of a DS18S20 by its counter.
        if !(fits(16.0, 0.07)
            || fits(32.0, 0.07)
            || fits(64.0, 0.07)
            || is_ds18s20 && fits(2.0, 1.0))
        {
            return impossible(format!("{low:02x} {high:02x} for {temperature_c} C"));
        }
        Ok(())
    }

    /// Returns `true` if the reserved registers differ from the datasheet.
    pub(super) const fn is_unusual(&self) -> bool {
        let Self([_, _, _, _, _, reserved, _, per_degree, _]) = *self;
        reserved != 0xff || per_degree != 0x10
    }
}

/// Checksum of 1-wire devices: x^8 + x^5 + x^4 + 1, least significant bit first (Application Note
/// 27).
fn crc8(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |crc, byte| {
        (0..8).fold(crc ^ byte, |crc: u8, _| if crc & 1 == 1 { crc >> 1 ^ 0x8c } else { crc >> 1 })
    })
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Formats registers as the two lines of `w1_slave`.
    pub(in crate::thermometer) fn w1_slave(registers: [u8; 8], thousandths: i32) -> String {
        let crc = crc8(&registers);
        let hex: String = registers.iter().map(|register| format!("{register:02x} ")).collect();
        format!("{hex}{crc:02x} : crc={crc:02x} YES\n{hex}{crc:02x} t={thousandths}\n")
    }

    #[test]
    fn checksum_matches_a_sensor() {
        assert_eq!(crc8(&[0x72, 0x01, 0x4b, 0x46, 0x7f, 0xff, 0x0e, 0x10]), 0x57);
        assert_eq!(crc8(&[0x50, 0x05, 0x4b, 0x46, 0x7f, 0xff, 0x0c, 0x10]), 0x1c);
        assert_eq!(crc8(&[0; 8]), 0);
    }
}
