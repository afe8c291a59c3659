//! Reading frames byte by byte from a line that may lose, change or add bytes.

use super::{CRC_LEN, DELIMITER, HEADER_LEN, Header, PAYLOAD_MAX, crc32};

/// Finds frames in a stream of bytes.
///
/// Unstuffs while bytes come in, so it holds one payload and nothing else. After any fault it
/// drops everything up to the next delimiter: the tail of a frame that was too long is never
/// taken for a frame.
#[derive(Debug, Clone)]
pub struct FrameDecoder {
    payload: [u8; PAYLOAD_MAX],
    len: u8,
    /// Bytes left in the current COBS block.
    run: u8,
    state: State,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    /// Before the first code byte of a frame.
    Between,
    Inside,
    /// Until the next delimiter.
    Dropping(DropReason),
}

/// The event that a byte completed.
#[derive(Debug, PartialEq, Eq)]
pub enum Received<'a> {
    /// Nothing yet.
    Nothing,
    /// A frame whose CRC is right. The message inside is not looked at.
    Frame(RawFrame<'a>),
    /// Two delimiters with nothing between: harmless.
    Empty,
    /// The end of something that was no frame.
    Dropped(DropReason),
}

/// A frame with a right CRC.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RawFrame<'a> {
    /// Boot nonce and sequence number.
    pub header: Header,
    /// The encoded message, one byte at least.
    pub body: &'a [u8],
    /// The CRC, which tells a repeated request from another one with the same number.
    pub crc: u32,
    /// Bytes on the wire, with code byte and delimiter.
    pub wire_len: u8,
}

/// The reason why bytes were dropped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DropReason {
    /// The delimiter came inside a COBS block.
    Stuffing,
    /// More than [`PAYLOAD_MAX`] bytes without a delimiter.
    TooLong,
    /// The CRC is wrong, or there are too few bytes for header, message and CRC.
    Checksum,
    /// The line reported an error of its own (framing, overrun).
    Line,
}

/// Counts of what a receiver dropped, by kind. Counters stop at their largest value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LinkCounters {
    /// Frames with a wrong CRC or too short for one.
    pub checksum: u16,
    /// Frames with broken stuffing.
    pub stuffing: u16,
    /// Runs of more bytes than a frame may have.
    pub too_long: u16,
    /// Frames hit by an error that the line itself reported.
    pub line: u16,
    /// Right frames with a message that this version does not know.
    pub undecodable: u16,
    /// Right messages that came too late: old duplicates, or from before a restart.
    pub stale: u16,
    /// Empty frames (delimiters in a row). Not a fault.
    pub empty: u16,
}

impl LinkCounters {
    /// Adds one dropped frame.
    pub fn count(&mut self, reason: DropReason) {
        let counter = match reason {
            DropReason::Stuffing => &mut self.stuffing,
            DropReason::TooLong => &mut self.too_long,
            DropReason::Checksum => &mut self.checksum,
            DropReason::Line => &mut self.line,
        };
        count(counter);
    }
}

/// Counts up to the largest value, and stays there.
// Not inlined: there are many counters.
#[inline(never)]
pub(crate) fn count(counter: &mut u16) {
    *counter = counter.saturating_add(1);
}

impl Default for FrameDecoder {
    fn default() -> Self {
        Self::new()
    }
}

impl FrameDecoder {
    /// A decoder between frames.
    #[must_use]
    pub const fn new() -> Self {
        Self { payload: [0; PAYLOAD_MAX], len: 0, run: 0, state: State::Between }
    }

    /// Takes the next byte from the line.
    pub fn push(&mut self, byte: u8) -> Received<'_> {
        if byte == DELIMITER {
            return self.end();
        }
        match self.state {
            State::Between => {
                self.len = 0;
                self.run = byte.wrapping_sub(1);
                self.state = State::Inside;
            }
            State::Inside if self.run == 0 => {
                self.append(DELIMITER);
                self.run = byte.wrapping_sub(1);
            }
            State::Inside => {
                self.append(byte);
                self.run = self.run.wrapping_sub(1);
            }
            State::Dropping(_) => {}
        }
        Received::Nothing
    }

    /// The line reported an error: what is being received is dropped up to the next delimiter.
    pub fn damage(&mut self) {
        self.state = State::Dropping(DropReason::Line);
    }

    fn append(&mut self, byte: u8) {
        if let Some(slot) = self.payload.get_mut(usize::from(self.len)) {
            *slot = byte;
            self.len = self.len.wrapping_add(1);
        } else {
            self.state = State::Dropping(DropReason::TooLong);
        }
    }

    fn end(&mut self) -> Received<'_> {
        let state = core::mem::replace(&mut self.state, State::Between);
        match state {
            State::Between => Received::Empty,
            State::Dropping(reason) => Received::Dropped(reason),
            State::Inside if self.run != 0 => Received::Dropped(DropReason::Stuffing),
            State::Inside => match self.check() {
                Some(frame) => Received::Frame(frame),
                None => Received::Dropped(DropReason::Checksum),
            },
        }
    }

    fn check(&self) -> Option<RawFrame<'_>> {
        let payload = self.payload.get(..usize::from(self.len))?;
        let (covered, crc) = payload.split_last_chunk::<CRC_LEN>()?;
        let (header, body) = covered.split_first_chunk::<HEADER_LEN>()?;
        let crc = u32::from_le_bytes(*crc);
        if body.is_empty() || crc32(covered) != crc {
            return None;
        }
        let [boot_low, boot_high, seq_low, seq_high] = *header;
        Some(RawFrame {
            header: Header {
                boot: u16::from_le_bytes([boot_low, boot_high]),
                seq: u16::from_le_bytes([seq_low, seq_high]),
            },
            body,
            crc,
            wire_len: self.len.wrapping_add(2),
        })
    }
}
