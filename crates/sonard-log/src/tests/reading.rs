//! Reading of damaged files.

use std::io::{self, BufRead, BufReader, Read};

use proptest::prelude::*;
use sonard_records::{MAX_LINE_BYTES, RecordErrorKind};

use super::*;
use crate::{Line, read_log};

fn lines(bytes: &[u8]) -> Vec<Line> {
    read_log(bytes).map(|line| line.expect("memory can be read")).collect()
}

fn faults(bytes: &[u8]) -> Vec<(u64, RecordErrorKind)> {
    let fault = |line: Line| line.record.err().map(|error| (error.line, error.fault.kind));
    lines(bytes).into_iter().filter_map(fault).collect()
}

#[test]
fn number_and_offset_of_lines() {
    let lines = lines(LOG.as_bytes());
    assert_eq!(lines.len(), 11);
    for line in &lines {
        let (from, to) = (line.offset as usize, (line.offset + line.length) as usize);
        assert_eq!(&LOG.as_bytes()[from..to], line.bytes);
        assert_eq!(&LOG.as_bytes()[to..=to], b"\n");
    }
    assert_eq!(lines.last().map(|line| line.number), Some(11));
    assert_eq!(
        lines.into_iter().filter_map(|line| line.record.ok()).collect::<Vec<_>>(),
        records()
    );
}

#[test]
fn damage_affects_single_lines() {
    let session = LOG.lines().next().expect("a session");
    let end = LOG.lines().nth(9).expect("an end");
    let log = format!("{session}\nrubbish\n\n{end}\n\0\0\0\n{{\"type\":\"pong\"}}\n{end}\n{{\"ty");
    let (empty, text) = (RecordErrorKind::Empty, RecordErrorKind::NotText);
    assert_eq!(
        faults(log.as_bytes()),
        [
            (2, RecordErrorKind::NotJson),
            (3, empty),
            (5, text),
            (6, RecordErrorKind::UnknownType),
            (8, RecordErrorKind::Truncated)
        ]
    );
}

#[test]
fn windows_line_ends_and_bom() {
    let windows = format!("\u{feff}{}", LOG.replace('\n', "\r\n"));
    assert_eq!(faults(windows.as_bytes()), []);
    // Within the file, a byte-order mark is damage.
    let late = LOG.replace("\n{\"type\":\"scan_end\"", "\n\u{feff}{\"type\":\"scan_end\"");
    assert_eq!(faults(late.as_bytes()), [(10, RecordErrorKind::NotJson)]);
}

#[test]
fn memory_is_bounded() {
    // A streamed line of 64 MiB between two valid ones.
    let good = LOG.lines().next().expect("a session").to_owned() + "\n";
    let long = io::repeat(b'x').take(64 << 20);
    let log = good.as_bytes().chain(long).chain(&b"\n"[..]).chain(good.as_bytes());
    let lines: Vec<Line> = read_log(BufReader::new(log)).map(|line| line.expect("read")).collect();
    assert_eq!(lines.len(), 3);
    assert_eq!(lines[1].length, 64 << 20);
    assert!(lines[1].bytes.capacity() <= 4 * MAX_LINE_BYTES, "{}", lines[1].bytes.capacity());
    assert_eq!(
        lines[1].record.as_ref().err().map(|e| e.fault.kind),
        Some(RecordErrorKind::TooLong)
    );
    assert!(lines[2].record.is_ok());
    assert_eq!(lines[2].offset, good.len() as u64 + (64 << 20) + 1);
}

#[test]
fn maximum_line_length() {
    let event = LOG.lines().nth(10).expect("an event");
    for (length, ok) in [(MAX_LINE_BYTES, true), (MAX_LINE_BYTES + 3, false)] {
        let filler = "x".repeat(length - event.len());
        let line = event.replace("on request", &format!("on request{filler}")) + "\n";
        let read = lines(line.as_bytes());
        assert_eq!((read.len(), read[0].length, read[0].record.is_ok()), (1, length as u64, ok));
    }
}

#[test]
fn read_error_ends_the_iteration() {
    struct Broken;
    impl Read for Broken {
        fn read(&mut self, _: &mut [u8]) -> io::Result<usize> {
            Err(io::Error::other("bad sector"))
        }
    }
    let log = LOG.as_bytes().chain(BufReader::new(Broken));
    let items: Vec<_> = read_log(log).collect();
    assert_eq!(items.len(), 12);
    assert!(items[..11].iter().all(Result::is_ok) && items[11].is_err());
}

proptest! {
    /// Random bytes: the lines cover the file without gaps, and none follows a line without
    /// newline.
    #[test]
    fn lines_tile_the_file(
        pieces in proptest::collection::vec(
            prop_oneof![
                proptest::collection::vec(any::<u8>(), 0..40),
                (0..11_usize).prop_map(|i| LOG.lines().nth(i).expect("11 lines").into()),
                Just(b"\n".to_vec()),
            ],
            0..20,
        ),
        buffer in 1..64_usize,
    ) {
        let bytes = pieces.concat();
        let mut at = 0;
        let mut ended = true;
        for line in read_log(BufReader::with_capacity(buffer, &bytes[..])) {
            let line = line.expect("memory can be read");
            prop_assert!(ended);
            prop_assert_eq!(line.offset, at);
            ended = line.ended;
            at += line.length + u64::from(ended);
        }
        prop_assert_eq!(at, bytes.len() as u64);
        prop_assert_eq!(lines(&bytes).len(), bytes.lines().count());
    }
}
