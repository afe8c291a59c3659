//! The logs on disk.

use axum::{
    Json,
    body::Body,
    extract::State,
    http::{HeaderMap, StatusCode, header},
    response::{IntoResponse, Response},
};
use serde_json::json;
use sonard_api::LogEntry;
use sonard_log::log_files;
use tokio::{
    fs::File,
    io::{AsyncReadExt as _, AsyncSeekExt as _, SeekFrom},
};
use tokio_util::io::ReaderStream;

use crate::server::{
    Api,
    answer::{Failed, Path},
    openapi::Endpoint,
};

pub(super) fn endpoints() -> Vec<Endpoint> {
    vec![
        Endpoint::get("/v1/logs", list, "The logs, oldest first")
            .answers::<Vec<LogEntry>>(200, "The logs"),
        Endpoint::get("/v1/logs/{name}", download, "A log, as far as it is written")
            .parameter("path", "name", json!({"type": "string"}), "A name from GET /v1/logs")
            .parameter(
                "header",
                "Range",
                json!({"type": "string"}),
                "bytes=N-: from byte N on. Any other range is answered with the whole",
            )
            .answers_text(200, "application/x-ndjson", "One record a line")
            .answers_text(
                206,
                "application/x-ndjson",
                "The log from the byte on that was asked for",
            ),
    ]
}

async fn list(State(api): State<Api>) -> Result<Json<Vec<LogEntry>>, Failed> {
    let current = api.daemon.status().log.file;
    let current = current.as_deref().and_then(|file| file.file_name()).map(ToOwned::to_owned);
    let entries = files(&api)?.into_iter().map(|file| LogEntry {
        current: current.as_ref().is_some_and(|current| *current == *file.name),
        name: file.name,
        bytes: file.bytes,
    });
    Ok(Json(entries.collect()))
}

async fn download(
    State(api): State<Api>,
    Path(name): Path<String>,
    asked: HeaderMap,
) -> Result<Response, Failed> {
    // Only what the list shows: a name can't lead out of the folder.
    let known = files(&api)?.into_iter().any(|file| file.name == name);
    if !known {
        let help = "GET /v1/logs names them";
        return Err(Failed::new(StatusCode::NOT_FOUND, format!("there is no log {name}"), help));
    }
    let mut file =
        File::open(api.log_folder.join(&name)).await.map_err(|error| unreadable(&error))?;
    let bytes = file.metadata().await.map_err(|error| unreadable(&error))?.len();
    let from = first_byte(&asked);
    let begin = from.unwrap_or(0);
    if from.is_some() && begin >= bytes {
        let status = StatusCode::RANGE_NOT_SATISFIABLE;
        return Err(Failed::new(status, format!("{name} has {bytes} bytes"), "ask for fewer"));
    }
    file.seek(SeekFrom::Start(begin)).await.map_err(|error| unreadable(&error))?;
    let headers = [
        (header::CONTENT_TYPE, "application/x-ndjson".to_owned()),
        (header::CONTENT_LENGTH, (bytes - begin).to_string()),
        (header::ACCEPT_RANGES, "bytes".to_owned()),
        (header::CONTENT_DISPOSITION, format!("attachment; filename=\"{name}\"")),
    ];
    // The log grows: what was announced is what is sent.
    let body = Body::from_stream(ReaderStream::new(file.take(bytes - begin)));
    let range = [(header::CONTENT_RANGE, format!("bytes {begin}-{}/{bytes}", bytes.max(1) - 1))];
    match from {
        Some(_) => Ok((StatusCode::PARTIAL_CONTENT, headers, range, body).into_response()),
        None => Ok((headers, body).into_response()),
    }
}

/// The byte from which on a part is asked for. Other ranges may be answered with the whole (RFC 9110, 14.2).
fn first_byte(asked: &HeaderMap) -> Option<u64> {
    let range = asked.get(header::RANGE)?.to_str().ok()?;
    range.strip_prefix("bytes=")?.strip_suffix('-')?.parse().ok()
}

fn files(api: &Api) -> Result<Vec<sonard_log::LogFile>, Failed> {
    log_files(&api.log_folder).map_err(|error| unreadable(&error))
}

fn unreadable(error: &std::io::Error) -> Failed {
    let help = "check the log folder and its permissions";
    Failed::new(StatusCode::INTERNAL_SERVER_ERROR, format!("cannot read: {error}"), help)
}
