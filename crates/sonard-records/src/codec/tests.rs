use proptest::prelude::*;

use super::*;

const LOG: &str = include_str!("../../../../tests/fixtures/small.jsonl");

fn line_of(kind: &str) -> &'static str {
    let tag = format!("{{\"type\":\"{kind}\"");
    LOG.lines().find(|line| line.starts_with(&tag)).expect("the fixture has every kind")
}

#[test]
fn fixture_round_trips() {
    for line in LOG.lines() {
        let record = decode_line(line.as_bytes()).expect("the fixture is clean");
        let mut written = Vec::new();
        encode_line(&record, &mut written).expect("it was read, so it can be written");
        assert_eq!(written.pop(), Some(b'\n'));
        let (was, is): (serde_json::Value, serde_json::Value) = (
            serde_json::from_str(line).expect("JSON"),
            serde_json::from_slice(&written).expect("JSON"),
        );
        assert_eq!(was, is);
    }
}

/// Asserts kind, column and field of the error of a line.
fn check(line: impl AsRef<[u8]>, kind: RecordErrorKind, column: Option<usize>, field: &str) {
    let shown = String::from_utf8_lossy(line.as_ref()).into_owned();
    let fault = decode_line(line.as_ref()).expect_err(&shown);
    assert_eq!(
        (fault.kind, fault.column, fault.field.as_deref().unwrap_or("")),
        (kind, column, field),
        "{shown}: {fault}"
    );
    assert!(!fault.message.contains("at line 1"), "{fault}");
}

#[test]
fn damage_is_located() {
    let ping = line_of("ping");
    check("", RecordErrorKind::Empty, None, "");
    check(" \r", RecordErrorKind::Empty, None, "");
    check("garbage", RecordErrorKind::NotJson, Some(1), "");
    check("[1]", RecordErrorKind::NotJson, Some(1), "");
    check(&ping[..40], RecordErrorKind::NotJson, Some(40), "");
    check(b"\0\0\0\0", RecordErrorKind::NotText, Some(1), "");
    check(b"{\"type\":\"ev\xffnt\"}", RecordErrorKind::NotText, Some(12), "");
    check("{}", RecordErrorKind::NoType, None, "type");
    check(r#"{"type":7}"#, RecordErrorKind::NoType, None, "type");
    check(r#"{"type":"pong"}"#, RecordErrorKind::UnknownType, None, "type");
    check(format!("{ping} {ping}"), RecordErrorKind::NotJson, Some(ping.len() + 2), "");
    let wrong = ping.replace("\"order\":1", "\"order\":-1");
    let column = wrong.find(":-1").expect("just put there") + 3;
    check(&wrong, RecordErrorKind::BadField, Some(column), "sim.path.order");
    let session: serde_json::Value = serde_json::from_str(line_of("session")).expect("JSON");
    let writer = format!("sonard {}", session["sonard"].as_str().expect("a version"));
    for other in ["0", "2", "4294967296"] {
        let session = line_of("session").replace("\"format\":1", &format!("\"format\":{other}"));
        check(&session, RecordErrorKind::UnsupportedFormat, None, "format");
        check(
            session.replace("\"started\"", "\"begun\""),
            RecordErrorKind::UnsupportedFormat,
            None,
            "format",
        );
        let fault = decode_line(session.as_bytes()).expect_err(other).to_string();
        assert!(
            fault.contains(&format!("log format {other} ")) && fault.contains(&writer),
            "{fault}"
        );
    }
    let session = line_of("session").replace("\"format\":1", "\"format\":-1");
    assert_eq!(
        decode_line(session.as_bytes()).expect_err("negative").kind,
        RecordErrorKind::BadField
    );
    check("[".repeat(100_000), RecordErrorKind::NotJson, Some(1), "");
    let deep =
        line_of("session").replace("\"lossless\":false", &format!("\"x\":{}", "[".repeat(9999)));
    check(&deep, RecordErrorKind::NotJson, Some(deep.len() - 1), "");
    let deep = deep.replace("[}", &format!("[{}}}", "]".repeat(9999)));
    assert_eq!(decode_line(deep.as_bytes()).expect_err("too deep").kind, RecordErrorKind::BadField);
}

#[test]
fn ignores_unknown_fields() {
    let ping = line_of("ping");
    let more = ping.replace("\"index\"", "\"note\":{\"a\":[1,2]},\"index\"") + "\r";
    assert_eq!(decode_line(more.as_bytes()), decode_line(ping.as_bytes()));
}

#[test]
fn rejects_unreadable_records() {
    let Ok(Record::Ping(ping)) = decode_line(line_of("ping").as_bytes()) else {
        panic!("the fixture is clean")
    };
    let mut line = b"before".to_vec();
    let mut bad = ping.clone();
    bad.azimuth_deg = f64::NAN;
    let error = encode_line(&Record::Ping(bad), &mut line).expect_err("not a number");
    assert!(error.to_string().starts_with("azimuth_deg is NaN"), "{error}");
    let mut long = ping.clone();
    long.echo_ticks = vec![u32::MAX; 100_000];
    let error = encode_line(&Record::Ping(long), &mut line).expect_err("too long");
    assert!(matches!(error, EncodeError::TooLong(_)), "{error}");
    assert_eq!(line, b"before");
    // Optional values may be non-finite and are encoded as null.
    let mut unknown = ping;
    unknown.range_m = Some(f64::INFINITY);
    encode_line(&Record::Ping(unknown), &mut line).expect("null is a value");
    let text = String::from_utf8(line).expect("JSON is UTF-8");
    assert!(text.contains("\"range_m\":null"), "{text}");
}

proptest! {
    #[test]
    fn finite_numbers_round_trip(
        range_m in proptest::num::f64::NORMAL | proptest::num::f64::SUBNORMAL,
        azimuth_deg in 0.0..360.0_f64,
        ticks in any::<u64>(),
    ) {
        let Ok(Record::Ping(mut ping)) = decode_line(line_of("ping").as_bytes()) else {
            panic!("the fixture is clean")
        };
        ping.range_m = Some(range_m);
        ping.azimuth_deg = azimuth_deg;
        ping.fired_ticks = Some(ticks);
        let record = Record::Ping(ping);
        let mut line = Vec::new();
        encode_line(&record, &mut line).expect("finite");
        prop_assert_eq!(decode_line(line.trim_ascii_end()), Ok(record));
    }

    #[test]
    fn arbitrary_bytes_do_not_panic(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
        let _ = decode_line(&bytes);
    }

    /// Nearly valid lines exercise more code than noise.
    #[test]
    fn modified_records_do_not_panic(
        line in 0..11_usize, at in 0..2000_usize, byte in any::<u8>(), cut in any::<bool>(),
    ) {
        let mut bytes = LOG.lines().nth(line).expect("11 lines").as_bytes().to_vec();
        let at = at % bytes.len();
        if cut { bytes.truncate(at) } else { bytes[at] = byte }
        let _ = decode_line(&bytes);
    }
}
