//! Calls that may block for a moment.

use tokio::runtime::{Handle, RuntimeFlavor};

/// Runs a call that may block. Other tasks continue meanwhile, unless the runtime has a single
/// thread.
pub(crate) fn block_in_place<T>(call: impl FnOnce() -> T) -> T {
    match Handle::current().runtime_flavor() {
        RuntimeFlavor::CurrentThread => call(),
        _ => tokio::task::block_in_place(call),
    }
}
