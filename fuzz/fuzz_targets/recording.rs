//! Any bytes as a recording of ROS 2, and as a message in one: nothing panics, and memory follows
//! the bytes.
#![no_main]

use std::io::{self, Cursor, Read};

use libfuzzer_sys::fuzz_target;
use sonard::{
    acoustics::Air,
    geometry::Pose,
    import::{Assumptions, Format, ImportSource, Mapping, read_message},
};

fuzz_target!(|bytes: &[u8]| {
    for type_name in
        ["sensor_msgs/msg/Range", "sensor_msgs/msg/LaserScan", "tf2_msgs/msg/TFMessage"]
    {
        if let Ok(numbers) = read_message(type_name, bytes) {
            assert!(numbers <= bytes.len(), "{numbers} numbers of {} bytes", bytes.len());
        }
    }
    let whole = [b"\x89MCAP0\r\n", bytes].concat();
    let open = || -> io::Result<Box<dyn Read>> { Ok(Box::new(Cursor::new(whole.clone()))) };
    let taken = Assumptions {
        sha256: String::new(),
        pose: Pose { x_m: 0.0, y_m: 0.0, heading_deg: 0.0 },
        array: None,
        sensor: "hc-sr04".to_owned(),
        max_range_m: 4.0,
        min_range_m: 0.02,
        air: Air::default(),
        started: "1970-01-01T00:00:00Z".parse().expect("a time"),
        skip_checks: false,
    };
    let mapping = Mapping { format: Some(Format::Mcap), ..Mapping::default() };
    if let Ok(found) = (ImportSource { open: &open }).examine(mapping, taken) {
        let scans = found.scans(Cursor::new(whole.clone())).expect("a recording");
        assert!(scans.count() > 0 || found.readings == 0);
    }
});
