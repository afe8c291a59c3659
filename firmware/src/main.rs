//! Firmware of the sonard ranger: an ATmega328P (Arduino Uno), a SensComp 6500 module, a stepper.
//!
//! Only pins, timers and the serial line are here. What the device does is decided by
//! [`firmware_protocol::device::Device`], the same code as in the mock: `board` feeds it with what happens
//! and carries out what it asks for.
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

/// Whether the motor is built in the other way round.
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

/// Nothing here panics, but if it did: everything safe, then the watchdog restarts the chip.
/// Sleeping with interrupts off is what the emulator takes for a crash.
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    hardware::disable_interrupts();
    pins::make_safe();
    loop {
        hardware::halt();
    }
}
