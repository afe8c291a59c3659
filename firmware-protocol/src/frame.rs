//! Frames: `COBS(header, body, CRC-32) 0x00`, in both directions.
//!
//! At most [`PAYLOAD_MAX`] bytes before stuffing, so a frame is one COBS block and stuffing
//! costs exactly one byte. The CRC is the one of zlib, little-endian, over header and body.

mod decoder;
mod encoder;

pub(crate) use decoder::count;
pub use decoder::{DropReason, FrameDecoder, LinkCounters, RawFrame, Received};
pub use encoder::{Frame, TooLong};

use crc::{CRC_32_ISO_HDLC, Crc, NoTable};

/// Bytes of a frame before stuffing, at most: header, body and CRC.
pub const PAYLOAD_MAX: usize = 64;
/// Bytes of the header: boot nonce and sequence number, both `u16` little-endian.
pub const HEADER_LEN: usize = 4;
/// Bytes of the CRC at the end.
pub const CRC_LEN: usize = 4;
/// Bytes of the encoded message, at most.
pub const BODY_MAX: usize = PAYLOAD_MAX - HEADER_LEN - CRC_LEN;
/// Bytes of a frame on the wire, at most: the code byte, the payload, the delimiter.
pub const FRAME_MAX: usize = PAYLOAD_MAX + 2;
/// The byte between frames. It never occurs inside one.
pub const DELIMITER: u8 = 0;

/// The header of every message, in both directions. Its layout is frozen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Header {
    /// The device's boot nonce, or [`Header::BOOT_UNKNOWN`] from a host that has not met the device.
    pub boot: u16,
    /// The request's number; a reply repeats the number of its request, an event that of the
    /// operation it belongs to (or 0).
    pub seq: u16,
}

impl Header {
    /// The boot nonce of a host that does not know the device's.
    pub const BOOT_UNKNOWN: u16 = 0;
}

/// CRC-32 as zlib computes it. Bit by bit: a table would cost a microcontroller 1 KB of RAM.
#[must_use]
pub fn crc32(bytes: &[u8]) -> u32 {
    Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC).checksum(bytes)
}
