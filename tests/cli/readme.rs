//! Commands of the documents, run as pasted in an empty folder.

use std::{
    env, fs,
    path::{Path, PathBuf},
    process::{Command, Stdio},
};

use crate::common::{run, stderr};

const README: &str = include_str!("../../README.md");
const COPYING_LOGS: &str = include_str!("../../docs/copying-logs.md");

/// Starts of lines that build, install, or need hardware or the rights of root.
const EXCEPTIONS: [&str; 5] = ["cargo ", "./test.sh", "pip ", "sudo ", "sudoedit "];

/// Shell blocks of a document without the lines of [`EXCEPTIONS`].
fn shell_blocks(document: &str) -> Vec<String> {
    let exception = |line: &&str| !EXCEPTIONS.iter().any(|start| line.starts_with(start));
    let block = |rest: &str| {
        let block = rest.split("```").next().unwrap_or_default();
        block.lines().filter(exception).map(|line| format!("{line}\n")).collect()
    };
    document.split("```sh\n").skip(1).map(block).collect()
}

/// Runs a block in `folder` with `sonard` on the path; its background processes end with it.
fn run_block(block: &str, folder: &Path) {
    let program = Path::new(env!("CARGO_BIN_EXE_sonard")).parent().expect("a folder");
    let path = format!("{}:{}", program.display(), env::var("PATH").unwrap_or_default());
    let script = format!("set -e\ntrap 'kill $(jobs -p) 2>/dev/null || true' EXIT\n{block}");
    let output = Command::new("bash")
        .args(["-c", &script])
        .current_dir(folder)
        .env("PATH", &path)
        .env("NO_COLOR", "1")
        .output()
        .expect("bash starts");
    let (out, err) = (String::from_utf8_lossy(&output.stdout), stderr(&output));
    assert!(output.status.success(), "{block}\n{out}\n{err}");
    assert!(!err.contains("panicked"), "{block}\n{err}");
}

/// Panics unless `program`, of the Debian package of that name, can be run.
fn require(program: &str) {
    let version = Command::new(program).arg("--version").stdout(Stdio::null()).status();
    assert!(version.is_ok(), "{program} is missing: sudo apt-get install {program}");
}

#[test]
fn readme_commands_run() {
    require("curl");
    let folder = tempfile::tempdir().expect("a folder");
    let (mut commands, mut verbs) = (0, Vec::new());
    for block in shell_blocks(README) {
        let of_sonard = block.lines().filter(|line| line.starts_with("sonard "));
        verbs.extend(of_sonard.filter_map(|line| line.split(' ').nth(1).map(str::to_owned)));
        commands += block.lines().filter(|line| !line.trim().is_empty()).count();
        run_block(&block, folder.path());
    }
    verbs.sort();
    verbs.dedup();
    assert!(commands > 40 && verbs.len() > 17, "{commands} lines of {verbs:?}");
    for file in ["out/fig7/scan.png", "path.png", "plan.png", "map/map.yaml", "array.png"] {
        assert!(fs::metadata(folder.path().join(file)).is_ok_and(|file| file.len() > 0), "{file}");
    }
}

/// Logs in a folder, ordered by name.
fn logs_in(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("read").path());
    let mut logs: Vec<_> =
        entries.filter(|log| log.extension().is_some_and(|e| e == "jsonl")).collect();
    logs.sort();
    logs
}

#[test]
fn rsync_of_logs() {
    require("rsync");
    let folder = tempfile::tempdir().expect("a folder");
    let blocks = shell_blocks(COPYING_LOGS);
    let [first, again] = &blocks[..] else { panic!("{blocks:?}") };
    run_block(first, folder.path());
    run_block(again, folder.path());
    let copies = |robot: &str| logs_in(&folder.path().join("history").join(robot));
    let same = || {
        ["kiwi", "lime"].iter().all(|robot| {
            let sources = logs_in(&folder.path().join("robots").join(robot));
            let copies = copies(robot);
            let bytes = |logs: &[PathBuf]| -> Vec<_> {
                logs.iter().map(|log| fs::read(log).expect("readable")).collect()
            };
            !sources.is_empty() && bytes(&sources) == bytes(&copies)
        })
    };
    assert!(same());
    let readings = |robot: &str| -> usize {
        let pings = |log: &PathBuf| {
            fs::read_to_string(log).expect("readable").matches("\"type\":\"ping\"").count()
        };
        copies(robot).iter().map(pings).sum()
    };
    let table = fs::read_to_string(folder.path().join("history.csv")).expect("written");
    let expected = readings("kiwi") + readings("lime");
    assert!(expected > 0);
    assert_eq!(table.lines().count(), expected + 1);
    assert!(table.contains("kiwi/sonard-") && table.contains("lime/sonard-"));

    // An interrupted transfer: the copy ends within a line.
    let copy = copies("kiwi").remove(0);
    let whole = fs::read(&copy).expect("readable");
    fs::write(&copy, &whole[..whole.len() / 2]).expect("written");
    run_block(again, folder.path());
    assert!(same(), "continued");
    // A copy that differs, of a log that has grown since.
    let mut damaged = whole[..whole.len() / 2].to_vec();
    damaged[..100].fill(b'x');
    fs::write(&copy, &damaged).expect("written");
    let verified = run(&["log", "verify", copy.to_str().expect("a plain path")]);
    assert_eq!(verified.status.code(), Some(1));
    run_block(again, folder.path());
    assert!(same(), "transferred again");
}

#[test]
fn old_curl_options() {
    // --json came with 7.82; Debian 11 has 7.74.
    for (name, text) in [("README.md", README), ("run.rs", include_str!("../../src/cli/run.rs"))] {
        let newer = text.lines().find(|line| line.contains("curl") && line.contains("--json"));
        assert_eq!(newer, None, "{name}");
    }
}
