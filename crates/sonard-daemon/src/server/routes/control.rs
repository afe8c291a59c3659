//! Orders.

use axum::{Json, extract::State, http::StatusCode};
use sonard_api::{Accepted, AirOrder, CancelRequest, ScanRequest, Scanning, SensorOrder, Started};
use sonard_model::geometry::Pose;
use sonard_records::ScanPlan;

use crate::{
    Order,
    server::{
        Api,
        answer::{Body, Failed},
        openapi::Endpoint,
    },
};

type Answer = Result<(StatusCode, Json<Accepted>), Failed>;

pub(super) fn endpoints() -> Vec<Endpoint> {
    let taken = "Taken in; it counts from the next scan on";
    vec![
        Endpoint::post("/v1/start", start, "Take scans, or go on with those of the mode")
            .takes::<ScanRequest>()
            .answers::<Started>(202, "Taken in"),
        Endpoint::post(
            "/v1/cancel",
            cancel,
            "Take no more scans of a request, end the one under way",
        )
        .takes::<CancelRequest>()
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
        Endpoint::put(
            "/v1/sensor",
            sensor,
            "The sensor is like this: what readings are predicted for, and when the receiver listens",
        )
        .takes::<SensorOrder>()
        .answers::<Accepted>(202, taken),
        Endpoint::delete(
            "/v1/sensor",
            own_sensor,
            "The sensor is again what the configuration says",
        )
        .answers::<Accepted>(202, taken),
    ]
}

async fn start(
    State(api): State<Api>,
    Body(start): Body<ScanRequest>,
) -> Result<(StatusCode, Json<Started>), Failed> {
    Ok((StatusCode::ACCEPTED, Json(api.daemon.start(start).await?)))
}

async fn cancel(State(api): State<Api>, Body(cancel): Body<CancelRequest>) -> Answer {
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

async fn sensor(State(api): State<Api>, Body(order): Body<SensorOrder>) -> Answer {
    carry_out(&api, Order::Sensor(Box::new(order))).await
}

async fn own_sensor(State(api): State<Api>) -> Answer {
    carry_out(&api, Order::OwnSensor).await
}

async fn carry_out(api: &Api, order: Order) -> Answer {
    api.daemon.order(order).await?;
    Ok((StatusCode::ACCEPTED, Json(Accepted { accepted: true })))
}
