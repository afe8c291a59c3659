//! Arguments that are valid text but unusual: paths that are not UTF-8, extreme numbers.

use std::{ffi::OsStr, fs, os::unix::ffi::OsStrExt as _};

use crate::{
    collect::joined_stderr,
    common::{run, sonard, stderr},
};

#[test]
fn non_utf8_paths() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = folder.path().join(OsStr::from_bytes(b"room-\xff.json"));
    fs::write(&scene, include_str!("../../scenes/simple-room.json")).expect("writes");
    for arguments in [
        &["scene", "check"][..],
        &["simulate", "--pose", "fig9", "--to-deg", "9", "--scene"],
        &["scan", "--mock", "--pose", "fig9", "--to-deg", "9", "--scene"],
    ] {
        let output = sonard(arguments).arg(&scene).output().expect("starts");
        assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", stderr(&output));
    }
    // A configuration is text: it is refused by name.
    for option in ["--scene", "--log"] {
        let output = sonard(&["run", "--check", "--mock", option]).arg(&scene).output();
        let output = output.expect("starts");
        assert_eq!(output.status.code(), Some(2));
        assert!(
            joined_stderr(&output).contains(&format!("{option}: ")),
            "{}",
            joined_stderr(&output)
        );
    }
}

#[test]
fn too_many_cells() {
    let folder = tempfile::tempdir().expect("a folder");
    let log = folder.path().join("log.jsonl");
    let log = log.to_str().expect("plain path");
    let simulate = ["simulate", "--scene", "simple-room", "--pose", "fig9", "-o", log];
    assert_eq!(run(&simulate).status.code(), Some(0));
    for resolution in ["1e-12", "1e-200"] {
        let out = folder.path().join("map");
        let out = out.to_str().expect("plain path");
        let map = run(&["map", log, "--out", out, "--resolution", resolution]);
        let text = joined_stderr(&map);
        assert_eq!(map.status.code(), Some(2), "{text}");
        assert!(text.contains("more than 10^12 cells are too many"), "{text}");
    }
}

/// Poses of the scene are listed if none is given and the default one is not free.
#[test]
fn missing_pose_of_a_daemon() {
    let check = ["run", "--check", "--mock", "--scene", "simple-room"];
    let [missing, wrong] =
        [&[][..], &["--pose", "fig8"]].map(|pose| run(&[&check[..], pose].concat()));
    assert_eq!(missing.status.code(), Some(2));
    for part in ["the pose in `simple-room` is missing", "or `fig7`, `fig9`"] {
        assert!(stderr(&missing).contains(part), "{}", stderr(&missing));
    }
    assert!(stderr(&wrong).contains("no pose `fig8`"), "{}", stderr(&wrong));
}
