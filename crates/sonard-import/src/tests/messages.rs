//! Logs of CARMEN and Player.

use super::*;
use crate::Format;

/// Two rangers, one ahead and one to the left.
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
fn a_log_of_carmen_is_an_arrays() {
    let mapping = Mapping { none_from: Some(5.0), ..Mapping::default() };
    let found = examine(CARMEN.as_bytes(), mapping.clone(), taken()).expect("right");
    assert_eq!((found.format, found.readings, found.echoes), (Format::Carmen, 4, 3));
    let array = found.taken.array.as_ref().expect("an array");
    array.check().expect("one that can be");
    assert_eq!((array.rangers[1].y_m, array.rangers[1].bearing_deg), (0.1, 90.0));
    let records = import(CARMEN, mapping).expect("right");
    let starts = starts(&records);
    // The true pose, though odometry came later.
    assert_eq!(starts[0].pose, Pose { x_m: 1.0, y_m: 2.0, heading_deg: 90.0 });
    assert_eq!(starts[1].time.as_millisecond(), 1_000_700);
    let readings: Vec<_> = pings(&records)
        .iter()
        .map(|ping| (ping.ranger.clone().expect("a ranger"), ping.range_m))
        .collect();
    let expected = [("s0", Some(1.5)), ("s1", None), ("s0", Some(1.4)), ("s1", Some(0.75))];
    assert_eq!(readings, expected.map(|(id, range_m)| (id.to_owned(), range_m)));
}

/// Lines without places, and older ones without the cone's angle.
#[test]
fn an_array_that_the_log_does_not_say_is_asked_for() {
    let array = examine(CARMEN.as_bytes(), Mapping::default(), taken()).expect("right").taken.array;
    for line in ["SONAR 0.26 2 1.5 2.5 10.0 host 0.3\n", "SONAR 2 1.5 2.5 10.0 host 0.3\n"] {
        let without = said(examine(line.as_bytes(), Mapping::default(), taken()));
        assert!(
            without.contains("does not say where its 2 rangers are") && without.contains("--array")
        );
        let with = Taken { array: array.clone(), ..taken() };
        let found = examine(line.as_bytes(), Mapping::default(), with).expect("right");
        assert_eq!((found.readings, found.echoes, found.has_poses), (2, 2, false), "{line}");
    }
}

const PLAYER: &str = "\
## Player version 2.0.0
0010.000 robot 6665 position2d 00 001 001 +01.000 +02.000 +0.000 0 0 0 0
0010.000 robot 6665 sonar 00 004 002 2 0.2 0.0 0.0 0.0 0.1 1.5707963267948966
0010.100 robot 6665 sonar 00 001 001 2 1.500 2.500
0010.200 robot 6665 laser 00 001 001 0 0 0 0 0
";

#[test]
fn a_log_of_player_is_an_arrays() {
    let records = import(PLAYER, Mapping::default()).expect("right");
    let pings = pings(&records);
    assert_eq!(pings.iter().map(|ping| ping.range_m).collect::<Vec<_>>(), [Some(1.5), Some(2.5)]);
    assert_eq!(pings[1].azimuth_deg, 90.0);
    assert_eq!(starts(&records)[0].pose, Pose { x_m: 1.0, y_m: 2.0, heading_deg: 0.0 });
}

/// Without type and subtype, as versions before 2 wrote them.
#[test]
fn an_older_log_of_player_is_read() {
    let array = examine(PLAYER.as_bytes(), Mapping::default(), taken()).expect("right").taken.array;
    let old =
        "10.0 robot 6665 position 0 1.0 2.0 0.0 0 0 0\n10.1 robot 6665 sonar 0 2 1.500 2.500\n";
    let found =
        examine(old.as_bytes(), Mapping::default(), Taken { array, ..taken() }).expect("right");
    assert_eq!((found.format, found.readings, found.has_poses), (Format::Player, 2, true));
}

#[test]
fn messages_that_are_cut_or_change_are_named() {
    let change = CARMEN.replace("1.40 0.75 0.2", "1.40 0.75 0.3");
    let fewer = "SONAR 0.26 1 1.4 1.0 host 0.8\n";
    for (text, words) in [
        (change, "line 8: the rangers are elsewhere than before"),
        (format!("{CARMEN}{fewer}"), "line 9: 1 ranges, and 2 before"),
        ("SONAR 0.26 2 1.5\n".to_owned(), "line 1: a SONAR message of a form that is not known"),
        (
            "ODOM 1 2\nSONAR 1 1.0 1.0 host 0.8\n".to_owned(),
            "line 1: the line ends before its theta",
        ),
        ("ODOM 1 2 3\n".to_owned(), "there is no sonar message in it"),
        (PLAYER.replace("2 1.500 2.500", "2 1.500"), "the line ends before its range"),
    ] {
        let said = said(examine(text.as_bytes(), Mapping::default(), taken()));
        assert!(said.contains(words), "{said}");
    }
}
