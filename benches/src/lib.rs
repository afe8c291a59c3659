//! Inputs that benchmarks and instruction counts share.

use firmware_protocol::{
    frame::Header,
    messages::{Echoes, Reading, ReadingStatus},
};

/// Header of all frames.
pub const HEADER: Header = Header { boot: 0x1234, seq: 0x42 };

/// Reading of a sweep with one echo.
#[must_use]
pub fn reading(index: u16) -> Reading {
    Reading {
        sweep: 7,
        index,
        step: i32::from(index),
        fired_ticks: 123_400_000 + u32::from(index),
        status: ReadingStatus::Echo,
        echoes: Echoes::from_ticks(&[9_652]),
    }
}
