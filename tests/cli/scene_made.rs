//! `sonard scene from-grid`, `from-svg`, `from-dxf` and `from-sdf`.

mod drawings;
#[cfg(feature = "dxf")]
mod dxf;
mod maps;
mod worlds;

use std::fs;

use sonard::{
    geometry::DVec2,
    scene::{Scene, Wall},
};

use crate::{
    common::{run, stderr},
    map::write_ideal,
};

/// Runs a verb that must reject its input with a message that contains `part`.
fn refused(arguments: &[&str], part: &str) {
    let output = run(arguments);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {}", stderr(&output));
    assert!(stderr(&output).contains(part), "{arguments:?}: {}", stderr(&output));
}

/// Runs a verb that converts a plan and parses the printed scene.
fn made(arguments: &[&str]) -> Scene {
    let output = run(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", stderr(&output));
    Scene::from_json(&String::from_utf8(output.stdout).expect("text")).expect("a scene")
}

#[test]
fn map_round_trip() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).to_str().expect("a plain path").to_owned();
    let log = path("log.jsonl");
    assert!(
        run(&[
            "simulate",
            "--scene",
            "two-surface-room",
            "--pose",
            "middle",
            "--max-range",
            "4",
            "-o",
            &log
        ])
        .status
        .success()
    );
    let maps = (path("map"), path("ideal"));
    assert!(run(&["map", &log, "--out", &maps.0]).status.success());
    write_ideal(&maps.0, "two-surface-room", &maps.1);
    let scene = made(&["scene", "from-grid", &maps.1]);
    let shipped =
        Scene::from_json(sonard::scene::shipped::text("two-surface-room").expect("shipped"))
            .expect("a scene");
    let middle = shipped.pose("middle").expect("a pose");
    assert!(scene.check_pose(&middle).is_ok(), "the middle stays accessible");
    // Every wall of the scene is on a wall of the room to about a cell.
    for wall in &scene.walls {
        for end in [wall.a, wall.b] {
            assert!(
                shipped.clearance_m(end).abs() < 0.12,
                "{end}: {} m off",
                shipped.clearance_m(end)
            );
        }
    }
    // The same as a PNG, in colours, with a whole path to it.
    let (yaml, png_path) = (path("map.yaml"), path("map.png"));
    let pgm = fs::read(format!("{}/map.pgm", maps.1)).expect("there");
    let text = fs::read_to_string(format!("{}/map.yaml", maps.1)).expect("there");
    fs::write(&yaml, text.replace("map.pgm", "map.png")).expect("writable");
    let header: Vec<usize> = String::from_utf8_lossy(&pgm[..20])
        .split_whitespace()
        .skip(1)
        .take(2)
        .map(|n| n.parse().expect("a number"))
        .collect();
    let pixels = &pgm[pgm.len() - header[0] * header[1]..];
    let mut encoder = png::Encoder::new(
        fs::File::create(&png_path).expect("writable"),
        header[0] as u32,
        header[1] as u32,
    );
    encoder.set_color(png::ColorType::Rgb);
    let colours: Vec<u8> = pixels.iter().flat_map(|grey| [*grey; 3]).collect();
    encoder.write_header().expect("writable").write_image_data(&colours).expect("writable");
    let of_png = made(&["scene", "from-grid", &yaml, "--name", &scene.name]);
    assert_eq!(of_png.walls, scene.walls);
    // What is none.
    fs::write(&png_path, &fs::read(&png_path).expect("there")[..60]).expect("writable");
    let output = run(&["scene", "from-grid", &yaml]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("PNG"), "{}", stderr(&output));
    fs::write(format!("{}/map.pgm", maps.1), pgm.iter().map(|_| b'P').collect::<Vec<u8>>())
        .expect("writable");
    assert_eq!(run(&["scene", "from-grid", &maps.1]).status.code(), Some(2));
}

#[test]
fn svg_scale() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("plan.svg");
    let drawing = path.to_str().expect("a plain path");
    let write = |content: &str| {
        let svg = format!(
            "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 400 300'>{content}</svg>"
        );
        fs::write(&path, svg).expect("writable");
    };
    write(
        "<g transform='translate(10 20)'><rect width='380' height='260' fill='none' stroke='black'/></g>\
         <line x1='200' y1='100' x2='200' y2='200' stroke='red'/><circle cx='100' cy='100' r='20' stroke='black'/>\
         <text x='50' y='50'>kitchen</text>",
    );
    let scene = made(&["scene", "from-svg", drawing, "--width-m", "4", "--reflectance", "0.9"]);
    assert_eq!(scene.name, "plan");
    let ends = |id: &str| {
        let wall = scene.walls.iter().find(|wall| &*wall.id == id).expect(id);
        [wall.a, wall.b]
    };
    assert!(scene.walls.iter().all(|wall| wall.material.reflectance == 0.9));
    // The y axis points up, the lower left corner of the drawing is the origin.
    let close = |a: DVec2, x: f64, y: f64| a.distance((x, y).into()) < 1e-3;
    assert!(
        close(ends("wall-1.0")[0], 0.1, 2.8) && close(ends("wall-1.0")[1], 3.9, 2.8),
        "{:?}",
        ends("wall-1.0")
    );
    assert!(close(ends("wall-2")[0], 2.0, 2.0) && close(ends("wall-2")[1], 2.0, 1.0));
    let round: Vec<_> = scene.walls.iter().filter(|wall| wall.id.starts_with("wall-3.")).collect();
    assert!(round.len() > 12, "{}", round.len());
    assert!(round.iter().all(|wall| (wall.a.distance((1.0, 2.0).into()) - 0.2).abs() < 1e-3));
    for (content, part) in [("<text x='9'>nothing</text>", "no walls"), ("<path d='", "SVG")] {
        write(content);
        refused(&["scene", "from-svg", drawing, "--width-m", "4"], part);
    }
    write("<line x2='9' stroke='red'/>");
    refused(&["scene", "from-svg", drawing, "--width-m", "0"], "greater than 0");
}

/// Ends of a wall or of a row of walls, by the name of its first.
fn walls<'a>(scene: &'a Scene, id: &str) -> Vec<&'a Wall> {
    let is_of = |wall: &&Wall| *wall.id == *id || wall.id.starts_with(&format!("{id}."));
    let walls: Vec<_> = scene.walls.iter().filter(is_of).collect();
    assert!(!walls.is_empty(), "no {id} among {:?}", scene.walls);
    walls
}

#[cfg(not(feature = "dxf"))]
#[test]
fn dxf_without_the_feature() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("plan.dxf");
    fs::write(&path, "0\nEOF\n").expect("writable");
    refused(&["scene", "from-dxf", path.to_str().expect("a plain path")], "--features dxf");
}

const WORLD: &str = r#"<?xml version="1.0"?>
<sdf version="1.9"><world name="arena">
  <model name="ground"><static>true</static><link name="link">
    <collision name="c"><geometry><plane><normal>0 0 1</normal></plane></geometry></collision>
  </link></model>
  <model name="north"><pose>0 2 0.5 0 0 0</pose><link name="link">
    <collision name="c"><geometry><box><size>4 0.1 1</size></box></geometry></collision>
    <visual name="v"><geometry><box><size>9 9 9</size></box></geometry></visual>
  </link></model>
  <model name="crate"><pose degrees="true">1 0 0 0 0 90</pose><link name="link"><pose>0.5 0 0.25 0 0 0</pose>
    <collision name="c"><geometry><box><size>0.6 0.2 0.5</size></box></geometry></collision>
  </link></model>
  <model name="lying"><pose>-1 0 0.2 1.5707963 0 0</pose><link name="link">
    <collision name="c"><geometry><box><size>0.4 0.4 0.8</size></box></geometry></collision>
  </link></model>
  <model name="leaning"><pose>0 0 0.2 0.5 0 0</pose><link name="link">
    <collision name="c"><geometry><box><size>1 1 1</size></box></geometry></collision>
  </link></model>
  <model name="table"><link name="link">
    <collision name="top"><pose>-1 1 0.7 0 0 0</pose><geometry><box><size>1 1 0.05</size></box></geometry></collision>
    <collision name="leg"><pose>-1 1 0.35 0 0 0</pose><geometry><cylinder><radius>0.03</radius><length>0.7</length></cylinder></geometry></collision>
  </link></model>
  <model name="corner"><link name="link"><collision name="c"><geometry><polyline>
    <point>-2 -2</point><point>-1.5 -2</point><point>-2 -1.5</point><height>1</height>
  </polyline></geometry></collision></link></model>
  <include><uri>model://chair</uri></include>
</world></sdf>"#;

#[test]
fn sdf_slice() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("arena.sdf");
    let world = path.to_str().expect("a plain path");
    fs::write(&path, WORLD).expect("writable");
    let output = run(&["scene", "from-sdf", world]);
    for part in ["1 models from elsewhere", "1 tilted objects"] {
        assert!(stderr(&output).contains(part), "{}", stderr(&output));
    }
    let scene = made(&["scene", "from-sdf", world]);
    let span = |id: &str| {
        let ends: Vec<DVec2> = walls(&scene, id).iter().flat_map(|wall| [wall.a, wall.b]).collect();
        let low = ends.iter().copied().fold(DVec2::INFINITY, DVec2::min);
        let high = ends.iter().copied().fold(DVec2::NEG_INFINITY, DVec2::max);
        [low.x, low.y, high.x, high.y].map(|m| (1e3 * m).round() / 1e3)
    };
    assert_eq!(span("north-1"), [-2.0, 1.95, 2.0, 2.05]);
    // Turned by a quarter, and its link half a metre on along what is then y.
    assert_eq!(span("crate-2"), [0.9, 0.2, 1.1, 0.8]);
    assert_eq!(span("lying-3"), [-1.2, -0.4, -0.8, 0.4]);
    assert_eq!(span("corner-5"), [-2.0, -2.0, -1.5, -1.5]);
    let [leg] = &scene.cylinders[..] else { panic!("{:?}", scene.cylinders) };
    assert_eq!((&*leg.id, leg.radius_m, leg.center), ("table-4", 0.03, DVec2::new(-1.0, 1.0)));
    let higher = made(&["scene", "from-sdf", world, "--cut-z-m", "0.69"]);
    assert_eq!(walls(&higher, "table-2").len(), 4);
    for (was, is, part) in [
        (
            "<size>4 0.1 1</size>",
            "<size>4 0.1</size>",
            "line 7, column 40: size is `4 0.1`: 3 numbers",
        ),
        ("<radius>0.03</radius>", "", "cylinder has no radius"),
        ("</sdf>", "", "arena.sdf"),
        ("<sdf version=\"1.9\">", "<sdf version=\"1.9\"><world/></sdf><!--", "arena.sdf"),
    ] {
        fs::write(&path, WORLD.replace(was, is)).expect("writable");
        refused(&["scene", "from-sdf", world], part);
    }
    fs::write(&path, "<svg/>").expect("writable");
    refused(&["scene", "from-sdf", world], "not sdf");
    fs::write(&path, WORLD.replace("<pose>0 2", "<pose relative_to=\"shed\">0 2"))
        .expect("writable");
    let output = run(&["scene", "from-sdf", world]);
    assert!(stderr(&output).contains("relative to `shed`"), "{}", stderr(&output));
    assert!(!String::from_utf8_lossy(&output.stdout).contains("north"));
}
