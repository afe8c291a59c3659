//! Interpretation of a scan: occupancy grid, lines, planes, corners and edges.

use std::sync::Arc;

use axum::{Json, extract::State, http::StatusCode};
use serde_json::json;
use sonard_api::{Findings, FoundFeature, FoundLine, MapCells};
use sonard_interpret::interpret::{
    Extents, Feature, InterpretSettings, Sweep,
    grid::Grid,
    interpret,
    lines::{LineMap, LineMapSettings, MapLine},
    mapping::{MapSettings, Mapper},
};
use sonard_log::ScanSpan;
use sonard_records::{Record, ScanView, decode_line};
use tokio::sync::OwnedSemaphorePermit;

use super::scans::{find_written, internal_error, unreadable};
use crate::server::{
    Api,
    openapi::Route,
    response::{ApiError, PathParams},
};

/// Maximum number of readings of an interpreted scan.
const MAX_READINGS: usize = 4000;
/// Maximum number of cells of a grid; a larger area has larger cells.
const MAX_CELLS: f64 = 40_000.0;

pub(super) fn endpoints() -> Vec<Route> {
    let about = "Occupancy grid, lines, planes, corners and edges of a single scan, as computed by `sonard map`, \
                 `lines` and `interpret`. At most 4000 readings";
    vec![
        Route::get("/v1/scans/{scan}/findings", findings, about)
            .parameter(
                "path",
                "scan",
                json!({"type": "string", "format": "uuid"}),
                "Scan from GET /v1/scans, or the current scan",
            )
            .responds::<Findings>(200, "Interpretation of the scan"),
    ]
}

async fn findings(
    State(api): State<Api>,
    PathParams(scan): PathParams<String>,
) -> Result<Json<Findings>, ApiError> {
    let passage = find_written(&api, &scan).await?;
    // One interpretation at a time, even if clients disconnect meanwhile.
    let permit = Arc::clone(&api.predicting).acquire_owned().await.ok();
    let finding = tokio::task::spawn_blocking(move || interpret_scan(&passage, permit));
    finding.await.map_err(|error| internal_error(&error))?.map(Json)
}

fn interpret_scan(
    passage: &ScanSpan,
    _permit: Option<OwnedSemaphorePermit>,
) -> Result<Findings, ApiError> {
    let view = read(passage)?;
    let nothing = |why: String| ApiError::new(StatusCode::CONFLICT, why, "see `sonard map --help`");
    let session = view.session.as_deref();
    let session =
        session.ok_or_else(|| nothing("the log does not contain the scan's session".into()))?;
    let extents = Extents::from_session(session).map_err(|error| nothing(error.to_string()))?;
    let sweep = Sweep::from_scan(&view).map_err(|error| nothing(error.to_string()))?;
    let is_array = session.array.is_some();
    let mut lines = LineMap::new(LineMapSettings::default());
    lines.add_sonar(&sweep);
    let map = map(&sweep, &extents, is_array);
    let sweeps = [(view.scan, sweep)];
    // Features are derived from arcs, which need a scanning ranger.
    let features = if is_array {
        Vec::new()
    } else {
        interpret(&sweeps, &extents, &InterpretSettings::default())
    };
    let lacks = is_array.then(|| "features need a scanning ranger".to_owned());
    Ok(Findings {
        map,
        lines: lines.lines().iter().map(found_line).collect(),
        features: features.iter().filter_map(found_feature).collect(),
        unavailable_reason: lacks,
    })
}

/// Reads the scan with its readings; the last one of a repeated beam counts.
pub(super) fn read(passage: &ScanSpan) -> Result<ScanView, ApiError> {
    let mut view = passage.view.clone();
    let mut count = 0;
    for line in passage.lines(true).map_err(|error| unreadable(&error))? {
        let line = line.map_err(|error| unreadable(&error))?;
        let Ok(Record::Ping(ping)) = decode_line(line.trim_ascii_end()) else { continue };
        if ping.scan != view.scan {
            continue;
        }
        count += 1;
        if count > MAX_READINGS {
            let help = "use `sonard map`, `sonard lines` and `sonard interpret`, which accept logs of any length";
            let error = format!("more than {MAX_READINGS} readings");
            return Err(ApiError::new(StatusCode::CONFLICT, error, help));
        }
        view.pings.push(*ping);
    }
    Ok(view)
}

fn map(sweep: &Sweep, extents: &Extents, is_array: bool) -> Option<MapCells> {
    let mut mapping = MapSettings::default();
    let max_range_m = mapping.max_range_m(extents);
    let mut shape = mapping.shape([sweep], max_range_m).ok()?;
    let coarser = (shape.cells() as f64 / MAX_CELLS).sqrt();
    if coarser > 1.0 {
        mapping.resolution_m *= coarser * 1.05;
        shape = mapping.shape([sweep], max_range_m).ok()?;
    }
    let mut mapper = Mapper::new(&mapping, Grid::new(shape), extents.clone(), is_array, 1);
    mapper.add(sweep);
    let grid = mapper.finish();
    let percent = |p: f64| if (p - 0.5).abs() < 1e-6 { -1 } else { (100.0 * p).round() as i8 };
    Some(MapCells {
        origin: shape.origin.to_array(),
        resolution_m: shape.resolution_m,
        width: shape.width,
        cells: grid.probabilities().map(percent).collect(),
    })
}

fn found_line(line: &MapLine) -> FoundLine {
    let [from, to] = line.ends.map(|end| end.to_array());
    FoundLine { from, to, confidence: line.confidence }
}

/// Converts a feature; `None` if its range is unknown.
fn found_feature(feature: &Feature) -> Option<FoundFeature> {
    Some(FoundFeature {
        kind: feature.kind,
        at: [feature.x_m?, feature.y_m?],
        confidence: feature.confidence,
        reason: feature.reason,
        beams: feature.beams,
    })
}
