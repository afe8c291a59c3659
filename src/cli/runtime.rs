//! The async runtime of the verbs that talk to a device.

use tokio::runtime::{Builder, Runtime};

use super::Failure;
pub(super) use crate::interrupts::Interrupts;

pub(super) fn new() -> Result<Runtime, Failure> {
    Builder::new_multi_thread().worker_threads(2).enable_all().build().map_err(|error| {
        Failure::device(format!("cannot start: {error}"), "free some threads or memory")
    })
}
