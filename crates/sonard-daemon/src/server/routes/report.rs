//! What the daemon is doing and has done.

use axum::{Json, extract::State, http::StatusCode, response::Response};
use sonard_api::{AirStatus, Health, InForce, ScanReport, SensorFigures, Setup, Status};
use sonard_model::{acoustics::Sensor, geometry::Pose};
use sonard_records::{ScanPlan, Session};

use super::{
    pieces::{Form, Pieces},
    scans::{answer, written},
};
use crate::{
    Moved,
    server::{Api, answer::Failed, openapi::Endpoint},
};

pub(super) fn endpoints() -> Vec<Endpoint> {
    vec![
        Endpoint::get("/v1/status", status, "What the daemon is doing")
            .answers::<Status>(200, "The status"),
        Endpoint::get("/v1/health", health, "Whether all is well, with link and scan statistics")
            .answers::<Health>(200, "All is well")
            .answers::<Health>(503, "Something is not well, and what"),
        Endpoint::get("/v1/scan/latest", latest, "The last scan that is over")
            .answers::<ScanReport>(200, "The scan"),
        Endpoint::get(
            "/v1/session",
            session,
            "What is true for the scans now: device, sensor, model",
        )
        .answers::<Session>(200, "The session"),
        Endpoint::get("/v1/setup", setup, "What the configuration decides about every scan")
            .answers::<InForce<Setup>>(200, "The setup, and what of it is pending"),
        Endpoint::get("/v1/plan", plan, "The azimuths in force")
            .answers::<InForce<ScanPlan>>(200, "The plan, and one that is pending"),
        Endpoint::get("/v1/pose", pose, "Where the ranger stands")
            .answers::<InForce<Pose>>(200, "The pose, and one that is pending"),
        Endpoint::get("/v1/air", air, "The air in force, with its age")
            .answers::<InForce<AirStatus>>(200, "The air, and what is pending"),
        Endpoint::get("/v1/sensor", sensor, "Those figures of the sensor that requests change")
            .answers::<InForce<SensorFigures>>(200, "The sensor, and what is pending"),
        Endpoint::get("/v1/sensors", sensors, "The sensors that come with the program")
            .answers::<Vec<Sensor>>(200, "All that is known of each, with sources"),
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

async fn latest(State(api): State<Api>) -> Result<Response, Failed> {
    let scan = api.daemon.latest_scan().ok_or_else(|| {
        let help = "start one with POST /v1/start, and wait for it";
        Failed::new(StatusCode::NOT_FOUND, "no scan is over yet", help)
    })?;
    let passage = written(&api, scan).await?.ok_or_else(|| {
        let help = "GET /v1/status says what the log lacks";
        Failed::new(StatusCode::SERVICE_UNAVAILABLE, "the log does not have the scan yet", help)
    })?;
    Ok(answer(&api, Pieces::new(passage, Form::Report, Moved::default())))
}

async fn session(State(api): State<Api>) -> Result<Response, Failed> {
    let session = api.daemon.session().ok_or_else(|| {
        let help = "a session begins with the first scan: POST /v1/start";
        Failed::new(StatusCode::NOT_FOUND, "there is no session yet", help)
    })?;
    Ok(api.session.answer(&session, Session::clone))
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
    // A preset that can't be read is a fault that a test finds.
    Json(Sensor::preset_names().filter_map(|name| Sensor::preset(name).ok()).collect())
}
