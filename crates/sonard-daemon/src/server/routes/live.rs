//! Live streams: lines of JSON, or server-sent events for browsers.

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
use sonard_api::{Beside, ScanReport};
use sonard_records::Record;
use tokio::{sync::OwnedSemaphorePermit, time::timeout};

use super::{
    pieces::{Form, Pieces, read_on},
    scans::written,
};
use crate::{
    Moved, ScanSubscription, Subscription, Wanted,
    server::{
        Api, Standing,
        answer::{Failed, Query},
        openapi::Endpoint,
    },
};

const MOVED: &str = "Only readings whose range moved by more than this since it was last sent for \
                     that direction, or whose status changed";
const NDJSON: &str = "application/x-ndjson";
const SSE: &str = "text/event-stream";
/// How often a stream in which nothing happens shows that it is alive; clients wait longer than twice that.
const SIGN_OF_LIFE: Duration = Duration::from_secs(15);

#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Options {
    #[serde(default)]
    format: Option<Format>,
    #[serde(default)]
    moved_m: Option<f64>,
    #[serde(default)]
    verdicts: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Format {
    Ndjson,
    Sse,
}

/// A record of a live stream.
#[derive(JsonSchema)]
#[expect(dead_code, reason = "its schema says what is written")]
struct LiveRecord {
    /// The record, as in a log.
    #[serde(flatten)]
    record: Record,
    /// What is told beside a reading, with `verdicts`.
    #[serde(flatten)]
    beside: Option<Beside>,
}

pub(super) fn endpoints() -> Vec<Endpoint> {
    let format = json!({"type": "string", "enum": ["ndjson", "sse"]});
    let format_about = "Lines of JSON or server-sent events; without it, as `Accept` says";
    let scans = "One scan a line, read from the log: a slow client costs no memory. A line \
        {\"type\":\"dropped\",\"scans\":N} stands for scans that the log no longer has. While none ends, an \
        empty line every 15 s shows that the daemon is alive";
    let records = "One record a line, as in a log. A line {\"type\":\"dropped\",\"readings\":N} \
        stands for readings that this client was too slow for. While nothing happens, an empty line every \
        15 s shows that the daemon is alive";
    vec![
        Endpoint::get("/v1/live/records", live_records, "Records as they are made")
            .parameter("query", "format", format.clone(), format_about)
            .parameter("query", "moved_m", json!({"type": "number", "minimum": 0}), MOVED)
            .parameter(
                "query",
                "verdicts",
                json!({"type": "boolean"}),
                "Give each reading a `verdict` and a `viewpoint`, as GET /v1/scans/{scan} has them",
            )
            .answers_as::<LiveRecord>(200, NDJSON, records)
            .answers_as::<LiveRecord>(200, SSE, records),
        Endpoint::get("/v1/live/scans", live_scans, "Whole scans when they are over")
            .parameter("query", "format", format, format_about)
            .parameter("query", "moved_m", json!({"type": "number", "minimum": 0}), MOVED)
            .answers_as::<ScanReport>(200, NDJSON, scans)
            .answers_as::<ScanReport>(200, SSE, scans),
    ]
}

async fn live_records(
    State(api): State<Api>,
    Extension(standing): Extension<Standing>,
    headers: HeaderMap,
    Query(options): Query<Options>,
) -> Result<Response, Failed> {
    let (format, leave) = begin(&api, standing, &headers, options)?;
    let wanted = Wanted { moved_m: options.moved_m, verdicts: options.verdicts };
    let subscription = api.daemon.hub().subscribe(wanted);
    let lines =
        stream::unfold((subscription, leave), move |(mut subscription, leave)| async move {
            let line = next_line(&mut subscription, format).await?;
            Some((line, (subscription, leave)))
        });
    Ok(answer(format, lines.map(Ok::<_, Infallible>)))
}

async fn live_scans(
    State(api): State<Api>,
    Extension(standing): Extension<Standing>,
    headers: HeaderMap,
    Query(options): Query<Options>,
) -> Result<Response, Failed> {
    let (format, leave) = begin(&api, standing, &headers, options)?;
    let scans = Scans {
        subscription: api.daemon.hub().subscribe_scans(),
        api,
        format,
        moved: Moved::new(options.moved_m),
        current: None,
        _leave: leave,
    };
    let pieces = stream::unfold(Some(scans), |scans| async move {
        match scans?.next().await {
            Ok((piece, scans)) => Some((Ok(piece?), Some(scans))),
            // What was begun can't be ended: the client sees that the stream broke off.
            Err(error) => Some((Err(error), None)),
        }
    });
    Ok(answer(format, pieces))
}

/// The form of a stream, and leave for it.
fn begin(
    api: &Api,
    standing: Standing,
    headers: &HeaderMap,
    options: Options,
) -> Result<(Format, Option<OwnedSemaphorePermit>), Failed> {
    if options.moved_m.is_some_and(|moved_m| !(moved_m.is_finite() && moved_m >= 0.0)) {
        let status = StatusCode::UNPROCESSABLE_ENTITY;
        return Err(Failed::new(status, "moved_m is no length", "metres, 0 or more"));
    }
    let leave = api.places.take_stream(standing).ok_or_else(|| {
        let help = "subscribe by the unix socket, or show the token; or raise server.max_clients";
        Failed::new(StatusCode::SERVICE_UNAVAILABLE, "too many live streams of guests", help)
    })?;
    let accepts_events = headers
        .get(header::ACCEPT)
        .and_then(|accept| accept.to_str().ok())
        .is_some_and(|accept| accept.contains(SSE));
    let usual = if accepts_events { Format::Sse } else { Format::Ndjson };
    Ok((options.format.unwrap_or(usual), leave))
}

fn answer<E>(
    format: Format,
    pieces: impl Stream<Item = Result<Bytes, E>> + Send + 'static,
) -> Response
where
    E: Into<Box<dyn std::error::Error + Send + Sync>> + 'static,
{
    let mut response = Body::from_stream(pieces).into_response();
    let media = if format == Format::Sse { SSE } else { NDJSON };
    response.headers_mut().insert(header::CONTENT_TYPE, HeaderValue::from_static(media));
    response
}

impl Format {
    /// What stands before and after each text.
    const fn around(self) -> [&'static [u8]; 2] {
        match self {
            Self::Ndjson => [b"", b"\n"],
            Self::Sse => [b"data: ", b"\n\n"],
        }
    }

    /// What shows that a stream is alive: an empty line, or a comment.
    const fn sign_of_life(self) -> Bytes {
        Bytes::from_static(match self {
            Self::Ndjson => b"\n",
            Self::Sse => b":\n\n",
        })
    }
}

/// The next line of a stream; `None` at its end. Where nothing has to stand around it, it is everybody's.
async fn next_line(subscription: &mut Subscription, format: Format) -> Option<Bytes> {
    let Ok(line) = timeout(SIGN_OF_LIFE, subscription.next()).await else {
        return Some(format.sign_of_life());
    };
    match format {
        Format::Ndjson => Some(Bytes::from_owner(line?)),
        Format::Sse => Some([b"data: ", &*line?, b"\n"].concat().into()),
    }
}

/// A stream of whole scans.
struct Scans {
    subscription: ScanSubscription,
    api: Api,
    format: Format,
    moved: Moved,
    /// The one that is being sent.
    current: Option<Pieces>,
    _leave: Option<OwnedSemaphorePermit>,
}

impl Scans {
    /// The next piece of the stream; `None` at its end.
    async fn next(mut self) -> io::Result<(Option<Bytes>, Self)> {
        loop {
            let pieces = match self.current.take() {
                Some(pieces) => pieces,
                None => match self.begin().await? {
                    Begun::Scan(pieces) => *pieces,
                    Begun::Told(told) => return Ok((told, self)),
                },
            };
            let (piece, pieces) = read_on(pieces, Arc::clone(&self.api.reading)).await?;
            if piece.is_some() {
                self.current = Some(pieces);
                return Ok((piece, self));
            }
            self.moved = pieces.into_moved();
        }
    }

    /// Waits for the next scan.
    async fn begin(&mut self) -> io::Result<Begun> {
        let scan = match timeout(SIGN_OF_LIFE, self.subscription.next()).await {
            Ok(Some(scan)) => scan,
            Ok(None) => return Ok(Begun::Told(None)),
            Err(_nothing_yet) => return Ok(Begun::Told(Some(self.format.sign_of_life()))),
        };
        let passage = written(&self.api, scan)
            .await
            .map_err(|failed| io::Error::other(failed.problem.error))?;
        let around = self.format.around();
        let Some(passage) = passage else {
            let told = [around[0], br#"{"type":"dropped","scans":1}"#, around[1]].concat();
            return Ok(Begun::Told(Some(told.into())));
        };
        let moved = std::mem::take(&mut self.moved);
        let pieces = Pieces::new(passage, Form::Report, moved).within(around);
        Ok(Begun::Scan(Box::new(pieces)))
    }
}

/// What comes next in a stream of scans.
enum Begun {
    Scan(Box<Pieces>),
    /// Something else, or the end.
    Told(Option<Bytes>),
}
