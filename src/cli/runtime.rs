//! The async runtime of the verbs that talk to a device.

use std::io;

use tokio::runtime::{Builder, Runtime};

use super::Failure;
pub(super) use crate::interrupts::Interrupts;

/// Pairs of file descriptors that must be free for the runtime to start: its library panics where it
/// gets none for signals.
const DESCRIPTOR_PAIRS: usize = 6;

pub(super) fn new() -> Result<Runtime, Failure> {
    let spare: io::Result<Vec<_>> = (0..DESCRIPTOR_PAIRS).map(|_| io::pipe()).collect();
    spare.map_err(|error| {
        let help = "raise the limit of file descriptors (`ulimit -n`, `LimitNOFILE=` of a unit)";
        Failure::device(format!("cannot start: {error}"), help)
    })?;
    Builder::new_multi_thread().worker_threads(2).enable_all().build().map_err(|error| {
        Failure::device(format!("cannot start: {error}"), "free some threads or memory")
    })
}
