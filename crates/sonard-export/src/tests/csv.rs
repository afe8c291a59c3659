use std::{
    collections::{BTreeMap, BTreeSet},
    io,
};

use crate::{COLUMNS, CsvExport, Export as _, ExportError};
use sonard_records::ScanView;

use super::scans::{Full, bare, measured};

fn exported(scans: &[ScanView]) -> String {
    let mut bytes = Vec::new();
    let mut export = Box::new(CsvExport::new(&mut bytes).expect("memory takes it"));
    for scan in scans {
        assert_eq!(export.scan("small.jsonl", scan).expect("memory takes it"), None);
    }
    export.finish().expect("memory takes it");
    String::from_utf8(bytes).expect("UTF-8")
}

/// Returns the rows, with cells by column name.
fn rows(table: &str) -> Vec<BTreeMap<String, String>> {
    let mut reader = csv::Reader::from_reader(table.as_bytes());
    reader.deserialize().map(|row| row.expect("a row")).collect()
}

#[test]
fn rows_match_records() {
    let scans = measured();
    let table = exported(&scans);
    assert_eq!(table.lines().next(), Some(CsvExport::<Vec<u8>>::head().as_str()));
    let rows = rows(&table);
    let pings: Vec<_> = scans.iter().flat_map(|scan| &scan.pings).collect();
    assert_eq!(rows.len(), pings.len());
    for (row, ping) in rows.iter().zip(&pings) {
        // Record fields appear in the column of the same name.
        let record = serde_json::to_value(ping).expect("JSON");
        let sim = record.get("sim").cloned().unwrap_or_default();
        for (name, cell) in row {
            let of_record = match name.strip_prefix("sim_") {
                Some(name) => sim.get(name),
                None => record.get(name),
            };
            match of_record {
                _ if name == "path" || name == "sim_path" => {}
                None if name == "repaired" => assert_eq!(cell, "false"),
                None => {}
                Some(serde_json::Value::Null) => assert_eq!(cell, "", "{name}"),
                Some(serde_json::Value::String(text)) => assert_eq!(cell, text, "{name}"),
                Some(serde_json::Value::Number(number)) => {
                    assert_eq!(cell.parse().ok(), number.as_f64(), "{name}");
                }
                Some(serde_json::Value::Array(list)) => {
                    let expected: Vec<_> = list.iter().map(ToString::to_string).collect();
                    assert_eq!(*cell, expected.join(" "), "{name}");
                }
                Some(other) => assert_eq!(*cell, other.to_string(), "{name}"),
            }
        }
        assert_eq!((row["log"].as_str(), row["session"].as_str()), ("small.jsonl", "1"));
        assert_eq!(
            (row["sensor"].as_str(), row["scene"].as_str()),
            ("senscomp-6500", "simple-room")
        );
    }
    assert_eq!(rows[1]["sim_path"], "south, north, south");
    assert_eq!(
        (rows[1]["transducer_x_m"].as_str(), rows[1]["direction_deg"].as_str()),
        ("0.774", "0.9")
    );
}

#[test]
fn missing_values_are_empty() {
    let rows = rows(&exported(&bare()));
    assert!(!rows.is_empty());
    for row in rows {
        assert!(!row["azimuth_deg"].is_empty() && !row["status"].is_empty());
        for name in ["session", "x_m", "transducer_x_m", "sound_speed_m_s", "scan_started"] {
            assert_eq!(row[name], "", "{name}");
        }
    }
}

#[test]
fn numbers_sessions() {
    let mut scans = measured();
    scans.extend(measured());
    let mut warmer = measured();
    for scan in &mut warmer {
        let mut session = scan.session.as_deref().expect("it has one").clone();
        session.air.temperature_c += 1.0;
        scan.session = Some(session.into());
    }
    scans.extend(warmer);
    let numbers: BTreeSet<_> = rows(&exported(&scans))
        .iter()
        .map(|row| (row["session"].clone(), row["temperature_c"].clone()))
        .collect();
    assert_eq!(
        numbers,
        [("1", "20"), ("2", "21")].map(|(a, b)| (a.to_owned(), b.to_owned())).into()
    );
}

#[test]
fn columns_have_unique_names_and_kinds() {
    let names: BTreeSet<_> = COLUMNS.iter().map(|column| column.name).collect();
    assert_eq!(names.len(), COLUMNS.len());
    for scan in measured() {
        for ping in &scan.pings {
            let row = crate::ReadingRow::new("small.jsonl", Some(1), &scan, ping);
            for column in COLUMNS {
                let kind = column.cell(&row).map_or(column.kind, |value| value.kind());
                assert_eq!(kind, column.kind, "{}", column.name);
            }
        }
    }
}

#[test]
fn reports_full_disk() {
    let mut export = Box::new(CsvExport::new(Full(500)).expect("the first line waits"));
    let result = measured().iter().try_for_each(|scan| export.scan("a", scan).map(drop));
    match result.and_then(|()| export.finish()) {
        Err(ExportError::Write(error)) => assert_eq!(error.kind(), io::ErrorKind::StorageFull),
        other => panic!("{other:?}"),
    }
}

/// The columns explained in docs/export.md, in their order.
#[test]
fn documentation_lists_all_columns() {
    let text = include_str!("../../../../docs/export.md");
    let (_, table) = text.split_once("| columns | what they hold |\n").expect("the table");
    let rows = table.lines().skip(1).take_while(|line| line.starts_with('|'));
    let cells = rows.filter_map(|row| row.split('|').nth(1));
    let names: Vec<_> =
        cells.flat_map(|cell| cell.split(',')).map(|name| name.trim().trim_matches('`')).collect();
    assert_eq!(names, COLUMNS.iter().map(|column| column.name).collect::<Vec<_>>());
}
