//! `sonard compare` with several logs.

use crate::common::{mock_scan, run, stderr};

#[test]
fn compare_of_several_logs() {
    let folder = tempfile::tempdir().expect("a folder");
    let logs = ["one", "two"].map(|name| {
        let out = folder.path().join(name);
        let taken = mock_scan("fig9", &out, &["--to-deg", "9"]);
        assert_eq!(taken.status.code(), Some(0), "{}", stderr(&taken));
        out.join("scan.jsonl").to_str().expect("plain path").to_owned()
    });
    let compared = run(&["compare", &logs[0], &logs[1]]);
    let text = String::from_utf8_lossy(&compared.stdout);
    let (_, all) = text.split_once("all 2 logs\n").unwrap_or_else(|| panic!("{text}"));
    assert!(all.starts_with("20 beams compared, in 2 scans"), "{text}");
    assert!(!String::from_utf8_lossy(&run(&["compare", &logs[0]]).stdout).contains("all 1"));
}
