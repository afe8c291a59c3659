//! Constants written for no echo, in every format, and the option offered for them.

use super::*;

/// Ranges of a room in centimetres; every third is the constant.
fn ranges(constant: f64) -> Vec<f64> {
    (0..36).map(|at| if at % 3 == 0 { constant } else { 120.0 + f64::from(at % 7) }).collect()
}

fn table(ranges: &[f64]) -> String {
    let row = |(at, range): (usize, &f64)| format!("{},{range}\n", 10 * at);
    ranges.iter().enumerate().map(row).collect()
}

fn json(ranges: &[f64]) -> String {
    let angles: Vec<usize> = (0..ranges.len()).map(|at| 10 * at).collect();
    format!("{{\"azimuth_deg\": {angles:?}, \"range_cm\": {ranges:?}}}")
}

fn player(ranges: &[f64]) -> String {
    let places = |at: usize| format!(" 0.1 0 {}", 0.5 * at as f64);
    let places: String = (0..6).map(places).collect();
    let rounds = ranges.chunks_exact(6).map(|round| {
        let round: Vec<String> = round.iter().map(|cm| (cm / 100.0).to_string()).collect();
        format!("1000000000.0 h 6665 sonar 00 001 001 6 {}\n", round.join(" "))
    });
    format!("1000000000.0 h 6665 sonar 00 001 002 6{places}\n{}", rounds.collect::<String>())
}

fn carmen(ranges: &[f64]) -> String {
    let rounds = ranges.chunks_exact(6).map(|round| {
        let round: Vec<String> = round.iter().map(|cm| (cm / 100.0).to_string()).collect();
        let places = (0..6).map(|at| format!(" 0.1 0 {}", 0.5 * f64::from(at))).collect::<String>();
        format!("SONAR 0.26 6 {}{places} 1000000000.0 host 0.3\n", round.join(" "))
    });
    rounds.collect()
}

/// Parses the value of `--no-echo` that a message offers.
fn offered(message: &str) -> f64 {
    let (_, rest) = message.split_once("--no-echo=").unwrap_or_else(|| panic!("{message}"));
    rest.split([';', ' ']).next().and_then(|value| value.parse().ok()).expect("a number")
}

#[test]
fn offered_constant_resolves_error() {
    for constant in [255.0, 400.0, 797.0, 4000.0, 65_535.0, 500.0, 299.9, 0.0, -1.0, -100.0] {
        let ranges = ranges(constant);
        for (text, mapping) in [
            (table(&ranges), columns("azimuth_deg=1,range_cm=2")),
            (json(&ranges), Mapping::default()),
            (player(&ranges), Mapping::default()),
            (carmen(&ranges), Mapping::default()),
        ] {
            let is_log = text.contains("1000000000.0");
            if constant == 0.0 && is_log {
                // Value that drivers of these formats write for no echo: accepted, and noted.
                let found = examine(text.as_bytes(), mapping, assumptions()).expect("right");
                assert_eq!((found.readings, found.echoes), (36, 24));
                assert!(
                    found.notes.join(" ").contains("12 of 36 ranges are 0"),
                    "{:?}",
                    found.notes
                );
                continue;
            }
            let message = error_text(examine(text.as_bytes(), mapping.clone(), assumptions()));
            assert!(message.contains("12 of 36"), "{constant}: {message}");
            let mapping = Mapping { none: vec![offered(&message)], ..mapping };
            let found = examine(text.as_bytes(), mapping, assumptions());
            let found = found.unwrap_or_else(|error| panic!("{constant}: {error}"));
            assert_eq!((found.readings, found.echoes), (36, 24), "{constant}");
        }
    }
}

#[test]
fn offered_cluster_resolves_error() {
    let noisy = |at: usize| 396.0 + (at * 7919 % 83) as f64 / 10.0;
    let ranges: Vec<f64> =
        (0..120).map(|at| if at % 3 == 0 { noisy(at) } else { 120.0 + (at % 7) as f64 }).collect();
    let rows: String =
        ranges.iter().enumerate().map(|(at, range)| format!("{},{range}\n", 3 * at)).collect();
    let mapping = columns("azimuth_deg=1,range_cm=2");
    let message = error_text(examine(rows.as_bytes(), mapping.clone(), assumptions()));
    let (_, rest) = message.split_once("--no-echo-from=").unwrap_or_else(|| panic!("{message}"));
    let from = rest.split(';').next().and_then(|value| value.parse().ok());
    let found = examine(rows.as_bytes(), Mapping { none_from: from, ..mapping }, assumptions())
        .expect("answered");
    assert_eq!((found.readings, found.echoes), (120, 80));
}

#[test]
fn accepts_walls_at_one_distance() {
    let ranges = |is_wall: fn(usize) -> bool| -> Vec<f64> {
        (0..36).map(|at| if is_wall(at) { 243.0 } else { 100.0 + (7 * at % 23) as f64 }).collect()
    };
    for (name, ranges) in [
        ("one arc", ranges(|at| (10..15).contains(&at))),
        ("across zero", ranges(|at| !(3..34).contains(&at))),
        ("half a turn", ranges(|at| at < 18)),
        ("everywhere", vec![150.0; 36]),
        ("a real greatest value", (0..36).map(|at| 200.0 + f64::from(at * 5 % 9)).collect()),
        (
            "twice the greatest",
            (0..36).map(|at| if at % 18 == 0 { 300.0 } else { 250.0 + f64::from(at) }).collect(),
        ),
    ] {
        let found =
            examine(table(&ranges).as_bytes(), columns("azimuth_deg=1,range_cm=2"), assumptions());
        assert_eq!(found.expect(name).echoes, 36, "{name}");
    }
    // One ranger of an array next to a wall.
    let mut along_wall = vec![120.0; 36];
    for (at, range) in along_wall.iter_mut().enumerate() {
        *range = if at % 6 == 2 { 255.0 } else { 100.0 + 3.0 * at as f64 };
    }
    assert_eq!(
        examine(carmen(&along_wall).as_bytes(), Mapping::default(), assumptions())
            .expect("a wall")
            .echoes,
        36
    );
}

/// Values of zero or less are never distances.
#[test]
fn offers_all_negative_values_at_once() {
    let rows = "0,-1\n10,100\n20,0\n30,-1\n";
    let message =
        error_text(examine(rows.as_bytes(), columns("azimuth_deg=1,range_cm=2"), assumptions()));
    assert!(
        message.contains("--no-echo=-1 --no-echo=0") && message.contains("(2 of 4 readings)"),
        "{message}"
    );
}
