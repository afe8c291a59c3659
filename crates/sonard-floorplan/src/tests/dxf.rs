//! Drawings as DXF.

use super::walls;
use crate::dxf::{self, DxfOptions};

/// A drawing in metres; `entities` are pairs of code and value, separated by blanks.
fn drawing(entities: &str) -> String {
    let pairs = format!(
        "0 SECTION 2 HEADER 9 $INSUNITS 70 6 0 ENDSEC 0 SECTION 2 ENTITIES 0 LINE 8 0 10 0 20 0 11 4 21 3 {entities} 0 ENDSEC 0 EOF"
    );
    pairs.split_whitespace().map(|word| format!("{word}\n")).collect()
}

#[test]
fn unknown_entities_are_named() {
    let entities = "0 HATCH 8 0 0 MULTILEADER 8 0 170 1 304 LEADER{ 0 FROBNICATE 8 0 0 MESH 8 0 0 TEXT 8 0 67 1";
    let plan = dxf::read(drawing(entities).as_bytes(), &DxfOptions::default()).expect("a drawing");
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
fn other_files_and_line_ends() {
    let returns = drawing("").replace('\n', "\r");
    dxf::read(returns.as_bytes(), &DxfOptions::default()).expect("a drawing");
    for (bytes, what) in [(&b"AC1027\0"[..], "DWG"), (b"\x1f\x8b\x08", "gzip"), (b"<svg/>", "XML")]
    {
        let error = dxf::read(bytes, &DxfOptions::default()).expect_err("no drawing");
        assert!(error.to_string().contains(what) && !error.help().is_empty(), "{error}");
    }
    let small = drawing("").replace("\n4\n", "\n1\n").replace("\n3\n", "\n1\n");
    let error = dxf::read(small.as_bytes(), &DxfOptions::default()).expect_err("too small");
    assert!(error.help().contains("--unit-m"), "{}", error.help());
}

#[test]
fn large_drawings_are_rejected() {
    let large = vec![b' '; crate::MAX_FILE_BYTES + 1];
    let error = dxf::read(&large, &DxfOptions::default()).expect_err("too large");
    assert!(error.to_string().contains("larger than 16 MB"), "{error}");
}
