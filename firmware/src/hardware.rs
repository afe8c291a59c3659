//! The few registers of the ATmega328P that are used, by address, and the interrupt flag.
//!
//! By hand, because generating every register of the chip takes minutes of each clean build.

use core::arch::{asm, global_asm};
use core::cell::UnsafeCell;

/// A register at a fixed address.
#[derive(Clone, Copy)]
pub struct Register(u8);

pub const PINB: Register = Register(0x23);
pub const DDRB: Register = Register(0x24);
pub const PORTB: Register = Register(0x25);
pub const PINC: Register = Register(0x26);
pub const PORTC: Register = Register(0x28);
pub const DDRD: Register = Register(0x2a);
pub const PORTD: Register = Register(0x2b);
pub const TIFR1: Register = Register(0x36);
pub const EECR: Register = Register(0x3f);
pub const EEDR: Register = Register(0x40);
pub const EEARL: Register = Register(0x41);
pub const EEARH: Register = Register(0x42);
pub const SMCR: Register = Register(0x53);
pub const WDTCSR: Register = Register(0x60);
pub const PCICR: Register = Register(0x68);
pub const PCMSK1: Register = Register(0x6c);
pub const TIMSK1: Register = Register(0x6f);
pub const TCCR1A: Register = Register(0x80);
pub const TCCR1B: Register = Register(0x81);
pub const TCCR1C: Register = Register(0x82);
pub const TCNT1: Register = Register(0x84);
pub const ICR1: Register = Register(0x86);
pub const OCR1A: Register = Register(0x88);
pub const OCR1B: Register = Register(0x8a);
pub const UCSR0A: Register = Register(0xc0);
pub const UCSR0B: Register = Register(0xc1);
pub const UCSR0C: Register = Register(0xc2);
pub const UBRR0L: Register = Register(0xc4);
pub const UDR0: Register = Register(0xc6);

impl Register {
    #[inline(always)]
    pub fn read(self) -> u8 {
        // SAFETY: the constants above are the only registers there are.
        unsafe { (self.0 as *const u8).read_volatile() }
    }

    #[inline(always)]
    pub fn write(self, value: u8) {
        // SAFETY: as in `read`; none of them moves memory.
        unsafe { (self.0 as *mut u8).write_volatile(value) }
    }

    #[inline(always)]
    pub fn has(self, bits: u8) -> bool {
        self.read() & bits != 0
    }

    /// A pair of registers, low byte first, which latches the high one.
    #[inline(always)]
    pub fn read_pair(self, _: &Alone) -> u16 {
        // SAFETY: as in `read`. The compiler loads the low byte of a pair first, as this family
        // of chips wants it, and stores the high one first.
        unsafe { (self.0 as *const u16).read_volatile() }
    }

    /// A pair of registers, high byte first: the low one takes both over.
    #[inline(always)]
    pub fn write_pair(self, _: &Alone, value: u16) {
        let [low, high] = value.to_le_bytes();
        Self(self.0 + 1).write(high);
        self.write(low);
    }

    /// Sets bits; not atomic.
    #[inline(always)]
    pub fn set(self, _: &Alone, bits: u8) {
        self.write(self.read() | bits);
    }

    /// Clears bits; not atomic.
    #[inline(always)]
    pub fn clear(self, _: &Alone, bits: u8) {
        self.write(self.read() & !bits);
    }
}

/// Shows that no interrupt can come in between.
pub struct Alone(());

impl Alone {
    /// # Safety
    /// Only in an interrupt handler: there the flag is off.
    pub const unsafe fn in_interrupt() -> Self {
        Self(())
    }
}

/// Does `work` with interrupts off, and puts the flag back as it was.
#[inline(always)]
pub fn alone<R>(work: impl FnOnce(&Alone) -> R) -> R {
    let flags: u8;
    // SAFETY: restored below; the blocks are barriers for memory.
    unsafe { asm!("in {}, 0x3f", "cli", out(reg) flags) };
    let result = work(&Alone(()));
    // SAFETY: what was read above.
    unsafe { asm!("out 0x3f, {}", in(reg) flags) };
    result
}

/// Something that interrupt handlers and the main loop share.
pub struct Shared<T>(UnsafeCell<T>);

// SAFETY: only reached with an `Alone`, on a chip with one core.
unsafe impl<T> Sync for Shared<T> {}

impl<T> Shared<T> {
    pub const fn new(value: T) -> Self {
        Self(UnsafeCell::new(value))
    }

    /// The value. The caller must let go of it before asking for it again, which everybody here
    /// does by asking once in a function.
    #[inline(always)]
    #[expect(clippy::mut_from_ref, reason = "interrupts are off while the token lives")]
    pub fn get<'a>(&'a self, _: &'a Alone) -> &'a mut T {
        // SAFETY: nobody else runs, and nobody here asks twice at a time.
        unsafe { &mut *self.0.get() }
    }
}

impl<T: Copy> Shared<T> {
    #[inline(always)]
    pub fn read(&self) -> T {
        alone(|alone| *self.get(alone))
    }
}

/// Lets interrupts in and sleeps until one came. One block, because only the instruction right
/// behind `sei` is sure to come before the interrupt that is to end the sleep.
#[inline(always)]
pub fn sleep() {
    // SAFETY: idle mode was chosen at boot.
    unsafe { asm!("sei", "sleep") }
}

#[inline(always)]
pub fn enable_interrupts() {
    // SAFETY: every handler is ready when this is called.
    unsafe { asm!("sei") }
}

#[inline(always)]
pub fn disable_interrupts() {
    // SAFETY: always sound.
    unsafe { asm!("cli") }
}

#[inline(always)]
pub fn feed_watchdog() {
    // SAFETY: always sound.
    unsafe { asm!("wdr") }
}

/// Sleeps with whatever interrupts there are.
pub fn halt() {
    // SAFETY: always sound.
    unsafe { asm!("sleep") }
}

// In place of the compiler's own, which are fast and take half a kilobyte.
global_asm!(
    ".section .text.memory, \"ax\", @progbits",
    ".global memcpy",
    "memcpy:",
    "movw r30, r22",
    "movw r26, r24",
    "rjmp 2f",
    "1: ld r0, Z+",
    "st X+, r0",
    "2: subi r20, 1",
    "sbci r21, 0",
    "brcc 1b",
    "ret",
    ".global memset",
    "memset:",
    "movw r26, r24",
    "rjmp 4f",
    "3: st X+, r22",
    "4: subi r20, 1",
    "sbci r21, 0",
    "brcc 3b",
    "ret",
    ".text",
);
