//! Async runtime of the verbs that use a device or a daemon.

use std::{io, time::Duration};

use tokio::runtime::{Builder, Runtime};

use super::Failure;
pub(super) use crate::interrupts::Interrupts;

/// Time allowed for tasks and blocking calls that are left when a verb has ended.
const SHUTDOWN_TIMEOUT: Duration = Duration::from_millis(500);
/// Pairs of file descriptors that must be free for the runtime to start: its library panics where it gets none for
/// signals.
const DESCRIPTOR_PAIRS: usize = 6;

/// A runtime of two threads.
///
/// # Errors
/// When the system refuses threads or descriptors.
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

/// Runs a verb that stops in order on a signal. If the end is forced by another signal, it is abandoned a few seconds
/// later; what it owns is dropped in either case, and nothing that blocks is waited for.
///
/// # Errors
/// The verb's own; when its end was forced; when no runtime can be started.
pub(super) fn run_interruptible<T>(
    work: impl AsyncFnOnce(Interrupts) -> Result<T, Failure>,
) -> Result<T, Failure> {
    let runtime = new()?;
    let outcome = runtime.block_on(async {
        let interrupts = Interrupts::listen();
        tokio::select! {
            biased;
            outcome = work(interrupts.clone()) => outcome,
            () = interrupts.wait_overdue() => Err(abandoned()),
        }
    });
    runtime.shutdown_timeout(SHUTDOWN_TIMEOUT);
    outcome
}

/// Failure of a verb whose end was forced before it had stopped in order.
pub(super) fn abandoned() -> Failure {
    Failure::Found(Some("interrupted again: ended before everything was closed in order".into()))
}
