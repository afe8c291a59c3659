//! Many subscribers, and figures of CPU time and memory (`figures_`, run with `--run-ignored all`).

use std::{
    io::{BufRead as _, BufReader, Write as _},
    sync::atomic::{AtomicBool, Ordering},
    time::{Duration, Instant},
};

use jiff::Timestamp;
use serde_json::Value;
use sonard::mock::Pace;

use super::{Daemon, clean_log, memory_kb, own_kb, resident_kb, rig::Rig};
use crate::common::{SetOnDrop, cpu_s, wait_until};

/// Share of a core that a process used over a while.
fn core_share(daemon: &Daemon, over: Duration) -> f64 {
    let (before, since) = (cpu_s(daemon.id()), Instant::now());
    std::thread::sleep(over);
    (cpu_s(daemon.id()) - before) / since.elapsed().as_secs_f64()
}

fn start(rig: &Rig, folder: &std::path::Path, further: &[&str]) -> Daemon {
    let options = rig.options();
    let options: Vec<&str> = options.iter().map(String::as_str).collect();
    Daemon::start(folder, &[&options[..], &["--set", "link.status_interval_s=5"], further].concat())
}

#[test]
#[ignore = "prints figures"]
fn figures_of_cpu_and_memory() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut rig = Rig::new(folder.path(), Pace::RealTime);
    rig.plug("", 1);
    let began = Timestamp::now();
    let daemon = start(&rig, folder.path(), &["--set", "model.max_range_m=10"]);
    daemon.wait_for("ready");
    let idle = core_share(&daemon, Duration::from_secs(5));
    assert_eq!(daemon.send("POST", "/v1/start", r#"{"scans":2}"#).status, 202);
    // Before the first beam at a new position the model computes its predictions once.
    wait_until("a beam", || daemon.status()["scan"]["done"].as_u64() >= Some(1));
    let predicted_s = cpu_s(daemon.id());
    let scanning = core_share(&daemon, Duration::from_secs(10));
    let kb = own_kb(daemon.id());
    assert_eq!(daemon.stop(), Some(0));
    println!(
        "idle {:.2} %, scanning {:.2} % of a core, {kb} kB of its own; {predicted_s:.2} s of CPU until \
         the first beam",
        idle * 100.0,
        scanning * 100.0
    );

    let second = tempfile::tempdir().expect("a folder");
    rig.plug("", 2);
    let again = Timestamp::now();
    let daemon = start(&rig, second.path(), &["--set", "scanning.mode=continuous"]);
    wait_until("a beam", || daemon.status()["scan"]["done"].as_u64() >= Some(1));
    let own_s = cpu_s(daemon.id());
    assert_eq!(daemon.stop(), Some(0));
    let log = clean_log(second.path());
    let first: Timestamp =
        log.pings()[0]["time"].as_str().expect("a time").parse().expect("a time");
    let waited_s = first.duration_since(again).as_secs_f64();
    println!("first ping {waited_s:.2} s after the start, {own_s:.2} s of CPU; begun {began}");
}

#[test]
fn dead_subscribers() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut rig = Rig::new(folder.path(), Pace::RealTime);
    rig.plug("", 1);
    let further = [
        "scanning.mode=continuous",
        "model.max_range_m=0.6",
        "motion.min_interval_ms=8",
        "plan.pings_per_stop=20",
        "server.write_timeout_s=2",
        "server.queue=64",
    ];
    let further: Vec<&str> = further.iter().flat_map(|setting| ["--set", setting]).collect();
    let daemon = start(&rig, folder.path(), &further);
    daemon.wait_for("scanning");
    let alone_kb = own_kb(daemon.id());
    let subscribe = || {
        let mut stream = daemon.connect().expect("it listens");
        let request = b"GET /v1/live/records HTTP/1.1\r\nHost: localhost\r\n\r\n";
        stream.write_all(request).expect("it listens");
        stream
    };
    let dead: Vec<_> = (0..10).map(|_| subscribe()).collect();
    let until = Instant::now() + Duration::from_secs(15);
    let living: Vec<_> = (0..90)
        .map(|_| {
            let stream = BufReader::new(subscribe());
            std::thread::spawn(move || lateness_ms(stream, until))
        })
        .collect();
    wait_until("everybody", || daemon.status()["subscribers"]["now"] == 100);
    let crowded_kb = own_kb(daemon.id());
    wait_until("the dead ones to be cut off", || daemon.status()["subscribers"]["cut_off"] == 10);
    let subscribers = daemon.status()["subscribers"].clone();
    let mut late_ms: Vec<f64> =
        living.into_iter().flat_map(|one| one.join().expect("no panic")).collect();
    late_ms.sort_by(f64::total_cmp);
    let end_kb = own_kb(daemon.id());
    drop(dead);
    let percentile = |p: f64| late_ms[(p * (late_ms.len() - 1) as f64) as usize];
    println!(
        "{} readings at 90 subscribers: {:.1} ms late in the middle, {:.1} ms at 95 %; {subscribers}; \
         {alone_kb} kB of its own alone, {crowded_kb} kB with 100, {end_kb} kB in the end",
        late_ms.len(),
        percentile(0.5),
        percentile(0.95),
    );
    assert!(!late_ms.is_empty(), "the others get readings");
    assert_eq!(subscribers["now"], 90, "the others are still there");
    assert_eq!(daemon.stop(), Some(0));
}

/// Delays of readings after the end of their receive window, milliseconds.
fn lateness_ms(stream: impl std::io::Read, until: Instant) -> Vec<f64> {
    let mut late_ms = Vec::new();
    for line in BufReader::new(stream).lines().map_while(Result::ok) {
        if Instant::now() > until {
            break;
        }
        let Ok(record) = serde_json::from_str::<Value>(&line) else { continue };
        let Some(time) = record["time"].as_str().filter(|_| record["type"] == "ping") else {
            continue;
        };
        let fired: Timestamp = time.parse().expect("a time");
        // 0.6 m there and back take 3.5 ms.
        late_ms.push(Timestamp::now().duration_since(fired).as_secs_f64() * 1e3 - 3.5);
    }
    late_ms
}

/// Beams of the largest scans here: 400 stops, 160 firings at each.
const MANY_BEAMS: u64 = 64_000;

/// Reads a stream slowly, as over a poor line, until the flag is set.
fn read_slowly(mut stream: impl std::io::Read, over: &AtomicBool) {
    let mut piece = [0; 4096];
    while !over.load(Ordering::Relaxed) && stream.read(&mut piece).is_ok_and(|count| count > 0) {
        std::thread::sleep(Duration::from_millis(100));
    }
}

/// Most memory that a process has had since `forget_peak`, kilobytes.
fn peak_kb(process: u32) -> u64 {
    memory_kb(process, "VmHWM:")
}

fn forget_peak(process: u32) {
    std::fs::write(format!("/proc/{process}/clear_refs"), "5").expect("it is ours");
}

fn ask_for(daemon: &Daemon, path: &str) -> std::os::unix::net::UnixStream {
    let mut stream = daemon.connect().expect("it listens");
    let request = format!("GET {path} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
    stream.write_all(request.as_bytes()).expect("it listens");
    stream
}

/// A log with a scan of very many beams, taken while 100 subscribers to whole scans read slowly.
#[test]
fn large_scans_to_slow_clients() {
    let folder = tempfile::tempdir().expect("a folder");
    let many =
        ["--virtual-time", "--set", "plan.pings_per_stop=160", "--set", "model.max_range_m=1"];
    let daemon = Daemon::start_mock(
        folder.path(),
        &[&many[..], &["--set", "server.write_timeout_s=30"]].concat(),
    );
    daemon.wait_for("ready");
    let over = AtomicBool::new(false);
    let (idle_kb, taken_kb) = std::thread::scope(|scope| {
        let _end = SetOnDrop(&over);
        forget_peak(daemon.id());
        let idle_kb = resident_kb(daemon.id());
        for at in 0..100 {
            let moved = if at % 10 == 0 { "?moved_m=0.01" } else { "" };
            let stream = ask_for(&daemon, &format!("/v1/live/scans{moved}"));
            let over = &over;
            scope.spawn(move || read_slowly(stream, over));
        }
        wait_until("the subscribers", || daemon.status()["subscribers"]["now"] == 100);
        assert_eq!(daemon.send("POST", "/v1/start", r#"{"scans":1}"#).status, 202);
        daemon.wait_for_scans(1);
        // The scan goes out to all of them meanwhile.
        std::thread::sleep(Duration::from_secs(5));
        (idle_kb, peak_kb(daemon.id()))
    });
    let beams = daemon.health()["scans"]["beams"].as_u64();
    assert_eq!(beams, Some(MANY_BEAMS));
    println!("idle {idle_kb} kB; {taken_kb} kB with 100 slow subscribers of {MANY_BEAMS} beams");
    assert_eq!(daemon.stop(), Some(0));

    // A second daemon measures in real time while clients request that scan.
    let mut rig = Rig::new(folder.path(), Pace::RealTime);
    rig.plug("", 1);
    let further = [
        "scanning.mode=continuous",
        "model.max_range_m=0.6",
        "motion.min_interval_ms=8",
        "server.write_timeout_s=30",
    ];
    let further: Vec<&str> = further.iter().flat_map(|setting| ["--set", setting]).collect();
    let daemon = start(&rig, folder.path(), &further);
    daemon.wait_for("scanning");
    forget_peak(daemon.id());
    let idle_kb = resident_kb(daemon.id());
    let scans = daemon.get("/v1/scans").json();
    let large = scans
        .as_array()
        .into_iter()
        .flatten()
        .find(|scan| scan["end"]["beams"].as_u64() == Some(MANY_BEAMS));
    let path =
        format!("/v1/scans/{}", large.expect("the large scan")["scan"].as_str().expect("an id"));
    let over = AtomicBool::new(false);
    let mut late_ms = std::thread::scope(|scope| {
        let _end = SetOnDrop(&over);
        for _ in 0..10 {
            let (stream, over) = (ask_for(&daemon, &path), &over);
            scope.spawn(move || read_slowly(stream, over));
        }
        for _ in 0..90 {
            let (stream, over) = (ask_for(&daemon, "/v1/live/scans"), &over);
            scope.spawn(move || read_slowly(stream, over));
        }
        let until = Instant::now() + Duration::from_secs(15);
        let readings = ask_for(&daemon, "/v1/live/records");
        let late_ms = scope.spawn(move || lateness_ms(readings, until));
        let whole = daemon.get(&path);
        assert_eq!(whole.status, 200);
        assert_eq!(whole.json()["pings"].as_array().map(Vec::len), Some(MANY_BEAMS as usize));
        late_ms.join().expect("no panic")
    });
    late_ms.sort_by(f64::total_cmp);
    let late = late_ms[late_ms.len() * 95 / 100];
    let asked_kb = peak_kb(daemon.id());
    println!(
        "idle {idle_kb} kB; {asked_kb} kB with the scan requested at once and ten times slowly; {} \
         readings, {late:.1} ms late at 95 %",
        late_ms.len()
    );
    assert!(!late_ms.is_empty(), "readings go on");
    assert_eq!(daemon.stop(), Some(0));
}
