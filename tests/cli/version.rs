//! Version, commit and features, in `--version` and in logs.

use crate::common::{Log, run, stderr};

#[test]
fn program_and_logs_agree() {
    let text = String::from_utf8(run(&["--version"]).stdout).expect("UTF-8");
    let mut lines = text.lines();
    let version = lines.next().and_then(|line| line.strip_prefix("sonard ")).expect("a version");
    let commit = lines.next().and_then(|line| line.strip_prefix("commit ")).expect("a commit");
    let features = lines.next().and_then(|line| line.strip_prefix("features ")).expect("features");
    assert!(!commit.is_empty() && features.split(", ").any(|name| name == "daemon"), "{text}");
    assert_eq!(run(&["-V"]).stdout, format!("sonard {version}\n").as_bytes());

    let folder = tempfile::tempdir().expect("a folder");
    let place = ["--scene", "simple-room", "--pose", "fig9", "--to-deg", "9"];
    let simulated = run(&[&["simulate"][..], &place].concat());
    let out = folder.path().to_str().expect("plain");
    let scanned = run(&[&["scan", "--mock", "--out", out][..], &place].concat());
    assert!(scanned.status.success(), "{}", stderr(&scanned));
    let simulated = Log::parse(&String::from_utf8(simulated.stdout).expect("UTF-8"));
    for log in [simulated, Log::read(&folder.path().join("scan.jsonl"))] {
        let session = log.of_type("session").next().expect("a session").clone();
        let features: Vec<_> = features.split(", ").collect();
        assert_eq!(session["sonard"], version);
        assert_eq!(session["build"], serde_json::json!({"commit": commit, "features": features}));
    }
}
