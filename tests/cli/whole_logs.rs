//! A log is whole by itself: what its predictions were made for is in it.

use std::{fs, path::Path};

use crate::{
    collect::joined_stderr,
    common::{Log, run, stderr},
};

/// Runs a command line that must succeed; `DIR` is replaced by `folder`.
#[track_caller]
fn succeed(words: &str, folder: &Path) -> (String, String) {
    let folder = folder.to_str().expect("plain path");
    let arguments: Vec<String> = words.split(' ').map(|word| word.replace("DIR", folder)).collect();
    let output = run(&arguments.iter().map(String::as_str).collect::<Vec<_>>());
    assert!(output.status.success(), "{words}: {}", stderr(&output));
    (String::from_utf8(output.stdout.clone()).expect("text"), joined_stderr(&output))
}

/// A room that does not come with the program, with the log of a scan in it; its file is gone.
fn scanned_room() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let room = include_str!("../../scenes/simple-room.json");
    let room = room.replacen("\"simple-room\"", "\"my-cellar\"", 1);
    fs::write(folder.path().join("cellar.json"), &room).expect("writable");
    succeed(
        "scan --mock --scene DIR/cellar.json --pose fig9 --max-range 2 --out DIR/scan",
        folder.path(),
    );
    fs::remove_file(folder.path().join("cellar.json")).expect("ours");
    let log = Log::read(&folder.path().join("scan/scan.jsonl"));
    let session = log.of_type("session").next().expect("there");
    assert_eq!(session["scene_text"], room.as_str());
    folder
}

#[test]
fn scene_from_the_log() {
    let folder = scanned_room();
    let drawn = |words: &str, name: &str| {
        let (_, printed) = succeed(words, folder.path());
        assert!(!printed.contains("--scene"), "{words}: {printed}");
        fs::read_to_string(folder.path().join(name)).expect("written")
    };
    let svg = drawn("plot DIR/scan/scan.jsonl -o DIR/scan.svg", "scan.svg");
    assert!(svg.contains("class=\"walls\"") && svg.contains("my-cellar"));
    let svg = drawn("plot DIR/scan/scan.jsonl --azimuth-deg 270 -o DIR/way.svg", "way.svg");
    assert!(svg.contains("my-cellar"));
    for verb in ["interpret", "lines"] {
        let svg =
            drawn(&format!("{verb} DIR/scan/scan.jsonl -o DIR/{verb}.svg"), &format!("{verb}.svg"));
        assert!(svg.contains("class=\"walls\""), "{verb}");
    }
    succeed("map DIR/scan/scan.jsonl --out DIR/map", folder.path());
}

#[test]
fn predictions_in_the_logged_scene() {
    let folder = scanned_room();
    let log = folder.path().join("scan/scan.jsonl");
    let bare: String = Log::read(&log)
        .records
        .into_iter()
        .map(|mut record| {
            if let Some(ping) = record.as_object_mut().filter(|record| record["type"] == "ping") {
                ping.remove("sim");
                ping.insert("residual_m".into(), serde_json::Value::Null);
            }
            format!("{record}\n")
        })
        .collect();
    let before = succeed("compare DIR/scan/scan.jsonl --json", folder.path()).0;
    fs::write(&log, bare).expect("writable");
    let after = succeed("compare DIR/scan/scan.jsonl --json", folder.path()).0;
    let figures = |text: &str| {
        let log = Log::parse(text);
        ["beams", "both_echo", "agree"].map(|name| log.records[0][name].as_u64().expect("a count"))
    };
    assert_eq!(figures(&before), figures(&after));
    assert!(figures(&after)[0] > 300, "{after}");
}

#[test]
fn modified_scene_is_rejected() {
    let folder = scanned_room();
    let log = folder.path().join("scan/scan.jsonl");
    let text = fs::read_to_string(&log).expect("there");
    fs::write(&log, text.replacen("\\\"reflectance\\\"", "\\\"reflectance\\\" ", 1))
        .expect("writable");
    let (_, printed) = succeed("plot DIR/scan/scan.jsonl -o DIR/scan.svg", folder.path());
    assert!(printed.contains("was changed") && printed.contains("--scene"), "{printed}");
    let svg = fs::read_to_string(folder.path().join("scan.svg")).expect("written");
    assert!(!svg.contains("class=\"walls\""));
}
