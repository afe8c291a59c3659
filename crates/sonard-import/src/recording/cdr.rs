//! Decoding of CDR, the serialization of ROS 2 messages (OMG DDS-XTypes, "plain CDR" version 1), in
//! either byte order.
//!
//! Four bytes identify the encoding. Numbers after them are aligned to their size, counted from the
//! end of those four bytes. A string is its length including the terminating zero, then its bytes;
//! a list is its length, then its elements.

/// Decoder of one message.
#[derive(Debug)]
pub(crate) struct CdrReader<'a> {
    /// Message after the four bytes of the encoding.
    bytes: &'a [u8],
    at: usize,
    is_big_endian: bool,
}

/// Decoding error.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub(crate) enum CdrError {
    #[error("the message ends too early")]
    Short,
    #[error("encoding {0:#06x} is not plain CDR")]
    Encoding(u16),
    #[error("a string is not UTF-8 or not terminated")]
    Text,
}

/// Result of decoding a part of a message.
pub(crate) type Decoded<T> = Result<T, CdrError>;

impl<'a> CdrReader<'a> {
    pub(crate) fn new(message: &'a [u8]) -> Decoded<Self> {
        let ([high, low, _, _], bytes) = message.split_first_chunk().ok_or(CdrError::Short)?;
        match (high, low) {
            (0, 0 | 1) => Ok(Self { bytes, at: 0, is_big_endian: *low == 0 }),
            _ => Err(CdrError::Encoding(u16::from_be_bytes([*high, *low]))),
        }
    }

    fn take<const N: usize>(&mut self) -> Decoded<[u8; N]> {
        let from = self.at.next_multiple_of(N);
        let rest = self.bytes.get(from..).ok_or(CdrError::Short)?;
        let mut number = *rest.first_chunk::<N>().ok_or(CdrError::Short)?;
        self.at = from + N;
        if self.is_big_endian {
            number.reverse();
        }
        Ok(number)
    }

    pub(crate) fn u8(&mut self) -> Decoded<u8> {
        self.take().map(u8::from_le_bytes)
    }

    pub(crate) fn u32(&mut self) -> Decoded<u32> {
        self.take().map(u32::from_le_bytes)
    }

    pub(crate) fn i32(&mut self) -> Decoded<i32> {
        self.take().map(i32::from_le_bytes)
    }

    pub(crate) fn f32(&mut self) -> Decoded<f32> {
        self.take().map(f32::from_le_bytes)
    }

    pub(crate) fn f64(&mut self) -> Decoded<f64> {
        self.take().map(f64::from_le_bytes)
    }

    pub(crate) fn text(&mut self) -> Decoded<&'a str> {
        let length = self.u32()? as usize;
        let rest = self.bytes.get(self.at..).ok_or(CdrError::Short)?;
        let text = rest.get(..length).ok_or(CdrError::Short)?;
        self.at += length;
        // Some programs write an empty string without its terminating zero.
        let text = if length == 0 { Some(text) } else { text.strip_suffix(&[0]) };
        text.and_then(|text| std::str::from_utf8(text).ok()).ok_or(CdrError::Text)
    }

    /// Decodes a list. Memory grows with decoded elements, as the stated length may be wrong.
    pub(crate) fn list<T>(&mut self, element: impl Fn(&mut Self) -> Decoded<T>) -> Decoded<Vec<T>> {
        let length = self.u32()?;
        let mut elements = Vec::new();
        for _ in 0..length {
            elements.push(element(self)?);
        }
        Ok(elements)
    }
}
