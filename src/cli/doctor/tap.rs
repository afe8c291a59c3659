//! Serial line that records the first bytes in each direction.

use std::{
    io,
    pin::Pin,
    task::{Context, Poll},
};

use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};

/// Maximum number of recorded bytes per direction.
const MAX_RECORDED: usize = 4096;

/// Line with the first bytes received and sent.
#[derive(Debug)]
pub(super) struct Tap<L> {
    line: L,
    pub(super) received: Vec<u8>,
    pub(super) sent: Vec<u8>,
}

impl<L> Tap<L> {
    pub(super) const fn new(line: L) -> Self {
        Self { line, received: Vec::new(), sent: Vec::new() }
    }
}

fn record(recorded: &mut Vec<u8>, bytes: &[u8]) {
    let room = MAX_RECORDED.saturating_sub(recorded.len());
    recorded.extend_from_slice(bytes.get(..room).unwrap_or(bytes));
}

impl<L: AsyncRead + Unpin> AsyncRead for Tap<L> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let before = buffer.filled().len();
        let polled = Pin::new(&mut self.line).poll_read(context, buffer);
        let new = buffer.filled().get(before..).unwrap_or_default().to_vec();
        record(&mut self.received, &new);
        polled
    }
}

impl<L: AsyncWrite + Unpin> AsyncWrite for Tap<L> {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        let polled = Pin::new(&mut self.line).poll_write(context, bytes);
        if let Poll::Ready(Ok(count)) = &polled {
            record(&mut self.sent, bytes.get(..*count).unwrap_or_default());
        }
        polled
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.line).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.line).poll_shutdown(context)
    }
}
