//! Frame decoder for a byte stream whose bytes may be lost, altered or inserted.

use super::{CRC_LEN, DELIMITER, HEADER_LEN, Header, PAYLOAD_MAX, crc32};

/// Extracts frames from a byte stream.
///
/// Unstuffs while bytes arrive, so the decoder stores a single payload and nothing else. After any
/// error it drops everything up to the next delimiter: the tail of an overlong frame is never read
/// as a frame.
#[derive(Debug, Clone)]
pub struct FrameDecoder {
    payload: [u8; PAYLOAD_MAX],
    len: u8,
    /// Bytes left in the current COBS block.
    run: u8,
    state: DecoderState,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum DecoderState {
    /// Before the first code byte of a frame.
    Between,
    Inside,
    /// Discarding bytes up to the next delimiter.
    Dropping(DropReason),
}

/// Event completed by a byte.
#[derive(Debug, PartialEq, Eq)]
pub enum Received<'a> {
    /// The frame is incomplete.
    Nothing,
    /// A frame with a valid CRC. The message inside is not decoded.
    Frame(RawFrame<'a>),
    /// Two delimiters in a row, which is harmless.
    Empty,
    /// End of a byte sequence that was not a valid frame.
    Dropped(DropReason),
}

/// Frame with a valid CRC.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RawFrame<'a> {
    /// Boot nonce and sequence number.
    pub header: Header,
    /// Encoded message, at least one byte.
    pub body: &'a [u8],
    /// CRC, which distinguishes a repeated request from a different one with the same number.
    pub crc: u32,
    /// Bytes on the wire, including code byte and delimiter.
    pub wire_len: u8,
}

/// Reason for dropping received bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DropReason {
    /// Delimiter inside a COBS block.
    Stuffing,
    /// More than [`PAYLOAD_MAX`] bytes without a delimiter.
    TooLong,
    /// Wrong CRC, or too few bytes for header, message and CRC.
    Checksum,
    /// Error reported by the line driver (framing, overrun).
    Line,
}

/// Counts of dropped or ignored frames, by reason. Counters saturate at `u16::MAX`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LinkCounters {
    /// Frames with a wrong CRC or too short for one.
    pub checksum: u16,
    /// Frames with broken stuffing.
    pub stuffing: u16,
    /// Runs of more bytes than a frame may have.
    pub too_long: u16,
    /// Frames affected by an error that the line driver reported.
    pub line: u16,
    /// Valid frames with a message unknown to this version.
    pub undecodable: u16,
    /// Valid messages that arrived too late: old duplicates, or from before a restart.
    pub stale: u16,
    /// Empty frames (consecutive delimiters). Not an error.
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

/// Increments a counter, saturating at `u16::MAX`.
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
    /// Creates a decoder in the state between two frames.
    #[must_use]
    pub const fn new() -> Self {
        Self { payload: [0; PAYLOAD_MAX], len: 0, run: 0, state: DecoderState::Between }
    }

    /// Processes the next byte from the line.
    pub fn push(&mut self, byte: u8) -> Received<'_> {
        if byte == DELIMITER {
            return self.end();
        }
        match self.state {
            DecoderState::Between => {
                self.len = 0;
                self.run = byte.wrapping_sub(1);
                self.state = DecoderState::Inside;
            }
            DecoderState::Inside if self.run == 0 => {
                self.append(DELIMITER);
                self.run = byte.wrapping_sub(1);
            }
            DecoderState::Inside => {
                self.append(byte);
                self.run = self.run.wrapping_sub(1);
            }
            DecoderState::Dropping(_) => {}
        }
        Received::Nothing
    }

    /// Discards the frame being received, after an error reported by the line driver.
    pub fn discard_frame(&mut self) {
        self.state = DecoderState::Dropping(DropReason::Line);
    }

    fn append(&mut self, byte: u8) {
        if let Some(slot) = self.payload.get_mut(usize::from(self.len)) {
            *slot = byte;
            self.len = self.len.wrapping_add(1);
        } else {
            self.state = DecoderState::Dropping(DropReason::TooLong);
        }
    }

    fn end(&mut self) -> Received<'_> {
        let state = core::mem::replace(&mut self.state, DecoderState::Between);
        match state {
            DecoderState::Between => Received::Empty,
            DecoderState::Dropping(reason) => Received::Dropped(reason),
            DecoderState::Inside if self.run != 0 => Received::Dropped(DropReason::Stuffing),
            DecoderState::Inside => match self.check() {
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
