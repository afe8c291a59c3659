//! In-memory port: an unpluggable pipe between host and board, without a device of the system.

use std::{
    io,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    task::{Context, Poll, Waker},
};

use tokio::{
    io::{AsyncReadExt as _, AsyncWrite as _, DuplexStream, duplex},
    sync::Notify,
};

/// Capacity of each direction of the pipe, bytes. Further bytes from the board are lost, as on a
/// serial line without a reader.
const PIPE_BYTES: usize = 64 * 1024;

/// Socket of an in-memory port: hosts open it with [`connect`](Self::connect) while a board is
/// plugged in.
///
/// Clones share the socket. At most one host is connected; a second one is rejected as busy.
#[derive(Debug, Clone, Default)]
pub struct MemorySocket {
    shared: Arc<SharedSocket>,
}

#[derive(Debug, Default)]
struct SharedSocket {
    state: Mutex<SocketState>,
    connected: Notify,
}

#[derive(Debug, Default)]
struct SocketState {
    plugged: bool,
    /// Board's end of a connection that the board has not accepted yet.
    offered: Option<DuplexStream>,
    /// `true` while a host's connection is open on the board's side.
    in_use: bool,
}

impl MemorySocket {
    /// Opens the port as a host.
    ///
    /// # Errors
    /// `NotFound` if no board is plugged in, `ResourceBusy` if another host is connected.
    pub fn connect(&self) -> io::Result<DuplexStream> {
        let mut state = self.state();
        if !state.plugged {
            return Err(io::ErrorKind::NotFound.into());
        }
        if state.in_use {
            return Err(io::ErrorKind::ResourceBusy.into());
        }
        let (host, board) = duplex(PIPE_BYTES);
        state.offered = Some(board);
        state.in_use = true;
        self.shared.connected.notify_one();
        Ok(host)
    }

    /// State of the socket. No code under the lock panics, so a poisoned lock is still consistent.
    fn state(&self) -> MutexGuard<'_, SocketState> {
        self.shared.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn set_plugged(&self, plugged: bool) {
        *self.state() = SocketState { plugged, ..SocketState::default() };
    }

    fn take_offered(&self) -> Option<DuplexStream> {
        self.state().offered.take()
    }

    fn release(&self) {
        let mut state = self.state();
        state.in_use = state.offered.is_some();
    }
}

/// Board's end of a [`MemorySocket`].
#[derive(Debug)]
pub(super) struct MemoryLine {
    socket: MemorySocket,
    stream: Option<DuplexStream>,
}

impl MemoryLine {
    /// Plugs the board in.
    pub(super) fn plug(socket: MemorySocket) -> Self {
        socket.set_plugged(true);
        Self { socket, stream: None }
    }

    /// Waits for bytes from a host, across connections. Cancel-safe.
    pub(super) async fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        loop {
            if let Some(stream) = &mut self.stream {
                if let Ok(count @ 1..) = stream.read(buffer).await {
                    return Ok(count);
                }
                self.stream = None;
                self.socket.release();
            }
            self.stream = self.socket.take_offered();
            if self.stream.is_none() {
                self.socket.shared.connected.notified().await;
            }
        }
    }

    /// Writes as many bytes as the pipe can hold; the rest is lost.
    pub(super) fn write(&mut self, bytes: &[u8]) {
        if self.stream.is_none() {
            self.stream = self.socket.take_offered();
        }
        let Some(stream) = &mut self.stream else { return };
        let mut context = Context::from_waker(Waker::noop());
        let mut rest = bytes;
        while !rest.is_empty()
            && let Poll::Ready(Ok(count @ 1..)) =
                std::pin::Pin::new(&mut *stream).poll_write(&mut context, rest)
        {
            rest = rest.get(count..).unwrap_or_default();
        }
    }

    /// Ends the host's connection and makes the port unavailable.
    pub(super) fn unplug(&mut self) {
        self.stream = None;
        self.socket.set_plugged(false);
    }

    /// Makes the port available again after [`unplug`](Self::unplug).
    pub(super) fn replug(&mut self) {
        self.socket.set_plugged(true);
    }
}

impl Drop for MemoryLine {
    fn drop(&mut self) {
        self.unplug();
    }
}
