//! Readings that the host has not acknowledged, packed.
//!
//! A reading is kept as ticks at firing (4 bytes), status and number of echoes (1 byte) and 3
//! bytes an echo. Sweep, index and step follow from the plan.

use crate::messages::limits::{MAX_ECHOES, RING_BYTES, kept_bytes};
use crate::messages::{Echoes, ReadingStatus};

/// Offsets are `u8` and wrap by themselves, so they always lie inside.
const CAPACITY: usize = RING_BYTES as usize;
const _: () = assert!(CAPACITY == 1 << u8::BITS);

/// A reading without what follows from the plan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Kept {
    pub(super) fired_ticks: u32,
    pub(super) status: ReadingStatus,
    pub(super) echoes: Echoes,
}

#[derive(Debug, Clone)]
pub(super) struct Ring {
    bytes: [u8; CAPACITY],
    /// Where the oldest reading begins.
    oldest: u8,
    used: u16,
    /// Index of the oldest reading.
    first: u16,
    count: u16,
}

impl Ring {
    pub(super) const fn new() -> Self {
        Self { bytes: [0; CAPACITY], oldest: 0, used: 0, first: 0, count: 0 }
    }

    /// Forgets everything; the next reading has index 0.
    pub(super) fn clear(&mut self) {
        self.used = 0;
        self.first = 0;
        self.count = 0;
    }

    /// Index of the oldest reading kept.
    pub(super) const fn first(&self) -> u16 {
        self.first
    }

    /// Whether a reading of up to `max_echoes` echoes fits.
    pub(super) const fn has_room(&self, max_echoes: u8) -> bool {
        self.used + kept_bytes(max_echoes) <= RING_BYTES
    }

    /// Keeps a reading; the caller has made sure of the room.
    pub(super) fn push(&mut self, kept: &Kept) {
        let mut cursor = self.oldest.wrapping_add(low_byte(self.used));
        for byte in kept.fired_ticks.to_le_bytes() {
            self.put(&mut cursor, byte);
        }
        let echo_count = low_byte_of_len(kept.echoes.len());
        self.put(&mut cursor, pack(kept.status, echo_count));
        for ticks in kept.echoes.iter() {
            let [low, middle, high, _] = ticks.to_le_bytes();
            for byte in [low, middle, high] {
                self.put(&mut cursor, byte);
            }
        }
        self.used = self.used.saturating_add(kept_bytes(echo_count));
        self.count = self.count.wrapping_add(1);
    }

    /// Drops all readings below index `next`, as far as there are any.
    pub(super) fn acknowledge(&mut self, next: u16) {
        while self.count > 0 && self.first < next {
            let size = kept_bytes(self.echo_count_at(self.oldest));
            self.oldest = self.oldest.wrapping_add(low_byte(size));
            self.used = self.used.saturating_sub(size);
            self.first = self.first.wrapping_add(1);
            self.count = self.count.wrapping_sub(1);
        }
    }

    /// The reading of beam `index`, if it is kept.
    pub(super) fn get(&self, index: u16) -> Option<Kept> {
        let behind = index.checked_sub(self.first).filter(|&behind| behind < self.count)?;
        let mut cursor = self.oldest;
        for _ in 0..behind {
            cursor = cursor.wrapping_add(low_byte(kept_bytes(self.echo_count_at(cursor))));
        }
        Some(self.read(cursor))
    }

    fn read(&self, mut cursor: u8) -> Kept {
        let mut next = || {
            let byte = self.at(cursor);
            cursor = cursor.wrapping_add(1);
            byte
        };
        let fired_ticks = u32::from_le_bytes([next(), next(), next(), next()]);
        let (status, echo_count) = unpack(next());
        let mut echoes = Echoes::new();
        for _ in 0..echo_count {
            // Fits: it came out of such a list.
            let _ = echoes.push(u32::from_le_bytes([next(), next(), next(), 0]));
        }
        Kept { fired_ticks, status, echoes }
    }

    fn echo_count_at(&self, start: u8) -> u8 {
        unpack(self.at(start.wrapping_add(4))).1
    }

    fn at(&self, offset: u8) -> u8 {
        self.bytes[usize::from(offset)]
    }

    fn put(&mut self, cursor: &mut u8, byte: u8) {
        self.bytes[usize::from(*cursor)] = byte;
        *cursor = cursor.wrapping_add(1);
    }
}

/// Status in the upper, number of echoes in the lower half.
const fn pack(status: ReadingStatus, echo_count: u8) -> u8 {
    (status as u8) << 4 | echo_count
}

const fn unpack(byte: u8) -> (ReadingStatus, u8) {
    let status = match byte >> 4 {
        0 => ReadingStatus::Echo,
        1 => ReadingStatus::NoEcho,
        2 => ReadingStatus::ModuleFault,
        _ => ReadingStatus::StepDoubtful,
    };
    let echo_count = byte & 0x0f;
    (status, if echo_count > MAX_ECHOES { MAX_ECHOES } else { echo_count })
}

/// Offsets count modulo 256.
const fn low_byte(value: u16) -> u8 {
    value as u8
}

#[expect(clippy::cast_possible_truncation, reason = "a list of echoes has at most eight")]
/// A list of echoes has at most eight.
const fn low_byte_of_len(len: usize) -> u8 {
    len as u8
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::collections::VecDeque;
    use std::vec::Vec;

    use proptest::prelude::*;

    use super::{Kept, Ring};
    use crate::messages::limits::{MAX_ECHOES, readings_in};
    use crate::messages::{Echoes, ReadingStatus};

    fn kept(fired_ticks: u32, echo_count: u8) -> Kept {
        let ticks: Vec<u32> =
            (0..u32::from(echo_count)).map(|echo| fired_ticks / 7 % 1_000 + echo).collect();
        Kept { fired_ticks, status: ReadingStatus::Echo, echoes: Echoes::from_ticks(&ticks) }
    }

    proptest! {
        /// The ring against a queue that is never short of room.
        #[test]
        fn keeps_what_a_queue_keeps(
            operations in prop::collection::vec((any::<bool>(), any::<u32>(), 0..=MAX_ECHOES), 1..400),
        ) {
            let mut ring = Ring::new();
            let mut queue = VecDeque::new();
            let mut first = 0_u16;
            for (push, number, echo_count) in operations {
                if push && ring.has_room(echo_count) {
                    ring.push(&kept(number, echo_count));
                    queue.push_back(kept(number, echo_count));
                } else if !push {
                    let next = first + u16::try_from(number % 4).expect("small");
                    ring.acknowledge(next);
                    while first < next && queue.pop_front().is_some() {
                        first += 1;
                    }
                }
                prop_assert_eq!(ring.first(), first);
                for (index, expected) in (first..).zip(&queue) {
                    prop_assert_eq!(ring.get(index), Some(*expected));
                }
                let end = first + u16::try_from(queue.len()).expect("small");
                prop_assert_eq!(ring.get(end), None);
            }
        }
    }

    #[test]
    fn holds_as_many_as_the_host_reckons_with() {
        for echo_count in 0..=MAX_ECHOES {
            let mut ring = Ring::new();
            let mut count = 0;
            while ring.has_room(echo_count) {
                ring.push(&kept(count, echo_count));
                count += 1;
            }
            assert_eq!(count, u32::from(readings_in(256, echo_count)));
            assert!(count <= 64, "the host remembers 64 beams out of order");
        }
    }
}
