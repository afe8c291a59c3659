//! Floor plan of the current scene.

use axum::{extract::State, http::StatusCode, response::Response};
use sonard_api::FloorPlan;

use crate::server::{Api, openapi::Route, response::ApiError};

pub(super) fn endpoints() -> Vec<Route> {
    vec![
        Route::get("/v1/scene", scene, "Floor plan of the current scene")
            .responds::<FloorPlan>(200, "Floor plan"),
    ]
}

async fn scene(State(api): State<Api>) -> Result<Response, ApiError> {
    let scene = api.daemon.scene().ok_or_else(|| {
        let help = "configure one in place.scene";
        ApiError::new(StatusCode::NOT_FOUND, "no scene is configured", help)
    })?;
    Ok(api.scene.response(&scene, FloorPlan::from_scene))
}
