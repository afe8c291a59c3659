//! Services of Windows.

use std::{
    io::{self, Write as _},
    task::{Context, Poll},
    time::Instant,
};

use tokio::signal::windows::{CtrlBreak, CtrlC, CtrlClose, ctrl_break, ctrl_c, ctrl_close};

/// Largest write, bytes, that is not expected to block.
pub(crate) const MAX_ATOMIC_BYTES: usize = 4096;

/// Standard error, the only output of messages.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Output;

/// Handler of a console event that requests the end.
#[derive(Debug)]
pub(crate) enum StopSignal {
    C(CtrlC),
    Break(CtrlBreak),
    Close(CtrlClose),
}

impl StopSignal {
    /// Polls for the next event.
    pub(crate) fn poll_recv(&mut self, context: &mut Context<'_>) -> Poll<Option<()>> {
        match self {
            Self::C(events) => events.poll_recv(context),
            Self::Break(events) => events.poll_recv(context),
            Self::Close(events) => events.poll_recv(context),
        }
    }
}

/// Returns `true`: the console of a closed window ends its processes.
pub(crate) fn ends_with_terminal() -> bool {
    true
}

/// Installs handlers for Ctrl-C, Ctrl-Break and, with `with_hangup`, the close of the console. Must
/// be called within a tokio runtime.
pub(crate) fn stop_signals(with_hangup: bool) -> Vec<StopSignal> {
    let close = with_hangup.then(|| ctrl_close().ok()).flatten();
    let [c, stop] = [ctrl_c().ok().map(StopSignal::C), ctrl_break().ok().map(StopSignal::Break)];
    [c, stop, close.map(StopSignal::Close)].into_iter().flatten().collect()
}

/// Does nothing: the system has no limit of file sizes.
pub fn ignore_file_size_signal() {}

/// Program that opens pictures on the desktop.
#[must_use]
pub fn picture_viewer() -> Option<&'static str> {
    Some("explorer")
}

/// Returns `None`: the system does not report the synchronisation of its clock.
pub(crate) fn is_clock_synchronized() -> Option<bool> {
    None
}

/// Standard error, open or not.
pub(crate) fn stderr() -> Output {
    Output
}

/// Writes all bytes, however long that takes.
///
/// # Errors
/// Returns the error of the system.
pub(crate) fn write_before(
    _output: Output,
    bytes: &[u8],
    _deadline: Option<Instant>,
) -> io::Result<()> {
    io::stderr().write_all(bytes)
}
