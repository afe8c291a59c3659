//! Output formats behind the [`RecordWriter`] interface.

use std::{fmt::Write as _, fs, path::PathBuf};

use super::{folder, read, records};
use sonard_records::{Record, decode_line};

use crate::{LogWriter, PipeOutput, RecordWriter, StoreError};

/// Table of azimuths and ranges, one reading per line.
struct Table {
    path: PathBuf,
    text: String,
}

impl RecordWriter for Table {
    fn write(&mut self, record: &Record) -> Result<(), StoreError> {
        let Record::Ping(ping) = record else { return Ok(()) };
        let range = ping.range_m.map(|range_m| range_m.to_string()).unwrap_or_default();
        writeln!(self.text, "{},{range}", ping.azimuth_deg).expect("memory");
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<(), StoreError> {
        let Self { path, text } = *self;
        fs::write(&path, text).map_err(|source| StoreError::Write { path, source })
    }
}

/// Writes the fixture with any writer.
fn write_all(mut writer: Box<dyn RecordWriter>) {
    for record in records() {
        writer.write(&record).expect("written");
    }
    writer.finish().expect("written");
}

#[test]
fn two_formats_from_one_source() {
    let (folder, log) = folder();
    let table = folder.path().join("table.csv");
    let file = fs::File::create(&log).expect("it is new");
    write_all(Box::new(LogWriter::new(PipeOutput(file), &log)));
    let lines = read(&log);
    let written: Vec<_> =
        lines.lines().map(|line| decode_line(line.as_bytes()).expect("clean")).collect();
    assert_eq!(written, records());
    write_all(Box::new(Table { path: table.clone(), text: String::new() }));
    let pings = records().into_iter().filter(|record| matches!(record, Record::Ping(_)));
    assert_eq!(read(&table).lines().count(), pings.count());
    assert!(read(&table).lines().all(|line| line.split(',').count() == 2));
}
