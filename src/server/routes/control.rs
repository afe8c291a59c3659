//! Orders.

use axum::{Json, extract::State, http::StatusCode};
use schemars::JsonSchema;
use serde::Deserialize;

use crate::{
    daemon::{AirOrder, Order},
    geometry::Pose,
    scan::ScanPlan,
    server::{
        Api,
        answer::{Accepted, Body, Failed},
        openapi::Endpoint,
    },
};

/// How many scans to take.
#[derive(Debug, Clone, Copy, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct Start {
    /// So many scans; without it, those of the mode go on (on-request: one scan).
    #[serde(default)]
    #[schemars(range(min = 1))]
    scans: Option<u32>,
}

type Answer = Result<(StatusCode, Json<Accepted>), Failed>;

pub(super) fn endpoints() -> Vec<Endpoint> {
    let taken = "Taken in; it counts from the next scan on";
    vec![
        Endpoint::post("/v1/start", start, "Take scans, or go on with those of the mode")
            .takes::<Start>()
            .answers::<Accepted>(202, "Taken in"),
        Endpoint::post("/v1/stop", stop, "End the scan under way and take no more until a start")
            .answers::<Accepted>(202, "Taken in"),
        Endpoint::put("/v1/plan", plan, "Measure these azimuths")
            .takes::<ScanPlan>()
            .answers::<Accepted>(202, taken),
        Endpoint::put("/v1/pose", pose, "The ranger stands here")
            .takes::<Pose>()
            .answers::<Accepted>(202, taken),
        Endpoint::put("/v1/air", air, "The air is like this")
            .takes::<AirOrder>()
            .answers::<Accepted>(202, taken),
    ]
}

async fn start(State(api): State<Api>, Body(start): Body<Start>) -> Answer {
    if start.scans == Some(0) {
        let help = "give 1 or more, or leave it out";
        return Err(Failed::new(StatusCode::UNPROCESSABLE_ENTITY, "scans is 0", help));
    }
    carry_out(&api, Order::Start(start.scans)).await
}

async fn stop(State(api): State<Api>) -> Answer {
    carry_out(&api, Order::Stop).await
}

async fn plan(State(api): State<Api>, Body(plan): Body<ScanPlan>) -> Answer {
    carry_out(&api, Order::Plan(plan)).await
}

async fn pose(State(api): State<Api>, Body(pose): Body<Pose>) -> Answer {
    carry_out(&api, Order::Pose(pose)).await
}

async fn air(State(api): State<Api>, Body(order): Body<AirOrder>) -> Answer {
    carry_out(&api, Order::Air(order)).await
}

async fn carry_out(api: &Api, order: Order) -> Answer {
    api.daemon.order(order).await?;
    Ok((StatusCode::ACCEPTED, Json(Accepted { accepted: true })))
}
