//! WebSocket endpoint for viewers of Foxglove's protocol.

use std::sync::Arc;

use axum::{
    extract::{
        Extension, State,
        ws::{WebSocketUpgrade, rejection::WebSocketUpgradeRejection},
    },
    http::StatusCode,
    response::Response,
};
use serde_json::json;
use sonard_api::Problem;
use sonard_export::foxglove::PROTOCOLS;

use crate::server::{
    Api, Principal,
    foxglove::{MAX_RECEIVED_BYTES, READ_BYTES, WRITE_BYTES},
    limits::ConnectionSlot,
    openapi::Route,
    response::ApiError,
};

/// Path of the WebSocket endpoint.
pub(in crate::server) const FOXGLOVE: &str = "/foxglove/";

pub(super) fn endpoints() -> Vec<Route> {
    let about = "Live messages by Foxglove's WebSocket protocol, if foxglove.enabled is set: responds 101 to a WebSocket \
                 upgrade with the sub-protocol foxglove.sdk.v1 or foxglove.websocket.v1";
    let token = "Access token, for browsers, which can't set headers of WebSocket requests";
    vec![
        Route::get(FOXGLOVE, upgrade, about)
            .parameter("query", "token", json!({"type": "string"}), token)
            .responds::<Problem>(400, "Not a WebSocket upgrade of this protocol")
            .responds::<Problem>(404, "Live messages are not enabled"),
    ]
}

async fn upgrade(
    State(api): State<Api>,
    Extension(principal): Extension<Principal>,
    Extension(connection_slot): Extension<Arc<ConnectionSlot>>,
    upgrade: Result<WebSocketUpgrade, WebSocketUpgradeRejection>,
) -> Result<Response, ApiError> {
    let viewers = api.foxglove.ok_or_else(|| {
        let help = "set foxglove.enabled and restart the daemon";
        ApiError::new(StatusCode::NOT_FOUND, "live messages are not enabled", help)
    })?;
    let bad_request = |error: String| {
        let help =
            "open ws://HOST:PORT/foxglove/ in Foxglove or Lichtblick, as \"Foxglove WebSocket\"";
        ApiError::new(StatusCode::BAD_REQUEST, error, help)
    };
    let upgrade = upgrade.map_err(|rejection| bad_request(rejection.body_text()))?;
    let upgrade = upgrade
        .protocols(PROTOCOLS)
        .max_message_size(MAX_RECEIVED_BYTES)
        .max_frame_size(MAX_RECEIVED_BYTES)
        .read_buffer_size(READ_BYTES)
        .write_buffer_size(0)
        .max_write_buffer_size(WRITE_BYTES);
    if upgrade.selected_protocol().is_none() {
        return Err(bad_request(format!(
            "unsupported sub-protocol; supported: {}",
            PROTOCOLS.join(", ")
        )));
    }
    let full = |what: &str, help: &str| ApiError::new(StatusCode::SERVICE_UNAVAILABLE, what, help);
    let stream_slot = api.slots.take_stream(principal).ok_or_else(|| {
        full("too many live streams of guests", "send the token, or raise server.max_clients")
    })?;
    let viewer_slot = viewers
        .take_slot(principal)
        .ok_or_else(|| full("too many viewers", "close one, or raise foxglove.max_clients"))?;
    Ok(upgrade.on_upgrade(async move |socket| {
        viewers.serve(socket).await;
        drop((viewer_slot, stream_slot, connection_slot));
    }))
}
