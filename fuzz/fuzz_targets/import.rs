//! Any bytes as a file of each format that is a text: nothing panics, and what was counted is what
//! comes out.
#![no_main]

use std::io::{self, Cursor, Read};

use libfuzzer_sys::fuzz_target;
use sonard::{
    acoustics::Air,
    array::RangerArray,
    geometry::Pose,
    import::{Assumptions, FORMATS, Format, ImportSource, Mapping},
    scan::Record,
};

fuzz_target!(|bytes: &[u8]| {
    let Some(([choice, options], text)) = bytes.split_first_chunk() else { return };
    let format = FORMATS[usize::from(*choice) % FORMATS.len()].format;
    if format == Format::Mcap {
        return;
    }
    let columns = match options % 4 {
        0 => Mapping::parse_columns("azimuth_deg=1,range_m=2,time=3").ok(),
        1 => Mapping::parse_columns("azimuth_deg=a,range_cm=b").ok(),
        2 => Mapping::parse_columns("range_m=1-8").ok(),
        _ => None,
    };
    let columns = columns.filter(|_| format.entry().has_columns).unwrap_or_default();
    let mapping = Mapping { format: Some(format), columns, ..Mapping::default() };
    let array = RangerArray::preset("pioneer-8").ok().filter(|_| options & 4 == 4);
    let taken = Assumptions {
        sha256: String::new(),
        pose: Pose { x_m: 0.0, y_m: 0.0, heading_deg: 0.0 },
        array,
        sensor: "hc-sr04".to_owned(),
        max_range_m: 4.0,
        min_range_m: 0.02,
        air: Air::default(),
        started: "1970-01-01T00:00:00Z".parse().expect("a time"),
        skip_checks: options & 8 == 8,
    };
    let open = || -> io::Result<Box<dyn Read>> { Ok(Box::new(Cursor::new(text.to_vec()))) };
    if let Ok(found) = (ImportSource { open: &open }).examine(mapping, taken) {
        let scans = found.scans(Cursor::new(text.to_vec())).expect("as before");
        let records = scans.flat_map(|scan| scan.expect("as before"));
        let pings = records.filter(|record| matches!(record, Record::Ping(_))).count() as u64;
        assert_eq!(pings, found.readings);
    }
});
