//! Live streams as lines of JSON, or as server-sent events for browsers.

use std::{convert::Infallible, io, sync::Arc, time::Duration};

use axum::{
    body::{Body, Bytes},
    extract::{Extension, State},
    http::{HeaderMap, HeaderValue, StatusCode, header},
    response::{IntoResponse, Response},
};
use futures_util::{Stream, StreamExt as _, stream};
use schemars::JsonSchema;
use serde::Deserialize;
use serde_json::json;
use sonard_api::{Annotations, ScanReport};
use sonard_records::Record;
use tokio::{sync::OwnedSemaphorePermit, time::timeout};

use super::{
    pieces::{ScanForm, ScanPieces, next_piece},
    scans::wait_written,
};
use crate::{
    DeadbandFilter, ScanSubscription, Subscription, SubscriptionFilter,
    server::{
        Api, Principal,
        openapi::Route,
        response::{ApiError, QueryParams},
    },
};

const MOVED_ABOUT: &str = "Only readings whose range changed by more than this (metres) since the last one \
                     sent for the same direction, or whose status changed";
const NDJSON: &str = "application/x-ndjson";
const SSE: &str = "text/event-stream";
/// Keep-alive interval of an idle stream. Client timeouts are longer than twice this interval.
const KEEP_ALIVE_INTERVAL: Duration = Duration::from_secs(15);

#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct StreamOptions {
    #[serde(default)]
    format: Option<StreamFormat>,
    #[serde(default)]
    moved_m: Option<f64>,
    #[serde(default)]
    verdicts: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum StreamFormat {
    Ndjson,
    Sse,
}

/// Record of a live stream.
#[derive(JsonSchema)]
#[expect(dead_code, reason = "only its schema is used")]
struct LiveRecord {
    /// Record, as in a log.
    #[serde(flatten)]
    record: Record,
    /// Annotations of a reading, with `verdicts`.
    #[serde(flatten)]
    beside: Option<Annotations>,
}

pub(super) fn endpoints() -> Vec<Route> {
    let format = json!({"type": "string", "enum": ["ndjson", "sse"]});
    let format_about = "Lines of JSON or server-sent events; by default according to `Accept`";
    let scans = "One scan per line, read from the log. A line {\"type\":\"dropped\",\"scans\":N} replaces scans \
        that the log no longer contains. An idle stream has an empty line every 15 s (keep-alive)";
    let records = "One record per line, as in a log. A line {\"type\":\"dropped\",\"readings\":N} \
        replaces readings dropped because this client was too slow. An idle stream has an empty line \
        every 15 s (keep-alive)";
    vec![
        Route::get("/v1/live/records", live_records, "Live records")
            .parameter("query", "format", format.clone(), format_about)
            .parameter("query", "moved_m", json!({"type": "number", "minimum": 0}), MOVED_ABOUT)
            .parameter(
                "query",
                "verdicts",
                json!({"type": "boolean"}),
                "Add a `verdict` and a `viewpoint` to each reading, as in GET /v1/scans/{scan}",
            )
            .responds_as::<LiveRecord>(200, NDJSON, records)
            .responds_as::<LiveRecord>(200, SSE, records),
        Route::get("/v1/live/scans", live_scans, "Complete scans, each after its end")
            .parameter("query", "format", format, format_about)
            .parameter("query", "moved_m", json!({"type": "number", "minimum": 0}), MOVED_ABOUT)
            .responds_as::<ScanReport>(200, NDJSON, scans)
            .responds_as::<ScanReport>(200, SSE, scans),
    ]
}

async fn live_records(
    State(api): State<Api>,
    Extension(principal): Extension<Principal>,
    headers: HeaderMap,
    QueryParams(options): QueryParams<StreamOptions>,
) -> Result<Response, ApiError> {
    let (format, slot) = prepare(&api, principal, &headers, options)?;
    let filter = SubscriptionFilter { deadband_m: options.moved_m, verdicts: options.verdicts };
    let subscription = api.daemon.hub().subscribe(filter);
    let lines = stream::unfold((subscription, slot), move |(mut subscription, slot)| async move {
        let line = next_line(&mut subscription, format).await?;
        Some((line, (subscription, slot)))
    });
    Ok(stream_response(format, lines.map(Ok::<_, Infallible>)))
}

async fn live_scans(
    State(api): State<Api>,
    Extension(principal): Extension<Principal>,
    headers: HeaderMap,
    QueryParams(options): QueryParams<StreamOptions>,
) -> Result<Response, ApiError> {
    let (format, slot) = prepare(&api, principal, &headers, options)?;
    let scans = ScanStream {
        subscription: api.daemon.hub().subscribe_scans(),
        api,
        format,
        moved: DeadbandFilter::new(options.moved_m),
        current: None,
        _slot: slot,
    };
    let pieces = stream::unfold(Some(scans), |scans| async move {
        match scans?.next().await {
            Ok((piece, scans)) => Some((Ok(piece?), Some(scans))),
            // A partial scan can't be completed, so the stream is aborted.
            Err(error) => Some((Err(error), None)),
        }
    });
    Ok(stream_response(format, pieces))
}

/// Returns the format of a stream, and a slot for it.
fn prepare(
    api: &Api,
    principal: Principal,
    headers: &HeaderMap,
    options: StreamOptions,
) -> Result<(StreamFormat, Option<OwnedSemaphorePermit>), ApiError> {
    if options.moved_m.is_some_and(|moved_m| !(moved_m.is_finite() && moved_m >= 0.0)) {
        let status = StatusCode::UNPROCESSABLE_ENTITY;
        return Err(ApiError::new(
            status,
            "moved_m is not a valid length",
            "expected metres, 0 or more",
        ));
    }
    let slot = api.slots.take_stream(principal).ok_or_else(|| {
        let help = "use the unix socket, send the token, or raise server.max_clients";
        ApiError::new(StatusCode::SERVICE_UNAVAILABLE, "too many live streams of guests", help)
    })?;
    let accepts_events = headers
        .get(header::ACCEPT)
        .and_then(|accept| accept.to_str().ok())
        .is_some_and(|accept| accept.contains(SSE));
    let default_format = if accepts_events { StreamFormat::Sse } else { StreamFormat::Ndjson };
    Ok((options.format.unwrap_or(default_format), slot))
}

fn stream_response<E>(
    format: StreamFormat,
    pieces: impl Stream<Item = Result<Bytes, E>> + Send + 'static,
) -> Response
where
    E: Into<Box<dyn std::error::Error + Send + Sync>> + 'static,
{
    let mut response = Body::from_stream(pieces).into_response();
    let media = if format == StreamFormat::Sse { SSE } else { NDJSON };
    response.headers_mut().insert(header::CONTENT_TYPE, HeaderValue::from_static(media));
    response
}

impl StreamFormat {
    /// Prefix and suffix of each text.
    const fn around(self) -> [&'static [u8]; 2] {
        match self {
            Self::Ndjson => [b"", b"\n"],
            Self::Sse => [b"data: ", b"\n\n"],
        }
    }

    /// Keep-alive message: an empty line, or a comment.
    const fn keep_alive(self) -> Bytes {
        Bytes::from_static(match self {
            Self::Ndjson => b"\n",
            Self::Sse => b":\n\n",
        })
    }
}

/// Returns the next line of a stream; `None` at its end. Lines without a prefix are shared by all
/// subscribers.
async fn next_line(subscription: &mut Subscription, format: StreamFormat) -> Option<Bytes> {
    let Ok(line) = timeout(KEEP_ALIVE_INTERVAL, subscription.next()).await else {
        return Some(format.keep_alive());
    };
    match format {
        StreamFormat::Ndjson => Some(Bytes::from_owner(line?)),
        StreamFormat::Sse => Some([b"data: ", &*line?, b"\n"].concat().into()),
    }
}

/// Stream of complete scans.
struct ScanStream {
    subscription: ScanSubscription,
    api: Api,
    format: StreamFormat,
    moved: DeadbandFilter,
    /// Scan that is being sent.
    current: Option<ScanPieces>,
    _slot: Option<OwnedSemaphorePermit>,
}

impl ScanStream {
    /// Returns the next piece of the stream; `None` at its end.
    async fn next(mut self) -> io::Result<(Option<Bytes>, Self)> {
        loop {
            let pieces = match self.current.take() {
                Some(pieces) => pieces,
                None => match self.begin().await? {
                    ScanStreamItem::Scan(pieces) => *pieces,
                    ScanStreamItem::Text(text) => return Ok((text, self)),
                },
            };
            let (piece, pieces) = next_piece(pieces, Arc::clone(&self.api.reading)).await?;
            if piece.is_some() {
                self.current = Some(pieces);
                return Ok((piece, self));
            }
            self.moved = pieces.into_moved();
        }
    }

    /// Waits for the next scan or a keep-alive message.
    async fn begin(&mut self) -> io::Result<ScanStreamItem> {
        let scan = match timeout(KEEP_ALIVE_INTERVAL, self.subscription.next()).await {
            Ok(Some(scan)) => scan,
            Ok(None) => return Ok(ScanStreamItem::Text(None)),
            Err(_nothing_yet) => return Ok(ScanStreamItem::Text(Some(self.format.keep_alive()))),
        };
        let passage = wait_written(&self.api, scan)
            .await
            .map_err(|failed| io::Error::other(failed.problem.error))?;
        let around = self.format.around();
        let Some(passage) = passage else {
            let text = [around[0], br#"{"type":"dropped","scans":1}"#, around[1]].concat();
            return Ok(ScanStreamItem::Text(Some(text.into())));
        };
        let moved = std::mem::take(&mut self.moved);
        let pieces = ScanPieces::new(passage, ScanForm::Report, moved).enclosed_in(around);
        Ok(ScanStreamItem::Scan(Box::new(pieces)))
    }
}

/// Next element of a stream of scans.
enum ScanStreamItem {
    Scan(Box<ScanPieces>),
    /// Other text, or the end.
    Text(Option<Bytes>),
}
