//! Results of long computations, streamed while the client is connected.

use std::{io, num::NonZero, sync::Arc, thread, time::Duration};

use axum::{
    body::{Body, Bytes},
    http::{StatusCode, header},
    response::{IntoResponse as _, Response},
};
use futures_util::stream;
use serde::Serialize;
use sonard_inverse::FitObserver;
use tokio::{
    sync::{OwnedSemaphorePermit, mpsc},
    task::JoinHandle,
    time::timeout,
};

use crate::server::{Api, response::ApiError};

/// Maximum wait for other computations to finish.
const BUSY_TIMEOUT: Duration = Duration::from_secs(5);

/// Waits for permission to compute. Only one client at a time, because a localization occupies
/// processors for seconds and a survey for minutes.
pub(super) async fn acquire_permit(api: &Api) -> Result<OwnedSemaphorePermit, ApiError> {
    let permit = timeout(BUSY_TIMEOUT, Arc::clone(&api.computing).acquire_owned()).await;
    permit.ok().and_then(Result::ok).ok_or_else(|| {
        let help = "try again later: one localization or survey at a time";
        let error = "a localization or survey of another client is running";
        ApiError::new(StatusCode::SERVICE_UNAVAILABLE, error, help)
    })
}

/// Runs `work` on a blocking thread and streams its results, while the client is connected.
pub(super) fn stream_results(
    media: &'static str,
    permit: OwnedSemaphorePermit,
    work: impl FnOnce(&ResultSender) + Send + 'static,
) -> Response {
    let (sender, receiver) = mpsc::channel(1);
    let working = tokio::task::spawn_blocking(move || {
        let _permit = permit;
        let results = ResultSender(sender);
        // One processor remains free for the measurement.
        let threads = thread::available_parallelism().map_or(1, NonZero::get).saturating_sub(1);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.max(1)).build();
        match pool {
            Ok(pool) => pool.install(|| work(&results)),
            Err(_) => work(&results),
        }
    });
    let pieces = stream::try_unfold((receiver, working), next_piece);
    ([(header::CONTENT_TYPE, media)], Body::from_stream(pieces)).into_response()
}

type PendingResults = (mpsc::Receiver<Bytes>, JoinHandle<()>);

/// Returns the next result. A panic of the worker aborts the stream instead of ending it.
async fn next_piece(
    (mut receiver, working): PendingResults,
) -> io::Result<Option<(Bytes, PendingResults)>> {
    match receiver.recv().await {
        Some(piece) => Ok(Some((piece, (receiver, working)))),
        None => working.await.map(|()| None).map_err(io::Error::other),
    }
}

/// Sender of results to the client.
pub(super) struct ResultSender(mpsc::Sender<Bytes>);

impl ResultSender {
    /// Sends a result; `None` if the client has disconnected.
    pub(super) fn send(&self, result: &impl Serialize, end: &str) -> Option<()> {
        let line = serde_json::to_string(result).ok()? + end;
        self.0.blocking_send(line.into()).ok()
    }

    /// Sends a line unless the client is behind.
    pub(super) fn offer_line(&self, line: &impl Serialize) {
        if let Ok(line) = serde_json::to_string(line) {
            let _ = self.0.try_send((line + "\n").into());
        }
    }

    /// Returns `true` once the client has disconnected.
    pub(super) fn is_closed(&self) -> bool {
        self.0.is_closed()
    }
}

impl FitObserver for ResultSender {
    fn is_cancelled(&self) -> bool {
        self.is_closed()
    }
}
