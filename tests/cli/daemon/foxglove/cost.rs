//! Cost of viewers, and isolation from viewers that do not read.

use std::time::{Duration, Instant};

use sonard_test_support::in_process::{Connection, Daemon};

use super::{
    super::{self as processes, own_kb},
    start,
    viewer::Viewer,
};
use crate::common::{cpu_s, wait_until};

/// A daemon that scans without a rest.
fn busy(folder: &std::path::Path, further: &[&str]) -> Daemon {
    let scanning = ["--set", "scanning.mode=continuous"];
    start(folder, &[&scanning, further].concat())
}

fn viewer(daemon: &Daemon) -> Viewer<Connection> {
    let mut viewer = Viewer::new(daemon.connect(), "foxglove.sdk.v1");
    viewer.wait_for_channels();
    viewer.subscribe_to_all();
    viewer
}

#[test]
fn stalled_viewer_gets_a_count() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = busy(
        folder.path(),
        &["--set", "foxglove.queue_kb=16", "--set", "server.write_timeout_s=60"],
    );
    let mut slow = viewer(&daemon);
    let before = daemon.health()["scans"]["completed"].as_u64().expect("a count");
    // More than sockets take in between.
    daemon.wait_for_scans(before + 40);
    let reported = slow.receive_for(Duration::from_secs(3));
    let left_out = |words: &String| words.ends_with(" messages left out");
    assert!(reported.words.iter().any(left_out), "{:?}", reported.words);
    assert!(reported.of("/sonar/range").count() > 0);
    drop(slow.until("/sonar/points"));
    daemon.stop();
}

#[test]
fn dead_viewers_are_disconnected() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = busy(folder.path(), &["--set", "server.write_timeout_s=3"]);
    let mut awake = viewer(&daemon);
    // Until as much waits as may.
    drop(awake.receive_for(Duration::from_secs(8)));
    let asleep: Vec<_> = (0..7).map(|_| viewer(&daemon)).collect();
    let cut_off = || daemon.status()["subscribers"]["cut_off"].as_u64();
    for _ in 0..130 {
        if cut_off() == Some(7) {
            break;
        }
        assert!(awake.receive_for(Duration::from_millis(300)).of("/tf").count() > 0);
    }
    assert_eq!(cut_off(), Some(7));
    assert_eq!(daemon.health()["scans"]["stopped"], 0);
    drop(asleep);
    daemon.stop();
}

/// Prints what one viewer of all topics costs a daemon that scans in real time: `--run-ignored all`.
#[test]
#[ignore = "takes two minutes, and prints figures"]
fn figures_of_one_viewer() {
    let folder = tempfile::tempdir().expect("a folder");
    let settings = [
        "--set",
        "scanning.mode=continuous",
        "--set",
        "model.max_range_m=4",
        "--set",
        "foxglove.enabled=true",
    ];
    let daemon = processes::Daemon::start_mock(folder.path(), &settings);
    daemon.wait_for_scans(1);
    let share = |daemon: &processes::Daemon| {
        let (before, since) = (cpu_s(daemon.id()), Instant::now());
        std::thread::sleep(Duration::from_secs(40));
        100.0 * (cpu_s(daemon.id()) - before) / since.elapsed().as_secs_f64()
    };
    let (alone, alone_kb) = (share(&daemon), own_kb(daemon.id()));
    let connection = daemon.connect().expect("it listens");
    let mut viewer = Viewer::new(connection, "foxglove.sdk.v1");
    viewer.wait_for_channels();
    viewer.subscribe_to_all();
    let watching = std::thread::spawn(move || {
        let reported = {
            let until = Instant::now() + Duration::from_secs(45);
            viewer.receive_while(|_| Instant::now() < until)
        };
        let topics: Vec<String> = reported
            .topics()
            .map(|topic| format!("{topic} {}", reported.of(topic).count()))
            .collect();
        let bytes: usize = reported
            .topics()
            .flat_map(|topic| reported.of(topic).map(|(_, bytes)| bytes.len()).collect::<Vec<_>>())
            .sum();
        (topics, bytes, reported.words)
    });
    wait_until("the viewer", || daemon.status()["subscribers"]["now"] == 1);
    let (watched, watched_kb) = (share(&daemon), own_kb(daemon.id()));
    let (topics, bytes, words) = watching.join().expect("no panic");
    println!(
        "{alone:.2} % of a core and {alone_kb} kB without a viewer, {watched:.2} % and {watched_kb} kB with one of all \
         topics; {bytes} bytes in 45 s: {topics:?}; {words:?}"
    );
    assert_eq!(daemon.stop(), Some(0));
}
