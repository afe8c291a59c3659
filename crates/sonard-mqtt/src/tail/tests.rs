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

fn texts(lines: &[LogLine]) -> Vec<String> {
    let messages = lines.iter().filter_map(|line| line.message.as_ref());
    messages.map(|message| String::from_utf8(message.payload.to_vec()).expect("text")).collect()
}

fn open(folder: &TempDir, history: bool) -> (Tail, Option<String>) {
    Tail::open(folder.path(), history).expect("the folder is readable")
}

fn read(tail: &mut Tail) -> TailChunk {
    tail.read(usize::MAX).expect("the logs are readable")
}

#[test]
fn starts_at_the_end_or_with_history() {
    let folder = tempfile::tempdir().expect("a folder");
    append(&folder, 1, &(event(1) + "\n"));
    append(&folder, 2, &(event(2) + "\n"));
    let (mut all, gap) = open(&folder, true);
    assert_eq!((texts(&read(&mut all).lines), gap), (vec![event(1), event(2)], None));
    // The start is checkpointed: records before the first connection are published, too.
    fs::remove_file(folder.path().join("mqtt-place.json")).expect("a checkpoint");
    let (mut tail, gap) = open(&folder, false);
    assert_eq!((read(&mut tail), gap), (TailChunk { is_end: true, ..TailChunk::default() }, None));
    append(&folder, 2, &(event(3) + "\n"));
    let (mut again, _) = open(&folder, false);
    assert_eq!(texts(&read(&mut again).lines), [event(3)]);
    assert_eq!(texts(&read(&mut tail).lines), [event(3)]);
}

#[test]
fn only_complete_records_are_read() {
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
    // A line too long for a record, and a torn one before the next log.
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
fn removed_log_is_a_gap() {
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
    assert!(gap.gap.is_some_and(|text| text.contains(&name(1)) && text.contains(&name(3))));
    assert_eq!(
        (texts(&read(&mut tail).lines), read(&mut tail).gap),
        (vec![event(3), event(4)], None)
    );
    // Truncated before the position.
    fs::write(folder.path().join(name(4)), "").expect("writes");
    assert!(read(&mut tail).gap.is_some_and(|text| text.contains("removed or cut")));
}

#[test]
fn mismatched_checkpoint_is_a_gap() {
    let folder = tempfile::tempdir().expect("a folder");
    append(&folder, 1, &(event(1) + "\n"));
    append(&folder, 2, &(event(2) + "\n"));
    let (mut tail, _) = open(&folder, true);
    read(&mut tail);
    LogCheckpoint::write(folder.path(), tail.place()).expect("writes");
    // Same length, other contents: a log that was truncated by a power cut and continued.
    fs::write(folder.path().join(name(2)), event(7) + "\n").expect("writes");
    let (mut again, gap) = open(&folder, false);
    assert!(gap.is_some_and(|text| text.contains(&name(2))));
    assert_eq!(texts(&read(&mut again).lines), [event(7)], "the log before it was published");
    fs::write(folder.path().join("mqtt-place.json"), "{").expect("writes");
    let (mut all, gap) = open(&folder, false);
    assert!(gap.is_some_and(|text| text.contains("not known")));
    assert_eq!(texts(&read(&mut all).lines), [event(1), event(7)]);
}

proptest! {
    /// For appends of any length to any number of logs, with reads of any size in between: every
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
