//! Packed storage for unacknowledged readings.
//!
//! A reading takes 4 bytes for the ticks at firing, 1 byte for status and number of echoes, and 3
//! bytes per echo. Sweep, index and step follow from the plan.

use crate::messages::limits::{MAX_ECHOES, RING_BYTES, kept_bytes};
use crate::messages::{ReadingStatus, Wire as _, Writer};

/// Size of the ring. Offsets are `u8` and wrap at this size, so they are always valid.
const CAPACITY: usize = RING_BYTES as usize;
const _: () = assert!(CAPACITY == 1 << u8::BITS);

/// Reading in the ring, decoded on access. Values that follow from the plan are not stored.
#[derive(Debug, Clone, Copy)]
pub(super) struct StoredReading<'a> {
    ring: &'a ReadingRing,
    at: u8,
}

/// Echoes of a stored reading, encoded like [`crate::messages::Echoes`].
#[derive(Debug, Clone, Copy)]
pub(super) struct StoredEchoes<'a>(StoredReading<'a>);

#[derive(Debug, Clone)]
pub(super) struct ReadingRing {
    bytes: [u8; CAPACITY],
    /// Offset of the oldest reading.
    oldest: u8,
    used: u16,
    /// Index of the oldest reading.
    first: u16,
    count: u16,
}

impl ReadingRing {
    pub(super) const fn new() -> Self {
        Self { bytes: [0; CAPACITY], oldest: 0, used: 0, first: 0, count: 0 }
    }

    /// Removes all readings; the next one has index 0.
    pub(super) fn clear(&mut self) {
        self.used = 0;
        self.first = 0;
        self.count = 0;
    }

    /// Index of the oldest stored reading.
    pub(super) const fn first(&self) -> u16 {
        self.first
    }

    /// Returns `true` if a reading with up to `max_echoes` echoes fits.
    pub(super) const fn has_room(&self, max_echoes: u8) -> bool {
        self.used + kept_bytes(max_echoes) <= RING_BYTES
    }

    /// Stores a reading; the caller has checked [`Self::has_room`].
    pub(super) fn push(&mut self, fired_ticks: u32, status: ReadingStatus, echoes: &[u32]) {
        let mut cursor = self.oldest.wrapping_add(low_byte(self.used));
        self.put(&mut cursor, fired_ticks, 4);
        let echo_count = low_byte_of_len(echoes.len());
        self.put(&mut cursor, pack(status, echo_count).into(), 1);
        for ticks in echoes {
            self.put(&mut cursor, *ticks, 3);
        }
        self.used = self.used.wrapping_add(kept_bytes(echo_count));
        self.count = self.count.wrapping_add(1);
    }

    /// Removes all readings below index `next`.
    pub(super) fn acknowledge(&mut self, next: u16) {
        while self.count > 0 && self.first < next {
            let size = kept_bytes(self.echo_count_at(self.oldest));
            self.oldest = self.oldest.wrapping_add(low_byte(size));
            self.used = self.used.wrapping_sub(size);
            self.first = self.first.wrapping_add(1);
            self.count = self.count.wrapping_sub(1);
        }
    }

    /// Returns the reading of beam `index`, if stored.
    pub(super) fn get(&self, index: u16) -> Option<StoredReading<'_>> {
        let behind = index.checked_sub(self.first).filter(|&behind| behind < self.count)?;
        let mut at = self.oldest;
        for _ in 0..behind {
            at = at.wrapping_add(low_byte(kept_bytes(self.echo_count_at(at))));
        }
        Some(StoredReading { ring: self, at })
    }

    fn echo_count_at(&self, start: u8) -> u8 {
        unpack(self.at(start.wrapping_add(4))).1
    }

    fn at(&self, offset: u8) -> u8 {
        self.bytes[usize::from(offset)]
    }

    /// Reads three bytes, lowest first.
    fn three_at(&self, offset: u8) -> u32 {
        let byte = |behind| self.at(offset.wrapping_add(behind));
        u32::from_le_bytes([byte(0), byte(1), byte(2), 0])
    }

    /// Writes the lowest `bytes` bytes of `value`, lowest first.
    #[inline(never)]
    fn put(&mut self, cursor: &mut u8, mut value: u32, bytes: u8) {
        for _ in 0..bytes {
            let [low, ..] = value.to_le_bytes();
            self.bytes[usize::from(*cursor)] = low;
            *cursor = cursor.wrapping_add(1);
            value >>= 8;
        }
    }
}

impl<'a> StoredReading<'a> {
    /// Ticks at firing.
    pub(super) fn fired_ticks(self) -> u32 {
        let top = self.ring.at(self.at.wrapping_add(3));
        self.ring.three_at(self.at) | u32::from(top) << 24
    }

    pub(super) fn status(self) -> ReadingStatus {
        unpack(self.ring.at(self.at.wrapping_add(4))).0
    }

    pub(super) const fn echoes(self) -> StoredEchoes<'a> {
        StoredEchoes(self)
    }
}

impl StoredEchoes<'_> {
    pub(super) fn put(self, out: &mut Writer<'_>) {
        let Self(StoredReading { ring, at }) = self;
        let echo_count = ring.echo_count_at(at);
        out.byte(echo_count);
        let mut cursor = at.wrapping_add(5);
        for _ in 0..echo_count {
            ring.three_at(cursor).put(out);
            cursor = cursor.wrapping_add(3);
        }
    }
}

/// Packs status (upper half) and number of echoes (lower half).
const fn pack(status: ReadingStatus, echo_count: u8) -> u8 {
    (status as u8) << 4 | echo_count
}

const fn unpack(byte: u8) -> (ReadingStatus, u8) {
    let status = match byte >> 4 {
        0 => ReadingStatus::Echo,
        1 => ReadingStatus::NoEcho,
        2 => ReadingStatus::ModuleFault,
        _ => ReadingStatus::StepUncertain,
    };
    let echo_count = byte & 0x0f;
    (status, if echo_count > MAX_ECHOES { MAX_ECHOES } else { echo_count })
}

/// Truncates to an offset, modulo 256.
const fn low_byte(value: u16) -> u8 {
    value as u8
}

#[expect(clippy::cast_possible_truncation, reason = "a list of echoes has at most eight")]
const fn low_byte_of_len(len: usize) -> u8 {
    len as u8
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::collections::VecDeque;
    use std::vec::Vec;

    use proptest::prelude::*;

    use super::{ReadingRing, StoredReading};
    use crate::messages::limits::{MAX_ECHOES, WINDOW_TICKS_MAX, readings_in};
    use crate::messages::{Echoes, ReadingStatus, Wire as _, Writer};

    /// Ticks at firing, status, and the encoded echoes.
    type Decoded = (u32, ReadingStatus, Vec<u8>);

    fn encode(put: impl FnOnce(&mut Writer<'_>)) -> Vec<u8> {
        let mut bytes = [0; 64];
        let mut out = Writer::new(&mut bytes);
        put(&mut out);
        let len = out.finish().expect("fits");
        bytes[..usize::from(len)].to_vec()
    }

    /// Decodes a stored reading.
    fn decode(kept: StoredReading<'_>) -> Decoded {
        (kept.fired_ticks(), kept.status(), encode(|out| kept.echoes().put(out)))
    }

    /// Stores a reading derived from `number` and returns the expected decoding.
    fn push(ring: &mut ReadingRing, number: u32, echo_count: u8) -> Decoded {
        let first = number / 7 % (WINDOW_TICKS_MAX - 8);
        let ticks: Vec<u32> = (first..).take(echo_count.into()).collect();
        let status = [ReadingStatus::Echo, ReadingStatus::StepUncertain][(number % 2) as usize];
        ring.push(number, status, &ticks);
        (number, status, encode(|out| Echoes::from_ticks(&ticks).put(out)))
    }

    proptest! {
        #[test]
        fn matches_a_queue(
            operations in prop::collection::vec((any::<bool>(), any::<u32>(), 0..=MAX_ECHOES), 1..400),
        ) {
            let mut ring = ReadingRing::new();
            let mut queue = VecDeque::new();
            let mut first = 0_u16;
            for (keep, number, echo_count) in operations {
                if keep && ring.has_room(echo_count) {
                    queue.push_back(push(&mut ring, number, echo_count));
                } else if !keep {
                    let next = first + u16::try_from(number % 4).expect("small");
                    ring.acknowledge(next);
                    while first < next && queue.pop_front().is_some() {
                        first += 1;
                    }
                }
                prop_assert_eq!(ring.first(), first);
                for (index, expected) in (first..).zip(&queue) {
                    prop_assert_eq!(ring.get(index).map(decode), Some(expected.clone()));
                }
                let end = first + u16::try_from(queue.len()).expect("small");
                prop_assert!(ring.get(end).is_none());
            }
        }
    }

    #[test]
    fn capacity_matches_host() {
        for echo_count in 0..=MAX_ECHOES {
            let mut ring = ReadingRing::new();
            let mut count = 0;
            while ring.has_room(echo_count) {
                push(&mut ring, count, echo_count);
                count += 1;
            }
            assert_eq!(count, u32::from(readings_in(256, echo_count)));
            assert!(count <= 64, "the host accepts 64 beams out of order");
        }
    }
}
