//! Async runtime of the verbs that wait: for signals, a device or a daemon.

use std::{io, iter, sync::Mutex, thread, time::Duration};

use tokio::runtime::{Builder, Runtime};

use super::Failure;
pub(super) use crate::interrupts::Interrupts;

/// Pairs of file descriptors that must be free at the start: without them the runtime's signal
/// handling panics.
const DESCRIPTOR_PAIRS: usize = 6;
/// Threads that must be available at the start: without them the runtime panics or hangs.
const THREADS: usize = 6;
/// Maximum number of threads for blocking calls.
const MAX_BLOCKING_THREADS: usize = 32;
/// Time until an idle thread for blocking calls ends. The runtime panics if it has none and the
/// system denies a new one, so they are kept.
const KEEP_ALIVE: Duration = Duration::from_secs(365 * 24 * 3600);

/// Creates a runtime with two threads.
///
/// # Errors
///
/// The system has no free threads or descriptors.
pub(super) fn new() -> Result<Runtime, Failure> {
    let spare: io::Result<Vec<_>> = (0..DESCRIPTOR_PAIRS).map(|_| io::pipe()).collect();
    spare.map_err(|error| {
        let help = "raise the limit of file descriptors (`ulimit -n`, `LimitNOFILE=` of a unit)";
        Failure::device(format!("cannot start: {error}"), help)
    })?;
    let no_threads = |error| {
        let help = "free some threads or memory, or raise their limit (`ulimit -u`, `TasksMax=` of a unit)";
        Failure::device(format!("cannot start {THREADS} threads: {error}"), help)
    };
    check_threads(THREADS).map_err(no_threads)?;
    let mut builder = Builder::new_multi_thread();
    builder.max_blocking_threads(MAX_BLOCKING_THREADS).thread_keep_alive(KEEP_ALIVE);
    let runtime = builder.worker_threads(2).enable_all().build().map_err(no_threads)?;
    runtime.spawn_blocking(|| ());
    Ok(runtime)
}

/// Checks that `count` more threads can run at the same time.
fn check_threads(count: usize) -> io::Result<()> {
    let gate = Mutex::new(());
    let closed = gate.lock();
    thread::scope(|scope| {
        let start = || thread::Builder::new().spawn_scoped(scope, || drop(gate.lock()));
        let started: io::Result<Vec<_>> = iter::repeat_with(start).take(count).collect();
        drop(closed);
        started.map(drop)
    })
}
