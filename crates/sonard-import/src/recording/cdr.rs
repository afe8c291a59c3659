//! CDR, the bytes of ROS 2's messages (OMG DDS-XTypes, "plain CDR" version 1), of either byte order.
//!
//! Four bytes say which encoding it is. Behind them each number is aligned to its size, counted from behind
//! those four. A text is its length with the zero that ends it, then both; a list is its length, then its
//! elements.

/// A message that is being decoded.
#[derive(Debug)]
pub(crate) struct Cdr<'a> {
    /// From behind the four bytes of the encoding.
    bytes: &'a [u8],
    at: usize,
    is_big_endian: bool,
}

/// Why bytes are no such message.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub(crate) enum CdrError {
    #[error("its bytes end too early")]
    Short,
    #[error("its encoding, {0:#06x}, is not plain CDR")]
    Encoding(u16),
    #[error("a text in it is not UTF-8, or has no end")]
    Text,
}

/// A part of a message.
pub(crate) type Part<T> = Result<T, CdrError>;

impl<'a> Cdr<'a> {
    pub(crate) fn new(message: &'a [u8]) -> Part<Self> {
        let ([high, low, _, _], bytes) = message.split_first_chunk().ok_or(CdrError::Short)?;
        match (high, low) {
            (0, 0 | 1) => Ok(Self { bytes, at: 0, is_big_endian: *low == 0 }),
            _ => Err(CdrError::Encoding(u16::from_be_bytes([*high, *low]))),
        }
    }

    fn take<const N: usize>(&mut self) -> Part<[u8; N]> {
        let from = self.at.next_multiple_of(N);
        let rest = self.bytes.get(from..).ok_or(CdrError::Short)?;
        let mut number = *rest.first_chunk::<N>().ok_or(CdrError::Short)?;
        self.at = from + N;
        if self.is_big_endian {
            number.reverse();
        }
        Ok(number)
    }

    pub(crate) fn u8(&mut self) -> Part<u8> {
        self.take().map(u8::from_le_bytes)
    }

    pub(crate) fn u32(&mut self) -> Part<u32> {
        self.take().map(u32::from_le_bytes)
    }

    pub(crate) fn i32(&mut self) -> Part<i32> {
        self.take().map(i32::from_le_bytes)
    }

    pub(crate) fn f32(&mut self) -> Part<f32> {
        self.take().map(f32::from_le_bytes)
    }

    pub(crate) fn f64(&mut self) -> Part<f64> {
        self.take().map(f64::from_le_bytes)
    }

    pub(crate) fn text(&mut self) -> Part<&'a str> {
        let length = self.u32()? as usize;
        let rest = self.bytes.get(self.at..).ok_or(CdrError::Short)?;
        let text = rest.get(..length).ok_or(CdrError::Short)?;
        self.at += length;
        // Some write an empty text without its zero.
        let text = if length == 0 { Some(text) } else { text.strip_suffix(&[0]) };
        text.and_then(|text| std::str::from_utf8(text).ok()).ok_or(CdrError::Text)
    }

    /// The elements of a list. What a length says is not believed before the elements are there.
    pub(crate) fn list<T>(&mut self, element: impl Fn(&mut Self) -> Part<T>) -> Part<Vec<T>> {
        let length = self.u32()?;
        let mut elements = Vec::new();
        for _ in 0..length {
            elements.push(element(self)?);
        }
        Ok(elements)
    }
}
