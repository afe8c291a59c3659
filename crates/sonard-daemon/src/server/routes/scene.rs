//! The scene in force, as it is drawn.

use axum::{extract::State, http::StatusCode, response::Response};
use sonard_api::FloorPlan;

use crate::server::{Api, answer::Failed, openapi::Endpoint};

pub(super) fn endpoints() -> Vec<Endpoint> {
    vec![
        Endpoint::get("/v1/scene", scene, "The floor plan of the scene in force")
            .answers::<FloorPlan>(200, "The floor plan"),
    ]
}

async fn scene(State(api): State<Api>) -> Result<Response, Failed> {
    let scene = api.daemon.scene().ok_or_else(|| {
        let help = "give the daemon one with place.scene";
        Failed::new(StatusCode::NOT_FOUND, "there is no scene", help)
    })?;
    Ok(api.scene.answer(&scene, FloorPlan::of))
}
