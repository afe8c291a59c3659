//! Tables and JSON files.

use proptest::prelude::*;
use sonard_model::reading::PingStatus;

use sonard_model::array::RangerArray;

use super::*;
use crate::{Column, Format};

/// Returns azimuths in degrees and ranges in metres.
fn read(text: &str, mapping: Mapping) -> Vec<(f64, Option<f64>)> {
    let records = import(text, mapping).expect("valid");
    pings(&records).iter().map(|ping| (ping.azimuth_deg, ping.range_m)).collect()
}

#[test]
fn reads_every_separator_and_json() {
    let expected = [(10.0, Some(1.5)), (20.0, None), (30.0, Some(0.25))];
    for text in [
        "azimuth_deg,range_m\n10,1.5\n20,\n30,0.25\n",
        "azimuth_deg;range_m\r\n10;1.5\r\n20;nan\r\n30;0.25\r\n",
        "# by hand\nazimuth_deg\trange_m\n\n10\t1.5\n20\t-\n30\t0.25",
        "azimuth_deg   range_m\n  10 1.5\n20  none\n30 0.25\n",
        "\u{feff}\"azimuth_deg\",\"range_m\"\n\"10\", 1.5\n20,inf\n30,0.25\n",
        "[{\"azimuth_deg\": 10, \"range_m\": 1.5}, {\"azimuth_deg\": 20, \"range_m\": null},\n \
         {\"azimuth_deg\": 30, \"range_m\": 0.25}]",
        "{\"azimuth_deg\": 10, \"range_m\": 1.5}\n{\"azimuth_deg\": 20, \"range_m\": null}\n\
         {\"azimuth_deg\": 30, \"range_m\": 0.25}\n",
        "{\"azimuth_deg\": [10, 20, 30], \"range_m\": [1.5, null, 0.25]}",
    ] {
        let found = read(text, Mapping::default());
        for (is, should) in found.iter().zip(expected) {
            assert_eq!(is.0, should.0, "{text}");
            let off_m = is.1.zip(should.1).map_or(0.0, |(is, should)| (is - should).abs());
            assert!(off_m < 1e-12 && is.1.is_some() == should.1.is_some(), "{text}: {is:?}");
        }
        assert_eq!(found.len(), 3, "{text}");
    }
}

/// Direction sense, zero, unit, sound speed and no-echo value.
#[test]
fn converts_directions_and_ranges() {
    let mapping = Mapping {
        clockwise: true,
        zero_deg: 90.0,
        none: vec![255.0],
        sound_speed_m_s: Some(340.0),
        ..columns("azimuth_grad=1,range_cm=3")
    };
    let found = read("100 x 100\n0 y 255\n", mapping);
    let sound_speed_m_s = Air::default().sound_speed_m_s();
    assert!((found[0].0 - 0.0).abs() < 1e-9 && (found[1].0 - 90.0).abs() < 1e-9, "{found:?}");
    assert!((found[0].1.expect("a range") - sound_speed_m_s / 340.0).abs() < 1e-12);
    assert_eq!(found[1].1, None);
    let by_time = read("0 5000\n", columns("azimuth_deg=1,tof_us=2"));
    assert!((by_time[0].1.expect("a range") - 2500e-6 * sound_speed_m_s).abs() < 1e-12);
    // A bearing in the world, with the robot heading at 30 degrees.
    let in_world = read("75 1\n", columns("bearing_deg=1,range_m=2"));
    assert!((in_world[0].0 - 45.0).abs() < 1e-9);
    // In warmer air, the same time of flight is a longer range.
    let warm = read("0 5000 30\n", columns("azimuth_deg=1,tof_us=2,temperature_c=3"));
    let warm_m_s = Air::new(30.0, 50.0, 101.325).expect("air").sound_speed_m_s();
    assert!((warm[0].1.expect("a range") - 2500e-6 * warm_m_s).abs() < 1e-12);
}

#[test]
fn splits_scans_by_id_pose_or_sweep() {
    let turns: String = (0..25).map(|i| format!("{},1\n", 30 * i % 360)).collect();
    let records = import(&turns, columns("azimuth_deg=1,range_m=2")).expect("right");
    assert_eq!(
        starts(&records).iter().map(|start| start.plan.beams()).collect::<Vec<_>>(),
        [12, 12, 1]
    );
    let named = "0,1,a\n10,1,a\n20,1,b\n";
    let records = import(named, columns("azimuth_deg=1,range_m=2,scan=3")).expect("right");
    assert_eq!(starts(&records).len(), 2);
    let moved = "0,1,0.5,0.5\n10,1,0.5,0.5\n20,1,0.6,0.5\n";
    let records = import(moved, columns("azimuth_deg=1,range_m=2,x_m=3,y_m=4")).expect("right");
    let poses: Vec<_> = starts(&records).iter().map(|start| start.pose).collect();
    assert_eq!(
        poses,
        [
            Pose { x_m: 0.5, y_m: 0.5, heading_deg: 30.0 },
            Pose { x_m: 0.6, y_m: 0.5, heading_deg: 30.0 },
        ]
    );
    // Repeated imports give the same records.
    assert_eq!(
        import(moved, columns("azimuth_deg=1,range_m=2,x_m=3,y_m=4")).expect("right"),
        records
    );
}

/// Evenly spaced directions of either sense; otherwise the plan only has the number of beams.
#[test]
fn even_directions_are_a_plan() {
    let plan_of = |text: &str| {
        let records = import(text, columns("azimuth_deg=1,range_m=2")).expect("right");
        let plan = starts(&records)[0].plan;
        let indices: Vec<_> = pings(&records).iter().map(|ping| ping.index).collect();
        (plan.from_deg, plan.step_deg, plan.beams(), indices)
    };
    let (from, step, beams, indices) = plan_of("350,1\n0,1\n10,1\n20,1\n");
    assert!((from - 350.0).abs() < 1e-9 && (step - 10.0).abs() < 1e-9);
    assert_eq!((beams, indices), (4, vec![0, 1, 2, 3]));
    let (from, step, beams, indices) = plan_of("20,1\n10,1\n0,1\n350,1\n");
    assert!((from - 350.0).abs() < 1e-9 && (step - 10.0).abs() < 1e-9);
    assert_eq!((beams, indices), (4, vec![3, 2, 1, 0]));
    let (_, _, beams, indices) = plan_of("0,1\n10,1\n15,1\n");
    assert_eq!((beams, indices), (3, vec![0, 1, 2]));
}

#[test]
fn infers_header_or_offers_options() {
    let guess = |header: &str| {
        let text = format!("{header}\n{}\n", vec!["1"; header.split(',').count()].join(","));
        let unchecked = Assumptions { skip_checks: true, ..assumptions() };
        examine(text.as_bytes(), Mapping::default(), unchecked).map(|found| {
            assert!(found.is_inferred && found.format == Format::Csv);
            let columns = found.mapping.columns.into_iter();
            columns.map(|(field, column)| format!("{field}={column}")).collect::<Vec<_>>().join(" ")
        })
    };
    assert_eq!(
        guess("Angle (deg),Distance [cm]").expect("clear"),
        "azimuth_deg=`Angle (deg)` range_cm=`Distance [cm]`"
    );
    assert_eq!(
        guess("theta_rad,echo_us,t").expect("clear"),
        "azimuth_rad=`theta_rad` tof_us=`echo_us`"
    );
    let twice = error_text(guess("angle_deg,true_range_m,range_cm"));
    assert!(
        twice.contains("may both be the range")
            && twice.contains("--columns azimuth_deg=angle_deg,range_cm=range_cm"),
        "{twice}"
    );
    let unit = error_text(guess("angle_deg,distance"));
    assert!(
        unit.contains("unit of column `distance` is unknown") && unit.contains("range_mm=distance"),
        "{unit}"
    );
    let nothing = error_text(guess("foo,bar"));
    assert!(
        nothing.contains("no column is recognized as a direction") && nothing.contains("foo"),
        "{nothing}"
    );
    let numbers = error_text(examine(b"1,2\n", Mapping::default(), assumptions()));
    assert!(numbers.contains("the first line of 2 values has no column names"), "{numbers}");
}

/// Errors name line, field and column, and the remedy.
#[test]
fn errors_name_position_and_remedy() {
    let mapping = || columns("azimuth_deg=1,range_cm=2");
    for (text, mapping, words) in [
        ("1,2\n2,abc\n", mapping(), "line 2, range_cm (column 2): `abc` is not a number"),
        ("1,2\n,3\n", mapping(), "line 2: no azimuth"),
        (
            "1,2\n3,-1\n",
            mapping(),
            "line 2, range_cm (column 2): a range of -1 is not a distance (1 of 2 readings)",
        ),
        ("1,2\n3,0\n", mapping(), "--no-echo=0"),
        (
            "1,2\n",
            columns("azimuth_deg=1,range_cm=5"),
            "there is no column 5: the first line has 2 columns",
        ),
        ("1,2\n", columns("azimuth_deg=1,range_cm=dist"), "the first line has no column names"),
        ("a,b\n1,2\n", columns("azimuth_deg=a,range_cm=dist"), "the columns are a, b"),
        ("a,b\n", columns("azimuth_deg=a,range_cm=b"), "the file has no readings"),
        ("# nothing\n", mapping(), "no line of values"),
        ("1,2\n", columns("range_cm=2"), "no column is mapped to azimuth or bearing"),
        ("1,2,3\n", columns("azimuth_deg=1,range_cm=2,range_m=3"), "are both the range"),
        ("1,2,3\n", columns("azimuth_deg=1,range_cm=2,tof_us=3"), "both range and time of flight"),
        ("1,2,3\n", columns("azimuth_deg=1,range_cm=2,x_m=3"), "only one of x and y"),
        ("1,2,x\n", columns("azimuth_deg=1,range_cm=2,time=3"), "line 1, time (column 3)"),
        ("1,2,maybe\n", columns("azimuth_deg=1,range_cm=2,status=3"), "unknown status `maybe`"),
        ("1,2,90\n", columns("azimuth_deg=1,range_cm=2,temperature_c=3"), "temperature_c is 90"),
        (
            "{\"a\": 1}",
            columns("azimuth_deg=a,range_cm=b"),
            "object 1: no member `b`; the object has a",
        ),
        (
            "{\"a\": [1, 2], \"b\": [1]}",
            columns("azimuth_deg=a,range_cm=b"),
            "1 numbers of range_cm but 2 of azimuth_deg",
        ),
        (
            "{\"a\": 1, \"b\": 2}\n{\"a\"\n",
            columns("azimuth_deg=a,range_cm=b"),
            "line 2: invalid JSON",
        ),
        ("[1, 2", columns("azimuth_deg=a,range_cm=b"), "invalid JSON"),
        (
            "{\"a\": [1, \"x\"], \"b\": [1, 2]}",
            columns("azimuth_deg=a,range_cm=b"),
            "object 1, number 2 of its lists, azimuth_deg (`a`): `x` is not a number",
        ),
    ] {
        let message = error_text(import(text, mapping));
        assert!(message.contains(words), "{text:?}: {message}");
    }
    for text in ["azimuth_deg", "angle=1", "azimuth_deg=0", "azimuth_deg=1,azimuth_deg=2"] {
        error_text(Mapping::parse_columns(text));
    }
    assert_eq!(
        columns("range_m=a=b").columns.values().next(),
        Some(&Column::Name("a=b".to_owned()))
    );
}

/// Implausible units are rejected, unless the check is skipped.
#[test]
fn rejects_implausible_units() {
    let table = |angle: fn(f64) -> f64, range: fn(f64) -> f64| -> String {
        let row = |i: i32| {
            format!("{},{}\n", angle(f64::from(i) * 3.0), range(0.3 + 0.01 * f64::from(i)))
        };
        (0..120).map(row).collect()
    };
    for (text, mapping, words) in [
        (table(f64::to_radians, |m| m), columns("azimuth_deg=1,range_m=2"), "looks like radians"),
        (
            table(|deg| 10.0 * deg, |m| m),
            columns("azimuth_rad=1,range_m=2"),
            "if these are degrees",
        ),
        (table(|deg| deg, |m| 100.0 * m), columns("azimuth_deg=1,range_m=2"), "is the unit right?"),
        (table(|deg| deg, |m| 0.01 * m), columns("azimuth_deg=1,range_m=2"), "is the unit right"),
        (
            table(|deg| deg, |m| if m > 1.4 { 2.55 } else { m }),
            columns("azimuth_deg=1,range_ft=2"),
            "",
        ),
        (
            table(|deg| deg, |m| if m > 1.4 { 255.0 } else { m }),
            columns("azimuth_deg=1,range_m=2"),
            "10 of 120 ranges are 255 by range_m",
        ),
    ] {
        let found = import(&text, mapping.clone());
        if words.is_empty() {
            found.expect("plausible");
            continue;
        }
        let message = error_text(found);
        assert!(message.contains(words), "{message}");
        let unchecked = Assumptions { skip_checks: true, ..assumptions() };
        examine(text.as_bytes(), mapping, unchecked).expect("unchecked");
    }
}

#[test]
fn status_overrides_range() {
    let text = "0,1.5,echo\n10,1.5,no_echo\n20,,MIN_RANGE\n30,,\n";
    let records = import(text, columns("azimuth_deg=1,range_m=2,status=3")).expect("right");
    let found: Vec<_> =
        pings(&records).iter().map(|ping| (ping.status, ping.range_m.is_some())).collect();
    assert_eq!(
        found,
        [
            (PingStatus::Echo, true),
            (PingStatus::NoEcho, false),
            (PingStatus::MinRange, false),
            (PingStatus::NoEcho, false),
        ]
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    /// No file causes a panic, and each accepted reading is imported once.
    #[test]
    fn any_bytes_are_read_or_rejected(
        bytes in prop_oneof![
            proptest::collection::vec(any::<u8>(), 0..300),
            "[0-9eE.,;\t \n\"#-]{0,200}".prop_map(String::into_bytes),
            "(SONAR|ODOM|TRUEPOS)( [0-9.-]{1,6}){0,20}\n".prop_map(String::into_bytes),
            "[0-9]{1,4} h 1 (sonar|position2d) 0 [0-9]{1,3} [0-9]{1,3}( [0-9.]{1,5}){0,9}\n".prop_map(String::into_bytes),
            r#"\[?\{"a": ?\[?[0-9,.]{0,9}\]?, "b": ?[0-9\[\],]{0,9}\}\]?"#.prop_map(String::into_bytes),
        ],
        by_number in any::<bool>(),
    ) {
        let mapping = if by_number { columns("azimuth_deg=1,range_m=2") } else { columns("azimuth_deg=a,range_m=b") };
        let unchecked = Assumptions { skip_checks: true, ..assumptions() };
        if let Ok(found) = examine(&bytes, mapping, unchecked) {
            let scans: Vec<_> = found.scans(&bytes[..]).expect("as before").collect();
            let records: Vec<_> = scans.into_iter().flat_map(|scan| scan.expect("as before")).collect();
            prop_assert_eq!(pings(&records).len() as u64, found.readings);
        }
    }
}

/// Captures of terminals and plotters for boards.
#[test]
fn reads_captures_of_boards() {
    let values = |text: &str, mapping: Mapping| -> Vec<(f64, Option<f64>)> {
        let records = import(text, mapping).unwrap_or_else(|error| panic!("{text}: {error}"));
        pings(&records).iter().map(|ping| (ping.azimuth_deg, ping.range_m)).collect()
    };
    let expected = [(15.0, Some(0.31)), (16.0, Some(0.32)), (17.0, Some(0.33))];
    let auto = Mapping::default;
    for (text, mapping) in [
        ("angle_deg:15,dist_cm:31\nangle_deg:16,dist_cm:32\nangle_deg:17,dist_cm:33\n", auto()),
        (
            "Angle: 15 deg, Distance: 31 cm\nAngle: 16 deg, Distance: 32 cm\nAngle: 17 deg, Distance: 33 cm\n",
            auto(),
        ),
        ("angle,distance\n[deg],[cm]\n15,31\n16,32\n17,33\n", auto()),
        ("angle_deg,dist_cm\n15,31\n16,32\nangle_deg,dist_cm\n17,33\n", auto()),
        ("1\n15,31\n16,32\n17,33\n", columns("azimuth_deg=1,range_cm=2")),
        ("15,31 // first\n16,32 # second\n17,33\n", columns("azimuth_deg=1,range_cm=2")),
    ] {
        assert_eq!(values(text, mapping), expected, "{text}");
    }
    let text = "12:00:15.015 -> 15,31\n12:00:15.115 -> 16,32\n";
    let records = import(text, columns("time=1,azimuth_deg=2,range_cm=3")).expect("stamped");
    let time = pings(&records)[1].time.expect("a time");
    assert_eq!((time.as_millisecond() % 60_000, pings(&records)[1].range_m), (15_115, Some(0.32)));
}

#[test]
fn words_mean_no_echo() {
    for word in ["out of range", "---", "No echo", "n/a", "timeout"] {
        let text = format!("angle_deg,distance_cm\n0,100\n5,{word}\n10,102\n");
        let records = import(&text, Mapping::default()).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(pings(&records)[1].range_m, None, "{word}");
    }
    let message = error_text(import("angle_deg,distance_cm\n0,far\n", Mapping::default()));
    assert!(message.contains("`far` is not a number") && message.contains("leave the value empty"));
    let message = error_text(import("angle_deg,distance_cm\n0,31cm\n", Mapping::default()));
    assert!(message.contains("remove the unit"), "{message}");
}

/// A circle that turns back ends at the reading that closes it.
#[test]
fn full_circle_and_back() {
    let there = (0..=36).map(|at| 10 * at);
    let angles = there.clone().chain(there.clone().rev().skip(1)).chain(there.skip(1));
    let rows: String =
        angles.zip(0..).map(|(angle, at)| format!("{angle},{}\n", 100 + at % 9)).collect();
    let records = import(&rows, columns("azimuth_deg=1,range_cm=2")).expect("three scans");
    let ends = records.iter().filter_map(|record| match record {
        Record::ScanEnd(end) => Some(end.beams),
        _ => None,
    });
    assert_eq!(ends.collect::<Vec<_>>(), [37, 36, 36]);
}

/// Arrays with a column for each ranger, by names that have only the unit.
#[test]
fn array_columns_without_quantity() {
    let array = RangerArray::preset("pioneer-8").expect("a preset");
    let with = || Assumptions { array: Some(array.clone()), ..assumptions() };
    let names: Vec<String> = (0..8).map(|at| format!("s{at} [cm]")).collect();
    let row = (0..8).map(|at| (100 + 10 * at).to_string()).collect::<Vec<_>>().join(",");
    let text = format!("x_m,y_m,{}\n1,2,{row}\n1.5,2,{row}\n", names.join(","));
    let found = examine(text.as_bytes(), Mapping::default(), with()).expect("rounds");
    assert_eq!((found.readings, found.has_poses), (16, true));
    let text = text.replace(" [cm]", "").replace('s', "sonar");
    let message = error_text(examine(text.as_bytes(), Mapping::default(), with()));
    assert!(message.contains("--columns range_cm=3-10"), "{message}");
    let text = format!("1700000000,{row}\n1700000001,{row}\n");
    let message = error_text(examine(text.as_bytes(), Mapping::default(), with()));
    assert!(message.contains("has 9 values") && message.contains("range_m=2-9"), "{message}");
    let json = "[{\"ranges\": [1, 1.1, 1.2, 1.3, 1.4, 1.5, 1.6, 1.7]}]";
    let found = examine(json.as_bytes(), columns("range_m=ranges"), with()).expect("a round");
    assert_eq!(found.readings, 8);
}
