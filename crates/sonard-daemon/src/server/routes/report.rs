//! Status, health, current settings and latest scan.

use axum::{Json, extract::State, http::StatusCode, response::Response};
use sonard_api::{AirStatus, Health, InForce, ScanReport, SensorFigures, Setup, Status};
use sonard_model::{acoustics::Sensor, geometry::Pose};
use sonard_records::{ScanPlan, Session};

use super::{
    pieces::{ScanForm, ScanPieces},
    scans::{scan_response, wait_written},
};
use crate::{
    DeadbandFilter,
    server::{Api, openapi::Route, response::ApiError},
};

pub(super) fn endpoints() -> Vec<Route> {
    vec![
        Route::get("/v1/status", status, "Status of the daemon").responds::<Status>(200, "Status"),
        Route::get("/v1/health", health, "Health of the daemon, with link and scan statistics")
            .responds::<Health>(200, "Healthy")
            .responds::<Health>(503, "Unhealthy, with the reasons"),
        Route::get("/v1/scan/latest", latest, "Last completed scan")
            .responds::<ScanReport>(200, "Scan"),
        Route::get("/v1/session", session, "Current session of the log: device, sensor, model")
            .responds::<Session>(200, "Session"),
        Route::get("/v1/setup", setup, "Scan settings of the configuration")
            .responds::<InForce<Setup>>(200, "Current and pending settings"),
        Route::get("/v1/plan", plan, "Azimuths of scans")
            .responds::<InForce<ScanPlan>>(200, "Current and pending plan"),
        Route::get("/v1/pose", pose, "Pose of the ranger")
            .responds::<InForce<Pose>>(200, "Current and pending pose"),
        Route::get("/v1/air", air, "Air data and their age")
            .responds::<InForce<AirStatus>>(200, "Current and pending air data"),
        Route::get("/v1/sensor", sensor, "Sensor settings that the API can change")
            .responds::<InForce<SensorFigures>>(200, "Current and pending sensor settings"),
        Route::get("/v1/sensors", sensors, "Sensor presets")
            .responds::<Vec<Sensor>>(200, "Data of each preset, with sources"),
    ]
}

async fn status(State(api): State<Api>) -> Json<Status> {
    Json(api.daemon.status())
}

async fn health(State(api): State<Api>) -> (StatusCode, Json<Health>) {
    let health = api.daemon.health();
    let status = if health.healthy { StatusCode::OK } else { StatusCode::SERVICE_UNAVAILABLE };
    (status, Json(health))
}

async fn latest(State(api): State<Api>) -> Result<Response, ApiError> {
    let scan = api.daemon.latest_scan().ok_or_else(|| {
        let help = "start a scan with POST /v1/start and wait for its end";
        ApiError::new(StatusCode::NOT_FOUND, "no scan has been completed yet", help)
    })?;
    let passage = wait_written(&api, scan).await?.ok_or_else(|| {
        let help = "GET /v1/status reports the state of the log";
        ApiError::new(
            StatusCode::SERVICE_UNAVAILABLE,
            "the scan is not completely logged yet",
            help,
        )
    })?;
    Ok(scan_response(&api, ScanPieces::new(passage, ScanForm::Report, DeadbandFilter::default())))
}

async fn session(State(api): State<Api>) -> Result<Response, ApiError> {
    let session = api.daemon.session().ok_or_else(|| {
        let help = "a session begins with the first scan: POST /v1/start";
        ApiError::new(StatusCode::NOT_FOUND, "no session yet", help)
    })?;
    Ok(api.session.response(&session, Session::clone))
}

async fn setup(State(api): State<Api>) -> Json<InForce<Setup>> {
    Json(api.daemon.setup())
}

async fn plan(State(api): State<Api>) -> Json<InForce<ScanPlan>> {
    let Status { plan, pending, .. } = api.daemon.status();
    Json(InForce { now: plan, pending: pending.plan })
}

async fn pose(State(api): State<Api>) -> Json<InForce<Pose>> {
    let Status { pose, pending, .. } = api.daemon.status();
    Json(InForce { now: pose, pending: pending.pose })
}

async fn air(State(api): State<Api>) -> Json<InForce<AirStatus>> {
    let Status { air, pending, .. } = api.daemon.status();
    Json(InForce { now: air, pending: pending.air })
}

async fn sensor(State(api): State<Api>) -> Json<InForce<SensorFigures>> {
    let Status { sensor, pending, .. } = api.daemon.status();
    Json(InForce { now: sensor, pending: pending.sensor })
}

async fn sensors() -> Json<Vec<Sensor>> {
    // All presets are valid, which a test checks.
    Json(Sensor::preset_names().filter_map(|name| Sensor::preset(name).ok()).collect())
}
