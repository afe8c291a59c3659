//! What can be asked for, one file a subject.

mod control;
mod live;
mod logs;
mod metrics;
mod report;

use axum::{Json, extract::State};
use serde_json::Value;

use super::{Api, openapi::Endpoint};

/// Every endpoint of the API.
pub(super) fn endpoints() -> Vec<Endpoint> {
    let mut endpoints = report::endpoints();
    endpoints.extend(control::endpoints());
    endpoints.extend(live::endpoints());
    endpoints.extend(logs::endpoints());
    endpoints.extend(metrics::endpoints());
    endpoints.push(
        Endpoint::get("/v1/openapi.json", openapi, "This description")
            .answers::<Value>(200, "An OpenAPI 3.1 document"),
    );
    endpoints
}

async fn openapi(State(api): State<Api>) -> Json<Value> {
    Json((*api.document).clone())
}
