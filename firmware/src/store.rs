//! EEPROM storage: configuration of the board, and a boot counter.

use board_config::{BOOT_AT, BOOT_BYTES, BOOT_SLOTS, CONFIG_BYTES, Config};

use crate::hardware::{EEARH, EEARL, EECR, EEDR, critical_section};

const READ: u8 = 1;
const WRITE: u8 = 1 << 1;
const UNLOCK: u8 = 1 << 2;

pub fn config() -> Config {
    let mut bytes = [0; CONFIG_BYTES];
    for (at, byte) in (0..).zip(&mut bytes) {
        *byte = read(at);
    }
    Config::decode(&bytes)
}

/// Returns a number that differs from the previous boot's, never 0. The number is stored before it
/// is used. A boot that is interrupted while storing leaves the preceding number, or a slot whose
/// halves do not match.
pub fn next_boot() -> u16 {
    let mut latest = None;
    for slot in 0..BOOT_SLOTS {
        let Some(boot) = boot_in(slot) else { continue };
        if latest.is_none_or(|(_, before)| (boot.wrapping_sub(before) as i16) > 0) {
            latest = Some((slot, boot));
        }
    }
    let (slot, boot) = latest.unwrap_or((BOOT_SLOTS - 1, 0));
    let slot = (slot + 1) % BOOT_SLOTS;
    let boot = boot.wrapping_add(1).max(1);
    let ([low, high], [not_low, not_high]) = (boot.to_le_bytes(), (!boot).to_le_bytes());
    for (at, byte) in (BOOT_AT + slot * BOOT_BYTES..).zip([low, high, not_low, not_high]) {
        write(at, byte);
    }
    boot
}

fn boot_in(slot: u16) -> Option<u16> {
    let at = BOOT_AT + slot * BOOT_BYTES;
    let pair = |at| u16::from_le_bytes([read(at), read(at + 1)]);
    let boot = pair(at);
    (boot == !pair(at + 2)).then_some(boot)
}

#[inline(never)]
fn read(at: u16) -> u8 {
    select(at);
    EECR.write(READ);
    EEDR.read()
}

/// Writes a byte; takes 3.4 ms.
fn write(at: u16, byte: u8) {
    select(at);
    EEDR.write(byte);
    critical_section(|_| {
        // The second write must follow within four cycles of the first.
        EECR.write(UNLOCK);
        EECR.write(UNLOCK | WRITE);
    });
}

fn select(at: u16) {
    while EECR.has(WRITE) {}
    let [low, high] = at.to_le_bytes();
    EEARH.write(high);
    EEARL.write(low);
}
