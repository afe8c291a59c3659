//! The map for viewers, compared with `sonard map` of the log.

use std::{
    fs,
    os::unix::net::UnixStream,
    path::Path,
    time::{Duration, Instant},
};

use super::{
    super as processes, start,
    viewer::{Received, Viewer},
};
use crate::common::{run, stderr};

const MAP: &str = "/map";

/// The message of the recording that `sonard map` makes of the daemon's log.
fn made_of_log(folder: &Path) -> Vec<u8> {
    let [log, out] = ["log", "map"].map(|name| folder.join(name).display().to_string());
    let made = run(&["map", &log, "--out", &out]);
    assert!(made.status.success(), "{}", stderr(&made));
    let bytes = fs::read(folder.join("map/map.mcap")).expect("written");
    let mut messages = mcap::MessageStream::new(&bytes).expect("a recording");
    messages.next().expect("one").expect("whole").data.into_owned()
}

#[test]
fn live_map_matches_the_log() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = start(folder.path(), &["--set", "foxglove.map=true"]);
    daemon.wait_for("ready");
    let mut viewer = Viewer::new(daemon.connect(), "foxglove.sdk.v1");
    let mut reported = Vec::new();
    // From place to place, so that it gets larger; from the sixth scan on each counts once.
    for (scan, x_m) in (1..).zip([0.774, 0.2, 0.5, 0.85, 0.774, 0.35]) {
        let pose = serde_json::json!({"x_m": x_m, "y_m": 0.3, "heading_deg": 10 * scan});
        assert_eq!(daemon.send("PUT", "/v1/pose", &pose.to_string()).status, 202);
        assert_eq!(daemon.send("POST", "/v1/start", r#"{"scans":1}"#).status, 202);
        daemon.wait_for_scans(scan);
        if scan == 1 {
            viewer.wait_for_channels();
            viewer.subscribe_to_all();
        }
        let came = viewer.until(MAP);
        reported.push(came.of(MAP).next().expect("a map").1.to_vec());
    }
    let last = reported.last().expect("six").clone();
    assert!(reported.windows(2).all(|pair| pair[0] != pair[1]), "each scan changes it");
    // Who comes late gets it, too.
    let mut late = Viewer::new(daemon.connect(), "foxglove.sdk.v1");
    late.wait_for_channels();
    late.subscribe_to_all();
    let kept = late.receive_for(Duration::from_secs(1));
    assert!(kept.of(MAP).map(|(_, bytes)| bytes).eq([&last[..]]));
    daemon.stop();
    assert!(last == made_of_log(folder.path()), "cell for cell");
}

#[test]
fn too_large_map() {
    let folder = tempfile::tempdir().expect("a folder");
    let walls = r#"{"name": "plain", "materials": {"brick": {"reflectance": 0.9}},
        "walls": [{"id": "wall", "from": [-400, 2], "to": [400, 2], "material": "brick"}]}"#;
    let scene = folder.path().join("plain.json");
    fs::write(&scene, walls).expect("there is room");
    let scene = scene.to_str().expect("plain path");
    let keys = ["foxglove.enabled=true", "foxglove.map=true", "model.max_range_m=3"];
    let keys = keys.iter().flat_map(|key| ["--set", key]);
    let mock = ["--mock", "--virtual-time", "--scene", scene, "--pose", "0,0,0"];
    let options: Vec<&str> = mock.into_iter().chain(keys).collect();
    let daemon = processes::Daemon::start(folder.path(), &options);
    daemon.wait_for("ready");
    let mut viewer = Viewer::new(daemon.connect().expect("it listens"), "foxglove.sdk.v1");
    let take = |scan: u64, x_m: f64| {
        let pose = serde_json::json!({"x_m": x_m, "y_m": 0, "heading_deg": 0});
        assert_eq!(daemon.send("PUT", "/v1/pose", &pose.to_string()).status, 202);
        assert_eq!(daemon.send("POST", "/v1/start", r#"{"scans":1}"#).status, 202);
        daemon.wait_for_scans(scan);
    };
    take(1, -390.0);
    viewer.wait_for_channels();
    viewer.subscribe_to_all();
    drop(viewer.until(MAP));
    take(2, 390.0);
    let reported = receive_for(&mut viewer, Duration::from_secs(2));
    let printed =
        |words: &String| words.contains("live map stopped") && words.contains("sonard map");
    assert!(reported.words.iter().any(printed), "{:?}", reported.words);
    assert_eq!((reported.of(MAP).count(), reported.of("/sonar/points").count()), (0, 1));
    take(3, -390.0);
    let reported = receive_for(&mut viewer, Duration::from_secs(2));
    assert!(!reported.words.iter().any(printed), "reported once: {:?}", reported.words);
    assert_eq!((reported.of(MAP).count(), reported.of("/sonar/points").count()), (0, 1));
    assert_eq!(daemon.stop(), Some(0));
}

/// All that comes from a process within a span of time.
fn receive_for(viewer: &mut Viewer<UnixStream>, span: Duration) -> Received {
    let until = Instant::now() + span;
    let limit = Some(Duration::from_millis(200));
    viewer.socket.get_ref().set_read_timeout(limit).expect("a socket");
    let reported = viewer.receive_while(|_| Instant::now() < until);
    let limit = Some(Duration::from_secs(20));
    viewer.socket.get_ref().set_read_timeout(limit).expect("a socket");
    reported
}
