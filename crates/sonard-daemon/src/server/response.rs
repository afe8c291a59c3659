//! What goes wrong with a request, as JSON.

use std::sync::{Arc, Mutex, PoisonError};

use axum::{
    Json,
    body::Bytes,
    extract::{
        FromRequest, FromRequestParts, Request,
        rejection::{BytesRejection, JsonRejection, PathRejection, QueryRejection},
    },
    http::{HeaderValue, StatusCode, header},
    response::{IntoResponse, Response},
};
use serde::{Serialize, de::DeserializeOwned};
use sonard_api::{Problem, Strict, has_list};

use super::access::Refused;
use crate::{Refusal, RefusalKind};

/// A problem with its status.
#[derive(Debug, Clone)]
pub(super) struct Failed {
    pub(super) status: StatusCode,
    pub(super) problem: Problem,
}

/// An answer of any size that is the same for all: written once, and shared by who takes it.
pub(super) struct Shelved<T>(Arc<Mutex<Option<Written<T>>>>);

/// What was written, and of what.
type Written<T> = (Arc<T>, Bytes);

impl<T> Shelved<T> {
    /// The answer about `of`, by `write` if it is about another than before.
    pub(super) fn answer<U: Serialize>(
        &self,
        of: &Arc<T>,
        write: impl FnOnce(&T) -> U,
    ) -> Response {
        // Nothing under this lock can panic, so a poisoned one holds what it should.
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let same = kept.as_ref().filter(|(before, _)| Arc::ptr_eq(before, of));
        let bytes = match same {
            Some((_, bytes)) => bytes.clone(),
            None => {
                let bytes = Bytes::from(serde_json::to_vec(&write(of)).unwrap_or_default());
                *kept = Some((Arc::clone(of), bytes.clone()));
                bytes
            }
        };
        ([(header::CONTENT_TYPE, "application/json")], bytes).into_response()
    }
}

impl<T> Clone for Shelved<T> {
    fn clone(&self) -> Self {
        Self(Arc::clone(&self.0))
    }
}

impl<T> Default for Shelved<T> {
    fn default() -> Self {
        Self(Arc::default())
    }
}

impl Failed {
    pub(super) fn new(
        status: StatusCode,
        error: impl Into<String>,
        help: impl Into<String>,
    ) -> Self {
        Self { status, problem: Problem { error: error.into(), help: help.into() } }
    }
}

impl IntoResponse for Failed {
    fn into_response(self) -> Response {
        let mut response = (self.status, Json(self.problem)).into_response();
        if self.status == StatusCode::UNAUTHORIZED {
            let scheme = HeaderValue::from_static("Bearer realm=\"sonard\"");
            response.headers_mut().insert(header::WWW_AUTHENTICATE, scheme);
        }
        response
    }
}

impl From<Refusal> for Failed {
    fn from(refusal: Refusal) -> Self {
        let status = match refusal.kind {
            RefusalKind::Wrong => StatusCode::UNPROCESSABLE_ENTITY,
            RefusalKind::Conflict => StatusCode::CONFLICT,
            RefusalKind::Unknown => StatusCode::NOT_FOUND,
            RefusalKind::Stopping => StatusCode::SERVICE_UNAVAILABLE,
        };
        Self::new(status, refusal.message, refusal.help)
    }
}

impl From<Refused> for Failed {
    fn from(refused: Refused) -> Self {
        Self::new(refused.status, refused.message, refused.help)
    }
}

impl From<BytesRejection> for Failed {
    fn from(rejection: BytesRejection) -> Self {
        Self::new(
            rejection.status(),
            rejection.body_text(),
            "send less, or raise server.max_body_kb",
        )
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

impl From<PathRejection> for Failed {
    fn from(rejection: PathRejection) -> Self {
        Self::new(rejection.status(), rejection.body_text(), "see GET /v1/openapi.json")
    }
}

/// A JSON body whose faults are answered in JSON.
pub(super) struct Body<T>(pub(super) T);

impl<T: DeserializeOwned, S: Send + Sync> FromRequest<S> for Body<T> {
    type Rejection = Failed;

    async fn from_request(request: Request, state: &S) -> Result<Self, Failed> {
        let (parts, body) = request.into_parts();
        let (again, request) = (parts.clone(), Request::from_parts(parts, body));
        let bytes = Bytes::from_request(request, state).await?;
        let request = Request::from_parts(again, bytes.clone().into());
        let Json(Strict(body)) = Json::from_request(request, state).await?;
        if serde_json::from_slice(&bytes).is_ok_and(|value| has_list(&value)) {
            let help = "send objects, as GET /v1/openapi.json describes them";
            let error = "there is a list where an object is wanted";
            return Err(Self::Rejection::new(StatusCode::UNPROCESSABLE_ENTITY, error, help));
        }
        Ok(Self(body))
    }
}

/// Parts of the path whose faults are answered in JSON.
#[derive(FromRequestParts)]
#[from_request(via(axum::extract::Path), rejection(Failed))]
pub(super) struct Path<T>(pub(super) T);

/// A query whose faults are answered in JSON.
#[derive(FromRequestParts)]
#[from_request(via(axum::extract::Query), rejection(Failed))]
pub(super) struct Query<T>(pub(super) T);
