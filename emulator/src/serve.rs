//! Runs the emulator on a pty in real time.

use std::{
    error::Error,
    io,
    sync::atomic::{AtomicBool, Ordering},
    time::{Duration, Instant},
};

use sonard_device::link::Pty;

use crate::{CYCLES_PER_US, Emulator};

/// Device time between two polls of the pty.
const SLICE: Duration = Duration::from_micros(500);

/// Runs the emulator until `stop` is set, and calls `each` after every slice of time.
///
/// # Errors
///
/// Returns an error if the firmware crashes or the pty fails.
pub fn serve(
    emulator: &mut Emulator,
    pty: &Pty,
    stop: &AtomicBool,
    mut each: impl FnMut(&mut Emulator),
) -> Result<(), Box<dyn Error + Send + Sync>> {
    let started = Instant::now();
    let began = Duration::from_micros(emulator.now_us());
    while !stop.load(Ordering::Relaxed) {
        emulator.run(SLICE.as_micros() as u64 * CYCLES_PER_US)?;
        each(emulator);
        let mut buffer = [0; 256];
        match pty.read(&mut buffer) {
            Ok(count) => emulator.send(&buffer[..count]),
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
            Err(error) => return Err(error.into()),
        }
        transmit(pty, &emulator.received())?;
        let device = Duration::from_micros(emulator.now_us()) - began;
        let ahead = device.saturating_sub(started.elapsed());
        if !ahead.is_zero() {
            pty.clear_exclusive();
            std::thread::sleep(ahead);
        }
    }
    Ok(())
}

/// Writes to the pty; drops the bytes if it is full, like a serial line without a reader.
fn transmit(pty: &Pty, bytes: &[u8]) -> io::Result<()> {
    if bytes.is_empty() {
        return Ok(());
    }
    match pty.write(bytes) {
        Err(error) if error.kind() != io::ErrorKind::WouldBlock => Err(error),
        _ => Ok(()),
    }
}
