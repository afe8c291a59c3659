//! Handlers of requests that change settings, and that start and stop scans.

use axum::{Extension, Json, extract::State, http::StatusCode};
use sonard_api::{
    Accepted, AccessReport, AirOrder, CancelRequest, ScanRequest, Scanning, SensorOrder,
    SettingsOrder, Started,
};
use sonard_model::geometry::Pose;
use sonard_records::ScanPlan;

use crate::{
    Order,
    server::{
        Api,
        access::Principal,
        openapi::Route,
        response::{ApiError, JsonBody},
    },
};

type CommandResult = Result<(StatusCode, Json<Accepted>), ApiError>;

pub(super) fn endpoints() -> Vec<Route> {
    let accepted = "Accepted; takes effect with the next scan";
    vec![
        Route::get("/v1/access", access, "Permission of this client to change settings")
            .responds::<AccessReport>(200, "Permission"),
        Route::post("/v1/start", start, "Start scans, or resume the scan mode")
            .accepts::<ScanRequest>()
            .responds::<Started>(202, "Accepted"),
        Route::post("/v1/cancel", cancel, "Cancel a request for scans; its current scan ends")
            .accepts::<CancelRequest>()
            .responds::<Accepted>(202, "Accepted"),
        Route::get("/v1/scanning", scanning, "Scan mode and schedule")
            .responds::<Scanning>(200, "Scan mode"),
        Route::put("/v1/scanning", set_scanning, "Set the scan mode")
            .accepts::<Scanning>()
            .responds::<Accepted>(202, "Accepted"),
        Route::post("/v1/stop", stop, "End the current scan and stop scanning until a start")
            .responds::<Accepted>(202, "Accepted"),
        Route::put("/v1/settings", settings, "Set several of plan, pose, air and sensor, or none")
            .accepts::<SettingsOrder>()
            .responds::<Accepted>(202, accepted),
        Route::put("/v1/plan", plan, "Set the azimuths of scans")
            .accepts::<ScanPlan>()
            .responds::<Accepted>(202, accepted),
        Route::put("/v1/pose", pose, "Set the pose of the ranger")
            .accepts::<Pose>()
            .responds::<Accepted>(202, accepted),
        Route::put("/v1/air", air, "Set the air data")
            .accepts::<AirOrder>()
            .responds::<Accepted>(202, accepted),
        Route::delete("/v1/air", reset_air, "Reset the air data to configuration and thermometer")
            .responds::<Accepted>(202, accepted),
        Route::put(
            "/v1/sensor",
            sensor,
            "Set the sensor: prediction of readings, and receiver blanking",
        )
        .accepts::<SensorOrder>()
        .responds::<Accepted>(202, accepted),
        Route::delete("/v1/sensor", reset_sensor, "Reset the sensor to the configuration")
            .responds::<Accepted>(202, accepted),
    ]
}

async fn access(
    State(api): State<Api>,
    Extension(principal): Extension<Principal>,
) -> Json<AccessReport> {
    Json(AccessReport { write: api.access.write_access(principal) })
}

async fn start(
    State(api): State<Api>,
    JsonBody(start): JsonBody<ScanRequest>,
) -> Result<(StatusCode, Json<Started>), ApiError> {
    Ok((StatusCode::ACCEPTED, Json(api.daemon.start(start).await?)))
}

async fn cancel(
    State(api): State<Api>,
    JsonBody(cancel): JsonBody<CancelRequest>,
) -> CommandResult {
    execute(&api, Order::Cancel(cancel.request)).await
}

async fn scanning(State(api): State<Api>) -> Json<Scanning> {
    let report = api.daemon.status().scanning;
    Json(Scanning { mode: report.mode, every_s: Some(report.every_s) })
}

async fn set_scanning(
    State(api): State<Api>,
    JsonBody(scanning): JsonBody<Scanning>,
) -> CommandResult {
    execute(&api, Order::Mode(scanning.mode, scanning.every_s)).await
}

async fn stop(State(api): State<Api>) -> CommandResult {
    execute(&api, Order::Stop).await
}

async fn settings(
    State(api): State<Api>,
    JsonBody(order): JsonBody<SettingsOrder>,
) -> CommandResult {
    execute(&api, Order::Settings(Box::new(order))).await
}

async fn plan(State(api): State<Api>, JsonBody(plan): JsonBody<ScanPlan>) -> CommandResult {
    execute(&api, Order::Plan(plan)).await
}

async fn pose(State(api): State<Api>, JsonBody(pose): JsonBody<Pose>) -> CommandResult {
    execute(&api, Order::Pose(pose)).await
}

async fn air(State(api): State<Api>, JsonBody(order): JsonBody<AirOrder>) -> CommandResult {
    execute(&api, Order::Air(order)).await
}

async fn reset_air(State(api): State<Api>) -> CommandResult {
    execute(&api, Order::OwnAir).await
}

async fn sensor(State(api): State<Api>, JsonBody(order): JsonBody<SensorOrder>) -> CommandResult {
    execute(&api, Order::Sensor(Box::new(order))).await
}

async fn reset_sensor(State(api): State<Api>) -> CommandResult {
    execute(&api, Order::OwnSensor).await
}

async fn execute(api: &Api, order: Order) -> CommandResult {
    api.daemon.order(order).await?;
    Ok((StatusCode::ACCEPTED, Json(Accepted { accepted: true })))
}
