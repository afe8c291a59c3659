//! Encoding of messages in postcard's format, without the postcard crate.
//!
//! On the microcontroller, postcard and serde's generated code would take four kilobytes more than
//! this module. `tests/wire.rs` checks that both agree, on every message and on arbitrary bytes.

/// Value that can be encoded in a message.
pub trait Wire: Sized {
    /// Appends the encoding to `out`.
    fn put(&self, out: &mut Writer<'_>);
    /// Decodes a value into `self`. After an error the content is meaningless: see
    /// [`Reader::is_done`].
    // In place, because a returned value passes through a microcontroller's registers.
    fn read(&mut self, input: &mut Reader<'_>);
    /// Initial value to decode into.
    const BLANK: Self;

    /// Decodes a value that fills `body` exactly; returns `false` on failure.
    fn read_exactly(&mut self, body: &[u8]) -> bool {
        let mut input = Reader::new(body);
        self.read(&mut input);
        input.is_done()
    }
}

/// Writer into a fixed buffer; records an overflow instead of writing past the end.
#[derive(Debug)]
pub struct Writer<'a> {
    buffer: &'a mut [u8],
    len: u8,
    overflowed: bool,
}

impl<'a> Writer<'a> {
    /// Creates a writer at the start of `buffer`.
    pub const fn new(buffer: &'a mut [u8]) -> Self {
        Self { buffer, len: 0, overflowed: false }
    }

    /// Returns the number of bytes written; `None` after an overflow.
    #[must_use]
    pub const fn finish(self) -> Option<u8> {
        if self.overflowed { None } else { Some(self.len) }
    }

    /// Appends one byte.
    // Not inlined, like the other small functions: every field of every message calls it.
    #[inline(never)]
    pub fn byte(&mut self, byte: u8) {
        match self.buffer.get_mut(usize::from(self.len)) {
            Some(slot) if self.len < u8::MAX => {
                *slot = byte;
                self.len += 1;
            }
            _ => self.overflowed = true,
        }
    }

    /// Appends `value` with 7 bits per byte, lowest first, the top bit set in all but the last.
    #[inline(never)]
    fn varint(&mut self, mut value: u32) {
        while value > 0x7f {
            self.byte(low_byte(value) | 0x80);
            value >>= 7;
        }
        self.byte(low_byte(value));
    }
}

/// Reader of a message body. After the first error it stays failed and returns zeros.
#[derive(Debug)]
pub struct Reader<'a> {
    rest: &'a [u8],
    failed: bool,
}

impl<'a> Reader<'a> {
    /// Creates a reader at the start of `body`.
    #[must_use]
    pub const fn new(body: &'a [u8]) -> Self {
        Self { rest: body, failed: false }
    }

    /// Returns `true` if everything read so far was valid.
    #[must_use]
    pub const fn is_valid(&self) -> bool {
        !self.failed
    }

    /// Returns `true` if everything read was valid and no bytes are left.
    #[must_use]
    pub const fn is_done(&self) -> bool {
        !self.failed && self.rest.is_empty()
    }

    /// Marks the input as invalid.
    pub const fn fail(&mut self) {
        self.failed = true;
    }

    /// Reads the next byte.
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

    /// Reads the code of a variant.
    pub fn code(&mut self) -> u8 {
        let code = self.varint(5, 0x0f);
        if code > 0x7f {
            self.failed = true;
        }
        low_byte(code)
    }

    /// Reads a varint of at most `max_len` bytes, the last of which is at most `last_max`.
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
        let mut present = false;
        present.read(input);
        *self = None;
        if present {
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

#[expect(clippy::cast_possible_truncation, reason = "only the lowest byte is needed")]
const fn low_byte(value: u32) -> u8 {
    value as u8
}

#[expect(clippy::cast_possible_truncation, reason = "the varint was checked to fit")]
const fn low_half(value: u32) -> u16 {
    value as u16
}
