//! Drawings in DXF: units, layers, blocks, far origins.

use std::fs;

use sonard::geometry::DVec2;

use super::{made, refused, walls};
use crate::common::{run, stderr};

/// A DXF file of groups, code and value.
fn dxf(units: &str, layers: &[(&str, i16)], entities: &[&[(i32, &str)]]) -> String {
    let mut groups: Vec<(i32, String)> = Vec::new();
    let mut add = |code: i32, value: &str| groups.push((code, value.to_owned()));
    for (code, value) in [(0, "SECTION"), (2, "HEADER"), (9, "$ACADVER"), (1, "AC1015")] {
        add(code, value);
    }
    for (code, value) in [(9, "$INSUNITS"), (70, units), (0, "ENDSEC")] {
        add(code, value);
    }
    for (code, value) in [(0, "SECTION"), (2, "TABLES"), (0, "TABLE"), (2, "LAYER")] {
        add(code, value);
    }
    for (name, color) in layers {
        for (code, value) in [(0, "LAYER"), (2, name), (70, "0"), (62, &color.to_string())] {
            add(code, value);
        }
    }
    for (code, value) in [(0, "ENDTAB"), (0, "ENDSEC"), (0, "SECTION"), (2, "ENTITIES")] {
        add(code, value);
    }
    for (code, value) in entities.iter().copied().flatten() {
        add(*code, value);
    }
    for (code, value) in [(0, "ENDSEC"), (0, "EOF")] {
        add(code, value);
    }
    groups.iter().map(|(code, value)| format!("{code:3}\n{value}\n")).collect()
}

const ROOM: &[(i32, &str)] = &[
    (0, "LWPOLYLINE"),
    (8, "A-WALL"),
    (90, "4"),
    (70, "1"),
    (10, "0"),
    (20, "0"),
    (10, "4000"),
    (20, "0"),
    (10, "4000"),
    (20, "3000"),
    (10, "0"),
    (20, "3000"),
];
/// Half a circle over the wall from (1, 0) to (2, 0), away from the room's inside and towards it.
const BAY: &[(i32, &str)] = &[
    (0, "LWPOLYLINE"),
    (8, "A-BAY"),
    (90, "2"),
    (70, "0"),
    (10, "1000"),
    (20, "1000"),
    (42, "1"),
    (10, "2000"),
    (20, "1000"),
];
const OLD_LINE: &[(i32, &str)] = &[
    (0, "POLYLINE"),
    (8, "A-WALL"),
    (66, "1"),
    (70, "0"),
    (0, "VERTEX"),
    (8, "A-WALL"),
    (10, "500"),
    (20, "2000"),
    (0, "VERTEX"),
    (8, "A-WALL"),
    (10, "500"),
    (20, "2500"),
    (0, "SEQEND"),
    (8, "A-WALL"),
];
const LINE: &[(i32, &str)] =
    &[(0, "LINE"), (8, "A-WALL"), (10, "3000"), (20, "500"), (11, "3500"), (21, "500")];
/// Seen from below: x is mirrored.
const COLUMN: &[(i32, &str)] = &[
    (0, "CIRCLE"),
    (8, "A-COLS"),
    (10, "-2500"),
    (20, "2000"),
    (40, "150"),
    (210, "0"),
    (220, "0"),
    (230, "-1"),
];
const ARC: &[(i32, &str)] =
    &[(0, "ARC"), (8, "A-BAY"), (10, "3000"), (20, "2000"), (40, "500"), (50, "270"), (51, "90")];
const BLOCK: &[(i32, &str)] = &[(0, "INSERT"), (8, "A-WALL"), (2, "door"), (10, "0"), (20, "0")];
const HIDDEN: &[(i32, &str)] =
    &[(0, "LINE"), (8, "A-ANNO"), (10, "0"), (20, "0"), (11, "4000"), (21, "3000")];

#[test]
fn dxf_units() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("plan.dxf");
    let drawing = path.to_str().expect("a plain path");
    let layers = [("A-WALL", 7), ("A-COLS", 3), ("A-BAY", 1), ("A-ANNO", -2)];
    let all = [ROOM, BAY, OLD_LINE, LINE, COLUMN, ARC, BLOCK, HIDDEN];
    fs::write(&path, dxf("4", &layers, &all)).expect("writable");
    let output = run(&["scene", "from-dxf", drawing]);
    assert!(stderr(&output).contains("ignored: 1 blocks"), "{}", stderr(&output));
    let scene = made(&["scene", "from-dxf", drawing]);
    let near =
        |a: DVec2, x: f64, y: f64| assert!(a.distance((x, y).into()) < 1e-3, "{a} is not {x}, {y}");
    let room = walls(&scene, "A-WALL-1");
    assert_eq!(room.len(), 4);
    near(room[1].b, 4.0, 3.0);
    // The bulge of a half circle to the right of the way from (1, 1) to (2, 1).
    let bay = walls(&scene, "A-BAY-2");
    assert!(bay.len() > 6 && bay.iter().all(|wall| wall.a.y < 1.0 + 1e-9), "{bay:?}");
    assert!(bay.iter().all(|wall| (wall.b.distance((1.5, 1.0).into()) - 0.5).abs() < 1e-3));
    near(walls(&scene, "A-WALL-3")[0].b, 0.5, 2.5);
    near(walls(&scene, "A-WALL-4")[0].a, 3.0, 0.5);
    let [column] = &scene.cylinders[..] else { panic!("{:?}", scene.cylinders) };
    near(column.center, 2.5, 2.0);
    assert_eq!((&*column.id, column.radius_m), ("A-COLS-5", 0.15));
    let arc = walls(&scene, "A-BAY-6");
    near(arc[0].a, 3.0, 1.5);
    near(arc[arc.len() - 1].b, 3.0, 2.5);
    assert!(arc.iter().all(|wall| wall.a.midpoint(wall.b).x > 3.0), "{arc:?}");
    // What is switched off counts where it is named, and nothing else does then.
    let scene = made(&["scene", "from-dxf", drawing, "--layer", "A-ANNO", "--unit-m", "0.01"]);
    let [wall] = &scene.walls[..] else { panic!("{:?}", scene.walls) };
    near(wall.b, 40.0, 30.0);
    refused(&["scene", "from-dxf", drawing, "--layer", "A-WALLS"], "layer `A-WALLS` is empty");
}

#[test]
fn unusable_drawings() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("plan.dxf");
    let drawing = path.to_str().expect("a plain path");
    // The last has a time that is out of range.
    let time = dxf("6\n  9\n$TDCREATE\n 40\n1e300", &[], &[LINE]);
    for (text, part) in [
        (dxf("0", &[], &[LINE]), "--unit-m"),
        (dxf("6", &[], &[BLOCK]), "no walls"),
        (dxf("6", &[], &[LINE]).replace("3500", "wide"), "invalid DXF"),
        ("hello".to_owned(), "invalid DXF"),
        (String::new(), "$INSUNITS"),
        (time, "out of range"),
    ] {
        fs::write(&path, text).expect("writable");
        refused(&["scene", "from-dxf", drawing], part);
        assert!(!stderr(&run(&["scene", "from-dxf", drawing])).contains("panicked"));
    }
}

/// A closed outline in a drawing's units, on a layer.
fn outline(layer: &str, corners: [(f64, f64); 4]) -> Vec<(i32, String)> {
    let head = [(0, "LWPOLYLINE"), (8, layer), (90, "4"), (70, "1")];
    let corners = corners.into_iter().flat_map(|(x, y)| [(10, x.to_string()), (20, y.to_string())]);
    head.into_iter().map(|(code, value)| (code, value.to_owned())).chain(corners).collect()
}

fn room(layer: &str, x: f64, y: f64) -> Vec<(i32, String)> {
    outline(layer, [(x, y), (x + 4.0, y), (x + 4.0, y + 3.0), (x, y + 3.0)])
}

/// A drawing with layers of these names, flags and colours.
fn drawing(
    units: &str,
    layers: &[(&str, i32, i32)],
    blocks: &str,
    entities: &[Vec<(i32, String)>],
) -> String {
    let entities: String =
        entities.iter().flatten().map(|(code, value)| format!("{code}\n{value}\n")).collect();
    let layers: String = layers
        .iter()
        .map(|(name, flags, colour)| {
            format!("0\nLAYER\n2\n{name}\n70\n{flags}\n62\n{colour}\n6\nContinuous\n")
        })
        .collect();
    format!(
        "0\nSECTION\n2\nHEADER\n9\n$ACADVER\n1\nAC1015\n9\n$INSUNITS\n70\n{units}\n0\nENDSEC\n\
         0\nSECTION\n2\nTABLES\n0\nTABLE\n2\nLAYER\n70\n9\n{layers}0\nENDTAB\n0\nENDSEC\n\
         0\nSECTION\n2\nBLOCKS\n{blocks}0\nENDSEC\n0\nSECTION\n2\nENTITIES\n{entities}0\nENDSEC\n0\nEOF\n"
    )
}

struct Dxf {
    folder: tempfile::TempDir,
}

impl Dxf {
    fn new(text: &str) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        fs::write(folder.path().join("plan.dxf"), text).expect("writable");
        Self { folder }
    }

    fn path(&self) -> String {
        self.folder.path().join("plan.dxf").to_str().expect("a plain path").to_owned()
    }
}

#[test]
fn hidden_layers() {
    for (name, flags, colour, is_seen) in [
        ("FURN", 0, 7, true),
        ("FURN", 1, 7, false),
        ("Furn", 5, 7, false),
        ("furn", 0, -7, false),
        ("FURN", 4, 7, true),
        ("FURN", 2, 7, true),
    ] {
        let layers = [("WALLS", 0, 7), (name, flags, colour)];
        let dxf = Dxf::new(&drawing(
            "6",
            &layers,
            "",
            &[room("WALLS", 0.0, 0.0), room("FURN", 1.0, 1.0)],
        ));
        let scene = made(&["scene", "from-dxf", &dxf.path()]);
        assert_eq!(scene.walls.len(), if is_seen { 8 } else { 4 }, "{name} {flags} {colour}");
        let scene = made(&["scene", "from-dxf", &dxf.path(), "--layer", "furn"]);
        assert_eq!(scene.walls.len(), 4);
    }
}

#[test]
fn implausible_and_far_plans() {
    for units in ["4", "1", "7"] {
        let dxf = Dxf::new(&drawing(units, &[], "", &[room("0", 0.0, 0.0)]));
        refused(&["scene", "from-dxf", &dxf.path()], "--unit-m 1");
        assert_eq!(
            made(&["scene", "from-dxf", &dxf.path(), "--unit-m", "1"]).walls[0].b,
            DVec2::new(4.0, 0.0)
        );
    }
    let dxf = Dxf::new(&drawing("6", &[], "", &[room("0", 500_000.0, 5_800_000.0)]));
    let output = run(&["scene", "from-dxf", &dxf.path()]);
    assert!(stderr(&output).contains("-500000 m in x and -5800000 m in y"), "{}", stderr(&output));
    assert_eq!(made(&["scene", "from-dxf", &dxf.path()]).walls[1].b, DVec2::new(4.0, 3.0));
}

#[test]
fn blocks_and_filled_areas() {
    let line = "0\nLINE\n8\n0\n10\n1\n20\n0\n11\n2\n21\n0\n";
    let block = format!(
        "0\nBLOCK\n8\n0\n2\nDOOR\n70\n0\n10\n1\n20\n0\n30\n0\n3\nDOOR\n{line}0\nENDBLK\n8\n0\n"
    );
    let insert = [
        (0, "INSERT"),
        (8, "DOORS"),
        (2, "door"),
        (10, "2"),
        (20, "1"),
        (30, "0"),
        (41, "2"),
        (42, "2"),
        (50, "90"),
    ];
    let solid = [
        (0, "SOLID"),
        (8, "0"),
        (10, "1"),
        (20, "1"),
        (30, "0"),
        (11, "2"),
        (21, "1"),
        (31, "0"),
        (12, "1"),
        (22, "2"),
        (32, "0"),
        (13, "2"),
        (23, "2"),
        (33, "0"),
    ];
    let owned = |pairs: &[(i32, &str)]| {
        pairs.iter().map(|(code, value)| (*code, (*value).to_owned())).collect::<Vec<_>>()
    };
    let dxf =
        Dxf::new(&drawing("6", &[], &block, &[room("0", 0.0, 0.0), owned(&insert), owned(&solid)]));
    let scene = made(&["scene", "from-dxf", &dxf.path()]);
    let door = walls(&scene, "DOORS-2");
    assert!(
        door[0].a.distance((2.0, 1.0).into()) < 1e-3
            && door[0].b.distance((2.0, 3.0).into()) < 1e-3,
        "{door:?}"
    );
    let square = walls(&scene, "0-3");
    assert!(
        square.len() == 4 && square.iter().all(|wall| wall.a.distance(wall.b) < 1.001),
        "{square:?}"
    );
    let text = [(0, "TEXT"), (8, "0"), (10, "1"), (20, "1"), (40, "0.2"), (1, "kitchen")];
    let dxf = Dxf::new(&drawing("6", &[], "", &[room("0", 0.0, 0.0), owned(&text)]));
    let output = run(&["scene", "from-dxf", &dxf.path()]);
    assert!(stderr(&output).contains("1 texts"), "{}", stderr(&output));
}
