use sonard_interpret::interpret::{
    Extents, Sweep,
    grid::Grid,
    mapping::{MapSettings, Mapper},
};
use sonard_model::geometry::Pose;
use sonard_records::{Record, ScanView};
use uuid::Uuid;

use crate::{ExportSettings, LiveConverter, PlaceFindings, SkippedScan, Topic, write_findings};

use super::scans::measured_records;

/// Returns the measured scan, shifted along x, with another id.
fn scan_aside(number: u128, x_m: f64) -> Vec<Record> {
    let scan = Uuid::from_u128(number);
    let mut records = measured_records();
    records.retain(|record| !matches!(record, Record::Session(_)));
    for record in &mut records {
        match record {
            Record::ScanStart(start) => {
                (start.scan, start.pose) = (scan, Pose { x_m: start.pose.x_m + x_m, ..start.pose });
            }
            Record::Ping(ping) => ping.scan = scan,
            Record::ScanEnd(end) => end.scan = scan,
            Record::Session(_) | Record::Event(_) => {}
        }
    }
    records
}

fn session() -> Record {
    let mut records = measured_records().into_iter();
    records.find(|record| matches!(record, Record::Session(_))).expect("it has one")
}

/// Returns the maps of records with their times, and the errors.
fn maps(live: &mut LiveConverter, records: &[Record]) -> (Vec<(u64, Vec<u8>)>, Vec<SkippedScan>) {
    let (mut maps, mut left_out) = (Vec::new(), Vec::new());
    for record in records {
        let result = live.convert(record.clone(), |message| {
            if message.topic == "/map" {
                maps.push((message.at_ns, message.bytes.to_vec()));
            }
        });
        left_out.extend(result.err());
    }
    (maps, left_out)
}

fn mapping_live() -> LiveConverter {
    LiveConverter::new(ExportSettings::default()).with_map(true)
}

/// Returns the map message of a recording of these records.
fn recorded(records: &[Record]) -> Vec<u8> {
    let scans = ScanView::from_records(records.iter().cloned());
    let session = scans[0].session.as_deref().expect("it has one");
    let sweeps: Vec<Sweep> =
        scans.iter().map(|scan| Sweep::from_scan(scan).expect("good")).collect();
    let (extents, mapping) =
        (Extents::from_session(session).expect("good"), MapSettings::default());
    let shape = mapping.shape(&sweeps, mapping.max_range_m(&extents)).expect("small");
    let mut mapper = Mapper::new(&mapping, Grid::new(shape), extents, false, sweeps.len());
    sweeps.iter().for_each(|sweep| drop(mapper.add(sweep)));
    let grid = mapper.finish();
    assert!(grid.probabilities().any(|p| p > 0.5) && grid.probabilities().any(|p| p < 0.5));
    let time = scans.iter().filter_map(|scan| Some(scan.start.as_ref()?.time)).max();
    let (lines, features) = (&[], &[]);
    let place =
        PlaceFindings { time, provenance: None, scene: None, grid: Some(&grid), lines, features };
    let mut bytes = Vec::new();
    write_findings(&mut bytes, &place).expect("memory takes it");
    let mut messages = mcap::MessageStream::new(&bytes).expect("a recording");
    messages.next().expect("one").expect("whole").data.into_owned()
}

#[test]
fn maps_all_scans_so_far() {
    let mut unfinished = scan_aside(2, 0.4);
    unfinished.retain(|record| !matches!(record, Record::ScanEnd(_)));
    let scans = [scan_aside(1, 0.0), unfinished, scan_aside(3, -0.7)];
    let (mut live, mut so_far, mut found) = (mapping_live(), vec![session()], Vec::new());
    drop(live.convert(session(), |_| {}));
    assert!(live.topics().contains(&Topic::map()));
    for scan in &scans {
        let (maps, left_out) = maps(&mut live, scan);
        assert_eq!(left_out, []);
        found.extend(maps.into_iter().map(|(_, map)| map));
    }
    let expected: Vec<Vec<u8>> = scans
        .iter()
        .map(|scan| {
            so_far.extend(scan.iter().cloned());
            recorded(&so_far)
        })
        .collect();
    assert_eq!(found.len(), 3);
    assert!(found == expected);
}

#[test]
fn continues_in_a_new_session() {
    let mut records = [vec![session()], scan_aside(1, 0.0)].concat();
    let mut live = mapping_live();
    let (first, _) = maps(&mut live, &records);
    let again = [vec![session()], scan_aside(2, 0.2)].concat();
    let (second, _) = maps(&mut live, &again);
    records.extend(again);
    assert_eq!((first.len(), second.len()), (1, 1));
    assert!(second[0].1 == recorded(&records) && second[0].0 >= first[0].0);

    let mut without = LiveConverter::new(ExportSettings::default());
    assert_eq!(maps(&mut without, &records), (Vec::new(), Vec::new()));
    assert!(!without.topics().contains(&Topic::map()));
}

#[test]
fn stops_once_at_a_large_place() {
    let mut live = mapping_live();
    let near = [vec![session()], scan_aside(1, 0.0)].concat();
    assert_eq!(maps(&mut live, &near).0.len(), 1);
    let (found, left_out) = maps(&mut live, &scan_aside(2, 1e4));
    let [SkippedScan::Map(why)] = &left_out[..] else { panic!("{left_out:?}") };
    assert!(found.is_empty() && why.contains("more than 500000 cells"), "{why}");
    assert!(left_out[0].to_string().contains("sonard map"));
    assert_eq!(maps(&mut live, &scan_aside(3, 0.0)), (Vec::new(), Vec::new()));
}

#[test]
fn excludes_long_scans() {
    let mut long = scan_aside(2, 0.3);
    let at = long.iter().position(|record| matches!(record, Record::Ping(_))).expect("one");
    let more = vec![long[at].clone(); 5000];
    long.splice(at..at, more);
    let mut live = mapping_live();
    let first = [vec![session()], scan_aside(1, 0.0)].concat();
    assert_eq!(maps(&mut live, &first).0.len(), 1);
    assert_eq!(maps(&mut live, &long), (Vec::new(), Vec::new()));
    let last = scan_aside(3, 0.3);
    assert!(maps(&mut live, &last).0[0].1 == recorded(&[first, last].concat()));
}
