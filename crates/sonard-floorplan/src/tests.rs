//! Floor plans from file to walls.

use std::path::{Path, PathBuf};

use sonard_model::scene::Scene;

use crate::{
    FloorPlan, PlanError,
    dxf::{self, DxfOptions},
    sdf::{self, Library, SdfOptions},
    svg::{self, SvgOptions},
};

/// Ends of the walls, to a millimetre.
fn walls(plan: &FloorPlan) -> Vec<[f64; 4]> {
    let scene: Scene = plan.surfaces.scene("plan", 0.97).build().expect("a scene");
    let round = |m: f64| (1e3 * m).round() / 1e3 + 0.0;
    scene.walls.iter().map(|wall| [wall.a.x, wall.a.y, wall.b.x, wall.b.y].map(round)).collect()
}

fn drawing(text: &str) -> Result<FloorPlan, PlanError> {
    svg::read(text.as_bytes(), &SvgOptions { width_m: 10.0 })
}

fn svg_page(content: &str) -> String {
    format!(
        "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 100 80' stroke='black'>{content}</svg>"
    )
}

const LINE: &str = "<line x1='0' y1='40' x2='100' y2='40'/>";

#[test]
fn svg_with_document_type() {
    for head in [
        "<!DOCTYPE svg PUBLIC '-//W3C//DTD SVG 1.1//EN' 'http://www.w3.org/Graphics/SVG/1.1/DTD/svg11.dtd'>",
        "<?xml version='1.0'?><!DOCTYPE svg [<!ENTITY ns 'http://www.w3.org/2000/svg'>]>",
    ] {
        let plan = drawing(&format!("{head}{}", svg_page(LINE))).expect("a drawing");
        assert_eq!(walls(&plan), [[0.0, 4.0, 10.0, 4.0]]);
    }
}

#[test]
fn svg_filters_and_pages() {
    let shadow =
        format!("<filter id='f'><feOffset dx='50'/></filter><g filter='url(#f)'>{LINE}</g>");
    assert_eq!(walls(&drawing(&svg_page(&shadow)).expect("a drawing")), [[0.0, 4.0, 10.0, 4.0]]);
    let beyond =
        drawing(&svg_page("<line x1='-50' y1='40' x2='150' y2='40'/>")).expect("a drawing");
    assert!(beyond.notes[0].contains("1 lines reach beyond the page"), "{:?}", beyond.notes);
}

#[test]
fn svg_clip_paths_of_any_shape() {
    for (clip, spans) in [
        ("<polygon points='20,0 60,0 60,80 40,80'/>", vec![[3.0, 6.0]]),
        (
            "<rect x='40' y='0' width='20' height='80' transform='rotate(45 50 40)'/>",
            vec![[3.586, 6.414]],
        ),
        (
            "<rect x='10' width='20' height='80'/><rect x='60' width='20' height='80'/>",
            vec![[1.0, 3.0], [6.0, 8.0]],
        ),
        (
            "<path clip-rule='evenodd' d='M10,0 H90 V80 H10 Z M40,20 H60 V60 H40 Z'/>",
            vec![[1.0, 4.0], [6.0, 9.0]],
        ),
    ] {
        let text = svg_page(&format!(
            "<clipPath id='c'>{clip}</clipPath><g clip-path='url(#c)'>{LINE}</g>"
        ));
        let found = walls(&drawing(&text).expect("a drawing"));
        let expected: Vec<[f64; 4]> =
            spans.iter().map(|[from, to]| [*from, 4.0, *to, 4.0]).collect();
        assert_eq!(found, expected, "{clip}");
    }
}

/// A drawing in metres; `entities` are pairs of code and value, separated by blanks.
fn dxf_text(entities: &str) -> String {
    let pairs = format!(
        "0 SECTION 2 HEADER 9 $INSUNITS 70 6 0 ENDSEC 0 SECTION 2 ENTITIES 0 LINE 8 0 10 0 20 0 11 4 21 3 {entities} 0 ENDSEC 0 EOF"
    );
    pairs.split_whitespace().map(|word| format!("{word}\n")).collect()
}

#[test]
fn dxf_unknown_entities_are_named() {
    let entities = "0 HATCH 8 0 0 MULTILEADER 8 0 170 1 304 LEADER{ 0 FROBNICATE 8 0 0 MESH 8 0 0 TEXT 8 0 67 1";
    let plan = dxf::read(dxf_text(entities).as_bytes(), &DxfOptions::default()).expect("a drawing");
    assert_eq!(walls(&plan), [[0.0, 0.0, 4.0, 3.0]]);
    let notes = plan.notes.join("\n");
    for part in
        ["1 hatches", "1 dimensions and leaders", "1 other entities (FROBNICATE)", "1 meshes"]
    {
        assert!(notes.contains(part), "{part}: {notes}");
    }
    assert!(!notes.contains("texts"), "{notes}");
}

#[test]
fn dxf_other_files_and_line_ends() {
    let returns = dxf_text("").replace('\n', "\r");
    dxf::read(returns.as_bytes(), &DxfOptions::default()).expect("a drawing");
    for (bytes, what) in [(&b"AC1027\0"[..], "DWG"), (b"\x1f\x8b\x08", "gzip"), (b"<svg/>", "XML")]
    {
        let error = dxf::read(bytes, &DxfOptions::default()).expect_err("no drawing");
        assert!(error.to_string().contains(what) && !error.help().is_empty(), "{error}");
    }
    let small = dxf_text("").replace("\n4\n", "\n1\n").replace("\n3\n", "\n1\n");
    let error = dxf::read(small.as_bytes(), &DxfOptions::default()).expect_err("too small");
    assert!(error.help().contains("--unit-m"), "{}", error.help());
}

/// Library with one model, a box on the ground.
struct Table;

impl Library for Table {
    fn model(
        &self,
        uri: &str,
        _: Option<&std::path::Path>,
    ) -> Option<(std::path::PathBuf, Vec<u8>)> {
        let model = format!("<sdf version='1.9'>{}</sdf>", model("table", "0 0 0.5 0 0 0"));
        (uri == "model://table").then(|| (uri.into(), model.into_bytes()))
    }
}

fn model(name: &str, pose: &str) -> String {
    format!(
        "<model name='{name}'><pose>{pose}</pose><link name='l'><collision name='c'><geometry><box><size>2 1 1</size></box>\
         </geometry></collision></link></model>"
    )
}

fn world(content: &str) -> FloorPlan {
    let text = format!("<sdf version='1.9'><world name='w'>{content}</world></sdf>");
    sdf::read(text.as_bytes(), &SdfOptions { cut_z_m: 0.2 }, &Table).expect("a world")
}

#[test]
fn sdf_state_of_included_models() {
    let state = "<state world_name='w'><model name='t'><pose>3 0 0.5 0 0 0</pose><link name='l'><pose>3 5 0.5 0 0 0</pose></link>\
                 </model></state>";
    let plan = world(&format!("<include><uri>model://table</uri><name>t</name></include>{state}"));
    assert_eq!(walls(&plan)[0], [2.0, 4.5, 4.0, 4.5]);
}

#[test]
fn sdf_omissions_are_named() {
    let content = format!(
        "{}{}<actor name='walker'/><include><uri>model://lamp</uri></include>",
        model("a", "0 0 0.5 0 0 0"),
        model("high", "0 0 5 0 0 0")
    );
    let text = format!(
        "<sdf version='1.9'><world name='w'>{content}</world><world name='v'>{}</world></sdf>",
        model("b", "0 9 0.5 0 0 0")
    );
    let plan = sdf::read(text.as_bytes(), &SdfOptions { cut_z_m: 0.2 }, &Table).expect("a world");
    assert_eq!(walls(&plan).len(), 4);
    let notes = plan.notes.join("\n");
    for part in ["actor `walker`", "model://lamp", "world `v`", "1 shapes are above or below"] {
        assert!(notes.contains(part), "{part}: {notes}");
    }
}

#[test]
fn sdf_nesting_is_limited() {
    let deep = "<model name='m'>".repeat(300) + &"</model>".repeat(300);
    assert!(world(&deep).notes.iter().any(|note| note.contains("nested too deeply")));
    let joint = "<model name='m'><link name='base'><pose>1 0 0 0 0 0</pose></link><joint name='j'><child>base</child></joint>\
                 <link name='l'><pose relative_to='j'>2 0 0.5 0 0 0</pose><collision name='c'><geometry><box><size>2 1 1</size></box>\
                 </geometry></collision></link></model>";
    assert_eq!(walls(&world(joint))[0], [2.0, -0.5, 4.0, -0.5]);
}

#[test]
fn large_files_are_rejected() {
    use std::io::Write as _;

    use flate2::{Compression, write::GzEncoder};

    let large = vec![b' '; crate::MAX_FILE_BYTES + 1];
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(&large).expect("in memory");
    let compressed = encoder.finish().expect("in memory");
    let svg = |bytes: &[u8]| svg::read(bytes, &SvgOptions { width_m: 10.0 });
    for plan in [
        dxf::read(&large, &DxfOptions::default()),
        svg(&large),
        svg(&compressed),
        sdf::read(&large, &SdfOptions { cut_z_m: 0.3 }, &Table),
    ] {
        let error = plan.expect_err("too large");
        assert!(error.to_string().contains("larger than 16 MB"), "{error}");
    }
}

/// Library in which every model includes itself repeatedly.
struct Recursive {
    padding: usize,
}

impl Library for Recursive {
    fn model(&self, uri: &str, _: Option<&Path>) -> Option<(PathBuf, Vec<u8>)> {
        let include = "<include><uri>model://again</uri></include>".repeat(4);
        let padding = " ".repeat(self.padding);
        let model = format!("<sdf version='1.6'><model name='m'>{include}{padding}</model></sdf>");
        Some((PathBuf::from(uri), model.into_bytes()))
    }
}

#[test]
fn recursive_models_are_bounded() {
    let world = "<sdf version='1.6'><world name='w'><include><uri>model://again</uri></include></world></sdf>";
    for (padding, limit) in [(0, "8 nested files"), (1 << 20, "64 MB of included files")] {
        let plan =
            sdf::read(world.as_bytes(), &SdfOptions { cut_z_m: 0.2 }, &Recursive { padding });
        let notes = plan.expect("a world").notes;
        let expected = format!("ignored: the model `model://again`: more than {limit}");
        assert!(notes.contains(&expected), "{padding}: {notes:?}");
    }
}

#[test]
fn notes_are_distinct_and_bounded() {
    let include = |name: usize| format!("<include><uri>model://m{name}</uri></include>");
    let includes: String = (0..500).chain(0..500).map(include).collect();
    let world = format!("<sdf version='1.6'><world name='w'>{includes}</world></sdf>");
    let plan = sdf::read(world.as_bytes(), &SdfOptions { cut_z_m: 0.2 }, &sdf::NoLibrary);
    let notes = plan.expect("a world").notes;
    assert_eq!((notes.len(), notes.last().map(String::as_str)), (101, Some("900 further notes")));
}
