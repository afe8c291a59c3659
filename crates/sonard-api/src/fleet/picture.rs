//! A robot's last scan, fetched and made small.

use std::time::Duration;

use serde::Deserialize;
use sonard_model::geometry::Pose;
use tokio::time::timeout;
use uuid::Uuid;

use crate::{
    api::{FleetPicture, FloorPlan},
    client::Client,
};

/// How long a scan and its scene may take.
const LIMIT: Duration = Duration::from_secs(8);
/// Longest scan and longest scene that are read, bytes: a scan with more is not shown.
const MOST_BYTES: usize = 4 << 20;
/// Most points of a picture.
const MOST_POINTS: usize = 360;
/// What a point and a wall are of a picture's JSON, at most, bytes.
const POINT_BYTES: usize = 24;
const WALL_BYTES: usize = 2 * POINT_BYTES + 4;
/// Farthest that anything is drawn, metres: what a robot says need not make sense.
const FARTHEST_M: f64 = 1e4;

/// What of a scan is looked at.
#[derive(Deserialize)]
struct Scan {
    start: Start,
    pings: Vec<Reading>,
}

#[derive(Deserialize)]
struct Start {
    pose: Pose,
}

#[derive(Deserialize)]
struct Reading {
    range_m: Option<f64>,
    viewpoint: Option<From>,
}

#[derive(Deserialize)]
struct From {
    x_m: f64,
    y_m: f64,
    direction_deg: f64,
}

/// Fetches a scan as a picture that is not longer than so many bytes of JSON; `None` if it can't be had.
pub(super) async fn fetch(client: &Client, scan: Uuid, most_bytes: usize) -> Option<FleetPicture> {
    let (scan_path, scene_path) = (format!("/v1/scans/{scan}"), format!("/v1/scans/{scan}/scene"));
    let both = async {
        let scan: Scan = client.get_json_within(&scan_path, MOST_BYTES).await.ok()?;
        // A scan without a scene has readings all the same.
        let scene: Option<FloorPlan> = client.get_json_within(&scene_path, MOST_BYTES).await.ok();
        Some(draw(&scan, scene.as_ref(), most_bytes))
    };
    timeout(LIMIT, both).await.ok().flatten()
}

fn draw(scan: &Scan, scene: Option<&FloorPlan>, most_bytes: usize) -> FleetPicture {
    let ends = scan.pings.iter().filter_map(|reading| {
        let (from, range_m) = (reading.viewpoint.as_ref()?, reading.range_m?);
        let (sin, cos) = from.direction_deg.to_radians().sin_cos();
        point([from.x_m + range_m * cos, from.y_m + range_m * sin])
    });
    let ends: Vec<_> = ends.collect();
    let most = MOST_POINTS.min(most_bytes / POINT_BYTES).max(1);
    let every = ends.len().div_ceil(most).max(1);
    let points_m: Vec<_> = ends.into_iter().step_by(every).collect();
    let left_bytes = most_bytes.saturating_sub(points_m.len() * POINT_BYTES);
    let walls = scene.map_or(&[][..], |scene| &scene.walls);
    // Some of the walls would be another room.
    let fits = walls.len() * WALL_BYTES <= left_bytes;
    let walls = walls.iter().filter(|_| fits);
    let walls_m = walls.filter_map(|wall| Some([point(wall.from)?, point(wall.to)?])).collect();
    FleetPicture { pose: scan.start.pose, points_m, walls_m }
}

/// A point to the millimetre, if it is one.
fn point(at: [f64; 2]) -> Option<[f64; 2]> {
    let is_near = at.iter().all(|metres| metres.abs() < FARTHEST_M);
    is_near.then(|| at.map(|metres| (metres * 1e3).round() / 1e3))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scan(readings: usize) -> Scan {
        let reading = |i: usize| Reading {
            range_m: Some(1.0 + i as f64 * 1e-4),
            viewpoint: Some(From { x_m: 0.0, y_m: 0.0, direction_deg: i as f64 }),
        };
        Scan {
            start: Start { pose: Pose { x_m: 0.5, y_m: 0.5, heading_deg: 0.0 } },
            pings: (0..readings).map(reading).collect(),
        }
    }

    #[test]
    fn a_picture_is_within_its_bytes_however_long_the_scan() {
        for (readings, most_bytes) in [(1, 100), (400, 3000), (100_000, 3000), (100_000, 100_000)] {
            let picture = draw(&scan(readings), None, most_bytes);
            let json = serde_json::to_string(&picture.points_m).expect("numbers");
            assert!(json.len() <= most_bytes, "{} of {most_bytes} bytes", json.len());
            assert!((1..=MOST_POINTS).contains(&picture.points_m.len()));
        }
    }

    #[test]
    fn a_reading_without_sense_is_not_drawn() {
        let mut scan = scan(3);
        scan.pings[0].range_m = Some(f64::INFINITY);
        scan.pings[1].range_m = None;
        let picture = draw(&scan, None, 1000);
        assert_eq!(picture.points_m, [[1.0, 0.035]]);
    }
}
