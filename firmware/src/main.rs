//! Firmware of the sonard ranger: an ATmega328P (Arduino Uno), a SensComp 6500 module, a stepper.
//!
//! Only pins, timers and the serial line are handled here. Every decision is made by
//! [`firmware_protocol::device::Device`], the state machine that the mock uses, too: `board` passes
//! it events and carries out its actions.
#![no_std]
#![no_main]
#![feature(abi_avr_interrupt, asm_experimental_arch)]

mod board;
mod boot;
mod clock;
mod hardware;
mod home;
mod motion;
mod pins;
mod ranger;
mod serial;
mod store;

use board_config::OPTION_REVERSED;

static OPTIONS: hardware::Shared<u8> = hardware::Shared::new(0);

/// Returns `true` if the motor is mounted in the opposite direction.
fn is_reversed() -> bool {
    OPTIONS.read() & OPTION_REVERSED != 0
}

#[unsafe(no_mangle)]
extern "C" fn main() -> ! {
    pins::set_up();
    hardware::SMCR.write(1);
    clock::start();
    serial::start();
    board::run()
}

/// Makes the pins safe and waits for the watchdog to restart the chip. No code here panics, but the
/// language requires a handler. The emulator treats sleep with interrupts off as a crash.
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    hardware::disable_interrupts();
    pins::make_safe();
    loop {
        hardware::halt();
    }
}
