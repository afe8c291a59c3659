//! Services of Linux and macOS.

use std::{fs::File, io, os::fd::BorrowedFd, time::Instant};

use rustix::{
    event::{PollFd, PollFlags, Timespec, poll},
    io::Errno,
};
use tokio::signal::unix::{Signal, SignalKind, signal};

/// File descriptor that messages are written to.
pub(crate) type Output = BorrowedFd<'static>;
/// Handler of a signal that requests the end.
pub(crate) type StopSignal = Signal;

/// Largest write that does not block once poll(2) reports a pipe as writable, bytes: `PIPE_BUF`.
pub(crate) const MAX_ATOMIC_BYTES: usize = libc::PIPE_BUF;

/// Returns `true` if a hangup ends this process: it has a controlling terminal, and the parent
/// process has not arranged for it to survive the hangup (`nohup`).
pub(crate) fn ends_with_terminal() -> bool {
    File::open("/dev/tty").is_ok() && !is_ignored(libc::SIGHUP)
}

/// Returns `true` if this process ignores a signal.
fn is_ignored(number: libc::c_int) -> bool {
    #[expect(unsafe_code, reason = "no safe wrapper of sigaction(2) among the dependencies")]
    // SAFETY: all-zero bytes are a valid `sigaction`, and without a new action the call only
    // writes to it.
    let (result, action) = unsafe {
        let mut action: libc::sigaction = std::mem::zeroed();
        (libc::sigaction(number, std::ptr::null(), &raw mut action), action)
    };
    result == 0 && action.sa_sigaction == libc::SIG_IGN
}

/// Installs handlers for SIGINT, SIGTERM and, with `with_hangup`, SIGHUP. Must be called within a
/// tokio runtime.
pub(crate) fn stop_signals(with_hangup: bool) -> Vec<StopSignal> {
    let mut kinds = vec![SignalKind::interrupt(), SignalKind::terminate()];
    kinds.extend(with_hangup.then(SignalKind::hangup));
    kinds.into_iter().filter_map(|kind| signal(kind).ok()).collect()
}

/// Makes an exceeded file-size limit an error of the write, with a message, instead of the end of
/// the process.
pub fn ignore_file_size_signal() {
    #[expect(unsafe_code, reason = "no safe wrapper of signal(2) among the dependencies")]
    // SAFETY: no handler runs: the signal is ignored, as a write reports its cause.
    unsafe {
        libc::signal(libc::SIGXFSZ, libc::SIG_IGN);
    }
}

/// Program that opens pictures on this desktop; `None` without a desktop.
#[must_use]
pub fn picture_viewer() -> Option<&'static str> {
    if cfg!(target_os = "macos") {
        return Some("open");
    }
    let is_set = |name| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    ["DISPLAY", "WAYLAND_DISPLAY"].into_iter().any(is_set).then_some("xdg-open")
}

/// Synchronisation as reported by adjtimex(2); `None` where a sandbox rejects it, such as
/// `ProtectClock=` of systemd.
#[cfg(target_os = "linux")]
pub(crate) fn is_clock_synchronized() -> Option<bool> {
    /// Maximum error of a synchronised clock, microseconds: the limit of systemd's
    /// `NTPSynchronized`. The kernel's flag `STA_UNSYNC` is also set to protect the battery-backed
    /// clock.
    const MAX_ERROR_US: libc::c_long = 16_000_000;
    #[expect(unsafe_code, reason = "no safe wrapper of adjtimex(2) among the dependencies")]
    // SAFETY: all-zero bytes are a valid `timex`, and with `modes` 0 the call only writes to it.
    let (state, clock) = unsafe {
        let mut clock: libc::timex = std::mem::zeroed();
        (libc::adjtimex(&raw mut clock), clock)
    };
    (state >= 0).then_some(clock.maxerror < MAX_ERROR_US)
}

/// Returns `None`: the system does not report the synchronisation of its clock.
#[cfg(not(target_os = "linux"))]
pub(crate) fn is_clock_synchronized() -> Option<bool> {
    None
}

/// Standard error, open or not.
pub(crate) fn stderr() -> Output {
    rustix::stdio::stderr()
}

/// Writes all bytes; before a deadline, `bytes` must not be longer than [`MAX_ATOMIC_BYTES`]. The
/// standard library's lock on standard error is not taken, since another thread may hold it while
/// it blocks.
///
/// # Errors
/// Returns the error of the system, or `TimedOut` after the deadline.
pub(crate) fn write_before(
    output: Output,
    mut bytes: &[u8],
    deadline: Option<Instant>,
) -> io::Result<()> {
    while !bytes.is_empty() {
        if let Some(deadline) = deadline {
            wait_writable(output, Some(deadline))?;
        }
        match rustix::io::write(output, bytes) {
            Ok(0) => return Err(io::ErrorKind::WriteZero.into()),
            Ok(written) => bytes = bytes.get(written..).unwrap_or_default(),
            Err(Errno::INTR) => {}
            // Another process may have made the shared descriptor non-blocking.
            Err(Errno::AGAIN) => wait_writable(output, deadline)?,
            Err(error) => return Err(error.into()),
        }
    }
    Ok(())
}

fn wait_writable(output: Output, deadline: Option<Instant>) -> io::Result<()> {
    loop {
        let left = deadline.map(|deadline| deadline.saturating_duration_since(Instant::now()));
        let left = left.and_then(|left| Timespec::try_from(left).ok());
        match poll(&mut [PollFd::from_borrowed_fd(output, PollFlags::OUT)], left.as_ref()) {
            Ok(0) => return Err(io::ErrorKind::TimedOut.into()),
            Ok(_) => return Ok(()),
            Err(Errno::INTR) => {}
            Err(error) => return Err(error.into()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ignored_signals_are_recognised() {
        // The runtime of the standard library ignores it.
        assert!(is_ignored(libc::SIGPIPE));
        assert!(!is_ignored(libc::SIGTERM));
        ignore_file_size_signal();
        assert!(is_ignored(libc::SIGXFSZ));
    }
}
