//! The bytes of messages: postcard's format, written and read without it.
//!
//! On the microcontroller postcard and serde's generated code would take four kilobytes more
//! than this. `tests/wire.rs` holds the two equal, on every message and on arbitrary bytes.

/// A value that can be encoded in a message.
pub trait Wire: Sized {
    /// Appends the encoding.
    fn put(&self, out: &mut Writer<'_>);
    /// Reads a value in the place of this one. What is there after a fault is of no meaning: see
    /// [`Reader::is_done`].
    // In place, because a value that is returned passes through a microcontroller's registers.
    fn read(&mut self, input: &mut Reader<'_>);
    /// What to read over.
    const BLANK: Self;

    /// Reads a value that fills `body` exactly; false if there is none.
    fn read_exactly(&mut self, body: &[u8]) -> bool {
        let mut input = Reader::new(body);
        self.read(&mut input);
        input.is_done()
    }
}

/// Writes into a buffer; what does not fit is remembered, not written.
#[derive(Debug)]
pub struct Writer<'a> {
    room: &'a mut [u8],
    len: u8,
    overflowed: bool,
}

impl<'a> Writer<'a> {
    /// Writes from the beginning of `room`.
    pub const fn new(room: &'a mut [u8]) -> Self {
        Self { room, len: 0, overflowed: false }
    }

    /// Bytes written; `None` if not all had room.
    #[must_use]
    pub const fn finish(self) -> Option<u8> {
        if self.overflowed { None } else { Some(self.len) }
    }

    /// Appends one byte.
    // Not inlined, as are the other small parts: every field of every message calls it.
    #[inline(never)]
    pub fn byte(&mut self, byte: u8) {
        match self.room.get_mut(usize::from(self.len)) {
            Some(slot) if self.len < u8::MAX => {
                *slot = byte;
                self.len += 1;
            }
            _ => self.overflowed = true,
        }
    }

    /// Appends 7 bits a byte, lowest first, the top bit set in all but the last.
    #[inline(never)]
    fn varint(&mut self, mut value: u32) {
        while value > 0x7f {
            self.byte(low_byte(value) | 0x80);
            value >>= 7;
        }
        self.byte(low_byte(value));
    }
}

/// Reads from a body. After the first fault it stays failed and gives zeros.
#[derive(Debug)]
pub struct Reader<'a> {
    rest: &'a [u8],
    failed: bool,
}

impl<'a> Reader<'a> {
    /// Reads `body` from the beginning.
    #[must_use]
    pub const fn new(body: &'a [u8]) -> Self {
        Self { rest: body, failed: false }
    }

    /// Whether everything read was right.
    #[must_use]
    pub const fn is_right(&self) -> bool {
        !self.failed
    }

    /// Whether everything read was right, and nothing is left.
    #[must_use]
    pub const fn is_done(&self) -> bool {
        !self.failed && self.rest.is_empty()
    }

    /// What was read cannot be.
    pub const fn fail(&mut self) {
        self.failed = true;
    }

    /// The next byte.
    #[inline(never)]
    pub fn byte(&mut self) -> u8 {
        match self.rest.split_first() {
            Some((byte, rest)) => {
                self.rest = rest;
                *byte
            }
            None => {
                self.failed = true;
                0
            }
        }
    }

    /// The code of a variant.
    pub fn code(&mut self) -> u8 {
        let code = self.varint(5, 0x0f);
        if code > 0x7f {
            self.failed = true;
        }
        low_byte(code)
    }

    /// A varint of at most `max_len` bytes, the last of them at most `last_max`.
    #[inline(never)]
    fn varint(&mut self, max_len: u8, last_max: u8) -> u32 {
        let mut value = 0;
        let mut shift = 0_u8;
        for left in (0..max_len).rev() {
            let byte = self.byte();
            value |= u32::from(byte & 0x7f) << (shift & 31);
            if byte <= 0x7f {
                if left == 0 && byte > last_max {
                    self.failed = true;
                }
                return value;
            }
            shift = shift.wrapping_add(7);
        }
        self.failed = true;
        0
    }
}

impl Wire for u8 {
    const BLANK: Self = 0;

    fn put(&self, out: &mut Writer<'_>) {
        out.byte(*self);
    }

    fn read(&mut self, input: &mut Reader<'_>) {
        *self = input.byte();
    }
}

impl Wire for bool {
    const BLANK: Self = false;

    fn put(&self, out: &mut Writer<'_>) {
        out.byte(u8::from(*self));
    }

    fn read(&mut self, input: &mut Reader<'_>) {
        let byte = input.byte();
        if byte > 1 {
            input.fail();
        }
        *self = byte == 1;
    }
}

impl Wire for u16 {
    const BLANK: Self = 0;

    fn put(&self, out: &mut Writer<'_>) {
        out.varint(u32::from(*self));
    }

    #[inline(never)]
    fn read(&mut self, input: &mut Reader<'_>) {
        *self = low_half(input.varint(3, 0x03));
    }
}

impl Wire for u32 {
    const BLANK: Self = 0;

    fn put(&self, out: &mut Writer<'_>) {
        out.varint(*self);
    }

    #[inline(never)]
    fn read(&mut self, input: &mut Reader<'_>) {
        *self = input.varint(5, 0x0f);
    }
}

impl Wire for i16 {
    const BLANK: Self = 0;

    fn put(&self, out: &mut Writer<'_>) {
        i32::from(*self).put(out);
    }

    fn read(&mut self, input: &mut Reader<'_>) {
        let mut zigzag = 0_u16;
        zigzag.read(input);
        let half = (zigzag >> 1).cast_signed();
        *self = if zigzag & 1 == 1 { !half } else { half };
    }
}

impl Wire for i32 {
    const BLANK: Self = 0;

    fn put(&self, out: &mut Writer<'_>) {
        let doubled = self.cast_unsigned() << 1;
        out.varint(if *self < 0 { !doubled } else { doubled });
    }

    #[inline(never)]
    fn read(&mut self, input: &mut Reader<'_>) {
        let mut zigzag = 0_u32;
        zigzag.read(input);
        let half = (zigzag >> 1).cast_signed();
        *self = if zigzag & 1 == 1 { !half } else { half };
    }
}

impl<T: Wire> Wire for Option<T> {
    const BLANK: Self = None;

    fn put(&self, out: &mut Writer<'_>) {
        self.is_some().put(out);
        if let Some(value) = self {
            value.put(out);
        }
    }

    fn read(&mut self, input: &mut Reader<'_>) {
        let mut there = false;
        there.read(input);
        *self = None;
        if there {
            self.insert(T::BLANK).read(input);
        }
    }
}

impl<const N: usize> Wire for [u8; N] {
    const BLANK: Self = [0; N];

    fn put(&self, out: &mut Writer<'_>) {
        for byte in self {
            out.byte(*byte);
        }
    }

    fn read(&mut self, input: &mut Reader<'_>) {
        for byte in self {
            *byte = input.byte();
        }
    }
}

#[expect(clippy::cast_possible_truncation, reason = "the lowest byte is what is wanted")]
const fn low_byte(value: u32) -> u8 {
    value as u8
}

#[expect(clippy::cast_possible_truncation, reason = "a varint of three bytes was checked to fit")]
const fn low_half(value: u32) -> u16 {
    value as u16
}
