//! What the EEPROM of a board holds. One text for the firmware, which reads it, and for whoever
//! writes it: the tool `eeprom-image` and the emulator.
#![cfg_attr(not(test), no_std)]

use firmware_protocol::{frame::crc32, messages::Capabilities};

/// Bytes of the configuration, from address 0 on.
pub const CONFIG_BYTES: usize = 20;
/// Where the boot counters begin.
pub const BOOT_AT: u16 = 64;
/// Boot counters, one after the other, so that each is written once in so many boots: an EEPROM
/// cell lasts 100,000 writes, this lasts 1.6 million boots.
pub const BOOT_SLOTS: u16 = 16;
/// Bytes of a boot counter: the number, then its complement.
pub const BOOT_BYTES: u16 = 4;

/// Turns the motor's sense of direction round.
pub const OPTION_REVERSED: u8 = 1;
/// The index sensor is high at the index, instead of low.
pub const OPTION_INDEX_HIGH: u8 = 2;

/// What every board can do, whatever its EEPROM says.
pub const ALWAYS: Capabilities = Capabilities::SHORT_BLANKING
    .with(Capabilities::MULTIPLE_ECHOES)
    .with(Capabilities::COIL_RELEASE);

/// What is fitted, and whose it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Config {
    /// Serial number.
    pub serial: [u8; 10],
    /// Steps a revolution, with microstepping and gears counted in.
    pub steps_per_revolution: u16,
    /// What is fitted besides [`ALWAYS`].
    pub capabilities: Capabilities,
    /// `OPTION_*` bits.
    pub options: u8,
}

impl Config {
    /// A board whose EEPROM nobody has written.
    pub const UNSET: Self = Self {
        serial: *b"UNO-NO-SER",
        steps_per_revolution: 400,
        capabilities: ALWAYS,
        options: 0,
    };

    /// The bytes at address 0: fields, one byte of zero, CRC-32.
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

    /// Reads what [`Self::encode`] wrote; [`Self::UNSET`] if it is anything else.
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
            capabilities: Capabilities(u16::from_le_bytes([can_low, can_high])).with(ALWAYS),
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
        capabilities: ALWAYS.with(Capabilities::INDEX_SENSOR),
        options: OPTION_REVERSED,
    };

    #[test]
    fn what_is_written_is_read() {
        assert_eq!(Config::decode(&FITTED.encode()), FITTED);
    }

    #[test]
    fn any_flipped_bit_and_a_blank_chip_give_the_defaults() {
        for bit in 0..CONFIG_BYTES * 8 {
            let mut bytes = FITTED.encode();
            bytes[bit / 8] ^= 1 << (bit % 8);
            assert_eq!(Config::decode(&bytes), Config::UNSET, "bit {bit}");
        }
        assert_eq!(Config::decode(&[0xff; CONFIG_BYTES]), Config::UNSET);
        assert_eq!(Config::decode(&[0; CONFIG_BYTES]), Config::UNSET);
    }
}
