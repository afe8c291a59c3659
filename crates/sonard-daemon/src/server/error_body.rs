//! Adds a JSON body to error responses of the HTTP library, which rejects malformed requests with a
//! bare status.

use std::{
    io::{self, IoSlice},
    pin::Pin,
    task::{Context, Poll, ready},
};

use sonard_api::Problem;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};

/// Connection that replaces bare error responses by responses with a JSON error body.
pub(super) struct ErrorBodyStream<S> {
    stream: S,
    /// Pending error response, and the number of its bytes already written.
    pending: (Vec<u8>, usize),
}

impl<S: AsyncWrite + Unpin> ErrorBodyStream<S> {
    pub(super) const fn new(stream: S) -> Self {
        Self { stream, pending: (Vec::new(), 0) }
    }

    fn poll_pending(&mut self, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        let (bytes, written) = &mut self.pending;
        while *written < bytes.len() {
            let more = ready!(
                Pin::new(&mut self.stream)
                    .poll_write(context, bytes.get(*written..).unwrap_or_default())
            )?;
            if more == 0 {
                return Poll::Ready(Err(io::ErrorKind::WriteZero.into()));
            }
            *written += more;
        }
        Poll::Ready(Ok(()))
    }
}

/// Returns the error response with a body if `bytes` is one without.
fn with_body(bytes: &[u8]) -> Option<Vec<u8>> {
    let head = bytes.strip_prefix(b"HTTP/1.1 4").and(bytes.strip_suffix(b"\r\n\r\n"))?;
    let head = std::str::from_utf8(head).ok()?;
    // All responses of the router have the first header.
    let has = |field: &str| head.lines().any(|line| line.eq_ignore_ascii_case(field));
    if has("x-content-type-options: nosniff") || !has("content-length: 0") {
        return None;
    }
    let status = head.lines().next()?;
    let reason = status.splitn(3, ' ').nth(2)?.to_ascii_lowercase();
    let problem = Problem {
        error: format!("invalid request: {reason}"),
        help: "use HTTP/1.1, with a request head of less than 32 kB".into(),
        field: None,
    };
    let body = serde_json::to_string(&problem).ok()?;
    let length = body.len();
    Some(
        format!(
            "{status}\r\ncontent-type: application/json\r\nx-content-type-options: nosniff\r\n\
             cache-control: no-store\r\nconnection: close\r\ncontent-length: {length}\r\n\r\n{body}"
        )
        .into_bytes(),
    )
}

impl<S: AsyncRead + Unpin> AsyncRead for ErrorBodyStream<S> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_read(context, buffer)
    }
}

impl<S: AsyncWrite + Unpin> AsyncWrite for ErrorBodyStream<S> {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        ready!(self.poll_pending(context))?;
        match with_body(bytes) {
            Some(response) => {
                self.pending = (response, 0);
                Poll::Ready(Ok(bytes.len()))
            }
            None => Pin::new(&mut self.stream).poll_write(context, bytes),
        }
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        slices: &[IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        if let [only] = slices {
            return self.poll_write(context, only);
        }
        ready!(self.poll_pending(context))?;
        Pin::new(&mut self.stream).poll_write_vectored(context, slices)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        ready!(self.poll_pending(context))?;
        Pin::new(&mut self.stream).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        ready!(self.poll_pending(context))?;
        Pin::new(&mut self.stream).poll_shutdown(context)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bare_errors_get_a_body() {
        let bare = b"HTTP/1.1 431 Request Header Fields Too Large\r\nconnection: close\r\n\
                     content-length: 0\r\ndate: Sun, 22 Nov 2026 10:00:00 GMT\r\n\r\n";
        let text = String::from_utf8(with_body(bare).expect("a body")).expect("text");
        let (head, body) = text.split_once("\r\n\r\n").expect("a body");
        assert!(head.starts_with("HTTP/1.1 431 ") && head.contains("connection: close"), "{head}");
        assert!(head.contains(&format!("content-length: {}", body.len())), "{head}");
        let problem: Problem = serde_json::from_str(body).expect("JSON");
        assert!(problem.error.contains("header fields too large"), "{problem:?}");
        for other in [
            &b"HTTP/1.1 200 OK\r\ncontent-length: 0\r\n\r\n"[..],
            b"HTTP/1.1 404 Not Found\r\ncontent-length: 0\r\nx-content-type-options: nosniff\r\n\r\n",
            b"HTTP/1.1 404 Not Found\r\ncontent-length: 5\r\n\r\n",
            b"{\"type\":\"ping\"}\r\n\r\n",
            b"",
        ] {
            assert_eq!(with_body(other), None);
        }
    }
}
