//! What the device accepts. Ticks are device ticks of 0.5 us.

/// Device ticks a second.
pub const TICK_HZ: u32 = 2_000_000;
/// Largest distance from home, steps.
pub const POSITION_MAX: i32 = 1_000_000;
/// Largest listening window, ticks (1.05 s): an echo time stays within three bytes.
pub const WINDOW_TICKS_MAX: u32 = (1 << 21) - 1;
/// Smallest listening window, ticks (1 ms).
pub const WINDOW_TICKS_MIN: u32 = 2_000;
/// Largest minimum time between firings, ticks (8.4 s).
pub const INTERVAL_TICKS_MAX: u32 = (1 << 24) - 1;
/// Largest settling time after a move, ticks (8.4 s).
pub const SETTLE_TICKS_MAX: u32 = (1 << 24) - 1;
/// Echoes in a reading, at most.
pub const MAX_ECHOES: u8 = 8;
/// Shortest blanking set from outside, ticks (0.5 ms): before that the transmitter still rings.
pub const SHORT_BLANKING_TICKS_MIN: u16 = 1_000;
/// Longest blanking set from outside, ticks (2.38 ms): what the module does by itself.
pub const SHORT_BLANKING_TICKS_MAX: u16 = 4_760;
/// Largest speed, steps/s.
pub const SPEED_MAX: u16 = 10_000;
/// Largest acceleration, steps/s^2.
pub const ACCELERATION_MAX: u32 = 200_000;
/// Longest time that idle coils are held without a word from the host, s.
pub const HOLD_S_MAX: u16 = 900;
/// Shortest lease of a sweep, ms.
pub const LEASE_MS_MIN: u16 = 100;
/// Beams in a sweep, at most: stops times pings per stop.
pub const BEAMS_MAX: u16 = u16::MAX;
/// Bytes that the device keeps for readings not yet acknowledged.
pub const RING_BYTES: u16 = 256;
/// Bytes of a kept reading without echoes.
pub const KEPT_READING_BYTES: u16 = 5;
/// Bytes of an echo in a kept reading.
pub const KEPT_ECHO_BYTES: u16 = 3;

/// How many unacknowledged readings of up to `max_echoes` echoes `ring_bytes` hold for certain.
#[must_use]
pub const fn readings_in(ring_bytes: u16, max_echoes: u8) -> u16 {
    ring_bytes / kept_bytes(max_echoes)
}

/// Bytes that a reading with `echoes` echoes takes while it is kept.
#[must_use]
pub const fn kept_bytes(echoes: u8) -> u16 {
    KEPT_READING_BYTES + KEPT_ECHO_BYTES * echoes as u16
}
