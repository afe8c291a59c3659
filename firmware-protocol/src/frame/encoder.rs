//! Frame encoder, in place and without a second buffer.

use core::ops::{Deref, Range};

use super::{CRC_LEN, DELIMITER, FRAME_MAX, HEADER_LEN, Header, PAYLOAD_MAX, crc32};
use crate::messages::{Wire, Writer};

/// Frame ready to be written to the line; dereferences to a byte slice.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Frame {
    /// Leading delimiter, code byte, payload, trailing delimiter.
    bytes: [u8; FRAME_MAX + 1],
    /// Index of the first byte to send: 0 with the leading delimiter, else 1.
    start: u8,
    end: u8,
    crc: u32,
}

/// Error for a message whose encoding exceeds [`super::BODY_MAX`] bytes. No message of the protocol
/// does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TooLong;

/// Index of the header in the buffer: after the leading delimiter and the code byte.
const PAYLOAD_AT: usize = 2;
/// Range of the message in the buffer.
const BODY: Range<usize> = PAYLOAD_AT + HEADER_LEN..PAYLOAD_AT + PAYLOAD_MAX - CRC_LEN;

impl Frame {
    /// Encodes `header` and `message`.
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

    /// Frame without any bytes.
    pub(crate) const EMPTY: Self =
        Self { bytes: [DELIMITER; FRAME_MAX + 1], start: 0, end: 0, crc: 0 };

    /// Returns a writer for the message body.
    pub(crate) fn body(&mut self) -> Writer<'_> {
        Writer::new(self.bytes.get_mut(BODY).unwrap_or_default())
    }

    /// Completes a frame whose message has `body_len` bytes: header, CRC and stuffing.
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

    pub(crate) const fn is_empty(&self) -> bool {
        self.start == self.end
    }

    /// Removes and returns the first byte.
    pub(crate) fn pop(&mut self) -> Option<u8> {
        let byte = self.bytes.get(usize::from(self.start)).filter(|_| !self.is_empty())?;
        self.start = self.start.wrapping_add(1);
        Some(*byte)
    }

    /// Returns the frame with a delimiter in front, which terminates any preceding noise.
    #[must_use]
    pub const fn with_leading_delimiter(self) -> Self {
        Self { start: 0, ..self }
    }

    /// CRC of the frame.
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

/// Applies COBS in place. The first byte of `block` is reserved for the first code; each zero
/// becomes the distance to the next. Valid for blocks shorter than 254 bytes.
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
