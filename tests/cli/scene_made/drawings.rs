//! Drawings: layers, units, blocks and far origins of DXF; markers, clip paths and compression of SVG.

use std::{fs, io::Write as _};

use super::*;

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

/// A drawing of 100 by 80 that is ten metres wide.
fn svg(content: &str) -> (Vec<[f64; 4]>, String) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("plan.svg");
    fs::write(
        &path,
        format!("<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 100 80'>{content}</svg>"),
    )
    .expect("writable");
    let path = path.to_str().expect("a plain path");
    let scene = made(&["scene", "from-svg", path, "--width-m", "10"]);
    let ends = scene.walls.iter().map(|wall| [wall.a.x, wall.a.y, wall.b.x, wall.b.y]);
    let rounded = ends.map(|ends| ends.map(|m| (1e3 * m).round() / 1e3)).collect();
    (rounded, stderr(&run(&["scene", "from-svg", path, "--width-m", "10"])))
}

#[test]
fn markers_and_clip_paths() {
    let marker = "<defs><marker id='a' orient='auto' style='overflow:visible'><path d='M 5,0 -3,5 V -5 Z'/></marker></defs>";
    for ends in
        ["marker-end:url(#a)", "marker-start:url(#a)", "marker-mid:url(#a)", "marker:url(#a)"]
    {
        let line = format!(
            "{marker}<path d='M 10 10 L 50 10 L 90 10' stroke='black' fill='none' style='{ends}'/>"
        );
        let (found, _) = svg(&line);
        assert!(
            found.iter().all(|wall| wall[1] == 7.0 && wall[3] == 7.0) && found.len() == 2,
            "{ends}: {found:?}"
        );
    }
    let clip = "<clipPath id='c'><rect x='40' y='0' width='20' height='80'/></clipPath><g clip-path='url(#c)'>\
                <line x1='0' y1='40' x2='100' y2='40' stroke='black'/></g>";
    assert_eq!(svg(clip), (vec![[4.0, 4.0, 6.0, 4.0]], String::new()));
    let moved = clip.replace("<g clip", "<g transform='translate(10 0)' clip");
    assert_eq!(svg(&moved).0, [[5.0, 4.0, 7.0, 4.0]]);
    let inner = "<svg x='20' y='20' width='40' height='40' viewBox='0 0 40 40'><line x1='10' y1='20' x2='70' y2='20' stroke='black'/></svg>";
    assert_eq!(svg(inner).0, [[3.0, 4.0, 6.0, 4.0]]);
    let (found, printed) = svg(&clip.replace(
        "<rect x='40' y='0' width='20' height='80'/>",
        "<circle cx='50' cy='40' r='10'/>",
    ));
    assert_eq!((found, printed), (vec![[4.0, 4.0, 6.0, 4.0]], String::new()));
}

#[test]
fn compressed_and_unsized_drawings() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("plan.svgz");
    let text = "<svg xmlns='http://www.w3.org/2000/svg'><line x1='0' y1='5' x2='100' y2='5' stroke='black'/></svg>";
    let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    packed.write_all(text.as_bytes()).expect("memory takes it");
    fs::write(&path, packed.finish().expect("memory takes it")).expect("writable");
    let output =
        run(&["scene", "from-svg", path.to_str().expect("a plain path"), "--width-m", "10"]);
    let printed = stderr(&output);
    assert!(output.status.success() && printed.contains("neither width nor viewBox"), "{printed}");
}
