//! Live streams of a daemon, line by line.

use std::time::Duration;

use http_body_util::BodyExt as _;
use hyper::body::Incoming;
use tokio::time::{Instant, timeout, timeout_at};

use super::{Client, ClientError};

/// Longest time in which nothing arrives of a stream that is alive: the daemon sends an empty line, or a comment, every
/// 15 s at least.
pub(super) const SILENCE: Duration = Duration::from_secs(40);
/// What is granted beyond it: a client that was itself suspended finds the time over and reads first.
const GRACE: Duration = Duration::from_secs(1);

/// Lines of a live stream.
pub struct LiveLines {
    body: Incoming,
    /// What has arrived of lines that are not returned yet, and how much of it was searched for a newline.
    rest: Vec<u8>,
    searched: usize,
    max_line_bytes: usize,
    /// When the stream counts as silent, while something is waited for.
    silent_at: Option<Instant>,
}

impl Client {
    /// Subscribes to a live stream of lines.
    ///
    /// # Errors
    /// As [`Self::get`].
    pub async fn live(&self, path: &str) -> Result<LiveLines, ClientError> {
        let body = self.get(path).await?.into_body();
        let (rest, searched, max_line_bytes) = (Vec::new(), 0, usize::MAX);
        Ok(LiveLines { body, rest, searched, max_line_bytes, silent_at: None })
    }
}

impl LiveLines {
    /// The same with a limit for a line, bytes.
    #[must_use]
    pub const fn with_max_line_bytes(mut self, bytes: usize) -> Self {
        self.max_line_bytes = bytes;
        self
    }

    /// The next line with its newline, `None` at the end of the stream. Empty lines are left out. Cancel-safe.
    ///
    /// # Errors
    /// When the stream breaks off, nothing arrives for 40 s, or a line is too long.
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
            let silent_at = *self.silent_at.get_or_insert_with(|| Instant::now() + SILENCE);
            let frame = match timeout_at(silent_at, self.body.frame()).await {
                Ok(frame) => frame,
                Err(_) => {
                    timeout(GRACE, self.body.frame()).await.map_err(|_| ClientError::Silent)?
                }
            };
            self.silent_at = None;
            let Some(frame) = frame.transpose()? else { return Ok(None) };
            self.rest.extend_from_slice(frame.data_ref().map_or(&[][..], |data| data));
        }
    }

    /// A whole line, if one has arrived. A scan may be a line of many megabytes: each byte is searched once.
    fn take_line(&mut self) -> Option<Vec<u8>> {
        let end = self.rest[self.searched..].iter().position(|&byte| byte == b'\n');
        let Some(end) = end else {
            self.searched = self.rest.len();
            return None;
        };
        let line = self.rest.drain(..=self.searched + end).collect();
        self.searched = 0;
        Some(line)
    }
}
