//! Scans that are added to scans.

use super::*;

#[test]
fn append_needs_the_same_setup() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path();
    let first = short_scan("fig9", out, &[]);
    assert!(first.status.success() && !stderr(&first).contains("appending"), "{}", stderr(&first));
    let second = short_scan("fig9", out, &[]);
    assert!(second.status.success(), "{}", stderr(&second));
    assert!(stderr(&second).contains("contains 1 scan of the same setup"), "{}", stderr(&second));
    let was = fs::read(out.join("scan.jsonl")).expect("written");
    for (pose, further, difference) in [
        ("fig7", &[][..], "pose"),
        ("fig9", &["--step-deg", "1.8"], "plan"),
        ("fig9", &["--sensor", "hc-sr04"], "sensor"),
        ("fig9", &["--engine", "cone"], "model"),
    ] {
        let refused = short_scan(pose, out, further);
        let message = joined_stderr(&refused);
        assert_eq!(refused.status.code(), Some(2), "{message}");
        assert!(message.contains("a different setup") && message.contains(difference), "{message}");
        assert_eq!(fs::read(out.join("scan.jsonl")).expect("kept"), was, "{difference}");
    }
    let text = String::from_utf8(
        run(&["compare", out.join("scan.jsonl").to_str().expect("plain")]).stdout,
    );
    assert!(!text.expect("text").contains("poses"));
}

#[test]
fn compare_of_several_poses() {
    let folder = tempfile::tempdir().expect("a folder");
    let of = |pose: &str| {
        let out = folder.path().join(pose);
        assert!(short_scan(pose, &out, &[]).status.success());
        fs::read_to_string(out.join("scan.jsonl")).expect("written")
    };
    let both = folder.path().join("both.jsonl");
    fs::write(&both, of("fig7") + &of("fig9")).expect("writable");
    let both = both.to_str().expect("plain path");
    let text = String::from_utf8(run(&["compare", both]).stdout).expect("text");
    assert!(text.contains("2 scans at 2 poses, combined"), "{text}");
    let json =
        Log::parse(&String::from_utf8(run(&["compare", "--json", both]).stdout).expect("text"));
    assert_eq!((&json.records[0]["scans"], &json.records[0]["poses"]), (&2.into(), &2.into()));
}
