//! `sonard tour`.

use std::fs;

use crate::common::{sonard, stderr};

#[test]
fn all_steps() {
    let folder = tempfile::tempdir().expect("a folder");
    let output = sonard(&["tour"]).current_dir(folder.path()).output().expect("it starts");
    let text = String::from_utf8(output.stdout.clone()).expect("UTF-8");
    assert!(output.status.success(), "{text}\n{}", stderr(&output));
    for part in
        ["[1/6] A scan", "[6/6] One beam", "$ sonard compare out/fig7/scan.jsonl", "verdict"]
    {
        assert!(text.contains(part), "{part}: {text}");
    }
    let tour = folder.path().join("sonard-tour");
    for picture in ["out/fig9/scan.png", "out/fig7/scan.png", "path.png"] {
        let path = fs::canonicalize(tour.join(picture)).expect("drawn");
        assert!(text.contains(&format!("picture: {}", path.display())), "{picture}: {text}");
    }
    // A second tour leaves the first one alone.
    let again = sonard(&["tour"]).current_dir(folder.path()).output().expect("it starts");
    assert_eq!(again.status.code(), Some(2));
    assert!(stderr(&again).contains("sonard-tour is not empty"), "{}", stderr(&again));
}
