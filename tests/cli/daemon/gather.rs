//! Logs of many daemons in one folder, whatever happens to them and to who gathers.

mod liars;

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Child, Output, Stdio},
    time::Duration,
};

use rustix::process::{Pid, Signal, kill_process};
use serde_json::{Value, json};

use super::{Daemon, clean_log, logs, memory_kb};
use crate::common::{Log, run, sonard, stderr, wait_until};

/// A small plan, taken faster than in real time.
const PLAN: [&str; 5] =
    ["--virtual-time", "--set", "model.max_range_m=3", "--set", "plan.to_deg=36"];

/// A robot with a folder of its own.
fn start(folder: &Path, robot: &str, further: &[&str]) -> Daemon {
    drop(fs::create_dir(folder));
    let robot = format!("fleet.robot={robot}");
    Daemon::start_mock(folder, &[&PLAN[..], &["--set", &robot], further].concat())
}

fn take_scans(daemon: &Daemon, scans: u64) {
    daemon.wait_for("ready");
    let before = daemon.health()["scans"]["completed"].as_u64().expect("a count");
    assert_eq!(daemon.send("POST", "/v1/start", &json!({"scans": scans}).to_string()).status, 202);
    daemon.wait_for_scans(before + scans);
    // The end of the last scan is in the log.
    wait_until("the log", || {
        let log = daemon.status()["log"].clone();
        log["synced"].as_u64() >= log["written"].as_u64()
    });
}

fn socket(folder: &Path) -> String {
    folder.join("s").display().to_string()
}

/// The arguments that gather from these robots' folders into another.
fn arguments(folders: &[&Path], out: &Path, further: &[&str]) -> Vec<String> {
    let sockets = folders.iter().flat_map(|folder| ["--socket".to_owned(), socket(folder)]);
    let out = ["--out".to_owned(), out.display().to_string()];
    let further = further.iter().map(|word| (*word).to_owned());
    ["gather".to_owned()].into_iter().chain(sockets).chain(out).chain(further).collect()
}

fn words(arguments: &[String]) -> Vec<&str> {
    arguments.iter().map(String::as_str).collect()
}

fn gather(folders: &[&Path], out: &Path, further: &[&str]) -> Output {
    run(&words(&arguments(folders, out, further)))
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn file_names(paths: &[PathBuf]) -> Vec<&std::ffi::OsStr> {
    paths.iter().map(|path| path.file_name().expect("a name")).collect()
}

/// The gathered logs of a robot.
fn gathered(out: &Path, robot: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir(out.join(robot)).expect("a folder").flatten();
    let mut found: Vec<_> = entries.map(|entry| entry.path()).collect();
    found.retain(|path| path.extension().is_some_and(|ending| ending == "jsonl"));
    found.sort();
    found
}

fn text_of(logs: &[PathBuf]) -> String {
    logs.iter().map(|log| fs::read_to_string(log).expect("readable")).collect()
}

/// Whether a robot's logs are here what they are there, byte by byte.
fn is_same(out: &Path, robot: &str, folder: &Path) -> bool {
    let (here, there) = (gathered(out, robot), logs(folder));
    file_names(&here) == file_names(&there) && text_of(&here) == text_of(&there)
}

/// The same told record by record, so that a difference is seen.
fn assert_same(out: &Path, robot: &str, folder: &Path) {
    let here = Log::parse(&text_of(&gathered(out, robot))).records;
    let there = clean_log(folder).records;
    for (number, (here, there)) in here.iter().zip(&there).enumerate() {
        assert_eq!(here, there, "record {number} of {robot}");
    }
    assert_eq!(here.len(), there.len(), "{robot}");
    assert!(is_same(out, robot, folder), "{robot}");
}

#[test]
fn the_logs_of_three_robots_become_one_data_set_record_by_record() {
    let folder = tempfile::tempdir().expect("a folder");
    let own = ["kiwi", "lime", "mango"].map(|name| folder.path().join(name));
    let out = folder.path().join("all/history");
    // One begins another log with nearly each scan.
    let kiwi = start(&own[0], "kiwi", &["--set", "log.rotate_mb=0.01"]);
    let lime = start(&own[1], "lime", &[]);
    let mango = start(&own[2], "mango", &[]);
    take_scans(&kiwi, 4);
    take_scans(&lime, 3);
    take_scans(&mango, 2);
    assert!(logs(&own[0]).len() > 2);
    let places = own.each_ref().map(PathBuf::as_path);
    let output = gather(&places, &out, &[]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    for (robot, own) in ["kiwi", "lime", "mango"].iter().zip(&own) {
        assert_same(&out, robot, own);
    }
    // Again: nothing is there to be taken, and nothing is touched.
    let ledger =
        |robot: &str| fs::read(out.join(robot).join("gathered.json")).expect("it is there");
    let before = ledger("lime");
    let output = gather(&places, &out, &["--json"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    for line in said(&output).lines() {
        let told: Value = serde_json::from_str(line).expect("JSON");
        assert_eq!((&told["records"], &told["wrong"]), (&json!(0), &Value::Null), "{told}");
    }
    assert_eq!(ledger("lime"), before);
    // More of one, while another is away: that one is told, and the others are taken.
    take_scans(&lime, 2);
    assert_eq!(mango.stop(), Some(0));
    let output = gather(&places, &out, &["--json"]);
    assert_eq!(output.status.code(), Some(3), "{}", stderr(&output));
    let told: Vec<Value> =
        said(&output).lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    assert_eq!(told[1]["scans"], 2, "{told:?}");
    assert_eq!(told[2]["state"], "silent", "{told:?}");
    assert!(stderr(&output).contains("no daemon answers"), "{}", stderr(&output));
    assert_same(&out, "lime", &own[1]);

    // All of it as one data set, each reading once.
    let readings: usize = own
        .iter()
        .map(|own| clean_log(own).records.iter().filter(|one| one["type"] == "ping").count())
        .sum();
    let history = out.to_str().expect("plain path");
    let table = folder.path().join("all.csv");
    let output = run(&["export", history, "-o", table.to_str().expect("plain path")]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let table = fs::read_to_string(table).expect("written");
    assert_eq!(table.lines().count(), readings + 1);
    for robot in ["kiwi/sonard-", "lime/sonard-", "mango/sonard-"] {
        assert!(table.contains(robot), "{robot}");
    }
    for format in ["parquet", "mcap"] {
        let file = folder.path().join(format!("all.{format}"));
        let output = run(&["export", history, "-o", file.to_str().expect("plain path")]);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        let told = format!("11 scans, {readings} readings");
        assert!(stderr(&output).contains(&told), "{told}: {}", stderr(&output));
    }
    let output = run(&["compare", history, "--json"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    drop((kiwi, lime));
}

fn spawn(arguments: &[String]) -> Child {
    sonard(&words(arguments))
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("the program starts")
}

#[test]
fn killed_at_any_moment_it_goes_on_where_it_stood() {
    let folder = tempfile::tempdir().expect("a folder");
    let (own, out) = (folder.path().join("kiwi"), folder.path().join("history"));
    let busy = ["--set", "scanning.mode=continuous", "--set", "log.rotate_mb=2"];
    let kiwi = start(&own, "kiwi", &busy);
    kiwi.wait_for_scans(1500);
    assert_eq!(kiwi.send("POST", "/v1/stop", "{}").status, 202);
    let arguments = arguments(&[&own], &out, &[]);
    let bytes = |path: &PathBuf| fs::metadata(path).map_or(0, |file| file.len());
    let (mut kills, mut sizes) = (0, Vec::new());
    for after_ms in (0..).map(|number| 10 + 6 * number) {
        let mut gathering = spawn(&arguments);
        std::thread::sleep(Duration::from_millis(after_ms));
        if gathering.try_wait().expect("it is ours").is_some() {
            break;
        }
        gathering.kill().expect("it runs");
        gathering.wait().expect("it ends");
        kills += 1;
        let there = out.join("kiwi").is_dir();
        sizes.push(if there { gathered(&out, "kiwi").iter().map(bytes).sum::<u64>() } else { 0 });
    }
    println!("killed {kills} times, bytes: {sizes:?}");
    assert!(kills > 5, "{kills}");
    let till_same = || {
        // What was measured last may be on its way to the log.
        wait_until("the same", || {
            let output = run(&words(&arguments));
            assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
            is_same(&out, "kiwi", &own)
        });
        assert_same(&out, "kiwi", &own);
    };
    till_same();
    // Somebody cut a copy, and removed another: they are taken again.
    let here = gathered(&out, "kiwi");
    fs::write(&here[0], "{\"type\":").expect("writes");
    fs::remove_file(&here[1]).expect("it is there");
    till_same();
}

#[test]
fn followed_robots_may_be_killed_and_come_back() {
    let folder = tempfile::tempdir().expect("a folder");
    let own = ["kiwi", "lime"].map(|name| folder.path().join(name));
    let out = folder.path().join("history");
    let busy = ["--set", "scanning.mode=continuous"];
    let kiwi = start(&own[0], "kiwi", &busy);
    let lime = start(&own[1], "lime", &[]);
    let places = own.each_ref().map(PathBuf::as_path);
    let mut following = spawn(&arguments(&places, &out, &["--follow"]));
    let bytes = || {
        gathered(&out, "kiwi").iter().map(|log| log.metadata().map_or(0, |m| m.len())).sum::<u64>()
    };
    wait_until("some", || out.join("kiwi").is_dir() && bytes() > 500_000);
    kiwi.kill();
    take_scans(&lime, 3);
    wait_until("the other", || out.join("lime").is_dir() && is_same(&out, "lime", &own[1]));
    // Its log was torn perhaps, and goes on with what it says of that.
    let kiwi = start(&own[0], "kiwi", &[]);
    take_scans(&kiwi, 2);
    wait_until("all of both", || is_same(&out, "kiwi", &own[0]) && is_same(&out, "lime", &own[1]));
    let pid = Pid::from_raw(following.id().cast_signed()).expect("a process id");
    kill_process(pid, Signal::INT).expect("it runs");
    assert_eq!(following.wait().expect("it ends").code(), Some(0));
    assert_same(&out, "kiwi", &own[0]);
    assert_same(&out, "lime", &own[1]);
}

#[test]
fn another_robot_is_named_and_never_mixed() {
    let folder = tempfile::tempdir().expect("a folder");
    let own = ["a", "b"].map(|name| folder.path().join(name));
    let out = folder.path().join("history");
    let tcp = ["--set", "server.listen=127.0.0.1:0"];
    let one = start(&own[0], "kiwi", &tcp);
    let other = start(&own[1], "kiwi", &[]);
    take_scans(&one, 1);
    take_scans(&other, 1);
    let refused = |output: &Output, part: &str| {
        assert_eq!(output.status.code(), Some(3), "{}", stderr(output));
        assert!(stderr(output).contains(part), "{part}: {}", stderr(output));
    };
    // Two of one name: neither.
    refused(&gather(&[&own[0], &own[1]], &out, &[]), "says that it is kiwi, too");
    assert!(!out.join("kiwi").exists());
    // One was taken: the other is not it.
    assert_eq!(gather(&[&own[0]], &out, &[]).status.code(), Some(0));
    let before = text_of(&gathered(&out, "kiwi"));
    refused(&gather(&[&own[1]], &out, &[]), "is not the log that was taken before");
    assert_eq!(text_of(&gathered(&out, "kiwi")), before);
    // Another than the one that was named.
    wait_until("its address", || one.said().contains("http://"));
    let named = format!("lime={}", one.address());
    let history = out.to_str().expect("plain path");
    refused(
        &run(&["gather", "--address", &named, "--out", history]),
        "kiwi answers in place of lime",
    );
    assert!(!out.join("lime").exists());
    // Another at the same place, unless that is what was meant.
    assert_eq!(one.stop(), Some(0));
    fs::remove_dir_all(own[0].join("log")).expect("it is there");
    let plum = start(&own[0], "plum", &[]);
    take_scans(&plum, 1);
    refused(&gather(&[&own[0]], &out, &[]), "plum answers where kiwi was before");
    assert!(!out.join("plum").exists());
    let list = folder.path().join("fleet.toml");
    let entry = format!("[[daemon]]\nrobot = \"plum\"\nsocket = {:?}\n", socket(&own[0]));
    fs::write(&list, entry).expect("writes");
    let output = run(&["gather", "--fleet", list.to_str().expect("plain path"), "--out", history]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert_same(&out, "plum", &own[0]);
    assert_eq!(text_of(&gathered(&out, "kiwi")), before);
    // A folder that a daemon logs to, or one below.
    for inner in ["log", "log/deep/er"] {
        let output = gather(&[&own[0]], &own[1].join(inner), &[]);
        assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
        assert!(stderr(&output).contains("a folder of logs"), "{}", stderr(&output));
    }
}

#[test]
fn a_part_of_a_log_can_be_asked_for() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = start(folder.path(), "kiwi", &[]);
    take_scans(&daemon, 1);
    let log = logs(folder.path()).remove(0);
    let path = format!("/v1/logs/{}", log.file_name().expect("a name").to_string_lossy());
    let whole = fs::read(&log).expect("readable");
    let get = |range: &str| {
        let headers = [("Host", "localhost"), ("Range", range)];
        super::ask(daemon.connect().expect("it listens"), "GET", &path, &headers, "")
    };
    let reply = get("bytes=100-");
    assert_eq!((reply.status, &reply.body[..]), (206, &whole[100..]));
    let range = format!("content-range: bytes 100-{}/{}", whole.len() - 1, whole.len());
    assert!(reply.head.contains(&range), "{}", reply.head);
    // What need not be understood is answered with the whole.
    for other in
        ["bytes=-5", "bytes=0-1,3-4", "lines=1-", "bytes=x-", "bytes=99999999999999999999-"]
    {
        let reply = get(other);
        assert_eq!((reply.status, reply.body.len()), (200, whole.len()), "{other}");
    }
    assert_eq!(get(&format!("bytes={}-", whole.len())).status, 416);
}
