//! LaserScan and Range messages as JSON and as YAML.

use sonard_model::reading::PingStatus;

use super::*;
use crate::Format;

const SCAN: &str = "{\"header\": {\"stamp\": {\"sec\": 1760000000, \"nanosec\": 500000000}, \"frame_id\": \"laser\"}, \
    \"angle_min\": -1.0, \"angle_max\": 1.0, \"angle_increment\": 0.5, \"range_min\": 0.02, \"range_max\": 4.0, \
    \"ranges\": [1.0, 1.1, null, 0.0, 5.0]}";

fn read(text: &str) -> Vec<(f64, Option<f64>)> {
    let records =
        import(text, Mapping::default()).unwrap_or_else(|error| panic!("{text}: {error}"));
    let round = |number: f64| (number * 1e3).round() / 1e3;
    pings(&records).iter().map(|ping| (round(ping.azimuth_deg), ping.range_m.map(round))).collect()
}

#[test]
fn reads_laser_scan_json() {
    // rosbridge writes null for infinity and NaN.
    let expected =
        [(302.704, Some(1.0)), (331.352, Some(1.1)), (0.0, None), (28.648, None), (57.296, None)];
    for text in [
        SCAN.to_owned(),
        format!("[{SCAN}]"),
        format!("{{\"op\": \"publish\", \"topic\": \"/scan\", \"msg\": {SCAN}}}\n"),
        format!("\u{feff}{SCAN}\n"),
    ] {
        assert_eq!(read(&text), expected, "{text}");
    }
    let twice = format!("{SCAN}\n{SCAN}\n");
    let records = import(&twice, Mapping::default()).expect("two scans");
    assert_eq!(starts(&records).len(), 2);
    assert_eq!(pings(&records)[0].time.map(|time| time.as_millisecond()), Some(1_760_000_000_500));
    let found = examine(SCAN.as_bytes(), Mapping::default(), assumptions()).expect("a scan");
    assert_eq!(found.format, Format::RosText);
    let notes = found.notes.join("\n");
    for part in ["ranges are 0", "are null", "beyond max_range", "the file has no frames"] {
        assert!(notes.contains(part), "{part}: {notes}");
    }
}

#[test]
fn reads_rostopic_echo() {
    let ros_1 = "header:\n  seq: 1\n  stamp:\n    secs: 1760000000\n    nsecs: 0\n  frame_id: \"laser\"\nangle_min: 0.0\n\
        angle_max: 3.14159\nangle_increment: 1.5707963\ntime_increment: 0.0\nscan_time: 0.1\nrange_min: 0.1\nrange_max: 10.0\n\
        ranges: [1.0, inf, 2.5]\nintensities: []\n---\n";
    let ros_2 = "header:\n  stamp:\n    sec: 1760000000\n    nanosec: 0\n  frame_id: laser\nangle_min: 0.0\nangle_max: 3.14159\n\
        angle_increment: 1.5707963\ntime_increment: 0.0\nscan_time: 0.1\nrange_min: 0.1\nrange_max: 10.0\nranges:\n- 1.0\n- .inf\n- 2.5\n\
        intensities: []\n---\n";
    for text in [ros_1, ros_2] {
        assert_eq!(read(text), [(0.0, Some(1.0)), (90.0, None), (180.0, Some(2.5))], "{text}");
        assert_eq!(read(&text.repeat(3)).len(), 9);
    }
    let shortened = ros_2.replace("- 2.5\n", "- '...'\n");
    assert!(error_text(import(&shortened, Mapping::default())).contains("--full-length"));
}

#[test]
fn range_messages_are_a_fixed_ranger() {
    let message = |range: &str| {
        format!(
            "header:\n  stamp:\n    secs: 1760000000\n    nsecs: 0\n  frame_id: sonar\nradiation_type: 0\nfield_of_view: 0.26\n\
                 min_range: 0.02\nmax_range: 4.0\nrange: {range}\n---\n"
        )
    };
    let text = [message("1.25"), message("4.0"), message("nan")].concat();
    let found = examine(text.as_bytes(), Mapping::default(), assumptions()).expect("ranges");
    assert_eq!((found.readings, found.echoes), (2, 1));
    assert!(found.notes.join(" ").contains("--azimuth-deg"), "{:?}", found.notes);
    let turned = Mapping { azimuth_deg: Some(-90.0), ..Mapping::default() };
    assert_eq!(pings(&import(&text, turned).expect("ranges"))[0].azimuth_deg, 270.0);
}

#[test]
fn reads_lists_of_pairs() {
    for text in ["[[0, 1.0], [10, 1.1], [20, null]]", "[0, 1.0]\n[10, 1.1]\n[20, NaN]\n"] {
        let message = error_text(import(text, Mapping::default()));
        assert!(
            message.contains("lists") && message.contains("--columns azimuth_deg=1"),
            "{message}"
        );
        let records = import(text, columns("azimuth_deg=1,range_m=2")).expect("pairs");
        let read: Vec<_> =
            pings(&records).iter().map(|ping| (ping.azimuth_deg, ping.range_m.is_some())).collect();
        assert_eq!(read, [(0.0, true), (10.0, true), (20.0, false)], "{text}");
    }
}

#[test]
fn non_finite_ranges_of_json() {
    let text = SCAN.replace("1.1, null, 0.0", "Infinity, -Infinity, NaN");
    let records = import(&text, Mapping::default()).expect("a scan");
    let statuses: Vec<PingStatus> = pings(&records).iter().map(|ping| ping.status).collect();
    use PingStatus::{Echo, MinRange, NoEcho};
    assert_eq!(statuses, [Echo, NoEcho, MinRange, NoEcho]);
    let found = examine(text.as_bytes(), Mapping::default(), assumptions()).expect("a scan");
    assert!(found.notes.join(" ").contains("1 of 5 ranges are NaN"), "{:?}", found.notes);
}

#[test]
fn rejects_angles_in_degrees() {
    let text = SCAN.replace("-1.0", "-90.0").replace("0.5,", "45.0,");
    let message = error_text(import(&text, Mapping::default()));
    assert!(
        message.contains("looks like degrees") && message.contains("--no-unit-check"),
        "{message}"
    );
}

#[test]
fn stamps_of_a_board_are_no_dates() {
    let text = SCAN.replace("1760000000", "12");
    let found = examine(text.as_bytes(), Mapping::default(), assumptions()).expect("a scan");
    assert!(found.notes.join(" ").contains("start of the board"), "{:?}", found.notes);
    let started = Some("2026-01-31T12:00:00Z".parse().expect("a time"));
    let records = import(&text, Mapping { started, ..Mapping::default() }).expect("a scan");
    assert_eq!(pings(&records)[0].time, started);
}

#[test]
fn cut_message_is_skipped() {
    let message = "angle_min: 0.0\nangle_increment: 0.5\nranges: [1.0, 2.0]\n---\n";
    let text = format!("{message}{}", &message[..message.len() - 12]);
    let found = examine(text.as_bytes(), Mapping::default(), assumptions()).expect("a scan");
    let notes = found.notes.join(" ");
    assert!(found.readings == 2 && notes.contains("skipped: 1 messages, cut off"), "{notes}");
    assert!(!notes.contains("have no direction"), "{notes}");
}
