//! Listing and download of the logs on disk.

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
    openapi::Route,
    response::{ApiError, PathParams},
};

pub(super) fn endpoints() -> Vec<Route> {
    vec![
        Route::get("/v1/logs", list, "Logs, oldest first")
            .responds::<Vec<LogEntry>>(200, "List of logs"),
        Route::get("/v1/logs/{name}", download, "Contents of a log, as far as it is written")
            .parameter("path", "name", json!({"type": "string"}), "Name from GET /v1/logs")
            .parameter(
                "header",
                "Range",
                json!({"type": "string"}),
                "bytes=N-: from byte N on. Any other range is ignored",
            )
            .responds_text(200, "application/x-ndjson", "One record per line")
            .responds_text(206, "application/x-ndjson", "The log from the requested byte on"),
    ]
}

async fn list(State(api): State<Api>) -> Result<Json<Vec<LogEntry>>, ApiError> {
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
    PathParams(name): PathParams<String>,
    request_headers: HeaderMap,
) -> Result<Response, ApiError> {
    // Only listed names are accepted, so a name can't lead out of the folder.
    let known = files(&api)?.into_iter().any(|file| file.name == name);
    if !known {
        let help = "GET /v1/logs lists them";
        return Err(ApiError::new(StatusCode::NOT_FOUND, format!("unknown log {name}"), help));
    }
    let mut file =
        File::open(api.log_folder.join(&name)).await.map_err(|error| unreadable(&error))?;
    let bytes = file.metadata().await.map_err(|error| unreadable(&error))?.len();
    let from = first_byte(&request_headers);
    let begin = from.unwrap_or(0);
    if from.is_some() && begin >= bytes {
        let status = StatusCode::RANGE_NOT_SATISFIABLE;
        return Err(ApiError::new(
            status,
            format!("{name} has {bytes} bytes"),
            "request a smaller offset",
        ));
    }
    file.seek(SeekFrom::Start(begin)).await.map_err(|error| unreadable(&error))?;
    let headers = [
        (header::CONTENT_TYPE, "application/x-ndjson".to_owned()),
        (header::CONTENT_LENGTH, (bytes - begin).to_string()),
        (header::ACCEPT_RANGES, "bytes".to_owned()),
        (header::CONTENT_DISPOSITION, format!("attachment; filename=\"{name}\"")),
    ];
    // The log can grow meanwhile; the announced length is sent.
    let body = Body::from_stream(ReaderStream::new(file.take(bytes - begin)));
    let range = [(header::CONTENT_RANGE, format!("bytes {begin}-{}/{bytes}", bytes.max(1) - 1))];
    match from {
        Some(_) => Ok((StatusCode::PARTIAL_CONTENT, headers, range, body).into_response()),
        None => Ok((headers, body).into_response()),
    }
}

/// Returns the first byte of a requested range `bytes=N-`. Other ranges may be served with the
/// whole file (RFC 9110, section 14.2).
fn first_byte(request_headers: &HeaderMap) -> Option<u64> {
    let range = request_headers.get(header::RANGE)?.to_str().ok()?;
    range.strip_prefix("bytes=")?.strip_suffix('-')?.parse().ok()
}

fn files(api: &Api) -> Result<Vec<sonard_log::LogFile>, ApiError> {
    log_files(&api.log_folder).map_err(|error| unreadable(&error))
}

fn unreadable(error: &std::io::Error) -> ApiError {
    let help = "check the log folder and its permissions";
    ApiError::new(StatusCode::INTERNAL_SERVER_ERROR, format!("cannot read: {error}"), help)
}
