//! Program that calls every method of the device machine. If any of them could panic, the panic
//! handler would remain in the program, and linking would fail because its callee is undefined.
#![no_std]
#![no_main]

use core::hint::black_box;
use core::panic::PanicInfo;

use firmware_protocol::device::{Board, Device, EchoReport, HomeError};
use firmware_protocol::messages::{
    Capabilities, Echoes, FirmwareVersion, ReadingStatus, ResetCause,
};

unsafe extern "C" {
    fn the_device_machine_can_panic() -> !;
}

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    // SAFETY: never linked.
    unsafe { the_device_machine_can_panic() }
}

/// Entry point of a program without a runtime.
#[unsafe(no_mangle)]
pub extern "C" fn _start() -> ! {
    let mut device = Device::new(black_box(Board {
        boot: 1,
        firmware: FirmwareVersion {
            major: 0,
            minor: 1,
            patch: 0,
        },
        serial: *b"NOPANIC001",
        steps_per_revolution: 400,
        capabilities: Capabilities(0),
        reset_cause: ResetCause::Unknown,
    }));
    loop {
        let now = black_box(0_u32);
        device.handle_byte(now, black_box(0));
        device.handle_line_error(now);
        device.handle_timeout(now);
        device.handle_moved(now, black_box(0));
        device.handle_homed(now, black_box(Ok(0)));
        device.handle_homed(now, black_box(Err(HomeError::IndexNotFound)));
        device.handle_emergency_stop(now);
        device.handle_motion_fault(now);
        device.handle_echoes(
            now,
            &EchoReport {
                fired_ticks: now,
                status: black_box(ReadingStatus::Echo),
                echoes: Echoes::from_ticks(black_box(&[1, 2, 3])),
            },
        );
        black_box(device.poll_action());
        black_box(device.poll_timeout());
        let mut buffer = [0; 16];
        black_box(device.poll_transmit(&mut buffer));
        black_box(buffer);
        black_box(device.step());
    }
}
