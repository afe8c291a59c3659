//! Orders.

use axum::{Json, extract::State, http::StatusCode};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use uuid::Uuid;

use crate::{
    config::Mode,
    daemon::{AirOrder, Asked, Order},
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
    /// Azimuths for these scans alone, instead of those in force.
    #[serde(default)]
    plan: Option<ScanPlan>,
    /// Where the ranger stands for these scans alone, instead of the pose in force.
    #[serde(default)]
    pose: Option<Pose>,
}

/// Scans were asked for.
#[derive(Debug, Clone, Copy, Serialize, JsonSchema)]
pub(super) struct Started {
    /// Always `true`.
    accepted: bool,
    /// Identifies the request: `scan_start.request` of its scans bears it. Scans that the mode
    /// takes by itself bear none.
    request: Uuid,
}

/// Which request.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct Cancel {
    /// As POST /v1/start gave it.
    request: Uuid,
}

/// When scans are taken.
#[derive(Debug, Clone, Copy, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct Scanning {
    /// The mode.
    mode: Mode,
    /// From the start of a scan to the start of the next, seconds, when the mode is schedule;
    /// without it, as it was.
    #[serde(default)]
    #[schemars(range(min = 1, max = 604_800))]
    every_s: Option<f64>,
}

type Answer = Result<(StatusCode, Json<Accepted>), Failed>;

pub(super) fn endpoints() -> Vec<Endpoint> {
    let taken = "Taken in; it counts from the next scan on";
    vec![
        Endpoint::post("/v1/start", start, "Take scans, or go on with those of the mode")
            .takes::<Start>()
            .answers::<Started>(202, "Taken in"),
        Endpoint::post(
            "/v1/cancel",
            cancel,
            "Take no more scans of a request, end the one under way",
        )
        .takes::<Cancel>()
        .answers::<Accepted>(202, "Taken in"),
        Endpoint::get("/v1/scanning", scanning, "When scans are taken")
            .answers::<Scanning>(200, "The mode"),
        Endpoint::put("/v1/scanning", set_scanning, "Take scans in this way, from now on")
            .takes::<Scanning>()
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
        Endpoint::delete(
            "/v1/air",
            own_air,
            "The air is again what the configuration and the thermometer say",
        )
        .answers::<Accepted>(202, taken),
    ]
}

async fn start(
    State(api): State<Api>,
    Body(start): Body<Start>,
) -> Result<(StatusCode, Json<Started>), Failed> {
    if start.scans == Some(0) {
        let help = "give 1 or more, or leave it out";
        return Err(Failed::new(StatusCode::UNPROCESSABLE_ENTITY, "scans is 0", help));
    }
    let Start { scans, plan, pose } = start;
    let request = Uuid::new_v4();
    api.daemon.order(Order::Start(Asked { request, scans, plan, pose })).await?;
    Ok((StatusCode::ACCEPTED, Json(Started { accepted: true, request })))
}

async fn cancel(State(api): State<Api>, Body(cancel): Body<Cancel>) -> Answer {
    carry_out(&api, Order::Cancel(cancel.request)).await
}

async fn scanning(State(api): State<Api>) -> Json<Scanning> {
    let report = api.daemon.status().scanning;
    Json(Scanning { mode: report.mode, every_s: Some(report.every_s) })
}

async fn set_scanning(State(api): State<Api>, Body(scanning): Body<Scanning>) -> Answer {
    carry_out(&api, Order::Mode(scanning.mode, scanning.every_s)).await
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

async fn own_air(State(api): State<Api>) -> Answer {
    carry_out(&api, Order::OwnAir).await
}

async fn carry_out(api: &Api, order: Order) -> Answer {
    api.daemon.order(order).await?;
    Ok((StatusCode::ACCEPTED, Json(Accepted { accepted: true })))
}
