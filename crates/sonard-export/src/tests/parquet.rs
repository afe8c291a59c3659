use std::{collections::BTreeMap, io};

use ::parquet::{
    file::reader::{FileReader as _, SerializedFileReader},
    record::Field,
};
use sonard_records::{Ping, PingStatus, ScanView};

use crate::{
    COLUMNS, ColumnKind, CsvExport, Export as _, ExportError, ParquetExport, ReadingRow,
    TableColumn, Value,
};

use super::scans::{Full, bare, every_status, measured, of_array, simulated};

fn exported(scans: &[ScanView]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut export = Box::new(ParquetExport::new(&mut bytes).expect("memory takes it"));
    export.add_metadata("shard", "3 of 8".to_owned());
    for scan in scans {
        assert_eq!(export.scan("small.jsonl", scan).expect("memory takes it"), None);
    }
    export.finish().expect("memory takes it");
    bytes
}

fn read(bytes: Vec<u8>) -> SerializedFileReader<bytes::Bytes> {
    SerializedFileReader::new(bytes.into()).expect("Parquet")
}

/// Returns the rows, with cells by column name.
fn rows(bytes: Vec<u8>) -> Vec<BTreeMap<String, Field>> {
    let reader = read(bytes);
    let rows = reader.get_row_iter(None).expect("rows").map(|row| row.expect("a row"));
    rows.map(|row| row.into_columns().into_iter().collect()).collect()
}

/// Returns the expected cell in Parquet.
fn cell(column: &TableColumn, row: &ReadingRow<'_>) -> Field {
    let Some(value) = column.cell(row) else { return Field::Null };
    match value {
        Value::Text(text) => Field::Str(text.into_owned()),
        Value::Integer(number) => Field::Long(number),
        Value::Number(number) if column.is_single => Field::Float(number as f32),
        Value::Number(number) => Field::Double(number),
        Value::Flag(flag) => Field::Bool(flag),
        Value::Time(time) => Field::Long(time.as_nanosecond() as i64),
        Value::Integers(_) | Value::Numbers(_) => panic!("checked by itself"),
    }
}

fn list(field: &Field) -> Vec<u32> {
    let Field::ListInternal(list) = field else { panic!("{field:?}") };
    let number = |field: &Field| match field {
        Field::UInt(number) => *number,
        other => panic!("{other:?}"),
    };
    list.elements().iter().map(number).collect()
}

#[test]
fn cells_have_their_types() {
    let mut ticks = every_status();
    ticks.pings[1].echo_ticks = vec![7, u32::MAX, 0];
    for scans in [measured(), bare(), simulated(), of_array(), vec![ticks, every_status()]] {
        let rows = rows(exported(&scans));
        let pings = scans.iter().flat_map(|scan| scan.pings.iter().map(move |ping| (scan, ping)));
        assert_eq!(rows.len(), pings.clone().count());
        for (read, (scan, ping)) in rows.iter().zip(pings) {
            let number = scan.session.is_some().then_some(1);
            let row = ReadingRow::new("small.jsonl", number, scan, ping);
            assert_eq!(read.len(), COLUMNS.len());
            for column in COLUMNS {
                match column.kind {
                    ColumnKind::Integers => assert_eq!(list(&read[column.name]), *ping.echo_ticks),
                    _ => assert_eq!(read[column.name], cell(column, &row), "{}", column.name),
                }
            }
        }
    }
}

#[test]
fn metadata_has_sessions_and_scenes() {
    let mut scans = simulated();
    let mut warmer = scans[0].session.as_deref().expect("it has one").clone();
    warmer.air.temperature_c += 1.0;
    let text = warmer.scene_text.clone().expect("a scene");
    let mut other = scans[0].clone();
    other.session = Some(warmer.into());
    scans.push(other);
    let reader = read(exported(&scans));
    let entries = reader.metadata().file_metadata().key_value_metadata().expect("metadata");
    let entries: BTreeMap<_, _> = entries
        .iter()
        .map(|entry| (entry.key.as_str(), entry.value.as_deref().unwrap_or("")))
        .collect();
    for (number, scan) in [1, 2].iter().zip(&scans) {
        let mut session = scan.session.as_deref().expect("it has one").clone();
        session.scene_text = None;
        let record = serde_json::from_str(entries[format!("sonard.session.{number}").as_str()]);
        assert_eq!(record.ok(), Some(session));
    }
    let scenes: Vec<_> =
        entries.iter().filter(|(key, _)| key.starts_with("sonard.scene.")).collect();
    assert_eq!(scenes.iter().map(|(_, value)| **value).collect::<Vec<_>>(), [&*text]);
    assert_eq!(entries["shard"], "3 of 8");
}

/// A log with more rows than a group; no row is lost between groups.
#[test]
fn writes_long_logs_in_groups() {
    let mut scan = bare().remove(0);
    let id = scan.scan;
    let pings = (0..70_000).map(|index| Ping::new(id, index, 0.0, PingStatus::NoEcho));
    scan.pings = pings.collect();
    let bytes = exported(&[scan]);
    assert_eq!(read(bytes.clone()).num_row_groups(), 2);
    let rows = rows(bytes);
    assert!(rows.iter().zip(0..).all(|(row, index)| row["index"] == Field::Long(index)));
    assert_eq!(rows.len(), 70_000);
}

/// Long texts complete a group early, which bounds memory.
#[test]
fn long_texts_end_a_group() {
    let mut scan = bare().remove(0);
    let id = scan.scan;
    let ping = |index: u32| {
        let mut ping = Ping::new(id, index, 0.0, PingStatus::NoEcho);
        ping.ranger = Some("r".repeat(1 << 20) + &index.to_string());
        ping
    };
    scan.pings = (0..20).map(ping).collect();
    assert_eq!(read(exported(&[scan])).num_row_groups(), 3);
}

#[test]
fn detected_by_its_head() {
    let bytes = exported(&measured());
    assert!(ParquetExport::<Vec<u8>>::is_own_file(&bytes));
    for other in [&bytes[..4], b"PAR1\x15\x04", b"sonard 0.1.0", b""] {
        assert!(!ParquetExport::<Vec<u8>>::is_own_file(other), "{other:?}");
    }
}

#[test]
fn reports_full_disk() {
    for bytes in [0, 3_000, 12_000] {
        let export = ParquetExport::new(Full(bytes)).map(Box::new);
        let written = export.and_then(|mut export| {
            simulated().iter().try_for_each(|scan| export.scan("a", scan).map(drop))?;
            export.finish()
        });
        match written {
            Err(ExportError::Write(error)) => assert_eq!(error.kind(), io::ErrorKind::StorageFull),
            other => panic!("{bytes}: {other:?}"),
        }
    }
}

/// The ratio stated in docs/export.md: a tenth of the same table as text.
#[test]
fn is_a_tenth_of_csv() {
    let mut scan = simulated().remove(0);
    let scans: Vec<_> = (0..50)
        .map(|number| {
            scan.scan = uuid::Uuid::from_u128(number);
            scan.clone()
        })
        .collect();
    let mut text = Vec::new();
    let mut csv = Box::new(CsvExport::new(&mut text).expect("memory takes it"));
    for scan in &scans {
        csv.scan("small.jsonl", scan).expect("memory takes it");
    }
    csv.finish().expect("memory takes it");
    let bytes = exported(&scans);
    println!("{} of {} bytes", bytes.len(), text.len());
    assert!(10 * bytes.len() < text.len(), "{} of {} bytes", bytes.len(), text.len());
}
