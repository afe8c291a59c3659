//! The serial line: 115200 bit/s, bytes by interrupts through two small rings.

use crate::clock;
use crate::hardware::{Alone, Shared, UBRR0L, UCSR0A, UCSR0B, UCSR0C, UDR0, alone};

/// Room for what comes in while the main loop checks a frame (0.6 ms, 7 bytes) and builds one.
const IN: usize = 64;
const OUT: usize = 32;

const DOUBLE_SPEED: u8 = 1 << 1;
const OVERRUN: u8 = 1 << 3;
const FRAMING: u8 = 1 << 4;
const RECEIVER_AND_SENDER: u8 = 0b1001_1000;
const ROOM_INTERRUPT: u8 = 1 << 5;

static RECEIVED: Shared<Ring<IN>> = Shared::new(Ring::new());
static TO_SEND: Shared<Ring<OUT>> = Shared::new(Ring::new());
/// The UART, or a full ring, lost something.
static DAMAGED: Shared<bool> = Shared::new(false);

struct Ring<const N: usize> {
    bytes: [u8; N],
    first: u8,
    len: u8,
}

impl<const N: usize> Ring<N> {
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

/// 115200 bit/s with the finer divider (2.1 % fast, which every UART takes), 8N1.
pub fn start() {
    UBRR0L.write(16);
    UCSR0A.write(DOUBLE_SPEED);
    UCSR0C.write(0b110);
    UCSR0B.write(RECEIVER_AND_SENDER);
}

/// The next byte from the host.
pub fn receive() -> Option<u8> {
    alone(|alone| RECEIVED.get(alone).pop())
}

/// Whether bytes were lost since the last call.
pub fn take_damage() -> bool {
    alone(|alone| core::mem::replace(DAMAGED.get(alone), false))
}

/// Whether a byte can be sent now.
pub fn has_room() -> bool {
    alone(|alone| usize::from(TO_SEND.get(alone).len) < OUT)
}

/// Sends a byte; the caller has asked for the room.
pub fn send(byte: u8) {
    alone(|alone| {
        TO_SEND.get(alone).push(byte);
        UCSR0B.set(alone, ROOM_INTERRUPT);
    });
}

/// USART_RX
#[unsafe(no_mangle)]
extern "avr-interrupt" fn __vector_18() {
    // SAFETY: an interrupt handler.
    let alone = &unsafe { Alone::in_interrupt() };
    // The status belongs to the byte that is read next.
    let damaged = UCSR0A.has(OVERRUN | FRAMING);
    let byte = UDR0.read();
    if damaged || !RECEIVED.get(alone).push(byte) {
        *DAMAGED.get(alone) = true;
    }
    clock::wake(alone);
}

/// USART_UDRE
#[unsafe(no_mangle)]
extern "avr-interrupt" fn __vector_19() {
    // SAFETY: an interrupt handler.
    let alone = &unsafe { Alone::in_interrupt() };
    let ring = TO_SEND.get(alone);
    match ring.pop() {
        Some(byte) => UDR0.write(byte),
        None => UCSR0B.clear(alone, ROOM_INTERRUPT),
    }
    if usize::from(ring.len) < OUT / 2 {
        clock::wake(alone);
    }
}
