//! Responses: errors as JSON, cached JSON, and extractors whose rejections are JSON.

use std::sync::{Arc, Mutex, PoisonError};

use axum::{
    Json,
    body::Bytes,
    extract::{
        FromRequest, FromRequestParts, Path, Query, Request,
        rejection::{BytesRejection, JsonRejection, PathRejection, QueryRejection},
    },
    http::{HeaderValue, StatusCode, header, request::Parts},
    response::{IntoResponse, Response},
};
use serde::{Serialize, de::DeserializeOwned};
use sonard_api::{Problem, Strict, has_list};

use super::access::AccessDenied;
use crate::{OrderError, OrderErrorKind};

/// Error response: HTTP status and JSON body.
#[derive(Debug, Clone)]
pub(super) struct ApiError {
    pub(super) status: StatusCode,
    pub(super) problem: Problem,
}

/// JSON response that is serialized once and shared by all clients.
pub(super) struct CachedJson<T>(Arc<Mutex<Option<Serialized<T>>>>);

/// Source value with its serialized JSON.
type Serialized<T> = (Arc<T>, Bytes);

impl<T> CachedJson<T> {
    /// Returns the JSON of `source`, serialized by `convert` if the source has changed.
    pub(super) fn response<U: Serialize>(
        &self,
        source: &Arc<T>,
        convert: impl FnOnce(&T) -> U,
    ) -> Response {
        // Nothing under this lock can panic, so a poisoned lock holds valid data.
        let mut cached = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let current = cached.as_ref().filter(|(before, _)| Arc::ptr_eq(before, source));
        let bytes = match current {
            Some((_, bytes)) => bytes.clone(),
            None => {
                let bytes = Bytes::from(serde_json::to_vec(&convert(source)).unwrap_or_default());
                *cached = Some((Arc::clone(source), bytes.clone()));
                bytes
            }
        };
        ([(header::CONTENT_TYPE, "application/json")], bytes).into_response()
    }
}

impl<T> Clone for CachedJson<T> {
    fn clone(&self) -> Self {
        Self(Arc::clone(&self.0))
    }
}

impl<T> Default for CachedJson<T> {
    fn default() -> Self {
        Self(Arc::default())
    }
}

impl ApiError {
    pub(super) fn new(
        status: StatusCode,
        error: impl Into<String>,
        help: impl Into<String>,
    ) -> Self {
        Self { status, problem: Problem { error: error.into(), help: help.into(), field: None } }
    }
}

impl IntoResponse for ApiError {
    fn into_response(self) -> Response {
        let mut response = (self.status, Json(self.problem)).into_response();
        if self.status == StatusCode::UNAUTHORIZED {
            let scheme = HeaderValue::from_static("Bearer realm=\"sonard\"");
            response.headers_mut().insert(header::WWW_AUTHENTICATE, scheme);
        }
        response
    }
}

impl From<OrderError> for ApiError {
    fn from(refusal: OrderError) -> Self {
        let status = match refusal.kind {
            OrderErrorKind::Invalid => StatusCode::UNPROCESSABLE_ENTITY,
            OrderErrorKind::Conflict => StatusCode::CONFLICT,
            OrderErrorKind::NotFound => StatusCode::NOT_FOUND,
            OrderErrorKind::Stopping => StatusCode::SERVICE_UNAVAILABLE,
        };
        let OrderError { message, help, field, .. } = refusal;
        Self { status, problem: Problem { error: message, help, field } }
    }
}

impl From<AccessDenied> for ApiError {
    fn from(denied: AccessDenied) -> Self {
        Self::new(denied.status, denied.message, denied.help)
    }
}

impl From<BytesRejection> for ApiError {
    fn from(rejection: BytesRejection) -> Self {
        Self::new(
            rejection.status(),
            rejection.body_text(),
            "send less, or raise server.max_body_kb",
        )
    }
}

impl From<JsonRejection> for ApiError {
    fn from(rejection: JsonRejection) -> Self {
        let help =
            "send JSON as GET /v1/openapi.json describes it, with `Content-Type: application/json`";
        Self::new(rejection.status(), rejection.body_text(), help)
    }
}

impl From<QueryRejection> for ApiError {
    fn from(rejection: QueryRejection) -> Self {
        Self::new(rejection.status(), rejection.body_text(), "see GET /v1/openapi.json")
    }
}

impl From<PathRejection> for ApiError {
    fn from(rejection: PathRejection) -> Self {
        Self::new(rejection.status(), rejection.body_text(), "see GET /v1/openapi.json")
    }
}

/// JSON body whose rejections are JSON.
pub(super) struct JsonBody<T>(pub(super) T);

impl<T: DeserializeOwned, S: Send + Sync> FromRequest<S> for JsonBody<T> {
    type Rejection = ApiError;

    async fn from_request(request: Request, state: &S) -> Result<Self, ApiError> {
        let (parts, body) = request.into_parts();
        let (retained, request) = (parts.clone(), Request::from_parts(parts, body));
        let bytes = Bytes::from_request(request, state).await?;
        let request = Request::from_parts(retained, bytes.clone().into());
        let Json(Strict(body)) = Json::from_request(request, state).await?;
        if serde_json::from_slice(&bytes).is_ok_and(|value| has_list(&value)) {
            let help = "send objects, as GET /v1/openapi.json describes them";
            let error = "found a list, expected an object";
            return Err(Self::Rejection::new(StatusCode::UNPROCESSABLE_ENTITY, error, help));
        }
        Ok(Self(body))
    }
}

/// Path parameters whose rejections are JSON.
pub(super) struct PathParams<T>(pub(super) T);

impl<T: DeserializeOwned + Send, S: Send + Sync> FromRequestParts<S> for PathParams<T> {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, ApiError> {
        let Path(params) = Path::from_request_parts(parts, state).await?;
        Ok(Self(params))
    }
}

/// Query parameters whose rejections are JSON.
pub(super) struct QueryParams<T>(pub(super) T);

impl<T: DeserializeOwned, S: Send + Sync> FromRequestParts<S> for QueryParams<T> {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, ApiError> {
        let Query(params) = Query::from_request_parts(parts, state).await?;
        Ok(Self(params))
    }
}
