use std::{
    collections::{BTreeMap, BTreeSet},
    io,
};

use byteorder::LittleEndian;
use jiff::Timestamp;
use serde::{Deserialize, de::DeserializeOwned};

use crate::{
    AttachedLog, Export as _, ExportError, ExportSettings, McapExport, Profile, SkippedScan,
    ros::interface::{FLOAT, Interface, LASER_SCAN, MARKERS, POINT_CLOUD, RANGE, TRANSFORMS},
};
use sonard_records::{PingStatus, ScanView};

use super::scans::{Full, bare, every_status, measured, of_array, simulated};

fn recorded_with(scans: &[ScanView], settings: ExportSettings) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut export = Box::new(McapExport::new(&mut bytes, settings).expect("memory takes it"));
    for scan in scans {
        assert_eq!(export.scan("small.jsonl", scan).expect("memory takes it"), None);
    }
    export.finish().expect("memory takes it");
    bytes
}

fn recorded(scans: &[ScanView]) -> Vec<u8> {
    recorded_with(scans, ExportSettings::default())
}

/// Time and bytes of a message.
type Read = (u64, Vec<u8>);

fn by_topic(recording: &[u8]) -> BTreeMap<String, Vec<Read>> {
    let mut topics: BTreeMap<String, Vec<Read>> = BTreeMap::new();
    for message in mcap::MessageStream::new(recording).expect("a recording") {
        let message = message.expect("a message");
        assert_eq!(message.channel.message_encoding, "cdr");
        let read = (message.log_time, message.data.into_owned());
        topics.entry(message.channel.topic.clone()).or_default().push(read);
    }
    topics
}

fn decoded<T: DeserializeOwned>(messages: &[Read]) -> Vec<T> {
    let decode = |(_, bytes): &Read| {
        let (message, read) =
            cdr_encoding::from_bytes::<T, LittleEndian>(&bytes[4..]).expect("decodes");
        assert_eq!(read, bytes.len() - 4, "the whole message");
        message
    };
    messages.iter().map(decode).collect()
}

#[derive(Debug, Deserialize)]
struct Header {
    sec: i32,
    nanosec: u32,
    frame_id: String,
}

impl Header {
    fn nanoseconds(&self) -> i128 {
        i128::from(self.sec) * 1_000_000_000 + i128::from(self.nanosec)
    }
}

#[derive(Debug, Deserialize)]
struct Range {
    header: Header,
    radiation_type: u8,
    field_of_view: f32,
    min_range: f32,
    max_range: f32,
    range: f32,
    variance: f32,
}

#[derive(Debug, Deserialize)]
struct LaserScan {
    header: Header,
    angle_min: f32,
    angle_max: f32,
    angle_increment: f32,
    time_increment: f32,
    scan_time: f32,
    range_min: f32,
    range_max: f32,
    ranges: Vec<f32>,
    intensities: Vec<f32>,
}

#[derive(Debug, Deserialize)]
struct Transform {
    header: Header,
    child_frame_id: String,
    translation: [f64; 3],
    rotation: [f64; 4],
}

#[test]
fn range_matches_reading() {
    let scans = measured();
    let topics = by_topic(&recorded(&scans));
    let ranges: Vec<Range> = decoded(&topics["/sonar/range"]);
    let echoes: Vec<_> =
        scans[0].pings.iter().filter(|ping| ping.status == PingStatus::Echo).collect();
    assert!(!echoes.is_empty());
    for ping in echoes {
        let at = ping.time.expect("measured").as_nanosecond();
        let range =
            ranges.iter().find(|range| range.header.nanoseconds() == at).expect("its message");
        assert_eq!(range.range, ping.range_m.expect("an echo") as f32);
        assert_eq!(
            (range.header.frame_id.as_str(), range.radiation_type, range.variance),
            ("sonar", 0, 0.0)
        );
        // 2380 us of blanking in air of 343.99 m/s; a piston of 19.3 mm at 49.4 kHz.
        assert!((range.min_range - 0.409_35).abs() < 1e-4, "{range:?}");
        assert_eq!(range.max_range, 10.7);
        assert!((range.field_of_view.to_degrees() - 10.3).abs() < 0.5, "{range:?}");
    }
    // A reading lost on the link has no firing time.
    let predicted = scans[0].pings.iter().filter(|ping| ping.sim.is_some() && ping.time.is_some());
    assert_eq!(topics["/sonar/predicted/range"].len(), predicted.count());
}

#[test]
fn profiles_encode_missing_echoes() {
    let scans = [every_status()];
    let found = |profile| {
        let settings = ExportSettings { profile, ..ExportSettings::default() };
        let topics = by_topic(&recorded_with(&scans, settings));
        let ranges: Vec<Range> = decoded(&topics["/sonar/range"]);
        let limits = (ranges[0].min_range, ranges[0].max_range);
        (ranges.iter().map(|range| range.range).collect::<Vec<_>>(), limits, topics)
    };
    let (ranges, _, topics) = found(Profile::Rep117);
    assert_eq!(ranges, [1.25, f32::INFINITY, f32::NEG_INFINITY]);
    let (ranges, (min, max), _) = found(Profile::Nav2);
    assert_eq!(ranges, [1.25, max, min]);
    let scan: LaserScan = decoded(&topics["/sonar/scan"]).remove(0);
    let [echo, no_echo, near, rest @ ..] = scan.ranges.as_slice() else { panic!("{scan:?}") };
    assert_eq!((*echo, *no_echo, *near), (1.25, f32::INFINITY, f32::NEG_INFINITY));
    assert!(rest.len() == 3 && rest.iter().all(|range| range.is_nan()), "{rest:?}");
}

#[test]
fn laser_scan_beams_are_in_place() {
    let scans = simulated();
    let scan: LaserScan = decoded(&by_topic(&recorded(&scans))["/sonar/scan"]).remove(0);
    let pings = &scans[0].pings;
    assert_eq!((scan.ranges.len(), scan.intensities.len()), (40, 40));
    for ping in pings {
        let place = ping.index as usize;
        let azimuth_deg = (scan.angle_min + place as f32 * scan.angle_increment).to_degrees();
        assert!((f64::from(azimuth_deg) - ping.azimuth_deg).abs() < 1e-3, "{place}");
        if let Some(range_m) = ping.range_m {
            assert_eq!(scan.ranges[place], range_m as f32);
        }
        assert_eq!(scan.intensities[place], ping.margin_db.unwrap_or(0.0) as f32);
    }
    assert!((scan.angle_max - scan.angle_min - 39.0 * scan.angle_increment).abs() < 1e-5);
    assert!((scan.scan_time - 40.0 * scan.time_increment) < scan.scan_time, "{scan:?}");
    assert!(scan.range_min < scan.range_max && scan.time_increment > 0.0);
    assert_eq!(scan.header.frame_id, "sonar_mount");
}

#[test]
fn residuals_match_the_log() {
    let scans = measured();
    let topics = by_topic(&recorded(&scans));
    let residuals: Vec<f64> = decoded(&topics["/sonar/residual"]);
    let expected: Vec<f64> = scans[0].pings.iter().filter_map(|ping| ping.residual_m).collect();
    assert!(!expected.is_empty());
    assert_eq!(residuals, expected);
}

#[test]
fn transforms_lead_to_the_transducer() {
    let scans = simulated();
    let topics = by_topic(&recorded(&scans));
    let fixed: Vec<Vec<Transform>> = decoded(&topics["/tf_static"]);
    assert_eq!((fixed.len(), fixed[0][0].child_frame_id.as_str()), (1, "sonar_mount"));
    let moving: Vec<Vec<Transform>> = decoded(&topics["/tf"]);
    let ranges: Vec<Range> = decoded(&topics["/sonar/range"]);
    // At each firing, and before the next one.
    assert_eq!(moving.len(), 2 * scans[0].pings.len());
    for (pair, (ping, range)) in moving.chunks(2).zip(scans[0].pings.iter().zip(&ranges)) {
        assert_eq!(pair[0][0].header.nanoseconds(), range.header.nanoseconds());
        assert!(pair[1][0].header.nanoseconds() > range.header.nanoseconds());
        for [base, sonar] in pair.iter().map(|message| [&message[0], &message[1]]) {
            let names = [
                &base.header.frame_id,
                &base.child_frame_id,
                &sonar.header.frame_id,
                &sonar.child_frame_id,
            ];
            assert_eq!(names, ["map", "base_link", "sonar_mount", "sonar"]);
            let from = scans[0].viewpoint(ping).expect("a place");
            assert_eq!(base.translation, [from.x_m, from.y_m, 0.0]);
            assert_eq!(sonar.translation, [0.0; 3]);
            let turn = |transform: &Transform| {
                let [_, _, z, w] = transform.rotation;
                2.0 * z.atan2(w).to_degrees()
            };
            let off = (turn(base) + turn(sonar) - from.direction_deg).rem_euclid(360.0);
            assert!(off.min(360.0 - off) < 1e-9, "{off}");
        }
    }
}

#[test]
fn array_rangers_have_own_topics() {
    let scans = of_array();
    let topics = by_topic(&recorded(&scans));
    let ids: BTreeSet<_> = scans[0].pings.iter().filter_map(|ping| ping.ranger.clone()).collect();
    assert!(ids.len() > 2 && !topics.contains_key("/sonar/scan"));
    let fixed: Vec<Vec<Transform>> = decoded(&topics["/tf_static"]);
    for id in ids {
        let ranges: Vec<Range> = decoded(&topics[&format!("/sonar/{id}/range")]);
        let frame = format!("sonar_{id}");
        assert!(ranges.iter().all(|range| range.header.frame_id == frame));
        let placed =
            fixed[0].iter().find(|transform| transform.child_frame_id == frame).expect(&frame);
        let session = scans[0].session.as_ref().expect("a session");
        let ranger = session.array.as_ref().and_then(|array| array.ranger(&id)).expect("it");
        assert_eq!(placed.translation[..2], [ranger.x_m, ranger.y_m]);
    }
}

#[test]
fn synthetic_times_are_sequential() {
    let mut scans = simulated();
    scans.extend(simulated());
    let recording = recorded(&scans);
    let topics = by_topic(&recording);
    for (topic, messages) in &topics {
        let times: Vec<_> = messages.iter().map(|(time, _)| *time).collect();
        assert!(times.is_sorted() && times[0] > 0, "{topic}");
    }
    let stamps: Vec<_> = decoded::<Range>(&topics["/sonar/range"])
        .iter()
        .map(|range| range.header.nanoseconds())
        .collect();
    assert!(stamps.windows(2).all(|pair| pair[0] < pair[1]), "{stamps:?}");
    // The last window ends before the next scan, so a frame has one placement at a time.
    let moving: Vec<Vec<Transform>> = decoded(&topics["/tf"]);
    let found: Vec<_> = moving.iter().map(|message| message[0].header.nanoseconds()).collect();
    assert!(found.windows(2).all(|pair| pair[0] < pair[1]), "{found:?}");
    let summary = mcap::Summary::read(&recording).expect("reads").expect("it has one");
    let remarks = mcap::read::metadata(&recording, &summary.metadata_indexes[0]).expect("reads");
    assert_eq!(remarks.name, "sonard");
    assert!(remarks.metadata["time_base"].starts_with("made up"), "{remarks:?}");
    assert_eq!(remarks.metadata["provenance"], "simulated");
}

#[test]
fn attaches_the_log() {
    let text = "{\"type\":\"session\"}\n".repeat(10_000);
    let mut bytes = Vec::new();
    let mut export =
        Box::new(McapExport::new(&mut bytes, ExportSettings::default()).expect("memory"));
    let written = Timestamp::UNIX_EPOCH;
    let log = AttachedLog { name: "small.jsonl", bytes: text.len() as u64, modified: written };
    export.attach(&log, &mut text.as_bytes()).expect("attached");
    export.finish().expect("memory");
    let summary = mcap::Summary::read(&bytes).expect("reads").expect("it has one");
    let found = mcap::read::attachment(&bytes, &summary.attachment_indexes[0]).expect("reads");
    assert_eq!((found.name.as_str(), &*found.data), ("small.jsonl", text.as_bytes()));
    // A log that has become shorter is an error.
    let mut export = McapExport::new(Vec::new(), ExportSettings::default()).expect("memory");
    let short = export.attach(&log, &mut &text.as_bytes()[1..]);
    assert!(matches!(short, Err(ExportError::Attach { .. })), "{short:?}");
}

#[test]
fn skips_scans_without_session_or_pose() {
    let mut export = McapExport::new(Vec::new(), ExportSettings::default()).expect("memory");
    for scan in bare() {
        assert_eq!(export.scan("a", &scan).expect("memory"), Some(SkippedScan::NoSession));
    }
    for mut scan in measured() {
        scan.start = None;
        assert_eq!(export.scan("a", &scan).expect("memory"), Some(SkippedScan::NoPose));
    }
    for mut scan in measured() {
        let mut session = scan.session.as_deref().expect("it has one").clone();
        session.sensor.frequency_hz = -1.0;
        scan.session = Some(session.into());
        for _ in 0..2 {
            let left_out = export.scan("a", &scan).expect("memory");
            assert!(matches!(left_out, Some(SkippedScan::Session(_))), "{left_out:?}");
        }
    }
}

/// Exported message types.
const INTERFACES: [Interface; 6] = [RANGE, FLOAT, LASER_SCAN, POINT_CLOUD, TRANSFORMS, MARKERS];

#[test]
fn topics_declare_types_and_qos() {
    let mut scans = measured();
    scans.extend(of_array());
    let recording = recorded(&scans);
    assert!(McapExport::<Vec<u8>>::is_own_file(&recording));
    let summary = mcap::Summary::read(&recording).expect("reads").expect("it has one");
    let known: BTreeMap<_, _> = INTERFACES.iter().map(|each| (each.name, each)).collect();
    let mut used = BTreeSet::new();
    for channel in summary.channels.values() {
        let schema = channel.schema.as_ref().expect("a schema");
        let interface = known[schema.name.as_str()];
        assert_eq!(
            (schema.encoding.as_str(), &*schema.data),
            ("ros2msg", interface.definition().as_bytes())
        );
        assert_eq!(channel.metadata["topic_type_hash"], interface.hash);
        let offered = &channel.metadata["offered_qos_profiles"];
        let is_fixed = ["/tf_static", "/sonar/scene"].contains(&channel.topic.as_str());
        assert_eq!(offered.contains("durability: transient_local"), is_fixed, "{}", channel.topic);
        assert!(offered.contains("reliability: reliable"));
        used.insert(schema.name.clone());
    }
    assert_eq!(used.len(), INTERFACES.len());
}

#[test]
fn reports_full_disk() {
    let mut export =
        Box::new(McapExport::new(Full(500), ExportSettings::default()).expect("its head fits"));
    let result = measured().iter().try_for_each(|scan| export.scan("a", scan).map(drop));
    match result.and_then(|()| export.finish()) {
        Err(ExportError::Write(error)) => assert_eq!(error.kind(), io::ErrorKind::StorageFull),
        other => panic!("{other:?}"),
    }
}
