//! Fetches a robot's last scan and reduces it to a small floor plan.

use std::time::Duration;

use serde::Deserialize;
use sonard_model::geometry::Pose;
use tokio::time::timeout;
use uuid::Uuid;

use crate::{
    api::{FleetPicture, FloorPlan},
    client::Client,
};

/// Time limit for fetching a scan and its scene.
const FETCH_TIMEOUT: Duration = Duration::from_secs(8);
/// Maximum size of a scan and of a scene, bytes; larger ones are not shown.
const MAX_BYTES: usize = 4 << 20;
/// Maximum number of points per picture.
const MAX_POINTS: usize = 360;
/// Maximum JSON size of a point and of a wall, bytes.
const POINT_BYTES: usize = 24;
const WALL_BYTES: usize = 2 * POINT_BYTES + 4;
/// Maximum coordinate, metres: values from other robots can be invalid.
const MAX_COORDINATE_M: f64 = 1e4;

/// Fields of a scan response that the picture needs.
#[derive(Deserialize)]
struct ScanData {
    start: StartData,
    pings: Vec<ReadingData>,
}

#[derive(Deserialize)]
struct StartData {
    pose: Pose,
}

#[derive(Deserialize)]
struct ReadingData {
    range_m: Option<f64>,
    viewpoint: Option<ViewpointData>,
}

#[derive(Deserialize)]
struct ViewpointData {
    x_m: f64,
    y_m: f64,
    direction_deg: f64,
}

/// Fetches a scan as a picture of at most `max_bytes` of JSON; `None` if it is unavailable.
pub(super) async fn fetch(client: &Client, scan: Uuid, max_bytes: usize) -> Option<FleetPicture> {
    let (scan_path, scene_path) = (format!("/v1/scans/{scan}"), format!("/v1/scans/{scan}/scene"));
    let both = async {
        let scan: ScanData = client.get_json_within(&scan_path, MAX_BYTES).await.ok()?;
        // A scan without a scene is shown without walls.
        let scene: Option<FloorPlan> = client.get_json_within(&scene_path, MAX_BYTES).await.ok();
        Some(draw(&scan, scene.as_ref(), max_bytes))
    };
    timeout(FETCH_TIMEOUT, both).await.ok().flatten()
}

fn draw(scan: &ScanData, scene: Option<&FloorPlan>, max_bytes: usize) -> FleetPicture {
    let ends = scan.pings.iter().filter_map(|reading| {
        let (from, range_m) = (reading.viewpoint.as_ref()?, reading.range_m?);
        let (sin, cos) = from.direction_deg.to_radians().sin_cos();
        rounded_point([from.x_m + range_m * cos, from.y_m + range_m * sin])
    });
    let ends: Vec<_> = ends.collect();
    let max_points = MAX_POINTS.min(max_bytes / POINT_BYTES).max(1);
    let every = ends.len().div_ceil(max_points).max(1);
    let points_m: Vec<_> = ends.into_iter().step_by(every).collect();
    let left_bytes = max_bytes.saturating_sub(points_m.len() * POINT_BYTES);
    let walls = scene.map_or(&[][..], |scene| &scene.walls);
    // A subset of the walls would show another room, so it is all or none.
    let fits = walls.len() * WALL_BYTES <= left_bytes;
    let walls = walls.iter().filter(|_| fits);
    let walls_m = walls
        .filter_map(|wall| Some([rounded_point(wall.from)?, rounded_point(wall.to)?]))
        .collect();
    FleetPicture { pose: scan.start.pose, points_m, walls_m }
}

/// Rounds a point to the millimetre; `None` for implausible coordinates.
fn rounded_point(at: [f64; 2]) -> Option<[f64; 2]> {
    let is_near = at.iter().all(|metres| metres.abs() < MAX_COORDINATE_M);
    is_near.then(|| at.map(|metres| (metres * 1e3).round() / 1e3))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scan(readings: usize) -> ScanData {
        let reading = |i: usize| ReadingData {
            range_m: Some(1.0 + i as f64 * 1e-4),
            viewpoint: Some(ViewpointData { x_m: 0.0, y_m: 0.0, direction_deg: i as f64 }),
        };
        ScanData {
            start: StartData { pose: Pose { x_m: 0.5, y_m: 0.5, heading_deg: 0.0 } },
            pings: (0..readings).map(reading).collect(),
        }
    }

    #[test]
    fn picture_fits_its_size_limit() {
        for (readings, max_bytes) in [(1, 100), (400, 3000), (100_000, 3000), (100_000, 100_000)] {
            let picture = draw(&scan(readings), None, max_bytes);
            let json = serde_json::to_string(&picture.points_m).expect("numbers");
            assert!(json.len() <= max_bytes, "{} of {max_bytes} bytes", json.len());
            assert!((1..=MAX_POINTS).contains(&picture.points_m.len()));
        }
    }

    #[test]
    fn invalid_readings_are_skipped() {
        let mut scan = scan(3);
        scan.pings[0].range_m = Some(f64::INFINITY);
        scan.pings[1].range_m = None;
        let picture = draw(&scan, None, 1000);
        assert_eq!(picture.points_m, [[1.0, 0.035]]);
    }
}
