//! Verbs that run until they are done or a signal stops them.

use std::time::Duration;

use super::{
    Failure,
    runtime::{self, Interrupts},
};

/// Time allowed for remaining tasks and blocking calls after a verb has ended.
const SHUTDOWN_TIMEOUT: Duration = Duration::from_millis(500);

/// Runs a verb that stops in an orderly way on a signal. After a second signal it is abandoned
/// within a few seconds; its resources are dropped in either case, and blocking calls are not
/// waited for.
///
/// # Errors
///
/// Errors of the verb, a forced stop, or a failed start of the runtime.
pub(super) fn run_interruptible<T>(
    work: impl AsyncFnOnce(Interrupts) -> Result<T, Failure>,
) -> Result<T, Failure> {
    let runtime = runtime::new()?;
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

/// Failure of a verb that was forced to stop.
pub(super) fn abandoned() -> Failure {
    Failure::Found(Some("interrupted again: stopped without closing everything".into()))
}
