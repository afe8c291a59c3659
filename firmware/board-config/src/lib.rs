//! Layout of a board's EEPROM, shared by the firmware, which reads it, and by its writers: the tool
//! `eeprom-image` and the emulator.
#![cfg_attr(not(test), no_std)]

use firmware_protocol::{frame::crc32, messages::Capabilities};

/// Length of the configuration at address 0, bytes.
pub const CONFIG_BYTES: usize = 20;
/// Address of the first boot counter.
pub const BOOT_AT: u16 = 64;
/// Number of boot counters, written in turn to spread the wear: an EEPROM cell lasts 100,000
/// writes, so the counters last 1.6 million boots.
pub const BOOT_SLOTS: u16 = 16;
/// Length of a boot counter, bytes: the number, then its complement.
pub const BOOT_BYTES: u16 = 4;

/// Option bit: reverses the direction of the motor.
pub const OPTION_REVERSED: u8 = 1;
/// Option bit: the index sensor is high at the index, instead of low.
pub const OPTION_INDEX_HIGH: u8 = 2;

/// Capabilities of every board, regardless of its EEPROM.
pub const BASE_CAPABILITIES: Capabilities = Capabilities::SHORT_BLANKING
    .with(Capabilities::MULTIPLE_ECHOES)
    .with(Capabilities::COIL_RELEASE);

/// Equipment and identity of a board.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Config {
    /// Serial number, unique to the board.
    pub serial: [u8; 10],
    /// Steps per revolution, including microstepping and gears.
    pub steps_per_revolution: u16,
    /// Capabilities of the fitted equipment, including [`BASE_CAPABILITIES`].
    pub capabilities: Capabilities,
    /// Combination of `OPTION_*` bits.
    pub options: u8,
}

impl Config {
    /// Configuration of a board with an unwritten EEPROM.
    pub const UNSET: Self = Self {
        serial: *b"UNO-NO-SER",
        steps_per_revolution: 400,
        capabilities: BASE_CAPABILITIES,
        options: 0,
    };

    /// Encodes the configuration for address 0: fields, a zero byte, CRC-32.
    #[must_use]
    pub fn encode(&self) -> [u8; CONFIG_BYTES] {
        let mut bytes = [0; CONFIG_BYTES];
        let [steps_low, steps_high] = self.steps_per_revolution.to_le_bytes();
        let [can_low, can_high] = self.capabilities.0.to_le_bytes();
        bytes[..10].copy_from_slice(&self.serial);
        bytes[10..15].copy_from_slice(&[steps_low, steps_high, can_low, can_high, self.options]);
        let crc = crc32(&bytes[..16]);
        bytes[16..].copy_from_slice(&crc.to_le_bytes());
        bytes
    }

    /// Decodes the result of [`Self::encode`]; returns [`Self::UNSET`] for invalid data.
    #[must_use]
    pub fn decode(bytes: &[u8; CONFIG_BYTES]) -> Self {
        let Some((fields, crc)) = bytes.split_last_chunk::<4>() else { return Self::UNSET };
        if crc32(fields) != u32::from_le_bytes(*crc) {
            return Self::UNSET;
        }
        let [
            s0,
            s1,
            s2,
            s3,
            s4,
            s5,
            s6,
            s7,
            s8,
            s9,
            steps_low,
            steps_high,
            can_low,
            can_high,
            options,
            ..,
        ] = *bytes;
        Self {
            serial: [s0, s1, s2, s3, s4, s5, s6, s7, s8, s9],
            steps_per_revolution: u16::from_le_bytes([steps_low, steps_high]),
            capabilities: Capabilities(u16::from_le_bytes([can_low, can_high]))
                .with(BASE_CAPABILITIES),
            options,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FITTED: Config = Config {
        serial: *b"LAB-000042",
        steps_per_revolution: 3200,
        capabilities: BASE_CAPABILITIES.with(Capabilities::INDEX_SENSOR),
        options: OPTION_REVERSED,
    };

    #[test]
    fn decodes_its_encoding() {
        assert_eq!(Config::decode(&FITTED.encode()), FITTED);
    }

    #[test]
    fn invalid_data_is_unset() {
        for bit in 0..CONFIG_BYTES * 8 {
            let mut bytes = FITTED.encode();
            bytes[bit / 8] ^= 1 << (bit % 8);
            assert_eq!(Config::decode(&bytes), Config::UNSET, "bit {bit}");
        }
        assert_eq!(Config::decode(&[0xff; CONFIG_BYTES]), Config::UNSET);
        assert_eq!(Config::decode(&[0; CONFIG_BYTES]), Config::UNSET);
    }
}
