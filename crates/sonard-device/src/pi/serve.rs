//! Service loop of a board on a pty.

use std::{
    io,
    sync::atomic::{AtomicBool, Ordering},
    time::Duration,
};

use super::{board::PiBoard, pins::Pins};
use crate::link::Pty;

/// Time before a deadline that is spent spinning, ticks: a sleep ends late.
const SPIN_TICKS: u64 = 200;
/// Maximum sleep, ticks, which bounds the latency of bytes from the host.
const MAX_SLEEP_TICKS: u64 = 1_000;
const TICK_NS: u64 = 500;

/// Serves the board until `stop` is set. Blocks, so it needs a dedicated thread.
///
/// # Errors
/// If the pty fails.
pub fn serve<P: Pins>(board: &mut PiBoard<P>, pty: &Pty, stop: &AtomicBool) -> io::Result<()> {
    let mut buffer = [0; 256];
    let mut outgoing = Vec::new();
    while !stop.load(Ordering::Relaxed) {
        board.advance();
        match pty.read(&mut buffer) {
            Ok(count) => board.handle_bytes(buffer.get(..count).unwrap_or_default()),
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
            Err(error) => return Err(error),
        }
        board.poll_transmit(&mut outgoing);
        if !outgoing.is_empty() {
            match pty.write(&outgoing) {
                // Like a serial line without a reader, a full pty loses bytes.
                Err(error) if error.kind() != io::ErrorKind::WouldBlock => return Err(error),
                _ => outgoing.clear(),
            }
        }
        let now = board.pins().now();
        let wake = board.next_wake().map_or(u64::MAX, |at| at.saturating_sub(SPIN_TICKS));
        let sleep = wake.saturating_sub(now).min(MAX_SLEEP_TICKS);
        if sleep > 0 {
            std::thread::sleep(Duration::from_nanos(sleep * TICK_NS));
        }
    }
    Ok(())
}
