//! Serves the playground from the configured folder.

use std::{io, path::Path as FilePath, sync::Arc};

use axum::{
    extract::State,
    http::{HeaderValue, StatusCode, header},
    response::{IntoResponse as _, Response},
};
use serde_json::json;
use tokio::{fs::File, io::AsyncReadExt as _};

use super::page::{CACHED, CSS, HTML, SCRIPT, SVG};
use crate::server::{
    Api,
    openapi::Route,
    response::{ApiError, PathParams},
};

/// Content security policy of the page itself, plus no embedding in frames. It permits the
/// compilation of WebAssembly, and forbids scripts from text and all requests, including those to
/// this server.
const POLICY: HeaderValue = HeaderValue::from_static(
    "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; worker-src blob:; style-src 'self'; \
     img-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
);
/// Maximum size of a file, bytes.
const MAX_BYTES: u64 = 16 << 20;

/// All served files of the folder; the first is the playground's page.
const FILES: [(&str, &str); 9] = [
    ("index.html", HTML),
    ("playground.js", SCRIPT),
    ("model-data.js", SCRIPT),
    ("hidden-room.html", HTML),
    ("hidden-room.js", SCRIPT),
    ("survey-data.js", SCRIPT),
    ("playground.css", CSS),
    ("style.css", CSS),
    ("icon.svg", SVG),
];

/// Returns `true` for paths of the playground, which has no data and no secrets.
pub(super) fn is_playground(path: &str) -> bool {
    path.starts_with("/playground/")
}

pub(super) fn endpoints() -> Vec<Route> {
    let about = "File of the page";
    vec![
        Route::get("/playground/", index, "Playground, if server.playground is configured")
            .responds_text(200, HTML, "HTML page"),
        Route::get("/playground/{file}", file, "File of the playground")
            .parameter(
                "path",
                "file",
                json!({"type": "string"}),
                "File name, as referenced by the page",
            )
            .responds_text(200, HTML, about)
            .responds_text(200, SCRIPT, about)
            .responds_text(200, CSS, about)
            .responds_text(200, SVG, about),
    ]
}

async fn index(State(api): State<Api>) -> Result<Response, ApiError> {
    serve(api.playground, FILES[0]).await
}

async fn file(
    State(api): State<Api>,
    PathParams(name): PathParams<String>,
) -> Result<Response, ApiError> {
    // Only known names are accepted, so none leads out of the folder.
    let known = FILES.into_iter().find(|(known, _)| *known == name);
    let missing = || {
        let help = "the page is at GET /playground/";
        ApiError::new(StatusCode::NOT_FOUND, "unknown file of the playground", help)
    };
    serve(api.playground, known.ok_or_else(missing)?).await
}

async fn serve(
    folder: Option<Arc<FilePath>>,
    (name, media): (&'static str, &'static str),
) -> Result<Response, ApiError> {
    let folder = folder.ok_or_else(|| {
        let help = "build it with web/build.sh, and set server.playground to its folder";
        ApiError::new(StatusCode::NOT_FOUND, "the playground is not configured", help)
    })?;
    let bytes = read(&folder.join(name)).await.map_err(|error| {
        let error = format!("cannot read {name} of server.playground: {error}");
        let help = "build the folder with web/build.sh, readable by the daemon";
        ApiError::new(StatusCode::INTERNAL_SERVER_ERROR, error, help)
    })?;
    let headers = [
        (header::CONTENT_TYPE, HeaderValue::from_static(media)),
        (header::CACHE_CONTROL, CACHED),
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::REFERRER_POLICY, HeaderValue::from_static("no-referrer")),
    ];
    Ok((headers, bytes).into_response())
}

async fn read(file: &FilePath) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let read = File::open(file).await?.take(MAX_BYTES + 1).read_to_end(&mut bytes).await?;
    if read as u64 > MAX_BYTES {
        return Err(io::Error::other("file too large"));
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn policy_matches_the_page() {
        let page = include_str!("../../../../../web/playground/index.html");
        let policy = POLICY;
        let policy = policy.to_str().expect("text");
        let own = policy.strip_suffix("; frame-ancestors 'none'").expect("no frames");
        assert!(page.contains(&format!("content=\"{own}\"")), "{own}");
    }

    #[test]
    fn referenced_files_are_served() {
        let page = include_str!("../../../../../web/playground/index.html");
        for attribute in ["src=\"", "href=\""] {
            for named in page.split(attribute).skip(1) {
                let (name, _) = named.split_once('"').expect("an end");
                assert!(FILES.iter().any(|(known, _)| *known == name), "{name}");
            }
        }
    }
}
