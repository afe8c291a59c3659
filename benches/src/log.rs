//! Records a second: written to a file, and read from memory.

use std::{hint::black_box, path::Path};

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use sonard::{
    scan::{Record, decode_line, encode_line},
    store::{LogWriter, read_log},
};

const LOG: &str = include_str!("../../tests/fixtures/small.jsonl");
const RECORDS: u64 = 1000;

fn ping() -> Record {
    let line = LOG.lines().nth(2).expect("the third line is a reading");
    decode_line(line.as_bytes()).expect("the fixture is clean")
}

fn write(c: &mut Criterion) {
    let mut group = c.benchmark_group("log");
    group.throughput(Throughput::Elements(RECORDS));
    let ping = ping();
    group.bench_function("encode", |b| {
        let mut line = Vec::new();
        b.iter(|| {
            for _ in 0..RECORDS {
                line.clear();
                encode_line(black_box(&ping), &mut line).expect("finite");
            }
        });
    });
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("log.jsonl");
    // With its syncs at the bounded interval; the file grows as a real one does.
    let mut writer = LogWriter::open(&path).expect("it is created");
    group.bench_function("write", |b| {
        b.iter(|| (0..RECORDS).for_each(|_| writer.append(&ping).expect("there is room")));
    });
    group.bench_function("write_and_sync", |b| {
        b.iter(|| {
            (0..RECORDS).for_each(|_| writer.append(&ping).expect("there is room"));
            writer.sync().expect("it syncs");
        });
    });
    let mut full = LogWriter::open(Path::new("/dev/null")).expect("it opens");
    group.bench_function("write_nowhere", |b| {
        b.iter(|| (0..RECORDS).for_each(|_| full.append(&ping).expect("there is room")));
    });
}

fn read(c: &mut Criterion) {
    let mut line = Vec::new();
    encode_line(&ping(), &mut line).expect("finite");
    let log = line.repeat(RECORDS as usize);
    let mut group = c.benchmark_group("log");
    group.throughput(Throughput::Elements(RECORDS));
    group.bench_function("read", |b| {
        b.iter(|| {
            let whole = read_log(black_box(&log[..]));
            whole.filter(|line| line.as_ref().is_ok_and(|l| l.record.is_ok())).count()
        });
    });
}

criterion_group!(benches, write, read);
criterion_main!(benches);
