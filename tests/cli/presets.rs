//! Shipped scenes, sensors and arrays: `list` and `show`.

use std::fs;

use crate::{
    collect::joined_stderr,
    common::{run, stderr},
};

#[test]
fn list_and_show() {
    let folder = tempfile::tempdir().expect("a folder");
    for (kind, name, use_it) in [
        (
            "sensor",
            "hc-sr04",
            &["simulate", "--scene", "simple-room", "--pose", "fig9", "--sensor"][..],
        ),
        ("array", "ring-12", &["simulate", "--scene", "mcgill-lab", "--pose", "fig4", "--array"]),
        ("scene", "corridor", &["scene", "check"]),
    ] {
        let listed = run(&[kind, "list"]);
        assert!(String::from_utf8_lossy(&listed.stdout).contains(name), "{kind}");
        let shown = run(&[kind, "show", name]);
        assert_eq!(shown.status.code(), Some(0), "{}", stderr(&shown));
        // What is printed is a file that does what the name does.
        let path = folder.path().join(format!("{kind}.json"));
        fs::write(&path, &shown.stdout).expect("writes");
        let path = path.to_str().expect("plain path");
        let short: &[&str] = if kind == "sensor" { &["--to-deg", "9"] } else { &[] };
        let used = run(&[use_it, &[path], short].concat());
        assert_eq!(used.status.code(), Some(0), "{kind}: {}", stderr(&used));
        let unknown = run(&[kind, "show", "no-such-one"]);
        assert_eq!(unknown.status.code(), Some(2));
        assert!(joined_stderr(&unknown).contains(name), "{}", joined_stderr(&unknown));
    }
}
