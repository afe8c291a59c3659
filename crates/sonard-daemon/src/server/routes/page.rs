//! Serves the files of the live page. They contain no secrets and use the API like any other
//! client.

use axum::{
    extract::State,
    http::{HeaderMap, HeaderValue, StatusCode, header},
    response::{IntoResponse, Response},
};
use serde_json::json;
use sha2::{Digest as _, Sha256};
use sonard_log::to_hex;

use super::{fleet::PAGE as FLEET, playground::is_playground};
use crate::server::{
    Api,
    openapi::Route,
    response::{ApiError, PathParams},
};

pub(super) const HTML: &str = "text/html; charset=utf-8";
pub(super) const CSS: &str = "text/css; charset=utf-8";
pub(super) const SCRIPT: &str = "text/javascript; charset=utf-8";
pub(super) const SVG: &str = "image/svg+xml";

/// Content security policy: own resources only, no inline scripts or styles, no embedding in
/// frames.
const POLICY: HeaderValue = HeaderValue::from_static(
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; \
     base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
);
/// Browsers revalidate their copy on each use, because an update can replace the files.
pub(super) const CACHED: HeaderValue = HeaderValue::from_static("no-cache");

struct Asset {
    name: &'static str,
    media: &'static str,
    text: &'static str,
}

macro_rules! assets {
    ($($name:literal $media:ident),* $(,)?) => {
        [$(Asset {
            name: $name,
            media: $media,
            text: include_str!(concat!("../page/", $name)),
        }),*]
    };
}

/// All files of the pages; the first two are the pages themselves.
static ASSETS: &[Asset] = &assets![
    "index.html" HTML,
    "fleet.html" HTML,
    "style.css" CSS,
    "icon.svg" SVG,
    "main.js" SCRIPT,
    "api.js" SCRIPT,
    "arrivals.js" SCRIPT,
    "beam.js" SCRIPT,
    "control.js" SCRIPT,
    "dom.js" SCRIPT,
    "download.js" SCRIPT,
    "drag-handles.js" SCRIPT,
    "explanations.js" SCRIPT,
    "findings.js" SCRIPT,
    "fleet.css" CSS,
    "fleet.js" SCRIPT,
    "format.js" SCRIPT,
    "gestures.js" SCRIPT,
    "ground.js" SCRIPT,
    "history.js" SCRIPT,
    "layers.js" SCRIPT,
    "link.js" SCRIPT,
    "location.js" SCRIPT,
    "measure.js" SCRIPT,
    "next-scan.js" SCRIPT,
    "overlays.js" SCRIPT,
    "picture.js" SCRIPT,
    "plan.js" SCRIPT,
    "ranger.js" SCRIPT,
    "scan.js" SCRIPT,
    "sketch.js" SCRIPT,
    "status.js" SCRIPT,
    "strip.js" SCRIPT,
    "summary.js" SCRIPT,
    "survey.js" SCRIPT,
    "surveyed-plan.js" SCRIPT,
    "svg.js" SCRIPT,
    "table.js" SCRIPT,
    "timeline.js" SCRIPT,
    "tip.js" SCRIPT,
    "tools.js" SCRIPT,
    "trace.js" SCRIPT,
    "verdicts.js" SCRIPT,
    "view.js" SCRIPT,
    "viewpoint.js" SCRIPT,
    "waterfall.js" SCRIPT,
];

/// Returns `true` for paths of the pages, which are public: they contain no data and no secrets.
pub(in crate::server) fn is_public(path: &str) -> bool {
    path == "/" || path == FLEET || path.starts_with("/page/") || is_playground(path)
}

pub(super) fn endpoints() -> Vec<Route> {
    let about = "File of the page";
    vec![
        Route::get("/", index, "Live page").responds_text(200, HTML, "HTML page"),
        Route::get("/page/{file}", file, "File of the live page")
            .parameter(
                "path",
                "file",
                json!({"type": "string"}),
                "File name, as referenced by the page",
            )
            .responds_text(200, SCRIPT, about)
            .responds_text(200, CSS, about)
            .responds_text(200, SVG, about),
    ]
}

#[expect(clippy::indexing_slicing, reason = "the table of assets begins with both pages")]
async fn index(State(api): State<Api>, headers: HeaderMap) -> Response {
    let Asset { media, text, .. } = &ASSETS[0];
    // Links to playground and fleet are hidden if they are not configured.
    let link = if api.playground.is_some() { "" } else { " hidden" };
    let fleet = if api.fleet.is_some() { "" } else { " hidden" };
    let text = text.replace(" data-playground", link).replace(" data-fleet", fleet);
    asset_response(media, text, &headers)
}

/// Returns the page of all robots.
#[expect(clippy::indexing_slicing, reason = "the table of assets begins with both pages")]
pub(super) fn fleet(headers: &HeaderMap) -> Response {
    let Asset { media, text, .. } = &ASSETS[1];
    asset_response(media, (*text).to_owned(), headers)
}

async fn file(
    PathParams(name): PathParams<String>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let asset = ASSETS.iter().skip(2).find(|asset| asset.name == name);
    let missing =
        || ApiError::new(StatusCode::NOT_FOUND, "unknown file of the page", "the page is at GET /");
    let asset = asset.ok_or_else(missing)?;
    Ok(asset_response(asset.media, asset.text.to_owned(), &headers))
}

/// Returns the file, or 304 if the browser's copy is current.
fn asset_response(media: &'static str, text: String, headers: &HeaderMap) -> Response {
    let tag = tag(&text);
    let client_tags = headers.get(header::IF_NONE_MATCH).and_then(|tags| tags.to_str().ok());
    let is_current =
        client_tags.is_some_and(|tags| tags.split(',').any(|known| known.trim() == tag));
    let common = [
        (header::CACHE_CONTROL, CACHED),
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::REFERRER_POLICY, HeaderValue::from_static("no-referrer")),
    ];
    let tag = [(header::ETAG, tag)];
    if is_current {
        return (StatusCode::NOT_MODIFIED, common, tag).into_response();
    }
    (common, tag, [(header::CONTENT_TYPE, media)], text).into_response()
}

/// Entity tag of a text, from its hash.
#[expect(clippy::indexing_slicing, reason = "a SHA-256 has 32 bytes")]
fn tag(text: &str) -> String {
    format!("\"{}\"", to_hex(&Sha256::digest(text.as_bytes())[..8]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Maximum size of all files of the page, bytes.
    const MAX_PAGE_BYTES: usize = 250_000;

    #[test]
    fn all_files_are_served() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/src/server/page");
        let mut names: Vec<String> = std::fs::read_dir(folder)
            .expect("the page's folder")
            .map(|entry| entry.expect("readable").file_name().into_string().expect("plain"))
            .collect();
        let mut served: Vec<&str> = ASSETS.iter().map(|asset| asset.name).collect();
        names.sort();
        served.sort_unstable();
        assert_eq!(names, served);
        let bytes: usize = ASSETS.iter().map(|asset| asset.text.len()).sum();
        assert!(
            bytes < MAX_PAGE_BYTES,
            "the page is {bytes} bytes, more than {MAX_PAGE_BYTES}: it is loaded over slow radio links"
        );
    }

    #[test]
    fn references_are_local() {
        for asset in ASSETS {
            let mut rest = asset.text;
            while let Some((_, after)) = rest.split_once("from \"./") {
                let (name, after) = after.split_once('"').expect("an end");
                assert!(ASSETS.iter().any(|known| known.name == name), "{}: {name}", asset.name);
                rest = after;
            }
            let elsewhere = asset.text.replace("http://www.w3.org/2000/svg", "");
            assert!(!elsewhere.contains("://"), "{} references another host", asset.name);
        }
    }

    #[test]
    fn current_copy_is_not_resent() {
        let mut headers = HeaderMap::new();
        let page = |headers: &HeaderMap| asset_response(HTML, ASSETS[0].text.to_owned(), headers);
        let first = page(&headers);
        assert_eq!(first.status(), StatusCode::OK);
        let tag = first.headers().get(header::ETAG).expect("a tag").clone();
        for (known, status) in [
            (tag.to_str().expect("text").to_owned(), StatusCode::NOT_MODIFIED),
            (format!("\"other\", {}", tag.to_str().expect("text")), StatusCode::NOT_MODIFIED),
            ("\"other\"".to_owned(), StatusCode::OK),
        ] {
            headers.insert(header::IF_NONE_MATCH, known.parse().expect("a value"));
            assert_eq!(page(&headers).status(), status, "{known}");
        }
    }
}
