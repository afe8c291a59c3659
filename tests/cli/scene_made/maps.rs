//! Maps of map_server: turned, thin-walled, and by their own rules.

use std::fs;

use super::*;

/// A map of 60 by 50 cells of 5 cm, with shades by column and row from the lower left.
fn map(folder: &std::path::Path, yaml: &str, shade: impl Fn(usize, usize) -> u8) -> String {
    let (width, height) = (60, 50);
    let rows = (0..height).rev().flat_map(|row| (0..width).map(move |column| (column, row)));
    let pixels: Vec<u8> = rows.map(|(column, row)| shade(column, row)).collect();
    let pgm = [format!("P5\n{width} {height}\n255\n").as_bytes(), &pixels].concat();
    fs::write(folder.join("map.pgm"), pgm).expect("writable");
    let text = format!("image: map.pgm\nresolution: 0.05\n{yaml}\n");
    let path = folder.join("map.yaml");
    fs::write(&path, text).expect("writable");
    path.to_str().expect("a plain path").to_owned()
}

/// A room whose walls are a cell thick, unknown outside.
fn room(column: usize, row: usize) -> u8 {
    match (column, row) {
        (6 | 53, 6..=43) | (6..=53, 6 | 43) => 0,
        (7..=52, 7..=42) => 254,
        _ => 205,
    }
}

const ORIGIN: &str = "origin: [0, 0, 0]";

#[test]
fn walls_follow_the_cells() {
    let folder = tempfile::tempdir().expect("a folder");
    // A partition of a cell from the upper wall down, and a notch of a cell in the lower one.
    let shade = |column: usize, row: usize| match (column, row) {
        (30, 24..=42) => 0,
        (20, 6) => 254,
        (20, 5) => 0,
        _ => room(column, row),
    };
    let scene = made(&["scene", "from-grid", &map(folder.path(), ORIGIN, shade)]);
    assert!(
        scene.walls.iter().all(|wall| wall.a.x == wall.b.x || wall.a.y == wall.b.y),
        "{:?}",
        scene.walls
    );
    let has = |x: f64, y: f64| scene.walls.iter().any(|wall| wall.a.distance((x, y).into()) < 1e-3);
    for (x, y) in [(1.5, 2.15), (1.5, 1.2), (1.55, 1.2), (1.55, 2.15), (1.0, 0.3), (1.05, 0.3)] {
        assert!(has(x, y), "{x}, {y}: {:?}", scene.walls);
    }
}

#[test]
fn rotated_map() {
    let folder = tempfile::tempdir().expect("a folder");
    let straight = made(&["scene", "from-grid", &map(folder.path(), "origin: [1, 2, 0]", room)]);
    let path = map(folder.path(), "origin: [1, 2, 0.7853981633974483]", room);
    let turned = made(&["scene", "from-grid", &path]);
    let turn = DVec2::from_angle(std::f64::consts::FRAC_PI_4);
    let origin = DVec2::new(1.0, 2.0);
    assert_eq!(straight.walls.len(), 4);
    for (one, other) in straight.walls.iter().zip(&turned.walls) {
        assert!(
            (origin + turn.rotate(one.a - origin)).distance(other.a) < 2e-4,
            "{one:?} {other:?}"
        );
    }
    let [log, out] =
        ["scan.jsonl", "map"].map(|name| folder.path().join(name).display().to_string());
    let simulated = ["simulate", "--scene", "simple-room", "--pose", "fig9", "--step-deg", "36"];
    assert!(run(&[&simulated[..], &["-o", &log]].concat()).status.success());
    let refused = run(&["map", &log, "--update", &path, "--out", &out]);
    assert!(stderr(&refused).contains("rotated"), "{}", stderr(&refused));
}

#[test]
fn thresholds_and_modes() {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, yaml, shade) in [
        ("as map_saver writes it", "negate: 0", room as fn(usize, usize) -> u8),
        ("by nav2", "free_thresh: 0.25\nmode: trinary", room),
        ("negated", "negate: 1", |column, row| 255 - room(column, row)),
        ("grey walls", "occupied_thresh: 0.3\nfree_thresh: 0.1", |column, row| {
            room(column, row).max(150)
        }),
        ("a stray shade", "negate: 0", |column, row| {
            if (column, row) == (0, 0) { 180 } else { room(column, row) }
        }),
        ("raw", "mode: raw", |column, row| match room(column, row) {
            0 => 100,
            254 => 0,
            _ => 255,
        }),
    ] {
        let scene =
            made(&["scene", "from-grid", &map(folder.path(), &format!("{ORIGIN}\n{yaml}"), shade)]);
        assert_eq!(scene.walls.len(), 4, "{name}: {:?}", scene.walls);
        assert!(
            scene.walls.iter().all(|wall| [0.35, 2.65].contains(&wall.a.x)),
            "{name}: {:?}",
            scene.walls
        );
    }
}

#[test]
fn missing_images() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = map(folder.path(), ORIGIN, room);
    refused(
        &["scene", "from-grid", folder.path().join("map.pgm").to_str().expect("a plain path")],
        "an image",
    );
    fs::remove_file(folder.path().join("map.pgm")).expect("writable");
    refused(&["scene", "from-grid", &path], "the file of `image:`");
}
