//! Plays the board on a pty.

use std::{
    io,
    sync::atomic::{AtomicBool, Ordering},
    time::Duration,
};

use super::{board::PiBoard, pins::Pins};
use crate::link::Pty;

/// The last moment before something is due is spent awake: a sleep ends late.
const AWAKE_TICKS: u64 = 200;
/// The longest sleep: bytes from the host wait so long at most.
const NAP_TICKS: u64 = 1_000;
const TICK_NS: u64 = 500;

/// Plays until `stop` is set. Blocks: give it a thread of its own.
///
/// # Errors
/// When the pty fails.
pub fn serve<P: Pins>(board: &mut PiBoard<P>, pty: &Pty, stop: &AtomicBool) -> io::Result<()> {
    let mut buffer = [0; 256];
    let mut said = Vec::new();
    while !stop.load(Ordering::Relaxed) {
        board.advance();
        match pty.read(&mut buffer) {
            Ok(count) => board.handle_bytes(buffer.get(..count).unwrap_or_default()),
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
            Err(error) => return Err(error),
        }
        board.poll_transmit(&mut said);
        if !said.is_empty() {
            match pty.write(&said) {
                // A serial line loses what nobody reads; so does a full pty.
                Err(error) if error.kind() != io::ErrorKind::WouldBlock => return Err(error),
                _ => said.clear(),
            }
        }
        let now = board.pins().now();
        let wake = board.next_wake().map_or(u64::MAX, |at| at.saturating_sub(AWAKE_TICKS));
        let nap = wake.saturating_sub(now).min(NAP_TICKS);
        if nap > 0 {
            std::thread::sleep(Duration::from_nanos(nap * TICK_NS));
        }
    }
    Ok(())
}
