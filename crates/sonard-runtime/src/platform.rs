//! Services of the operating system: signals, standard error without blocking, state of the clock.
//!
//! `unix` covers Linux and macOS, `windows` Windows. Both have the same items, so no other module
//! of this crate depends on the system.

#[cfg_attr(unix, path = "platform/unix.rs")]
#[cfg_attr(windows, path = "platform/windows.rs")]
mod system;

pub(crate) use system::{
    MAX_ATOMIC_BYTES, Output, StopSignal, ends_with_terminal, is_clock_synchronized, stderr,
    stop_signals, write_before,
};
pub use system::{ignore_file_size_signal, picture_viewer};
