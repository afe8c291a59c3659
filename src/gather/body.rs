//! The bytes of a log as they come, in bounded time and number.

use std::{future::Future, time::Duration};

use http_body_util::BodyExt as _;
use hyper::{
    StatusCode,
    body::{Bytes, Incoming},
};
use tokio::time::{Instant, timeout};

use super::pull::PullError;
use crate::{
    client::Client,
    store::{MARK_BYTES, Mark},
};

/// How long a daemon may take for the next bytes of a log.
const PATIENCE: Duration = Duration::from_secs(10);
/// What a daemon has to send on the average, from its first half minute on, bytes a second.
const LEAST_RATE: f64 = 1000.0;
const GRACE: Duration = Duration::from_secs(30);

/// The bytes of a log from a place on, up to where it was said to end.
pub(super) struct Body {
    body: Incoming,
    /// What is passed over before, and what is wanted behind that.
    skip: u64,
    left: u64,
    /// What was read too far.
    rest: Bytes,
    began: Instant,
    came: u64,
}

impl Body {
    /// From the last bytes on that were taken.
    pub(super) async fn of(
        client: &Client,
        name: &str,
        taken: u64,
        end: u64,
    ) -> Result<Self, PullError> {
        let from = taken - taken.min(MARK_BYTES);
        let answer = client.get_from(&format!("/v1/logs/{name}"), from).await?;
        let skip = match answer.status() {
            StatusCode::PARTIAL_CONTENT => 0,
            // One that knows no ranges.
            StatusCode::OK => from,
            status => return Err(PullError::Strange(format!("{name}: it answers {status}"))),
        };
        Ok(Self {
            body: answer.into_body(),
            skip,
            left: end - from,
            rest: Bytes::new(),
            began: Instant::now(),
            came: 0,
        })
    }

    /// The next bytes; `None` at the end.
    pub(super) async fn next(&mut self, name: &str) -> Result<Option<Bytes>, PullError> {
        if !self.rest.is_empty() {
            return Ok(Some(std::mem::take(&mut self.rest)));
        }
        let broken = || PullError::BrokenOff(name.to_owned());
        while self.left > 0 {
            let frame = within(self.body.frame()).await.ok_or_else(broken)?;
            let frame = frame.ok_or_else(broken)?.map_err(|_| broken())?;
            let Ok(mut bytes) = frame.into_data() else { continue };
            self.came += bytes.len() as u64;
            let took = self.began.elapsed();
            if took > GRACE && (self.came as f64) < LEAST_RATE * took.as_secs_f64() {
                return Err(broken());
            }
            let skipped = self.skip.min(bytes.len() as u64);
            self.skip -= skipped;
            drop(bytes.split_to(skipped as usize));
            bytes.truncate(usize::try_from(self.left).unwrap_or(usize::MAX));
            self.left -= bytes.len() as u64;
            if !bytes.is_empty() {
                return Ok(Some(bytes));
            }
        }
        Ok(None)
    }

    /// The last bytes that were taken, if they are still the same.
    pub(super) async fn before(
        &mut self,
        name: &str,
        taken: u64,
        sha256: &str,
    ) -> Result<Vec<u8>, PullError> {
        let (wanted, mut last) = (taken.min(MARK_BYTES) as usize, Vec::new());
        while last.len() < wanted {
            let mut bytes =
                self.next(name).await?.ok_or_else(|| PullError::BrokenOff(name.into()))?;
            last.extend_from_slice(&bytes.split_to(bytes.len().min(wanted - last.len())));
            self.rest = bytes;
        }
        let mut mark = Mark::default();
        mark.push(&last);
        match taken == 0 || mark.sha256() == sha256 {
            true => Ok(last),
            false => Err(PullError::OtherLog { log: name.into(), why: "it was changed" }),
        }
    }
}

async fn within<T>(wait: impl Future<Output = T>) -> Option<T> {
    timeout(PATIENCE, wait).await.ok()
}
