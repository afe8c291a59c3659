//! Encoding of CDR, the serialization of ROS 2 messages (OMG DDS-XTypes, "plain CDR" version 1,
//! little-endian).
//!
//! Four bytes identify the encoding. Numbers after them are aligned to their size, counted from the
//! end of those four bytes. A string is its length including the terminating zero, then its bytes;
//! a list is its length, then its elements.

/// Encoder of one message.
#[derive(Debug)]
pub(crate) struct CdrWriter(Vec<u8>);

/// Encapsulation header: version 1, little-endian, no options.
const ENCODING: [u8; 4] = [0, 1, 0, 0];

/// Message or part of a message that can be encoded.
pub(crate) trait Encode {
    fn encode(&self, cdr: &mut CdrWriter);
}

impl CdrWriter {
    /// Encodes a message into a reusable buffer.
    pub(crate) fn encode<'a>(message: &impl Encode, buffer: &'a mut Vec<u8>) -> &'a [u8] {
        let mut cdr = Self(std::mem::take(buffer));
        cdr.0.clear();
        cdr.0.extend(ENCODING);
        message.encode(&mut cdr);
        *buffer = cdr.0;
        buffer
    }

    fn align(&mut self, size: usize) {
        let end = (self.0.len() - ENCODING.len()).next_multiple_of(size) + ENCODING.len();
        self.0.resize(end, 0);
    }

    pub(crate) fn u8(&mut self, value: u8) {
        self.0.push(value);
    }

    pub(crate) fn flag(&mut self, value: bool) {
        self.u8(value.into());
    }

    pub(crate) fn u32(&mut self, value: u32) {
        self.align(4);
        self.0.extend(value.to_le_bytes());
    }

    pub(crate) fn i32(&mut self, value: i32) {
        self.u32(value.cast_unsigned());
    }

    pub(crate) fn f32(&mut self, value: f32) {
        self.u32(value.to_bits());
    }

    pub(crate) fn f64(&mut self, value: f64) {
        self.align(8);
        self.0.extend(value.to_le_bytes());
    }

    /// Writes the length of a list, saturated at the maximum of CDR, which no scan reaches.
    fn length(&mut self, length: usize) {
        self.u32(u32::try_from(length).unwrap_or(u32::MAX));
    }

    pub(crate) fn text(&mut self, text: &str) {
        self.length(text.len() + 1);
        self.0.extend(text.as_bytes());
        self.0.push(0);
    }

    pub(crate) fn bytes(&mut self, bytes: &[u8]) {
        self.length(bytes.len());
        self.0.extend(bytes);
    }

    pub(crate) fn f32s(&mut self, values: &[f32]) {
        self.length(values.len());
        self.0.reserve(4 * values.len());
        values.iter().for_each(|value| self.f32(*value));
    }

    pub(crate) fn list(&mut self, elements: &[impl Encode]) {
        self.length(elements.len());
        elements.iter().for_each(|element| element.encode(self));
    }
}
