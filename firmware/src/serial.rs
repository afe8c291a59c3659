//! Serial line: 115200 bit/s, interrupt-driven with two small ring buffers.

use crate::clock;
use crate::hardware::{
    CriticalSection, Shared, UBRR0L, UCSR0A, UCSR0B, UCSR0C, UDR0, critical_section,
};

/// Capacity for bytes that arrive while the main loop checks a frame (0.6 ms, 7 bytes) and encodes
/// one.
const IN: usize = 64;
const OUT: usize = 32;

const DOUBLE_SPEED: u8 = 1 << 1;
const OVERRUN: u8 = 1 << 3;
const FRAMING: u8 = 1 << 4;
const RECEIVER_AND_SENDER: u8 = 0b1001_1000;
const SEND_INTERRUPT: u8 = 1 << 5;

static RECEIVED: Shared<ByteRing<IN>> = Shared::new(ByteRing::new());
static TO_SEND: Shared<ByteRing<OUT>> = Shared::new(ByteRing::new());
/// Set when the UART or a full buffer has lost a byte.
static LINE_ERROR: Shared<bool> = Shared::new(false);

struct ByteRing<const N: usize> {
    bytes: [u8; N],
    first: u8,
    len: u8,
}

impl<const N: usize> ByteRing<N> {
    const fn new() -> Self {
        Self { bytes: [0; N], first: 0, len: 0 }
    }

    fn push(&mut self, byte: u8) -> bool {
        if usize::from(self.len) == N {
            return false;
        }
        // N is a power of two below 256.
        let at = usize::from(self.first.wrapping_add(self.len)) % N;
        self.bytes[at] = byte;
        self.len += 1;
        true
    }

    fn pop(&mut self) -> Option<u8> {
        self.len = self.len.checked_sub(1)?;
        let byte = self.bytes[usize::from(self.first) % N];
        self.first = self.first.wrapping_add(1);
        Some(byte)
    }
}

/// Starts the UART: 115200 bit/s with the double-speed divider (2.1 % fast, within the tolerance of
/// every UART), 8N1.
pub fn start() {
    UBRR0L.write(16);
    UCSR0A.write(DOUBLE_SPEED);
    UCSR0C.write(0b110);
    UCSR0B.write(RECEIVER_AND_SENDER);
}

/// Returns the next byte from the host.
pub fn receive() -> Option<u8> {
    critical_section(|cs| RECEIVED.get(cs).pop())
}

/// Returns `true` if bytes were lost since the last call.
pub fn take_line_error() -> bool {
    critical_section(|cs| core::mem::replace(LINE_ERROR.get(cs), false))
}

/// Returns `true` if the send buffer has room.
pub fn has_room() -> bool {
    critical_section(|cs| usize::from(TO_SEND.get(cs).len) < OUT)
}

/// Sends a byte; the caller has checked [`has_room`].
pub fn send(byte: u8) {
    critical_section(|cs| {
        TO_SEND.get(cs).push(byte);
        UCSR0B.set(cs, SEND_INTERRUPT);
    });
}

/// USART_RX
#[unsafe(no_mangle)]
extern "avr-interrupt" fn __vector_18() {
    // SAFETY: an interrupt handler.
    let cs = &unsafe { CriticalSection::in_interrupt() };
    // The status belongs to the byte that is read next.
    let line_error = UCSR0A.has(OVERRUN | FRAMING);
    let byte = UDR0.read();
    if line_error || !RECEIVED.get(cs).push(byte) {
        *LINE_ERROR.get(cs) = true;
    }
    clock::wake(cs);
}

/// USART_UDRE
#[unsafe(no_mangle)]
extern "avr-interrupt" fn __vector_19() {
    // SAFETY: an interrupt handler.
    let cs = &unsafe { CriticalSection::in_interrupt() };
    let ring = TO_SEND.get(cs);
    match ring.pop() {
        Some(byte) => UDR0.write(byte),
        None => UCSR0B.clear(cs, SEND_INTERRUPT),
    }
    if usize::from(ring.len) < OUT / 2 {
        clock::wake(cs);
    }
}
