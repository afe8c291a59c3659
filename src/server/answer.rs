//! What goes wrong with a request, as JSON.

use axum::{
    Json,
    extract::{
        FromRequest, FromRequestParts,
        rejection::{JsonRejection, QueryRejection},
    },
    http::StatusCode,
    response::{IntoResponse, Response},
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::access::Refused;
use crate::daemon::Refusal;

/// Why a request was not carried out.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
pub struct Problem {
    /// What is wrong.
    pub error: String,
    /// What would be right.
    pub help: String,
}

/// A problem with its status.
#[derive(Debug, Clone)]
pub(super) struct Failed {
    pub(super) status: StatusCode,
    pub(super) problem: Problem,
}

/// An order was taken in.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct Accepted {
    /// Always `true`.
    pub accepted: bool,
}

impl Failed {
    pub(super) fn new(status: StatusCode, error: impl ToString, help: impl ToString) -> Self {
        Self { status, problem: Problem { error: error.to_string(), help: help.to_string() } }
    }
}

impl IntoResponse for Failed {
    fn into_response(self) -> Response {
        (self.status, Json(self.problem)).into_response()
    }
}

impl From<Refusal> for Failed {
    fn from(refusal: Refusal) -> Self {
        Self::new(StatusCode::UNPROCESSABLE_ENTITY, refusal.message, refusal.help)
    }
}

impl From<Refused> for Failed {
    fn from(refused: Refused) -> Self {
        Self::new(refused.status, refused.message, refused.help)
    }
}

impl From<JsonRejection> for Failed {
    fn from(rejection: JsonRejection) -> Self {
        let help =
            "send JSON as GET /v1/openapi.json describes it, with `Content-Type: application/json`";
        Self::new(rejection.status(), rejection.body_text(), help)
    }
}

impl From<QueryRejection> for Failed {
    fn from(rejection: QueryRejection) -> Self {
        Self::new(rejection.status(), rejection.body_text(), "see GET /v1/openapi.json")
    }
}

/// A JSON body whose faults are answered in JSON.
#[derive(FromRequest)]
#[from_request(via(Json), rejection(Failed))]
pub(super) struct Body<T>(pub(super) T);

/// A query whose faults are answered in JSON.
#[derive(FromRequestParts)]
#[from_request(via(axum::extract::Query), rejection(Failed))]
pub(super) struct Query<T>(pub(super) T);
