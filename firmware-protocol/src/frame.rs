//! Frames: `COBS(header, body, CRC-32) 0x00`, in both directions.
//!
//! A frame has at most [`PAYLOAD_MAX`] bytes before stuffing, so it is a single COBS block and
//! stuffing costs exactly one byte. The CRC is that of zlib, little-endian, over header and body.

mod decoder;
mod encoder;

pub(crate) use decoder::count;
pub use decoder::{DropReason, FrameDecoder, LinkCounters, RawFrame, Received};
pub use encoder::{Frame, TooLong};

use crc::{CRC_32_ISO_HDLC, Crc, NoTable};

/// Maximum number of bytes of a frame before stuffing: header, body and CRC.
pub const PAYLOAD_MAX: usize = 64;
/// Length of the header in bytes: boot nonce and sequence number, both `u16` little-endian.
pub const HEADER_LEN: usize = 4;
/// Length of the trailing CRC in bytes.
pub const CRC_LEN: usize = 4;
/// Maximum number of bytes of an encoded message.
pub const BODY_MAX: usize = PAYLOAD_MAX - HEADER_LEN - CRC_LEN;
/// Maximum number of bytes of a frame on the wire: code byte, payload and delimiter.
pub const FRAME_MAX: usize = PAYLOAD_MAX + 2;
/// Byte that separates frames and never occurs inside one.
pub const DELIMITER: u8 = 0;

/// Header of every message, in both directions. The layout is frozen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Header {
    /// Boot nonce of the device, or [`Header::BOOT_UNKNOWN`] from a host that has not identified
    /// the device.
    pub boot: u16,
    /// Number of the request. A reply repeats the number of its request; an event carries that of
    /// the operation it belongs to, or 0.
    pub seq: u16,
}

impl Header {
    /// Boot nonce sent by a host that does not know the device's nonce.
    pub const BOOT_UNKNOWN: u16 = 0;
}

/// Computes the CRC-32 of zlib, bit by bit: a table would cost a microcontroller 1 KB of RAM.
#[must_use]
pub fn crc32(bytes: &[u8]) -> u32 {
    Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC).checksum(bytes)
}
