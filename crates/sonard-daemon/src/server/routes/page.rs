//! The live page: files without secrets, which ask the API like any other client.

use axum::{
    extract::State,
    http::{HeaderMap, HeaderValue, StatusCode, header},
    response::{IntoResponse, Response},
};
use serde_json::json;
use sha2::{Digest as _, Sha256};
use sonard_log::hexadecimal;

use super::{fleet::PAGE as FLEET, playground::is_playground};
use crate::server::{
    Api,
    answer::{Failed, Path},
    openapi::Endpoint,
};

pub(super) const HTML: &str = "text/html; charset=utf-8";
pub(super) const CSS: &str = "text/css; charset=utf-8";
pub(super) const SCRIPT: &str = "text/javascript; charset=utf-8";
pub(super) const SVG: &str = "image/svg+xml";

/// Nothing from elsewhere, no script or style within the page, no frame around it.
const POLICY: HeaderValue = HeaderValue::from_static(
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; \
     base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
);
/// A browser asks whether its copy is good, each time: after an update it must not be.
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

/// Every file of the pages; the first two are the pages themselves.
static ASSETS: &[Asset] = &assets![
    "index.html" HTML,
    "fleet.html" HTML,
    "style.css" CSS,
    "icon.svg" SVG,
    "main.js" SCRIPT,
    "api.js" SCRIPT,
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
    "svg.js" SCRIPT,
    "table.js" SCRIPT,
    "timeline.js" SCRIPT,
    "tools.js" SCRIPT,
    "trace.js" SCRIPT,
    "verdicts.js" SCRIPT,
    "view.js" SCRIPT,
    "viewpoint.js" SCRIPT,
    "waterfall.js" SCRIPT,
];

/// Whether a path is one of the page's files, which anybody who reaches the server may see: they
/// hold no data and no secret.
pub(in crate::server) fn is_public(path: &str) -> bool {
    path == "/" || path == FLEET || path.starts_with("/page/") || is_playground(path)
}

pub(super) fn endpoints() -> Vec<Endpoint> {
    let about = "A file of the page";
    vec![
        Endpoint::get("/", index, "The live page").answers_text(200, HTML, "The page"),
        Endpoint::get("/page/{file}", file, "A file of the live page")
            .parameter("path", "file", json!({"type": "string"}), "As the page names it")
            .answers_text(200, SCRIPT, about)
            .answers_text(200, CSS, about)
            .answers_text(200, SVG, about),
    ]
}

#[expect(clippy::indexing_slicing, reason = "the table of assets begins with both pages")]
async fn index(State(api): State<Api>, headers: HeaderMap) -> Response {
    let Asset { media, text, .. } = &ASSETS[0];
    // The way to the playground is shown where there is one.
    let link = if api.playground.is_some() { "" } else { " hidden" };
    let fleet = if api.fleet.is_some() { "" } else { " hidden" };
    let text = text.replace(" data-playground", link).replace(" data-fleet", fleet);
    answer(media, text, &headers)
}

/// The page of all robots.
#[expect(clippy::indexing_slicing, reason = "the table of assets begins with both pages")]
pub(super) fn fleet(headers: &HeaderMap) -> Response {
    let Asset { media, text, .. } = &ASSETS[1];
    answer(media, (*text).to_owned(), headers)
}

async fn file(Path(name): Path<String>, headers: HeaderMap) -> Result<Response, Failed> {
    let asset = ASSETS.iter().skip(2).find(|asset| asset.name == name);
    let missing =
        || Failed::new(StatusCode::NOT_FOUND, "the page has no such file", "the page is at GET /");
    let asset = asset.ok_or_else(missing)?;
    Ok(answer(asset.media, asset.text.to_owned(), &headers))
}

/// The file, or that the browser's copy is good.
fn answer(media: &'static str, text: String, headers: &HeaderMap) -> Response {
    let tag = tag(&text);
    let known = headers.get(header::IF_NONE_MATCH).and_then(|known| known.to_str().ok());
    let good = known.is_some_and(|known| known.split(',').any(|one| one.trim() == tag));
    let common = [
        (header::CACHE_CONTROL, CACHED),
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::REFERRER_POLICY, HeaderValue::from_static("no-referrer")),
    ];
    let tag = [(header::ETAG, tag)];
    if good {
        return (StatusCode::NOT_MODIFIED, common, tag).into_response();
    }
    (common, tag, [(header::CONTENT_TYPE, media)], text).into_response()
}

/// Names a text by what is in it.
#[expect(clippy::indexing_slicing, reason = "a SHA-256 has 32 bytes")]
fn tag(text: &str) -> String {
    format!("\"{}\"", hexadecimal(&Sha256::digest(text.as_bytes())[..8]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_file_of_the_page_is_served_and_small() {
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
        assert!(bytes < 205_000, "the page is {bytes} bytes");
    }

    #[test]
    fn what_a_file_names_is_there_and_nothing_is_from_elsewhere() {
        for asset in ASSETS {
            let mut rest = asset.text;
            while let Some((_, after)) = rest.split_once("from \"./") {
                let (name, after) = after.split_once('"').expect("an end");
                assert!(ASSETS.iter().any(|known| known.name == name), "{}: {name}", asset.name);
                rest = after;
            }
            let elsewhere = asset.text.replace("http://www.w3.org/2000/svg", "");
            assert!(!elsewhere.contains("://"), "{} names another place", asset.name);
        }
    }

    #[test]
    fn a_copy_that_is_good_is_not_sent_again() {
        let mut headers = HeaderMap::new();
        let page = |headers: &HeaderMap| answer(HTML, ASSETS[0].text.to_owned(), headers);
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
