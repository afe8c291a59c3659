//! Building frames, in place and without a second buffer.

use core::ops::{Deref, Range};

use super::{CRC_LEN, DELIMITER, FRAME_MAX, HEADER_LEN, Header, PAYLOAD_MAX, crc32};
use crate::messages::{Wire, Writer};

/// A frame ready to be written to the line.
///
/// Reads as a byte slice.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Frame {
    /// A delimiter, the code byte, the payload, a delimiter.
    bytes: [u8; FRAME_MAX + 1],
    /// Where reading begins: 0 with the leading delimiter, else 1.
    start: u8,
    end: u8,
    crc: u32,
}

/// A message whose encoding is over [`super::BODY_MAX`] bytes. No message of the protocol is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TooLong;

/// Where the header begins in the buffer: behind the leading delimiter and the code byte.
const PAYLOAD_AT: usize = 2;
/// Where the message is.
const BODY: Range<usize> = PAYLOAD_AT + HEADER_LEN..PAYLOAD_AT + PAYLOAD_MAX - CRC_LEN;

impl Frame {
    /// Encodes `message` behind `header`.
    ///
    /// # Errors
    ///
    /// [`TooLong`] if the encoded message does not fit.
    pub fn encode<M: Wire>(header: Header, message: &M) -> Result<Self, TooLong> {
        let mut frame = Self::EMPTY;
        let mut body = frame.body();
        message.put(&mut body);
        let body_len = body.finish().ok_or(TooLong)?;
        frame.close(header, body_len)?;
        Ok(frame)
    }

    /// No bytes at all.
    pub(crate) const EMPTY: Self =
        Self { bytes: [DELIMITER; FRAME_MAX + 1], start: 0, end: 0, crc: 0 };

    /// Where the message is to be written.
    pub(crate) fn body(&mut self) -> Writer<'_> {
        Writer::new(self.bytes.get_mut(BODY).unwrap_or_default())
    }

    /// Puts header, CRC and stuffing around a message of `body_len` bytes.
    #[inline(never)]
    pub(crate) fn close(&mut self, header: Header, body_len: u8) -> Result<(), TooLong> {
        let bytes = &mut self.bytes;
        let [boot_low, boot_high] = header.boot.to_le_bytes();
        let [seq_low, seq_high] = header.seq.to_le_bytes();
        put(bytes, PAYLOAD_AT, [boot_low, boot_high, seq_low, seq_high])?;
        let covered = HEADER_LEN + usize::from(body_len);
        let crc = crc32(bytes.get(PAYLOAD_AT..PAYLOAD_AT + covered).ok_or(TooLong)?);
        put(bytes, PAYLOAD_AT + covered, crc.to_le_bytes())?;
        let payload_len = covered + CRC_LEN;
        stuff(bytes.get_mut(1..PAYLOAD_AT + payload_len).ok_or(TooLong)?);
        let end = u8::try_from(PAYLOAD_AT + payload_len + 1).map_err(|_| TooLong)?;
        (self.start, self.end, self.crc) = (1, end, crc);
        Ok(())
    }

    /// Whether no bytes are left.
    pub(crate) const fn is_empty(&self) -> bool {
        self.start == self.end
    }

    /// Takes the first byte away.
    pub(crate) fn pop(&mut self) -> Option<u8> {
        let byte = self.bytes.get(usize::from(self.start)).filter(|_| !self.is_empty())?;
        self.start = self.start.wrapping_add(1);
        Some(*byte)
    }

    /// The same with a delimiter in front as well, which ends whatever noise came before.
    #[must_use]
    pub const fn with_leading_delimiter(self) -> Self {
        Self { start: 0, ..self }
    }

    /// The CRC the frame carries.
    #[must_use]
    pub const fn crc(&self) -> u32 {
        self.crc
    }
}

impl Deref for Frame {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        self.bytes.get(usize::from(self.start)..usize::from(self.end)).unwrap_or_default()
    }
}

fn put(bytes: &mut [u8], at: usize, value: [u8; 4]) -> Result<(), TooLong> {
    bytes.get_mut(at..at + 4).ok_or(TooLong)?.copy_from_slice(&value);
    Ok(())
}

/// COBS in place: the first byte of `block` is free for the first code; each zero becomes the
/// distance to the next. Right for blocks under 254 bytes.
fn stuff(block: &mut [u8]) {
    let mut distance: u8 = 1;
    let Some((code, payload)) = block.split_first_mut() else {
        return;
    };
    for byte in payload.iter_mut().rev() {
        if *byte == DELIMITER {
            *byte = distance;
            distance = 1;
        } else {
            distance = distance.wrapping_add(1);
        }
    }
    *code = distance;
}
