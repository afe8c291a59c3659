//! Live streams: lines of JSON, or server-sent events for browsers.

use std::{borrow::Cow, convert::Infallible, time::Duration};

use axum::{
    body::{Body, Bytes},
    extract::{Extension, State},
    http::{HeaderMap, HeaderValue, StatusCode, header},
    response::{IntoResponse, Response},
};
use futures_util::stream;
use serde::Deserialize;
use serde_json::json;
use tokio::time::timeout;

use super::scans::Word;
use crate::{
    daemon::{ScanReport, Subscription, Wanted},
    scan::{Record, decode_line},
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
/// How often an event stream without events shows that it is alive.
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

pub(super) fn endpoints() -> Vec<Endpoint> {
    let format = json!({"type": "string", "enum": ["ndjson", "sse"]});
    let format_about = "Lines of JSON or server-sent events; without it, as `Accept` says";
    let records = "One record a line, as in a log. A line {\"type\":\"dropped\",\"readings\":N} \
        stands for readings that this client was too slow for";
    vec![
        Endpoint::get("/v1/live/records", live_records, "Records as they are made")
            .parameter("query", "format", format.clone(), format_about)
            .parameter("query", "moved_m", json!({"type": "number", "minimum": 0}), MOVED)
            .parameter(
                "query",
                "verdicts",
                json!({"type": "boolean"}),
                "Give each reading a `verdict`, as GET /v1/scans/{scan} has it",
            )
            .answers_as::<Record>(200, NDJSON, records)
            .answers_as::<Record>(200, SSE, records),
        Endpoint::get("/v1/live/scans", live_scans, "Whole scans when they are over")
            .parameter("query", "format", format, format_about)
            .parameter("query", "moved_m", json!({"type": "number", "minimum": 0}), MOVED)
            .answers_as::<ScanReport>(200, NDJSON, "One scan a line")
            .answers_as::<ScanReport>(200, SSE, "One scan an event"),
    ]
}

async fn live_records(
    State(api): State<Api>,
    Extension(standing): Extension<Standing>,
    headers: HeaderMap,
    Query(options): Query<Options>,
) -> Result<Response, Failed> {
    live(&api, standing, &headers, options, false)
}

async fn live_scans(
    State(api): State<Api>,
    Extension(standing): Extension<Standing>,
    headers: HeaderMap,
    Query(options): Query<Options>,
) -> Result<Response, Failed> {
    live(&api, standing, &headers, options, true)
}

fn live(
    api: &Api,
    standing: Standing,
    headers: &HeaderMap,
    options: Options,
    scans: bool,
) -> Result<Response, Failed> {
    if options.moved_m.is_some_and(|moved_m| !(moved_m.is_finite() && moved_m >= 0.0)) {
        let status = StatusCode::UNPROCESSABLE_ENTITY;
        return Err(Failed::new(status, "moved_m is no length", "metres, 0 or more"));
    }
    let wanted = Wanted { moved_m: options.moved_m, scans };
    let accepts_events = headers
        .get(header::ACCEPT)
        .and_then(|accept| accept.to_str().ok())
        .is_some_and(|accept| accept.contains(SSE));
    let format =
        options.format.unwrap_or(if accepts_events { Format::Sse } else { Format::Ndjson });
    let leave = api.places.take_stream(standing).ok_or_else(|| {
        let help = "subscribe by the unix socket, or show the token; or raise server.max_clients";
        Failed::new(StatusCode::SERVICE_UNAVAILABLE, "too many live streams of guests", help)
    })?;
    let subscription = api.daemon.hub().subscribe(wanted);
    let chunks =
        stream::unfold((subscription, leave), move |(mut subscription, leave)| async move {
            let chunk = next_chunk(&mut subscription, format, options.verdicts).await?;
            Some((Ok::<_, Infallible>(chunk), (subscription, leave)))
        });
    let mut response = Body::from_stream(chunks).into_response();
    let media = if format == Format::Sse { SSE } else { NDJSON };
    response.headers_mut().insert(header::CONTENT_TYPE, HeaderValue::from_static(media));
    Ok(response)
}

/// The next piece of a stream; `None` at its end.
async fn next_chunk(
    subscription: &mut Subscription,
    format: Format,
    verdicts: bool,
) -> Option<Bytes> {
    let line = match format {
        Format::Ndjson => subscription.next().await?,
        Format::Sse => match timeout(SIGN_OF_LIFE, subscription.next()).await {
            Ok(line) => line?,
            Err(_nothing_yet) => return Some(Bytes::from_static(b":\n\n")),
        },
    };
    let line = if verdicts { with_verdict(&line) } else { Cow::Borrowed(&*line) };
    Some(match format {
        Format::Ndjson => [&*line, b"\n"].concat().into(),
        Format::Sse => [b"data: ", &*line, b"\n\n"].concat().into(),
    })
}

/// A reading with what explains it as its last field; any other line as it is.
fn with_verdict(line: &[u8]) -> Cow<'_, [u8]> {
    let Ok(Record::Ping(ping)) = decode_line(line) else { return Cow::Borrowed(line) };
    let (Some(open), Ok(verdict)) =
        (line.strip_suffix(b"}"), serde_json::to_string(&Word::of(&ping)))
    else {
        return Cow::Borrowed(line);
    };
    Cow::Owned([open, b",\"verdict\":", verdict.as_bytes(), b"}"].concat())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reading_gets_its_verdict_and_other_lines_stay() {
        let log = include_str!("../../../tests/fixtures/small.jsonl");
        let judged: Vec<serde_json::Value> = log
            .lines()
            .map(|line| serde_json::from_slice(&with_verdict(line.as_bytes())).expect("JSON"))
            .collect();
        let verdicts: Vec<Option<&str>> =
            judged.iter().map(|record| record["verdict"].as_str()).collect();
        assert_eq!(
            verdicts,
            [
                None,
                None,
                Some("direct"),
                Some("multiple"),
                Some("edge"),
                Some("min_range"),
                Some("silent"),
                Some("unexplained"),
                Some("link_lost"),
                None,
                None
            ]
        );
        for (record, line) in judged.iter().zip(log.lines()) {
            let mut record = record.clone();
            record.as_object_mut().expect("an object").remove("verdict");
            let before: serde_json::Value = serde_json::from_str(line).expect("JSON");
            assert_eq!(record, before);
        }
        assert_eq!(&*with_verdict(b"{\"type\":\"dropped\"}"), b"{\"type\":\"dropped\"}");
    }
}
