//! Any bytes as a log: nothing panics, every byte is accounted for, and what can be read is
//! written and read again as the same.
#![no_main]

use libfuzzer_sys::fuzz_target;
use sonard::{
    compare::compare,
    scan::{ScanView, decode_line, encode_line},
    store::{check_log, read_log},
};

fuzz_target!(|bytes: &[u8]| {
    let mut at = 0;
    let mut records = Vec::new();
    for line in read_log(bytes) {
        let line = line.expect("memory can be read");
        assert_eq!(line.offset, at);
        at += line.length + u64::from(line.ended);
        records.extend(line.record.ok());
    }
    assert_eq!(at, bytes.len() as u64);
    for record in &records {
        let mut written = Vec::new();
        encode_line(record, &mut written).expect("what was read can be written");
        let again = decode_line(written.trim_ascii_end()).expect("and read again");
        assert_eq!(&again, record);
    }
    check_log(bytes, |_| {}).expect("memory can be read");
    let scans = ScanView::from_records(records);
    let (comparison, judged) = compare(&scans);
    assert_eq!((comparison.beams + comparison.not_compared.total()) as usize, judged.len());
});
