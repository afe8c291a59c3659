//! Request handlers, one module per subject.

mod beam;
mod control;
mod findings;
mod fleet;
mod foxglove;
mod live;
mod location;
mod logs;
mod metrics;
mod page;
mod pieces;
mod playground;
mod preview;
mod report;
mod results;
mod scans;
mod scene;
mod survey;

use axum::{extract::State, http::header, response::IntoResponse};
use serde_json::Value;

pub(super) use foxglove::FOXGLOVE;
pub(super) use page::is_public;
pub(super) use survey::RunningSurvey;

use super::{Api, openapi::Route};

/// Returns all endpoints of the API.
pub(super) fn endpoints() -> Vec<Route> {
    let mut endpoints = report::endpoints();
    endpoints.extend(control::endpoints());
    endpoints.extend(scene::endpoints());
    endpoints.extend(fleet::endpoints());
    endpoints.extend(live::endpoints());
    endpoints.extend(foxglove::endpoints());
    endpoints.extend(scans::endpoints());
    endpoints.extend(findings::endpoints());
    endpoints.extend(location::endpoints());
    endpoints.extend(survey::endpoints());
    endpoints.extend(preview::endpoints());
    endpoints.extend(logs::endpoints());
    endpoints.extend(metrics::endpoints());
    endpoints.extend(page::endpoints());
    endpoints.extend(playground::endpoints());
    endpoints.push(
        Route::get("/v1/openapi.json", openapi, "OpenAPI description of this API")
            .responds::<Value>(200, "OpenAPI 3.1 document"),
    );
    endpoints
}

async fn openapi(State(api): State<Api>) -> impl IntoResponse {
    ([(header::CONTENT_TYPE, "application/json")], api.document)
}
