//! Limits checked by the device. Ticks are device ticks of 0.5 us.

/// Device ticks per second.
pub const TICK_HZ: u32 = 2_000_000;
/// Largest distance from home, steps.
pub const POSITION_MAX: i32 = 1_000_000;
/// Largest listening window, ticks (1.05 s), which keeps an echo time within three bytes.
pub const WINDOW_TICKS_MAX: u32 = (1 << 21) - 1;
/// Smallest listening window, ticks (1 ms).
pub const WINDOW_TICKS_MIN: u32 = 2_000;
/// Largest minimum time between firings, ticks (8.4 s).
pub const INTERVAL_TICKS_MAX: u32 = (1 << 24) - 1;
/// Largest settling time after a move, ticks (8.4 s).
pub const SETTLE_TICKS_MAX: u32 = (1 << 24) - 1;
/// Maximum number of echoes in a reading.
pub const MAX_ECHOES: u8 = 8;
/// Shortest blanking that can be set, ticks (0.5 ms): until then the transducer still rings.
pub const SHORT_BLANKING_TICKS_MIN: u16 = 1_000;
/// Longest blanking that can be set, ticks (2.38 ms): the internal blanking of the module.
pub const SHORT_BLANKING_TICKS_MAX: u16 = 4_760;
/// Largest speed of a move, steps/s.
pub const SPEED_MAX: u16 = 10_000;
/// Largest acceleration of a move, steps/s^2.
pub const ACCELERATION_MAX: u32 = 200_000;
/// Longest time that idle coils are held without a request from the host, s.
pub const HOLD_S_MAX: u16 = 900;
/// Shortest lease of a sweep, ms.
pub const LEASE_MS_MIN: u16 = 100;
/// Maximum number of beams in a sweep: stops times pings per stop.
pub const BEAMS_MAX: u16 = u16::MAX;
/// Capacity for unacknowledged readings in the device, bytes.
pub const RING_BYTES: u16 = 256;
/// Storage for an unacknowledged reading without echoes, bytes.
pub const KEPT_READING_BYTES: u16 = 5;
/// Storage for each echo of an unacknowledged reading, bytes.
pub const KEPT_ECHO_BYTES: u16 = 3;

/// Number of unacknowledged readings with up to `max_echoes` echoes that always fit into
/// `ring_bytes`.
#[must_use]
pub const fn readings_in(ring_bytes: u16, max_echoes: u8) -> u16 {
    ring_bytes / kept_bytes(max_echoes)
}

/// Storage for an unacknowledged reading with `echoes` echoes, bytes.
#[must_use]
pub const fn kept_bytes(echoes: u8) -> u16 {
    KEPT_READING_BYTES + KEPT_ECHO_BYTES * echoes as u16
}
