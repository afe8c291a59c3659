//! Reader of a daemon's live streams, line by line.

use std::time::Duration;

use http_body_util::BodyExt as _;
use hyper::body::Incoming;
use tokio::time::{Instant, timeout, timeout_at};

use super::{Client, ClientError};

/// Timeout of a live stream without data. The daemon sends an empty line or a comment at least
/// every 15 s.
pub const IDLE_TIMEOUT: Duration = Duration::from_secs(40);
/// Additional time for a first read after the timeout: a client that was itself suspended finds the
/// deadline passed although data are pending.
const GRACE: Duration = Duration::from_secs(1);

/// Line reader of a live stream.
pub struct LiveLines {
    body: Incoming,
    /// Received bytes not returned yet, and the number of those already searched for a newline.
    rest: Vec<u8>,
    searched: usize,
    max_line_bytes: usize,
    /// Deadline of the pending read, if any; kept across cancelled calls.
    deadline: Option<Instant>,
}

impl Client {
    /// Subscribes to a live stream of lines.
    ///
    /// # Errors
    /// As [`Self::get`].
    pub async fn live(&self, path: &str) -> Result<LiveLines, ClientError> {
        let body = self.get(path).await?.into_body();
        let (rest, searched, max_line_bytes) = (Vec::new(), 0, usize::MAX);
        Ok(LiveLines { body, rest, searched, max_line_bytes, deadline: None })
    }
}

impl LiveLines {
    /// Limits the length of a line, bytes.
    #[must_use]
    pub const fn with_max_line_bytes(mut self, bytes: usize) -> Self {
        self.max_line_bytes = bytes;
        self
    }

    /// Returns the next line with its newline, or `None` at the end of the stream. Empty lines are
    /// skipped. Cancel-safe.
    ///
    /// # Errors
    /// Interrupted stream, no data for 40 s, or a line that is too long.
    pub async fn next(&mut self) -> Result<Option<Vec<u8>>, ClientError> {
        loop {
            while let Some(line) = self.take_line() {
                if line != b"\n" {
                    return Ok(Some(line));
                }
            }
            if self.rest.len() > self.max_line_bytes {
                return Err(ClientError::TooLong(self.max_line_bytes));
            }
            let deadline = *self.deadline.get_or_insert_with(|| Instant::now() + IDLE_TIMEOUT);
            let frame = match timeout_at(deadline, self.body.frame()).await {
                Ok(frame) => frame,
                Err(_) => {
                    timeout(GRACE, self.body.frame()).await.map_err(|_| ClientError::IdleTimeout)?
                }
            };
            self.deadline = None;
            let Some(frame) = frame.transpose()? else { return Ok(None) };
            self.rest.extend_from_slice(frame.data_ref().map_or(&[][..], |data| data));
        }
    }

    /// Returns the first complete line, if one has been received. A scan can be a line of many
    /// megabytes, so each byte is searched only once.
    fn take_line(&mut self) -> Option<Vec<u8>> {
        let end = self.rest.iter().skip(self.searched).position(|&byte| byte == b'\n');
        let Some(end) = end else {
            self.searched = self.rest.len();
            return None;
        };
        let line = self.rest.drain(..=self.searched + end).collect();
        self.searched = 0;
        Some(line)
    }
}
