//! Live messages for viewers, by Foxglove's WebSocket protocol.

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
    Api, Standing,
    answer::Failed,
    foxglove::{MOST_RECEIVED_BYTES, READ_BYTES, WRITE_BYTES},
    openapi::Endpoint,
    slots::Slot,
};

/// Where viewers ask.
pub(in crate::server) const FOXGLOVE: &str = "/foxglove/";

pub(super) fn endpoints() -> Vec<Endpoint> {
    let about = "Live messages by Foxglove's WebSocket protocol, if foxglove.enabled is set: answers 101 to a request \
                 for a WebSocket with the sub-protocol foxglove.sdk.v1 or foxglove.websocket.v1";
    let token = "The token, for browsers, which can't send a header with such a request";
    vec![
        Endpoint::get(FOXGLOVE, upgrade, about)
            .parameter("query", "token", json!({"type": "string"}), token)
            .answers::<Problem>(400, "No request for a WebSocket of this protocol")
            .answers::<Problem>(404, "It is not enabled"),
    ]
}

async fn upgrade(
    State(api): State<Api>,
    Extension(standing): Extension<Standing>,
    Extension(place): Extension<Arc<Slot>>,
    upgrade: Result<WebSocketUpgrade, WebSocketUpgradeRejection>,
) -> Result<Response, Failed> {
    let viewers = api.foxglove.ok_or_else(|| {
        let help = "set foxglove.enabled, and start the daemon again";
        Failed::new(StatusCode::NOT_FOUND, "nothing is told to viewers here", help)
    })?;
    let wrong = |error: String| {
        let help =
            "open ws://HOST:PORT/foxglove/ in Foxglove or Lichtblick, as \"Foxglove WebSocket\"";
        Failed::new(StatusCode::BAD_REQUEST, error, help)
    };
    let upgrade = upgrade.map_err(|rejection| wrong(rejection.body_text()))?;
    let upgrade = upgrade
        .protocols(PROTOCOLS)
        .max_message_size(MOST_RECEIVED_BYTES)
        .max_frame_size(MOST_RECEIVED_BYTES)
        .read_buffer_size(READ_BYTES)
        .write_buffer_size(0)
        .max_write_buffer_size(WRITE_BYTES);
    if upgrade.selected_protocol().is_none() {
        return Err(wrong(format!("the sub-protocol is none of {}", PROTOCOLS.join(", "))));
    }
    let full = |what: &str, help: &str| Failed::new(StatusCode::SERVICE_UNAVAILABLE, what, help);
    let leave = api.places.take_stream(standing).ok_or_else(|| {
        full("too many live streams of guests", "show the token, or raise server.max_clients")
    })?;
    let seat = viewers
        .take_place(standing)
        .ok_or_else(|| full("too many viewers", "close one, or raise foxglove.max_clients"))?;
    Ok(upgrade.on_upgrade(async move |socket| {
        viewers.attend(socket).await;
        drop((seat, leave, place));
    }))
}
