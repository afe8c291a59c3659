//! CARMEN and Player logs.

use super::*;
use crate::Format;

/// Two rangers, one facing ahead and one facing left.
const CARMEN: &str = "\
# CARMEN Logfile
PARAM robot_length 0.5
ODOM 9 9 0 0 0 0 1000.0 host 0.1
TRUEPOS 1.0 2.0 1.5707963267948966 9 9 0 1000.0 host 0.1
ODOM 9.5 9 0 0 0 0 1000.1 host 0.2
SONAR 0.26 2 1.50 5.00 0.2 0.0 0.0 0.0 0.1 1.5707963267948966 1000.2 host 0.3
FLASER 3 1 2 3 0 0 0 0 0 0 1000.2 host 0.3
SONAR 0.26 2 1.40 0.75 0.2 0.0 0.0 0.0 0.1 1.5707963267948966 1000.7 host 0.8
";

#[test]
fn carmen_log_is_an_array() {
    let mapping = Mapping { none_from: Some(5.0), ..Mapping::default() };
    let found = examine(CARMEN.as_bytes(), mapping.clone(), assumptions()).expect("right");
    assert_eq!((found.format, found.readings, found.echoes), (Format::Carmen, 4, 3));
    let array = found.assumptions.array.as_ref().expect("an array");
    array.check().expect("one that can be");
    assert_eq!((array.rangers[1].y_m, array.rangers[1].bearing_deg), (0.1, 90.0));
    let records = import(CARMEN, mapping).expect("right");
    let starts = starts(&records);
    // The true pose, although odometry was logged later.
    assert_eq!(starts[0].pose, Pose { x_m: 1.0, y_m: 2.0, heading_deg: 90.0 });
    // Such times count from the start of a board, half a second apart.
    assert_eq!(starts[1].time.as_millisecond(), 500);
    let readings: Vec<_> = pings(&records)
        .iter()
        .map(|ping| (ping.ranger.clone().expect("a ranger"), ping.range_m))
        .collect();
    let expected = [("s0", Some(1.5)), ("s1", None), ("s0", Some(1.4)), ("s1", Some(0.75))];
    assert_eq!(readings, expected.map(|(id, range_m)| (id.to_owned(), range_m)));
}

/// Lines without positions, and older ones without the cone angle.
#[test]
fn missing_positions_need_an_array() {
    let array = examine(CARMEN.as_bytes(), Mapping::default(), assumptions())
        .expect("right")
        .assumptions
        .array;
    for line in ["SONAR 0.26 2 1.5 2.5 10.0 host 0.3\n", "SONAR 2 1.5 2.5 10.0 host 0.3\n"] {
        let without = error_text(examine(line.as_bytes(), Mapping::default(), assumptions()));
        assert!(
            without.contains("does not contain the positions of its 2 rangers")
                && without.contains("--array")
        );
        let with = Assumptions { array: array.clone(), ..assumptions() };
        let found = examine(line.as_bytes(), Mapping::default(), with).expect("right");
        assert_eq!((found.readings, found.echoes, found.has_poses), (2, 2, false), "{line}");
    }
}

const PLAYER: &str = "\
## Player version 2.0.0
0010.000 robot 6665 position2d 00 001 001 +01.000 +02.000 +0.000 0 0 0 0
0010.000 robot 6665 sonar 00 001 002 2 0.2 0.0 0.0 0.0 0.1 1.5707963267948966
0010.100 robot 6665 sonar 00 001 001 2 1.500 2.500
0010.200 robot 6665 laser 00 001 001 0 0 0 0 0
";

#[test]
fn player_log_is_an_array() {
    let records = import(PLAYER, Mapping::default()).expect("right");
    let pings = pings(&records);
    assert_eq!(pings.iter().map(|ping| ping.range_m).collect::<Vec<_>>(), [Some(1.5), Some(2.5)]);
    assert_eq!(pings[1].azimuth_deg, 90.0);
    assert_eq!(starts(&records)[0].pose, Pose { x_m: 1.0, y_m: 2.0, heading_deg: 0.0 });
}

/// Lines without type and subtype, from versions before 2.
#[test]
fn reads_old_player_log() {
    let array = examine(PLAYER.as_bytes(), Mapping::default(), assumptions())
        .expect("right")
        .assumptions
        .array;
    let old =
        "10.0 robot 6665 position 0 1.0 2.0 0.0 0 0 0\n10.1 robot 6665 sonar 0 2 1.500 2.500\n";
    let found = examine(old.as_bytes(), Mapping::default(), Assumptions { array, ..assumptions() })
        .expect("right");
    assert_eq!((found.format, found.readings, found.has_poses), (Format::Player, 2, true));
}

#[test]
fn rejects_truncated_or_changed_lines() {
    let change = CARMEN.replace("1.40 0.75 0.2", "1.40 0.75 0.3");
    let fewer = "SONAR 0.26 1 1.4 1.0 host 0.8\n";
    for (text, words) in [
        (change, "line 8: the positions of the rangers differ from those before"),
        (format!("{CARMEN}{fewer}"), "line 9: 1 ranges, but 2 before"),
        (
            "SONAR 0.26 2 1.5\n".to_owned(),
            "line 1: SONAR message with an unexpected number of words",
        ),
        (
            "ODOM 1 2\nSONAR 1 1.0 1.0 host 0.8\n".to_owned(),
            "line 1: the line ends before the theta",
        ),
        ("ODOM 1 2 3\n".to_owned(), "the log has no sonar messages"),
        (PLAYER.replace("2 1.500 2.500", "2 1.500"), "the line ends before the range"),
    ] {
        let message = error_text(examine(text.as_bytes(), Mapping::default(), assumptions()));
        assert!(message.contains(words), "{message}");
    }
}

/// Positions as data (1:2) and as a reply (4:1); offset and size of the base are not a pose.
#[test]
fn player_types_and_subtypes() {
    let base = "0009.000 robot 6665 position2d 00 004 001 -00.040 +00.000 +00.000 +00.440 +00.400\n\
                0009.000 robot 6665 position2d 00 001 002 -00.040 +00.000 +00.000 +00.440 +00.400\n\
                0009.000 robot 6665 sonar 00 004 003 2 9 9 9 9 9 9\n";
    let with = |geometry: &str| {
        let log = PLAYER.replace("sonar 00 001 002", &format!("sonar 00 {geometry}"));
        import(&format!("{base}{log}"), Mapping::default()).expect("right")
    };
    for geometry in ["001 002", "004 001"] {
        let records = with(geometry);
        assert_eq!(pings(&records).len(), 2, "{geometry}");
        assert_eq!(starts(&records)[0].pose, Pose { x_m: 1.0, y_m: 2.0, heading_deg: 0.0 });
    }
}

#[test]
fn player_3_rangers() {
    let log = "## Player version 3.0.2\n\
               0010.0 h 6665 ranger 00 004 001 0 0 0 0 0 0 0.1 0.1 0.1 2 0.2 0 0 0 0 0 0 0.1 0 0 0 1.5707963267948966 \
               2 0.01 0.01 0.01 0.01 0.01 0.01\n\
               0010.1 h 6665 ranger 00 001 001 0002 1.5 2.5\n\
               0010.1 h 6665 ranger 00 001 003 0002 7 7\n";
    let records = import(log, Mapping::default()).expect("right");
    let read: Vec<_> =
        pings(&records).iter().map(|ping| (ping.azimuth_deg, ping.range_m)).collect();
    assert_eq!(read, [(0.0, Some(1.5)), (90.0, Some(2.5))]);
}

#[test]
fn player_1_lines() {
    let log = "1106955333.270 rob 6665 position 00 1106955333.260 +01.200 -00.910 -1.501 -0.005 +0.000 +0.000\n\
               1106955333.287 rob 6665 sonar 00 1106955333.277 2 +00.115 +00.130 +1.5708 +00.115 -00.130 -1.5708 2 0.326 7.365\n";
    let records = import(log, Mapping::default()).expect("right");
    let pose = starts(&records)[0].pose;
    assert!((pose.x_m - 1.2).abs() < 1e-12 && (pose.heading_deg + 86.0).abs() < 0.01, "{pose:?}");
    assert_eq!(
        pings(&records).iter().map(|ping| ping.range_m).collect::<Vec<_>>(),
        [Some(0.326), Some(7.365)]
    );
    // Small time, as in a simulation.
    let simulated = log.replace("1106955333.260", "0012.260").replace("1106955333.277", "0012.277");
    assert!(
        (starts(&import(&simulated, Mapping::default()).expect("right"))[0].pose.x_m - 1.2).abs()
            < 1e-12
    );
}

#[test]
fn imports_one_of_several_devices() {
    let other =
        PLAYER.replace(" 6665 ", " 6666 ").replace("+01.000", "-03.000").replace("1.500", "0.500");
    let second = "0010.050 robot 6665 position2d 01 001 001 +05.000 +07.000 +1.571 0 0 0 0\n";
    let log = format!("{second}{PLAYER}{other}");
    let found = examine(log.as_bytes(), Mapping::default(), assumptions()).expect("right");
    let notes = found.notes.join("\n");
    for part in
        ["sonar robot:6666:00 (1 messages)", "position2d robot:6665:01 (1 messages)", "--device"]
    {
        assert!(notes.contains(part), "{part}: {notes}");
    }
    let records = import(&log, Mapping::default()).expect("right");
    assert_eq!((pings(&records).len(), starts(&records)[0].pose.x_m), (2, 1.0));
    for device in ["6666:00", "robot:6666:00", "6666"] {
        let mapping = Mapping { device: Some(device.to_owned()), ..Mapping::default() };
        let records = import(&log, mapping).expect("right");
        assert_eq!(
            (pings(&records)[0].range_m, starts(&records)[0].pose.x_m),
            (Some(0.5), -3.0),
            "{device}"
        );
    }
    let none = Mapping { device: Some("7000:00".to_owned()), ..Mapping::default() };
    assert!(error_text(import(&log, none)).contains("sonar robot:6665:00"));
}

#[test]
fn infinities_and_zeros_are_no_echo() {
    for value in ["inf", "-inf", "nan", "0.000", "0"] {
        let log = CARMEN.replace("5.00", value);
        let found = examine(log.as_bytes(), Mapping::default(), assumptions()).expect(value);
        assert_eq!((found.readings, found.echoes), (4, 3), "{value}");
        let is_noted = found.notes.iter().any(|note| note.contains("ranges are 0"));
        assert_eq!(is_noted, value.starts_with('0'), "{value}: {:?}", found.notes);
    }
}

#[test]
fn offers_range_unit() {
    let log = CARMEN.replace("1.50 5.00", "150 500").replace("1.40 0.75", "140 75");
    let message = error_text(examine(log.as_bytes(), Mapping::default(), assumptions()));
    assert!(message.contains("--range-unit cm"), "{message}");
    let mapping = Mapping { range_unit: Some(crate::RangeUnit::Cm), ..Mapping::default() };
    let records = import(&log, mapping).expect("right");
    let ranges: Vec<_> = pings(&records).iter().filter_map(|ping| ping.range_m).collect();
    let off = ranges
        .iter()
        .zip([1.5, 5.0, 1.4, 0.75])
        .map(|(is, should): (&f64, f64)| (is - should).abs());
    assert!(ranges.len() == 4 && off.fold(0.0, f64::max) < 1e-12, "{ranges:?}");
}

/// Two robots that log to one file differ in their hosts.
#[test]
fn carmen_robots_by_host() {
    let line = |host: &str, at: u32, range: &str| {
        format!(
            "ODOM {at} 0 0 0 0 0 1000.{at} {host} 0.{at}\nSONAR 0.26 2 {range} 1.5 0.2 0 0 0 0.1 1.57 1000.{at} {host} 0.{at}\n"
        )
    };
    let text: String = (1..4)
        .map(|at| line("lena", at, &format!("1.{at}")) + &line("otto", at + 5, &format!("0.{at}")))
        .collect();
    for (device, x_m, range_m) in [(None, 1.0, 1.1), (Some("otto".to_owned()), 6.0, 0.1)] {
        let mapping = Mapping { device, ..Mapping::default() };
        let found = examine(text.as_bytes(), mapping.clone(), assumptions()).expect("one robot");
        assert!(found.notes.join(" ").contains("several devices"), "{:?}", found.notes);
        let records = import(&text, mapping).expect("one robot");
        assert_eq!(starts(&records).len(), 3);
        assert_eq!(
            (starts(&records)[0].pose.x_m, pings(&records)[0].range_m),
            (x_m, Some(range_m))
        );
    }
    // Programs of one robot may run on several hosts.
    let text = text.replace("lena 0.1\nSONAR", "base 0.1\nSONAR");
    let single: String = text
        .lines()
        .filter(|line| !line.contains("otto"))
        .map(|line| format!("{line}\n"))
        .collect();
    assert!(examine(single.as_bytes(), Mapping::default(), assumptions()).expect("one").has_poses);
}

#[test]
fn rounds_before_first_pose() {
    let sonar = "SONAR 0.26 2 1.0 1.5 0.2 0 0 0 0.1 1.57 1000.1 host 0.1\n";
    let odometry = "ODOM 3 0 0 0 0 0 1000.2 host 0.2\n";
    let truth = "TRUEPOS 4 0 0 0 0 0 1000.3 host 0.3\n";
    let text = format!("{sonar}{odometry}{sonar}{sonar}");
    let found = examine(text.as_bytes(), Mapping::default(), assumptions()).expect("a log");
    assert!(
        found.readings == 4 && found.notes.join(" ").contains("1 rounds before the first pose")
    );
    let text = format!("{sonar}{odometry}{sonar}{truth}{sonar}");
    let records = import(&text, Mapping::default()).expect("a log");
    assert_eq!((starts(&records).len(), starts(&records)[0].pose.x_m), (1, 4.0));
    let message = error_text(import(&format!("{sonar}{odometry}"), Mapping::default()));
    assert!(message.contains("before the first pose"), "{message}");
}

#[test]
fn cut_last_line_is_skipped() {
    let sonar = "SONAR 0.26 2 1.0 1.5 0.2 0 0 0 0.1 1.57 1000.1 host 0.1\n";
    for (text, readings, note) in [
        (format!("{sonar}{}", &sonar[..30]), 2, "line 2 is incomplete"),
        (format!("{sonar}{}", sonar.trim_end()), 4, "the last line has no line end"),
    ] {
        let found = examine(text.as_bytes(), Mapping::default(), assumptions()).expect("a log");
        assert_eq!(found.readings, readings, "{text}");
        assert!(found.notes.join(" ").contains(note), "{:?}", found.notes);
    }
}
