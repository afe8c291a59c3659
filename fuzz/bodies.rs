//! Bodies of the fuzz targets of decoders; `tests/decoders.rs` runs them on random bytes and on the
//! kept seeds.
//!
//! Any bytes are read as a file: nothing panics, and an examination counts what a conversion
//! yields.

use std::{
    io::{self, Cursor, Read},
    path::{Path, PathBuf},
};

use sonard::{
    acoustics::Air,
    array::RangerArray,
    floorplan::{
        FloorPlan, PlanError,
        dxf::{self, DxfOptions},
        sdf::{self, Library, SdfOptions},
        svg::{self, SvgOptions},
    },
    geometry::Pose,
    import::{Assumptions, Format, ImportSource, Mapping, read_message},
    interpret::grid::{MapYaml, from_pgm},
    scan::Record,
};

/// Body of a target.
pub(crate) type Body = fn(&[u8]);

/// Targets with their bodies.
pub(crate) const BODIES: [(&str, Body); 11] = [
    ("import", |bytes| import(None, bytes)),
    ("table", |bytes| import(Some(Format::Csv), bytes)),
    ("json", |bytes| import(Some(Format::Json), bytes)),
    ("ros_text", |bytes| import(Some(Format::RosText), bytes)),
    ("carmen", |bytes| import(Some(Format::Carmen), bytes)),
    ("player", |bytes| import(Some(Format::Player), bytes)),
    ("recording", recording),
    ("map", map),
    ("sdf", sdf),
    ("dxf", dxf),
    ("svg", svg),
];

/// Runs the body of a target.
///
/// # Panics
/// Panics if there is no such target, or if the body finds a fault.
pub(crate) fn run(target: &str, bytes: &[u8]) {
    let found = BODIES.iter().find(|(name, _)| *name == target);
    found.expect("a target").1(bytes);
}

fn assumptions(array: Option<RangerArray>, skip_checks: bool) -> Assumptions {
    Assumptions {
        sha256: String::new(),
        pose: Pose { x_m: 0.0, y_m: 0.0, heading_deg: 0.0 },
        array,
        sensor: "hc-sr04".to_owned(),
        max_range_m: 4.0,
        min_range_m: 0.02,
        air: Air::default(),
        started: "1970-01-01T00:00:00Z".parse().expect("a time"),
        skip_checks,
    }
}

/// Reads a text of a format, or of the format that is detected; the first byte selects options.
fn import(format: Option<Format>, bytes: &[u8]) {
    let Some((options, text)) = bytes.split_first() else { return };
    let columns = match options % 4 {
        0 => Mapping::parse_columns("azimuth_deg=1,range_m=2,time=3").ok(),
        1 => Mapping::parse_columns("azimuth_deg=a,range_cm=b").ok(),
        2 => Mapping::parse_columns("range_m=1-8").ok(),
        _ => None,
    };
    let has_columns = format.is_none_or(|format| format.entry().has_columns);
    let columns = columns.filter(|_| has_columns).unwrap_or_default();
    let mapping = Mapping { format, columns, ..Mapping::default() };
    let array = RangerArray::preset("pioneer-8").ok().filter(|_| options & 4 == 4);
    let open = || -> io::Result<Box<dyn Read>> { Ok(Box::new(Cursor::new(text.to_vec()))) };
    let assumptions = assumptions(array, options & 8 == 8);
    if let Ok(found) = (ImportSource { open: &open }).examine(mapping, assumptions) {
        if found.format == Format::Mcap {
            return;
        }
        let scans = found.scans(Cursor::new(text.to_vec())).expect("as before");
        let records = scans.flat_map(|scan| scan.expect("as before"));
        let pings = records.filter(|record| matches!(record, Record::Ping(_))).count() as u64;
        assert_eq!(pings, found.readings);
    }
}

fn recording(bytes: &[u8]) {
    for type_name in
        ["sensor_msgs/msg/Range", "sensor_msgs/msg/LaserScan", "tf2_msgs/msg/TFMessage"]
    {
        if let Ok(numbers) = read_message(type_name, bytes) {
            assert!(numbers <= bytes.len(), "{numbers} numbers of {} bytes", bytes.len());
        }
    }
    let whole = [b"\x89MCAP0\r\n", bytes].concat();
    let open = || -> io::Result<Box<dyn Read>> { Ok(Box::new(Cursor::new(whole.clone()))) };
    let mapping = Mapping { format: Some(Format::Mcap), ..Mapping::default() };
    if let Ok(found) = (ImportSource { open: &open }).examine(mapping, assumptions(None, false)) {
        let scans = found.scans(Cursor::new(whole.clone())).expect("a recording");
        assert!(scans.count() > 0 || found.readings == 0);
    }
}

/// Reads a description and, after a zero byte, an image.
fn map(bytes: &[u8]) {
    let at = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
    let (text, image) = bytes.split_at(at);
    let image = image.get(1..).unwrap_or_default();
    let by_text = MapYaml::from_text(&String::from_utf8_lossy(text)).ok();
    let plain = "image: a.pgm\nresolution: 0.05\norigin: [0, 0, 0]\n";
    for yaml in [by_text, MapYaml::from_text(plain).ok()].into_iter().flatten() {
        if let Ok(grid) = from_pgm(image, &yaml) {
            assert!(grid.probabilities().all(|p| (0.0..=1.0).contains(&p)));
        }
    }
}

/// Library in which every model is the world itself, so that includes nest without end.
struct Endless<'a>(&'a [u8]);

impl Library for Endless<'_> {
    fn model(&self, uri: &str, _: Option<&Path>) -> Option<(PathBuf, Vec<u8>)> {
        Some((PathBuf::from(uri), self.0.to_vec()))
    }
}

fn sdf(bytes: &[u8]) {
    check(sdf::read(bytes, &SdfOptions { cut_z_m: 0.2 }, &Endless(bytes)));
}

fn dxf(bytes: &[u8]) {
    for unit_m in [None, Some(0.001)] {
        check(dxf::read(bytes, &DxfOptions { unit_m, layers: Vec::new() }));
    }
}

fn svg(bytes: &[u8]) {
    check(svg::read(bytes, &SvgOptions { width_m: 10.0 }));
}

fn check(plan: Result<FloorPlan, PlanError>) {
    match plan {
        Ok(plan) => {
            let scene = plan.surfaces.scene("any", 0.97);
            if let Ok(scene) = scene.build() {
                assert!(scene.walls.iter().all(|wall| wall.a.is_finite() && wall.b.is_finite()));
            }
        }
        Err(error) => assert!(!error.to_string().is_empty() && !error.help().is_empty()),
    }
}
