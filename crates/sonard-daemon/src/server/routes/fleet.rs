//! State of the other robots that this daemon polls.

use axum::{
    extract::State,
    http::{HeaderMap, StatusCode, header},
    response::{IntoResponse, Response},
};
use sonard_api::Fleet;

use super::page::{self, HTML};
use crate::server::{Api, openapi::Route, response::ApiError};

/// Path of the fleet page.
pub(super) const PAGE: &str = "/fleet";

pub(super) fn endpoints() -> Vec<Route> {
    vec![
        Route::get(
            "/v1/fleet",
            fleet,
            "State of other robots, as polled by this daemon (fleet.daemons)",
        )
        .responds::<Fleet>(200, "Robots and their state"),
        Route::get(PAGE, index, "Page of all robots").responds_text(200, HTML, "HTML page"),
    ]
}

async fn fleet(State(api): State<Api>) -> Result<Response, ApiError> {
    let fleet = api.fleet.as_ref().ok_or_else(no_fleet)?;
    let state = fleet.borrow().clone();
    Ok(([(header::CONTENT_TYPE, "application/json")], state).into_response())
}

async fn index(State(api): State<Api>, headers: HeaderMap) -> Result<Response, ApiError> {
    api.fleet.as_ref().ok_or_else(no_fleet)?;
    Ok(page::fleet(&headers))
}

fn no_fleet() -> ApiError {
    let help = "list other daemons in fleet.daemons";
    ApiError::new(StatusCode::NOT_FOUND, "no fleet is configured", help)
}
