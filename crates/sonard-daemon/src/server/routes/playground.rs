//! The playground, from the folder that the configuration names.

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
    answer::{Failed, Path},
    openapi::Endpoint,
};

/// What the page itself says, and no frame around it. WebAssembly is compiled, no text is run as a script, and
/// nothing is asked of anybody: not of this server either.
const POLICY: HeaderValue = HeaderValue::from_static(
    "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; worker-src blob:; style-src 'self'; \
     img-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
);
/// A file that is longer is none of the playground's.
const MOST_BYTES: u64 = 16 << 20;

/// Every file of the folder that is served; the first is the page itself.
const FILES: [(&str, &str); 6] = [
    ("index.html", HTML),
    ("playground.js", SCRIPT),
    ("model-data.js", SCRIPT),
    ("playground.css", CSS),
    ("style.css", CSS),
    ("icon.svg", SVG),
];

/// Whether a path is one of the playground's, which holds no data and no secret.
pub(super) fn is_playground(path: &str) -> bool {
    path.starts_with("/playground/")
}

pub(super) fn endpoints() -> Vec<Endpoint> {
    let about = "A file of the page";
    vec![
        Endpoint::get(
            "/playground/",
            index,
            "The playground, if server.playground names its folder",
        )
        .answers_text(200, HTML, "The page"),
        Endpoint::get("/playground/{file}", file, "A file of the playground")
            .parameter("path", "file", json!({"type": "string"}), "As the page names it")
            .answers_text(200, SCRIPT, about)
            .answers_text(200, CSS, about)
            .answers_text(200, SVG, about),
    ]
}

async fn index(State(api): State<Api>) -> Result<Response, Failed> {
    serve(api.playground, FILES[0]).await
}

async fn file(State(api): State<Api>, Path(name): Path<String>) -> Result<Response, Failed> {
    // Only names that are known: none leads out of the folder.
    let known = FILES.into_iter().skip(1).find(|(known, _)| *known == name);
    let missing = || {
        let help = "the page is at GET /playground/";
        Failed::new(StatusCode::NOT_FOUND, "the playground has no such file", help)
    };
    serve(api.playground, known.ok_or_else(missing)?).await
}

async fn serve(
    folder: Option<Arc<FilePath>>,
    (name, media): (&'static str, &'static str),
) -> Result<Response, Failed> {
    let folder = folder.ok_or_else(|| {
        let help = "web/build.sh makes it; name its folder in server.playground";
        Failed::new(StatusCode::NOT_FOUND, "the playground is not served here", help)
    })?;
    let bytes = read(&folder.join(name)).await.map_err(|error| {
        let error = format!("cannot read {name} of server.playground: {error}");
        let help = "make the folder with web/build.sh, readable by the daemon";
        Failed::new(StatusCode::INTERNAL_SERVER_ERROR, error, help)
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
    let read = File::open(file).await?.take(MOST_BYTES + 1).read_to_end(&mut bytes).await?;
    if read as u64 > MOST_BYTES {
        return Err(io::Error::other("it is too long"));
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_policy_is_the_pages_own_and_keeps_it_out_of_frames() {
        let page = include_str!("../../../../../web/playground/index.html");
        let policy = POLICY;
        let policy = policy.to_str().expect("text");
        let own = policy.strip_suffix("; frame-ancestors 'none'").expect("no frames");
        assert!(page.contains(&format!("content=\"{own}\"")), "{own}");
    }

    #[test]
    fn every_file_that_the_page_names_is_served() {
        let page = include_str!("../../../../../web/playground/index.html");
        for attribute in ["src=\"", "href=\""] {
            for named in page.split(attribute).skip(1) {
                let (name, _) = named.split_once('"').expect("an end");
                assert!(FILES.iter().any(|(known, _)| *known == name), "{name}");
            }
        }
    }
}
