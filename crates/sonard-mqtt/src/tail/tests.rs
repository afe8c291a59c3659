use std::{fs, io::Write as _};

use proptest::prelude::*;
use tempfile::TempDir;

use super::*;

const EVENT: &str =
    r#"{"type":"event","time":"2026-11-23T10:00:00Z","kind":"stopped","detail":"N"}"#;

fn event(number: usize) -> String {
    EVENT.replace('N', &number.to_string())
}

fn name(log: usize) -> String {
    format!("sonard-20261123T{log:06}Z.jsonl")
}

fn append(folder: &TempDir, log: usize, text: &str) {
    let path = folder.path().join(name(log));
    let mut file = fs::OpenOptions::new().create(true).append(true).open(path).expect("opens");
    file.write_all(text.as_bytes()).expect("writes");
}

fn texts(lines: &[Read]) -> Vec<String> {
    let messages = lines.iter().filter_map(|line| line.message.as_ref());
    messages.map(|message| String::from_utf8(message.payload.to_vec()).expect("text")).collect()
}

fn open(folder: &TempDir, history: bool) -> (Tail, Option<String>) {
    Tail::open(folder.path(), history).expect("the folder is readable")
}

fn read(tail: &mut Tail) -> Piece {
    tail.read(usize::MAX).expect("the logs are readable")
}

#[test]
fn the_first_time_it_begins_at_the_end_unless_the_history_is_wanted() {
    let folder = tempfile::tempdir().expect("a folder");
    append(&folder, 1, &(event(1) + "\n"));
    append(&folder, 2, &(event(2) + "\n"));
    let (mut all, told) = open(&folder, true);
    assert_eq!((texts(&read(&mut all).lines), told), (vec![event(1), event(2)], None));
    // That was remembered: what comes before the broker was there once counts, too.
    fs::remove_file(folder.path().join("mqtt-place.json")).expect("it was remembered");
    let (mut tail, told) = open(&folder, false);
    assert_eq!((read(&mut tail), told), (Piece { is_end: true, ..Piece::default() }, None));
    append(&folder, 2, &(event(3) + "\n"));
    let (mut again, _) = open(&folder, false);
    assert_eq!(texts(&read(&mut again).lines), [event(3)]);
    assert_eq!(texts(&read(&mut tail).lines), [event(3)]);
}

#[test]
fn a_line_is_read_once_it_is_whole_and_what_is_no_record_is_passed_over() {
    let folder = tempfile::tempdir().expect("a folder");
    append(&folder, 1, "");
    let (mut tail, _) = open(&folder, true);
    let text = event(1) + "\n";
    append(&folder, 1, &text[..30]);
    assert_eq!(read(&mut tail).lines, []);
    append(&folder, 1, &text[30..]);
    append(&folder, 1, "no record\n{\"type\":\"song\"}\n\n");
    let lines = read(&mut tail).lines;
    assert_eq!((lines.len(), texts(&lines)), (4, vec![event(1)]));
    // A line that no record can be as long as, and a torn one before the next log.
    append(&folder, 1, &"x".repeat(3 * MAX_LINE_BYTES));
    append(&folder, 1, "\n{\"type\":\"ev");
    append(&folder, 2, &(event(2) + "\n"));
    let lines = read(&mut tail).lines;
    assert_eq!(texts(&lines), [event(2)]);
    assert_eq!(
        tail.place(),
        &LogPosition { file: name(2).as_str().into(), bytes: text.len() as u64 }
    );
}

#[test]
fn a_log_that_is_gone_is_told_and_read_on_from_the_oldest_behind_it() {
    let folder = tempfile::tempdir().expect("a folder");
    for log in 1..=4 {
        append(&folder, log, &(event(log) + "\n"));
    }
    let (mut tail, _) = open(&folder, true);
    let piece = tail.read(1).expect("reads");
    assert_eq!((texts(&piece.lines), piece.is_end), (vec![event(1)], false));
    for log in [1, 2] {
        fs::remove_file(folder.path().join(name(log))).expect("is there");
    }
    let gap = read(&mut tail);
    assert!(gap.gap.is_some_and(|told| told.contains(&name(1)) && told.contains(&name(3))));
    assert_eq!(
        (texts(&read(&mut tail).lines), read(&mut tail).gap),
        (vec![event(3), event(4)], None)
    );
    // Cut shorter than what was read.
    fs::write(folder.path().join(name(4)), "").expect("writes");
    assert!(read(&mut tail).gap.is_some_and(|told| told.contains("removed or cut")));
}

#[test]
fn a_place_that_does_not_fit_any_more_is_told_when_it_is_opened() {
    let folder = tempfile::tempdir().expect("a folder");
    append(&folder, 1, &(event(1) + "\n"));
    append(&folder, 2, &(event(2) + "\n"));
    let (mut tail, _) = open(&folder, true);
    read(&mut tail);
    Bookmark::write(folder.path(), tail.place()).expect("writes");
    // The same length, and something else in it: a log that a power cut took the end of, and that went on.
    fs::write(folder.path().join(name(2)), event(7) + "\n").expect("writes");
    let (mut again, told) = open(&folder, false);
    assert!(told.is_some_and(|told| told.contains(&name(2))));
    assert_eq!(texts(&read(&mut again).lines), [event(7)], "the log before it was had");
    fs::write(folder.path().join("mqtt-place.json"), "{").expect("writes");
    let (mut all, told) = open(&folder, false);
    assert!(told.is_some_and(|told| told.contains("not known")));
    assert_eq!(texts(&read(&mut all).lines), [event(1), event(7)]);
}

proptest! {
    /// Whatever is appended, in pieces of any length, to however many logs, with reads of any size between: every
    /// record is read once, in order.
    #[test]
    fn every_record_is_read_once(
        cuts in prop::collection::vec((1..200_usize, 1..400_usize, prop::bool::weighted(0.2)), 1..40),
    ) {
        let folder = tempfile::tempdir().expect("a folder");
        append(&folder, 0, "");
        let (mut tail, _) = open(&folder, true);
        let (mut log, mut number, mut rest, mut got) = (0, 0, String::new(), Vec::new());
        for (bytes, most, is_next) in cuts {
            while rest.len() < bytes {
                rest += &(event(number) + "\n");
                number += 1;
            }
            let piece: String = rest.drain(..bytes).collect();
            append(&folder, log, &piece);
            got.extend(texts(&tail.read(most).expect("reads").lines));
            if is_next {
                append(&folder, log, &std::mem::take(&mut rest));
                log += 1;
                append(&folder, log, "");
            }
        }
        append(&folder, log, &rest);
        loop {
            let piece = tail.read(100).expect("reads");
            prop_assert_eq!(&piece.gap, &None);
            got.extend(texts(&piece.lines));
            if piece.is_end {
                break;
            }
        }
        prop_assert_eq!(got, (0..number).map(event).collect::<Vec<_>>());
    }
}
