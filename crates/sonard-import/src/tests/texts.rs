//! Encodings, line ends, separators, rows that are too long or too short, and times.

use super::*;

const ROWS: &str = "angle_deg,distance_cm\n15,31\n16,32\n17,33\n";

fn wide(text: &str, order: fn(u16) -> [u8; 2], mark: &[u8]) -> Vec<u8> {
    [mark, &text.encode_utf16().flat_map(order).collect::<Vec<_>>()].concat()
}

#[test]
fn reads_encodings_and_line_ends() {
    for (name, bytes) in [
        ("UTF-16LE with a mark", wide(ROWS, u16::to_le_bytes, b"\xff\xfe")),
        ("UTF-16BE with a mark", wide(ROWS, u16::to_be_bytes, b"\xfe\xff")),
        ("UTF-16LE without", wide(ROWS, u16::to_le_bytes, b"")),
        ("UTF-16BE without", wide(ROWS, u16::to_be_bytes, b"")),
        ("UTF-8 with a mark", [b"\xef\xbb\xbf", ROWS.as_bytes()].concat()),
        ("carriage returns", ROWS.replace('\n', "\r").into_bytes()),
        ("both", ROWS.replace('\n', "\r\n").into_bytes()),
        ("doubled returns", ROWS.replace('\n', "\r\r\n").into_bytes()),
        ("Latin-1", [&b"angle_deg [\xb0],distance_cm\n"[..], &ROWS.as_bytes()[22..]].concat()),
        (
            "semicolons and a line for Excel",
            format!("sep=;\r\n{}", ROWS.replace(',', ";")).into_bytes(),
        ),
        ("tabs", ROWS.replace(',', "\t").into_bytes()),
        ("bars", ROWS.replace(',', "|").into_bytes()),
        (
            "MATLAB comments",
            format!("% by hand\n{}% the end\n", ROWS.replace("16,32", "16,32 % uncertain"))
                .into_bytes(),
        ),
        ("names in a comment", format!("% {ROWS}").into_bytes()),
    ] {
        let found = examine(&bytes, Mapping::default(), assumptions());
        let found = found.unwrap_or_else(|error| panic!("{name}: {error}; {}", error.help()));
        let scans =
            found.scans(&bytes[..]).expect("as before").map(|scan| scan.expect("as before"));
        let records: Vec<Record> = scans.flatten().collect();
        let read: Vec<_> = pings(&records)
            .iter()
            .map(|ping| (ping.azimuth_deg, ping.range_m.map(|m| (m * 100.0).round())))
            .collect();
        assert_eq!(read, [(15.0, Some(31.0)), (16.0, Some(32.0)), (17.0, Some(33.0))], "{name}");
        let is_other = name.starts_with("UTF-16") || name == "Latin-1";
        assert_eq!(found.notes.iter().any(|note| note.contains("the text is")), is_other, "{name}");
    }
}

#[test]
fn accepts_certain_decimal_commas() {
    let expected = [(15.5, Some(31.5)), (16.5, Some(32.5))];
    for text in [
        "angle_deg;distance_cm\n15,5;31,5\n16,5;32,5\n",
        "angle_deg\tdistance_cm\n15,5\t31,5\n16,5\t32,5\n",
        "\"angle_deg\",\"distance_cm\"\n\"15,5\",\"31,5\"\n\"16,5\",\"32,5\"\n",
        "Winkel [Grad];Abstand [cm]\n15,5;31,5\n16,5;32,5\n",
    ] {
        let records = import(text, Mapping::default()).expect(text);
        let read: Vec<_> = pings(&records)
            .iter()
            .map(|ping| (ping.azimuth_deg, ping.range_m.map(|m| (m * 1000.0).round() / 10.0)))
            .collect();
        assert_eq!(read, expected, "{text}");
    }
    let message = error_text(import("angle_deg,distance_cm\n15,5,31,5\n", Mapping::default()));
    assert!(
        message.contains("line 2: 4 values") && message.contains("decimal commas"),
        "{message}"
    );
    let either = "angle_deg;distance_mm\n10;1,500\n20;1,750\n";
    let message = error_text(import(either, Mapping::default()));
    assert!(
        message.contains("--decimal comma") && message.contains("--decimal point"),
        "{message}"
    );
    let point = Mapping { decimal: Some(crate::Decimal::Point), ..Mapping::default() };
    assert_eq!(pings(&import(either, point).expect("given"))[0].range_m, Some(1.5));
}

#[test]
fn rejects_rows_of_wrong_length() {
    let long = error_text(import(
        "angle_deg,distance_cm\n0,100\n5,101,10,102,15,103\n",
        Mapping::default(),
    ));
    assert!(long.contains("line 3: 6 values, but the table has 2 columns"), "{long}");
    let short =
        error_text(import("angle_deg,distance_cm\n0,100\n10\n20,100\n", Mapping::default()));
    assert!(short.contains("line 3: 1 values"), "{short}");
    let found =
        examine(b"angle_deg,distance_cm\n0,100\n5,\n10,102,\n", Mapping::default(), assumptions())
            .expect("whole");
    assert_eq!((found.readings, found.echoes), (3, 2));
    let whole = examine(b"angle_deg,distance_cm\n0,100\n5,18", Mapping::default(), assumptions())
        .expect("maybe cut");
    assert!(
        whole.readings == 2 && whole.notes.join(" ").contains("the last line has no line end"),
        "{:?}",
        whole.notes
    );
    let cut =
        examine(b"angle_deg,distance_cm\n0,100\n5,120\n10", Mapping::default(), assumptions())
            .expect("cut");
    assert!(
        cut.readings == 2 && cut.notes.join(" ").contains("line 4 is incomplete"),
        "{:?}",
        cut.notes
    );
    let row = error_text(import("1,2,3,4,5,6,7,8\n", columns("azimuth_deg=1,range_cm=2")));
    assert!(row.contains("one row of 8 values"), "{row}");
}

#[test]
fn reads_streams_without_line_ends() {
    let stream: String = (15..45).map(|angle| format!("{angle},{}.", 31 + angle % 7)).collect();
    for (text, count) in [
        (stream.clone(), 30),
        (stream[2..].to_owned(), 29),
        (stream[..stream.len() - 4].to_owned(), 29),
    ] {
        let found = examine(text.as_bytes(), columns("azimuth_deg=1,range_cm=2"), assumptions())
            .expect("a stream");
        assert_eq!(found.readings, count, "{text}");
        assert!(found.notes[0].contains("full stop"), "{:?}", found.notes);
    }
}

#[test]
fn notes_assumptions_on_times() {
    let started =
        Assumptions { started: "2026-11-27T08:00:00Z".parse().expect("a time"), ..assumptions() };
    for (column, cells, first, note) in [
        (
            "time",
            ["2026-01-31 12:00:00", "2026-01-31 12:00:01"],
            "2026-01-31T12:00:00Z",
            "no time zone",
        ),
        ("time", ["12:00:15.015", "12:00:16.015"], "2026-11-27T12:00:15.015Z", "no date"),
        ("time_ms", ["1350", "1400"], "2026-11-27T08:00:00Z", "start of the board"),
        ("time_s", ["1700000000.5", "1700000001"], "2023-11-14T22:13:20.5Z", ""),
    ] {
        let text =
            format!("{column},angle_deg,distance_cm\n{},0,100\n{},5,101\n", cells[0], cells[1]);
        let found = examine(text.as_bytes(), Mapping::default(), started.clone()).expect(column);
        let scans =
            found.scans(text.as_bytes()).expect("as before").map(|scan| scan.expect("as before"));
        let records: Vec<Record> = scans.flatten().collect();
        assert_eq!(pings(&records)[0].time.map(|time| time.to_string()).as_deref(), Some(first));
        let notes = found.notes.join("\n");
        assert_eq!(notes.is_empty(), note.is_empty(), "{notes}");
        assert!(notes.contains(note), "{notes}");
    }
    let given = Mapping { started: "2020-01-01T00:00:00Z".parse().ok(), ..Mapping::default() };
    let text = "time_ms,angle_deg,distance_cm\n4294967200,0,100\n104,5,101\n";
    let records = import(text, given).expect("given");
    let times: Vec<_> =
        pings(&records).iter().filter_map(|ping| ping.time).map(|time| time.to_string()).collect();
    assert_eq!(times, ["2020-01-01T00:00:00Z", "2020-01-01T00:00:00.2Z"]);
}

/// `json.dump` writes a document without line ends.
#[test]
fn reads_a_long_json_document_in_one_line() {
    let document = |count: usize| {
        let entry =
            |at: usize| format!(r#"{{"angle_deg":{},"distance_cm":{}}}"#, at % 360, 100 + at % 90);
        format!("[{}]", (0..count).map(entry).collect::<Vec<_>>().join(","))
    };
    let text = document(60_000);
    assert!(text.len() > 2 << 20);
    let found = examine(text.as_bytes(), Mapping::default(), assumptions()).expect("a document");
    assert_eq!(found.readings, 60_000);
    let wrapped = format!(r#"{{"data":{text}}}"#);
    let found = examine(wrapped.as_bytes(), Mapping::default(), assumptions()).expect("wrapped");
    assert_eq!(found.readings, 60_000);
    let longer = document(500_000);
    let error = error_text(examine(longer.as_bytes(), Mapping::default(), assumptions()));
    assert!(error.contains("longer than 16 MB") && error.contains("jq -c"), "{error}");
}
