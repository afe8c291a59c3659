//! Signals, crashes, power cuts, full disks, rangers that go away.
//!
//! `SONARD_COLLECT_KILLS=200 cargo test --release --test cli collect::interrupted -- --nocapture`
//! for more.

use std::{
    env, fs,
    process::{Child, Stdio},
    time::Duration,
};

use rand::{RngExt as _, SeedableRng as _};

use super::{Case, joined_stderr};
use crate::{
    common::{MockProcess, interrupt, sonard, stderr, wait_until},
    daemon::rig::limit_files,
};

fn spawn(case: &Case, further: &[&str]) -> Child {
    let arguments = case.arguments(further);
    sonard(&arguments.iter().map(String::as_str).collect::<Vec<_>>())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts")
}

#[test]
fn resumes_after_kill() {
    let kills = env::var("SONARD_COLLECT_KILLS").ok().and_then(|n| n.parse().ok()).unwrap_or(24);
    let repeats = kills / 2 + 4;
    let case = Case::new(&format!(
        "[collection]\nrepeats = {repeats}\norder = \"random\"\n[poses]\nlist = [\"fig9\", \"fig7\"]\n"
    ));
    let mut random = rand_pcg::Pcg32::seed_from_u64(11);
    let mut torn = 0;
    for _ in 0..kills {
        let before = if case.path("out/scans").exists() { case.files("scans").len() } else { 0 };
        let mut child = spawn(&case, &["--realtime", "--set", "plan.to_deg=36"]);
        // Not before it has come to something: a scan under way, or one more that counts.
        wait_until("a scan", || {
            case.path("out/in-progress").exists() && !case.files("in-progress").is_empty()
                || case.path("out/scans").exists() && case.files("scans").len() > before
        });
        std::thread::sleep(Duration::from_millis(random.random_range(0..900)));
        child.kill().expect("it runs");
        child.wait().expect("it ends");
        // A power cut takes what was not synced, wherever that ends.
        for name in case.files("in-progress") {
            if random.random_bool(0.5) {
                continue;
            }
            let path = case.path("out/in-progress").join(name);
            let bytes = fs::read(&path).expect("readable");
            fs::write(&path, &bytes[..random.random_range(0..=bytes.len())]).expect("writable");
            torn += 1;
        }
    }
    let before = case.files("scans").len();
    case.collect_all(&["--set", "plan.to_deg=36"]);
    case.assert_each_scan_once(2, repeats, 10);
    let cut = case.entries("attempt").iter().filter(|take| take["outcome"] == "incomplete").count();
    println!("killed {kills} times, {torn} files torn, {cut} scans cut, {before} whole meanwhile");
    assert!(cut > 0 && before > 0, "{cut} scans cut, {before} whole");
    assert_eq!(case.entries("attempt").len() as u64, 2 * repeats + cut as u64);
}

#[test]
fn resumes_after_interrupt() {
    let case = Case::new("[poses]\nlist = [\"fig9\"]\n[collection]\nrepeats = 3\n");
    let child = spawn(&case, &["--realtime"]);
    wait_until("a scan", || {
        case.path("out/in-progress").exists()
            && case.files("in-progress").iter().any(|name| {
                fs::metadata(case.path("out/in-progress").join(name))
                    .is_ok_and(|file| file.len() > 9_000)
            })
    });
    interrupt(child.id());
    let output = child.wait_with_output().expect("it ends");
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    assert_eq!(case.files("in-progress"), Vec::<String>::new());
    assert_eq!(case.files("rejected").len(), 1);
    assert_eq!(case.manifest()["complete"], false);
    assert!(case.verify().1.contains("not complete"));
    case.collect_all(&[]);
    case.assert_each_scan_once(1, 3, 25);
}

#[test]
fn resumes_after_full_disk() {
    let case = Case::new("[poses]\nlist = [\"fig9\"]\n[collection]\nrepeats = 4\n");
    let child = spawn(&case, &["--realtime"]);
    wait_until("a scan", || case.path("out/scans/p001-r01.jsonl").exists());
    limit_files(child.id(), Some(6_000));
    let output = child.wait_with_output().expect("it ends");
    let text = joined_stderr(&output);
    assert!(output.status.code() == Some(3) && text.contains("file-size limit"), "{text}");
    case.collect_all(&[]);
    case.assert_each_scan_once(1, 4, 25);
}

#[test]
fn lost_ranger() {
    let case = Case::new("[poses]\nlist = [\"fig9\"]\n[collection]\nrepeats = 3\nretakes = 20\n");
    let folder = tempfile::tempdir().expect("a folder");
    let mock = MockProcess::start(folder.path(), &["--realtime"]);
    let port = mock.port().to_owned();
    let child = spawn(&case, &["--port", &port]);
    wait_until("some readings", || {
        let taking = case.path("out/in-progress/p001-r01.jsonl");
        fs::read_to_string(taking).is_ok_and(|log| log.matches("\"ping\"").count() >= 3)
    });
    drop(mock);
    wait_until("the refusal", || !case.files("rejected").is_empty());
    // Another boot of the same ranger under the same name.
    drop(fs::remove_file(folder.path().join("ranger")));
    let mock = MockProcess::start(folder.path(), &["--realtime"]);
    let output = child.wait_with_output().expect("it ends");
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    drop(mock);
    case.assert_each_scan_once(1, 3, 25);
    assert!(case.text("out/report.md").contains("have no usable reading"));
}

#[test]
fn running_sweep_is_stopped() {
    let plan = "[poses]\nlist = [\"fig9\"]\n[collection]\nrepeats = 2\n";
    let case = Case::new(plan);
    let folder = tempfile::tempdir().expect("a folder");
    let mock = MockProcess::start(folder.path(), &["--realtime"]);
    let mut first = spawn(&case, &["--port", mock.port()]);
    wait_until("some readings", || {
        let taking = case.path("out/in-progress/p001-r01.jsonl");
        fs::read_to_string(taking).is_ok_and(|log| log.matches("\"ping\"").count() >= 3)
    });
    first.kill().expect("it runs");
    first.wait().expect("it ends");
    case.collect_all(&["--port", mock.port()]);
    case.assert_each_scan_once(1, 2, 25);
    // Nothing but what the first run had begun.
    assert_eq!(case.files("rejected"), ["p001-r01-attempt1.jsonl"]);
}

#[test]
fn failing_ranger_backs_off() {
    let plan = "[poses]\nlist = [\"fig9\"]\n[collection]\nrepeats = 20\nretry_limit_s = 8\n";
    let case = Case::new(plan);
    let output = case.collect(&["--faults", "reset=1"]);
    let text = joined_stderr(&output);
    assert_eq!(output.status.code(), Some(3), "{text}");
    assert!(text.contains("supply"), "{text}");
    let tries = text.matches("ranger lost").count();
    assert!((2..=4).contains(&tries), "{tries} tries: {text}");
    assert_eq!(case.files("rejected"), Vec::<String>::new());
    assert_eq!(case.manifest()["counts"]["given_up"], 0, "its pose is not to blame");
    // With another ranger it goes on.
    case.collect_all(&["--set", "collection.repeats=2", "--accept-changed-plan"]);
}

#[test]
fn folder_is_locked() {
    let case = Case::new("[poses]\nlist = [\"fig9\"]\n[collection]\nrepeats = 3\n");
    let mut child = spawn(&case, &["--realtime"]);
    wait_until("a scan", || {
        case.path("out/in-progress").exists() && !case.files("in-progress").is_empty()
    });
    let second = case.collect(&[]);
    let text = joined_stderr(&second);
    assert!(second.status.code() == Some(3) && text.contains("another process"), "{text}");
    assert_eq!(child.wait().expect("it ends").code(), Some(0));
    case.assert_each_scan_once(1, 3, 25);
}
