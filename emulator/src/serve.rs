//! Plays the firmware on a pty, at the pace of the wall clock.

use std::{
    error::Error,
    io,
    sync::atomic::{AtomicBool, Ordering},
    time::{Duration, Instant},
};

use sonard_device::link::Pty;

use crate::{CYCLES_PER_US, Emulator};

/// How much device time passes between two looks at the pty.
const SLICE: Duration = Duration::from_micros(500);

/// Plays until `stop` is set, and hands the emulator to `each` after every slice of time.
///
/// # Errors
/// When the firmware crashes or the pty fails.
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
        speak(pty, &emulator.received())?;
        let device = Duration::from_micros(emulator.now_us()) - began;
        let ahead = device.saturating_sub(started.elapsed());
        if !ahead.is_zero() {
            pty.clear_exclusive();
            std::thread::sleep(ahead);
        }
    }
    Ok(())
}

/// A serial line loses what nobody reads; so does a full pty.
fn speak(pty: &Pty, bytes: &[u8]) -> io::Result<()> {
    if bytes.is_empty() {
        return Ok(());
    }
    match pty.write(bytes) {
        Err(error) if error.kind() != io::ErrorKind::WouldBlock => Err(error),
        _ => Ok(()),
    }
}
