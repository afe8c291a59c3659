//! Other robots that this daemon asks.

use axum::{
    extract::State,
    http::{HeaderMap, StatusCode, header},
    response::{IntoResponse, Response},
};
use sonard_api::Fleet;

use super::page::{self, HTML};
use crate::server::{Api, answer::Failed, openapi::Endpoint};

/// The fleet's page.
pub(super) const PAGE: &str = "/fleet";

pub(super) fn endpoints() -> Vec<Endpoint> {
    vec![
        Endpoint::get(
            "/v1/fleet",
            fleet,
            "How other robots are that this daemon asks (fleet.daemons)",
        )
        .answers::<Fleet>(200, "The robots"),
        Endpoint::get(PAGE, index, "The page of all robots").answers_text(200, HTML, "The page"),
    ]
}

async fn fleet(State(api): State<Api>) -> Result<Response, Failed> {
    let fleet = api.fleet.as_ref().ok_or_else(no_fleet)?;
    let told = fleet.borrow().clone();
    Ok(([(header::CONTENT_TYPE, "application/json")], told).into_response())
}

async fn index(State(api): State<Api>, headers: HeaderMap) -> Result<Response, Failed> {
    api.fleet.as_ref().ok_or_else(no_fleet)?;
    Ok(page::fleet(&headers))
}

fn no_fleet() -> Failed {
    let help = "name others in fleet.daemons";
    Failed::new(StatusCode::NOT_FOUND, "this daemon asks no other", help)
}
