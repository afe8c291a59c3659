//! What can be made of a scan: a map, lines, and planes, corners and edges.

use std::sync::Arc;

use axum::{Json, extract::State, http::StatusCode};
use serde_json::json;
use sonard_api::{Findings, FoundFeature, FoundLine, MapCells};
use sonard_interpret::interpret::{
    Extents, Feature, Settings, Sweep,
    grid::Grid,
    interpret,
    lines::{LineMap, LineMapSettings, MapLine},
    mapping::{Mapper, Mapping},
};
use sonard_log::Passage;
use sonard_records::{Record, ScanView, decode_line};
use tokio::sync::OwnedSemaphorePermit;

use super::scans::{broken, find_written, unreadable};
use crate::server::{
    Api,
    answer::{Failed, Path},
    openapi::Endpoint,
};

/// Most readings of a scan that something is made of.
const MOST_READINGS: usize = 4000;
/// Most cells of a map; cells are made larger for more.
const MOST_CELLS: f64 = 40_000.0;

pub(super) fn endpoints() -> Vec<Endpoint> {
    let about = "A map, lines, and planes, corners and edges made of a scan by itself, as `sonard map`, \
                 `lines` and `interpret` make them. Of at most 4000 readings";
    vec![
        Endpoint::get("/v1/scans/{scan}/findings", findings, about)
            .parameter(
                "path",
                "scan",
                json!({"type": "string", "format": "uuid"}),
                "A scan from GET /v1/scans, or the one under way",
            )
            .answers::<Findings>(200, "What was found"),
    ]
}

async fn findings(
    State(api): State<Api>,
    Path(scan): Path<String>,
) -> Result<Json<Findings>, Failed> {
    let passage = find_written(&api, &scan).await?;
    // One after the other, also when clients leave meanwhile.
    let turn = Arc::clone(&api.looking).acquire_owned().await.ok();
    let finding = tokio::task::spawn_blocking(move || find_in(&passage, turn));
    finding.await.map_err(|error| broken(&error))?.map(Json)
}

fn find_in(passage: &Passage, _turn: Option<OwnedSemaphorePermit>) -> Result<Findings, Failed> {
    let view = read(passage)?;
    let nothing = |why: String| Failed::new(StatusCode::CONFLICT, why, "see `sonard map --help`");
    let session = view.session.as_deref();
    let session = session.ok_or_else(|| nothing("the log lacks the scan's session".into()))?;
    let extents = Extents::of_session(session).map_err(|error| nothing(error.to_string()))?;
    let sweep = Sweep::of(&view).map_err(|error| nothing(error.to_string()))?;
    let of_array = session.array.is_some();
    let mut lines = LineMap::new(LineMapSettings::default());
    lines.add_sonar(&sweep);
    let map = map(&sweep, &extents, of_array);
    let sweeps = [(view.scan, sweep)];
    // Arcs need one ranger that turns.
    let features =
        if of_array { Vec::new() } else { interpret(&sweeps, &extents, &Settings::default()) };
    let lacks = of_array.then(|| "features need one ranger that turns".to_owned());
    Ok(Findings {
        map,
        lines: lines.lines().iter().map(found_line).collect(),
        features: features.iter().filter_map(found_feature).collect(),
        lacks,
    })
}

/// The scan with its readings; of a beam that was measured twice the last one.
pub(super) fn read(passage: &Passage) -> Result<ScanView, Failed> {
    let mut view = passage.view.clone();
    let mut count = 0;
    for line in passage.lines(true).map_err(|error| unreadable(&error))? {
        let line = line.map_err(|error| unreadable(&error))?;
        let Ok(Record::Ping(ping)) = decode_line(line.trim_ascii_end()) else { continue };
        if ping.scan != view.scan {
            continue;
        }
        count += 1;
        if count > MOST_READINGS {
            let help =
                "`sonard map`, `sonard lines` and `sonard interpret` take logs of any length";
            let error = format!("the scan has more than {MOST_READINGS} readings");
            return Err(Failed::new(StatusCode::CONFLICT, error, help));
        }
        view.pings.push(*ping);
    }
    Ok(view)
}

fn map(sweep: &Sweep, extents: &Extents, of_array: bool) -> Option<MapCells> {
    let mut mapping = Mapping::default();
    let max_range_m = mapping.max_range_m(extents);
    let mut shape = mapping.shape([sweep], max_range_m).ok()?;
    let coarser = (shape.cells() as f64 / MOST_CELLS).sqrt();
    if coarser > 1.0 {
        mapping.resolution_m *= coarser * 1.05;
        shape = mapping.shape([sweep], max_range_m).ok()?;
    }
    let mut mapper = Mapper::new(&mapping, Grid::new(shape), extents.clone(), of_array, 1);
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

/// Of a feature whose range is known.
fn found_feature(feature: &Feature) -> Option<FoundFeature> {
    Some(FoundFeature {
        kind: feature.kind,
        at: [feature.x_m?, feature.y_m?],
        confidence: feature.confidence,
        reason: feature.reason,
        beams: feature.beams,
    })
}
