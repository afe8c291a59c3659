//! Viewpoints of readings in the API: of an array, and of a transducer beside its axis.

use std::io::{BufRead as _, BufReader, Write as _};

use serde_json::Value;
use sonard_test_support::in_process;

use super::Reply;

/// The newest scan that has ended, by a function that sends GET requests.
fn newest(get: impl Fn(&str) -> Reply) -> Value {
    let scans = get("/v1/scans").json();
    let over = scans.as_array().expect("scans").iter().find(|scan| !scan["end"].is_null());
    let id = over.expect("a scan that is over")["scan"].as_str().expect("an id").to_owned();
    get(&format!("/v1/scans/{id}")).json()
}

fn point(of: &Value) -> [f64; 2] {
    [0, 1].map(|axis| of[axis].as_f64().expect("a coordinate"))
}

fn distance([x, y]: [f64; 2], [u, v]: [f64; 2]) -> f64 {
    (x - u).hypot(y - v)
}

/// Viewpoint of a reading: position, and direction in degrees.
fn viewpoint(reading: &Value) -> ([f64; 2], f64) {
    let number = |name: &str| reading["viewpoint"][name].as_f64().expect("a figure");
    ([number("x_m"), number("y_m")], number("direction_deg"))
}

/// Checks that each path begins and ends at its transducer, and that half its length is the range except for
/// the time walk that `late_m` allows for a margin over the threshold, decibels. Returns the number of echoes.
fn check_paths(get: impl Fn(&str) -> Reply, whole: &Value, late_m: impl Fn(f64) -> f64) -> usize {
    let mut received = 0;
    for reading in whole["pings"].as_array().expect("readings") {
        let scan = reading["scan"].as_str().expect("an id");
        let beam = get(&format!("/v1/scans/{scan}/beams/{}", reading["index"])).json();
        assert_eq!(&beam["reading"], reading);
        let Some(range_m) = reading["range_m"].as_f64() else { continue };
        let points: Vec<[f64; 2]> =
            beam["polyline"].as_array().expect("a path").iter().map(point).collect();
        let (from, _) = viewpoint(reading);
        for end in [points[0], points[points.len() - 1]] {
            assert!(distance(end, from) < 1e-9, "{reading}: its path ends at {end:?}");
        }
        let length_m: f64 = points.windows(2).map(|leg| distance(leg[0], leg[1])).sum();
        let over_db = reading["margin_db"].as_f64().or(reading["sim"]["margin_db"].as_f64());
        let late = range_m - length_m / 2.0;
        let most = late_m(over_db.expect("a margin"));
        assert!((-1e-3..=most).contains(&late), "{reading}: {late} m beyond its path");
        received += 1;
    }
    received
}

/// Time walk: delay of the detection after the path's length, metres. Weak echoes rise slowly to the
/// threshold; those of the tests' rooms, 20 dB above it and more, within 4 mm.
fn time_walk_m(over_db: f64) -> f64 {
    if over_db > 20.0 { 4e-3 } else { 35e-3 }
}

/// Engines that know no envelopes time echoes by their paths alone.
const FAN: [&str; 2] = ["--set", "model.engine=fan"];
const CONE: [&str; 2] = ["--set", "model.engine=cone"];

#[test]
fn positions_of_an_array() {
    for (further, late_m) in [(&[][..], time_walk_m as fn(f64) -> f64), (&FAN, |_| 1e-3)] {
        let folder = tempfile::tempdir().expect("a folder");
        let daemon = in_process::start_array(folder.path(), further);
        daemon.wait_for_scans(1);
        let whole = newest(|path| daemon.get(path));
        assert!(check_paths(|path| daemon.get(path), &whole, late_m) >= 6);
        let robot = &whole["start"]["pose"];
        let [x_m, y_m, heading_deg] =
            ["x_m", "y_m", "heading_deg"].map(|name| robot[name].as_f64().expect("a figure"));
        let (sin, cos) = heading_deg.to_radians().sin_cos();
        let rangers = whole["session"]["array"]["rangers"].as_array().expect("rangers");
        for (reading, ranger) in whole["pings"].as_array().expect("readings").iter().zip(rangers) {
            assert_eq!(reading["ranger"], ranger["id"]);
            let [ahead_m, left_m, bearing_deg] =
                ["x_m", "y_m", "bearing_deg"].map(|name| ranger[name].as_f64().expect("a figure"));
            let place = [x_m + cos * ahead_m - sin * left_m, y_m + sin * ahead_m + cos * left_m];
            let (seen, direction_deg) = viewpoint(reading);
            assert!(distance(seen, place) < 1e-9, "{reading}");
            let off_deg = (direction_deg - heading_deg - bearing_deg).rem_euclid(360.0);
            assert!(off_deg.min(360.0 - off_deg) < 1e-9, "{reading}");
        }
    }
}

#[test]
fn offset_transducer() {
    for (further, late_m) in [(&[][..], time_walk_m as fn(f64) -> f64), (&CONE, |_| 1e-3)] {
        let folder = tempfile::tempdir().expect("a folder");
        let plan = ["--set", "plan.step_deg=18", "--set", "model.max_range_m=4"];
        let daemon = in_process::start_ahead(folder.path(), &[&plan, further].concat());
        daemon.wait_for("ready");
        let mut live = daemon.connect();
        let request = "GET /v1/live/records?verdicts=true HTTP/1.1\r\nHost: localhost\r\n\r\n";
        live.write_all(request.as_bytes()).expect("it listens");
        daemon.wait_until("the stream", || daemon.status()["subscribers"]["now"] == 1);
        assert_eq!(daemon.send("POST", "/v1/start", r#"{"scans":1}"#).status, 202);
        let reported: Vec<Value> = BufReader::new(live)
            .lines()
            .filter_map(|line| serde_json::from_str(&line.ok()?).ok())
            .take_while(|record: &Value| record["type"] != "scan_end")
            .filter(|record| record["type"] == "ping")
            .collect();
        daemon.wait_for_scans(1);
        let whole = newest(|path| daemon.get(path));
        assert!(check_paths(|path| daemon.get(path), &whole, late_m) >= 10);
        let readings = whole["pings"].as_array().expect("readings");
        assert_eq!(reported.len(), readings.len());
        for (live, reading) in reported.iter().zip(readings) {
            assert_eq!(live["viewpoint"], reading["viewpoint"]);
            let (from, direction_deg) = viewpoint(reading);
            let (sin, cos) = direction_deg.to_radians().sin_cos();
            let face = [1.2 + 0.1 * cos, 1.0 + 0.1 * sin];
            assert!(distance(from, face) < 1e-9, "{reading}");
        }
    }
}
