//! Registers of the ATmega328P that the firmware uses, by address, and the interrupt flag.
//!
//! They are written by hand, because generating every register of the chip takes minutes of each
//! clean build.

use core::arch::{asm, global_asm};
use core::cell::UnsafeCell;

/// Register at a fixed address.
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
        // SAFETY: the constants above are the only registers that exist.
        unsafe { (self.0 as *const u8).read_volatile() }
    }

    #[inline(always)]
    pub fn write(self, value: u8) {
        // SAFETY: as in `read`; no register affects memory.
        unsafe { (self.0 as *mut u8).write_volatile(value) }
    }

    #[inline(always)]
    pub fn has(self, bits: u8) -> bool {
        self.read() & bits != 0
    }

    /// Reads a pair of registers; reading the low byte latches the high byte.
    #[inline(always)]
    pub fn read_pair(self, _: &CriticalSection) -> u16 {
        // SAFETY: as in `read`. The compiler loads the low byte of a pair first, as these chips
        // require.
        unsafe { (self.0 as *const u16).read_volatile() }
    }

    /// Writes a pair of registers, high byte first: writing the low byte transfers both.
    #[inline(always)]
    pub fn write_pair(self, _: &CriticalSection, value: u16) {
        let [low, high] = value.to_le_bytes();
        Self(self.0 + 1).write(high);
        self.write(low);
    }

    /// Sets bits. Not atomic.
    #[inline(always)]
    pub fn set(self, _: &CriticalSection, bits: u8) {
        self.write(self.read() | bits);
    }

    /// Clears bits. Not atomic.
    #[inline(always)]
    pub fn clear(self, _: &CriticalSection, bits: u8) {
        self.write(self.read() & !bits);
    }
}

/// Token that proves that interrupts are disabled.
pub struct CriticalSection(());

impl CriticalSection {
    /// # Safety
    ///
    /// Must be called in an interrupt handler only, where interrupts are disabled.
    pub const unsafe fn in_interrupt() -> Self {
        Self(())
    }
}

/// Runs `work` with interrupts disabled, then restores the interrupt flag.
#[inline(always)]
pub fn critical_section<R>(work: impl FnOnce(&CriticalSection) -> R) -> R {
    let flags: u8;
    // SAFETY: restored below; the blocks are memory barriers.
    unsafe { asm!("in {}, 0x3f", "cli", out(reg) flags) };
    let result = work(&CriticalSection(()));
    // SAFETY: restores the value read above.
    unsafe { asm!("out 0x3f, {}", in(reg) flags) };
    result
}

/// Value shared by interrupt handlers and the main loop.
pub struct Shared<T>(UnsafeCell<T>);

// SAFETY: accessed only with a `CriticalSection`, on a single-core chip.
unsafe impl<T> Sync for Shared<T> {}

impl<T> Shared<T> {
    pub const fn new(value: T) -> Self {
        Self(UnsafeCell::new(value))
    }

    /// Returns the value. The reference must be dropped before the next call for the same value:
    /// each function calls this once.
    #[inline(always)]
    #[expect(clippy::mut_from_ref, reason = "interrupts are off while the token lives")]
    pub fn get<'a>(&'a self, _: &'a CriticalSection) -> &'a mut T {
        // SAFETY: no other code runs, and no function calls this twice at a time.
        unsafe { &mut *self.0.get() }
    }
}

impl<T: Copy> Shared<T> {
    #[inline(always)]
    pub fn read(&self) -> T {
        critical_section(|cs| *self.get(cs))
    }
}

/// Enables interrupts and sleeps until one occurs. A single block, because only the instruction
/// after `sei` is guaranteed to run before the interrupt that ends the sleep.
#[inline(always)]
pub fn sleep() {
    // SAFETY: idle mode was chosen at boot.
    unsafe { asm!("sei", "sleep") }
}

#[inline(always)]
pub fn enable_interrupts() {
    // SAFETY: all handlers are initialised when this is called.
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

/// Sleeps with the current interrupt flag.
pub fn halt() {
    // SAFETY: always sound.
    unsafe { asm!("sleep") }
}

// Replacements of the compiler's own functions, which are fast and take half a kilobyte.
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
