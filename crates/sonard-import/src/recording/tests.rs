//! Recordings encoded by independent encoders, in both byte orders.

mod chunks;
mod places;

use std::{
    collections::BTreeMap,
    io::{self, Cursor},
};

use byteorder::{BigEndian, LittleEndian};
use proptest::prelude::*;
use serde::Serialize;
use sonard_model::{acoustics::Air, geometry::Pose, reading::PingStatus};
use sonard_records::{Ping, Record, ScanStart};

use super::{LASER_SCAN, RANGE, TRANSFORMS, read_message};
use crate::{Assumptions, Format, ImportError, ImportSource, Imported, Mapping};

#[derive(Debug, Clone, Copy, PartialEq)]
enum Order {
    Little,
    Big,
}

/// Encodes a message after the four bytes of its encoding.
fn cdr(message: &impl Serialize, order: Order) -> Vec<u8> {
    let (head, bytes) = match order {
        Order::Little => ([0, 1, 0, 0], cdr_encoding::to_vec::<_, LittleEndian>(message)),
        Order::Big => ([0, 0, 0, 0], cdr_encoding::to_vec::<_, BigEndian>(message)),
    };
    [&head[..], &bytes.expect("memory takes it")].concat()
}

#[derive(Debug, Clone, Serialize)]
struct Header(i32, u32, String);

fn header(time_s: f64, frame: &str) -> Header {
    Header(time_s.floor() as i32, (time_s.fract() * 1e9).round() as u32, frame.to_owned())
}

#[derive(Debug, Clone, Serialize)]
struct Range(Header, u8, [f32; 4]);

fn range(time_s: f64, frame: &str, range_m: f32) -> Range {
    Range(header(time_s, frame), 0, [0.2, 0.3, 4.0, range_m])
}

#[derive(Debug, Clone, Serialize)]
struct LaserScan(Header, [f32; 7], Vec<f32>, Vec<f32>);

#[derive(Debug, Clone, Serialize)]
struct Transform(Header, String, [f64; 7]);

fn transform(time_s: f64, parent: &str, child: &str, [x, y, yaw_deg]: [f64; 3]) -> Transform {
    let (sin, cos) = (yaw_deg.to_radians() / 2.0).sin_cos();
    Transform(header(time_s, parent), child.to_owned(), [x, y, 0.0, 0.0, 0.0, sin, cos])
}

/// Builder of a recording.
struct Bag {
    out: mcap::Writer<Cursor<Vec<u8>>>,
    channels: BTreeMap<String, u16>,
    order: Order,
}

impl Bag {
    fn new(order: Order) -> Self {
        let options = mcap::WriteOptions::new().profile("ros2").compression(None);
        let out = options.create(Cursor::new(Vec::new())).expect("memory takes it");
        Self { out, channels: BTreeMap::new(), order }
    }

    fn add(mut self, topic: &str, type_name: &str, time_s: f64, message: &impl Serialize) -> Self {
        let channel = match self.channels.get(topic) {
            Some(channel) => *channel,
            None => {
                let schema = self.out.add_schema(type_name, "ros2msg", b"").expect("new");
                let channel = self.out.add_channel(schema, topic, "cdr", &BTreeMap::new());
                let channel = channel.expect("new");
                self.channels.insert(topic.to_owned(), channel);
                channel
            }
        };
        let time = (time_s * 1e9) as u64;
        let header = mcap::records::MessageHeader {
            channel_id: channel,
            sequence: 0,
            log_time: time,
            publish_time: time,
        };
        let bytes = cdr(message, self.order);
        self.out.write_to_known_channel(&header, &bytes).expect("memory takes it");
        self
    }

    fn range(self, topic: &str, time_s: f64, frame: &str, range_m: f32) -> Self {
        self.add(topic, RANGE, time_s, &range(time_s, frame, range_m))
    }

    fn moves(self, time_s: f64, place: [f64; 3]) -> Self {
        let moved = vec![transform(time_s, "map", "base_link", place)];
        self.add("/tf", TRANSFORMS, time_s, &moved)
    }

    fn mounts(self, parent: &str, child: &str, place: [f64; 3]) -> Self {
        let mounted = vec![transform(0.0, parent, child, place)];
        self.add("/tf_static", TRANSFORMS, 1.0, &mounted)
    }

    fn bytes(mut self) -> Vec<u8> {
        self.out.finish().expect("memory takes it");
        self.out.into_inner().into_inner()
    }
}

fn assumptions() -> Assumptions {
    Assumptions {
        sha256: String::new(),
        pose: Pose { x_m: 7.0, y_m: 8.0, heading_deg: 9.0 },
        array: None,
        sensor: "hc-sr04".to_owned(),
        max_range_m: 4.0,
        min_range_m: 0.02,
        air: Air::default(),
        started: "2026-01-01T00:00:00Z".parse().expect("a time"),
        skip_checks: false,
    }
}

fn examine(bytes: &[u8], mapping: Mapping) -> Result<Imported, ImportError> {
    let open = || -> io::Result<Box<dyn io::Read>> { Ok(Box::new(Cursor::new(bytes.to_vec()))) };
    ImportSource { open: &open }.examine(mapping, assumptions())
}

fn scans(bytes: &[u8], mapping: Mapping) -> Result<Vec<(ScanStart, Vec<Ping>)>, ImportError> {
    let found = examine(bytes, mapping)?;
    let mut scans: Vec<(ScanStart, Vec<Ping>)> = Vec::new();
    for scan in found.scans(bytes)? {
        for record in scan? {
            match record {
                Record::ScanStart(start) => scans.push((start, Vec::new())),
                Record::Ping(ping) => scans.last_mut().expect("begun").1.push(*ping),
                _ => {}
            }
        }
    }
    Ok(scans)
}

fn error_text<T: std::fmt::Debug>(result: Result<T, ImportError>) -> String {
    let error = result.expect_err("this is wrong");
    format!("{error}; {}", error.help())
}

/// A ranger mounted ahead of the center of a robot that drives and turns.
fn driving(order: Order) -> Bag {
    Bag::new(order)
        .mounts("base_link", "front", [0.2, 0.0, 0.0])
        .moves(1.0, [0.0, 0.0, 0.0])
        .range("/front/range", 1.5, "front", 1.25)
        .moves(2.0, [1.0, 0.5, 90.0])
        .range("/front/range", 2.0, "front", f32::INFINITY)
        .range("/front/range", 2.0, "front", f32::NEG_INFINITY)
}

#[test]
fn interpolates_poses_in_both_orders() {
    let [little, big] = [Order::Little, Order::Big]
        .map(|order| scans(&driving(order).bytes(), Mapping::default()).expect("a recording"));
    assert_eq!(
        little.iter().flat_map(|(_, pings)| pings).map(|ping| ping.range_m).collect::<Vec<_>>(),
        big.iter().flat_map(|(_, pings)| pings).map(|ping| ping.range_m).collect::<Vec<_>>()
    );
    // A single fixed ranger is an array of one: each firing is a round.
    let [(first, one), (second, two), (_, three)] = &little[..] else { panic!("{little:?}") };
    assert_eq!(first.pose, Pose { x_m: 0.5, y_m: 0.25, heading_deg: 45.0 });
    assert_eq!(second.pose, Pose { x_m: 1.0, y_m: 0.5, heading_deg: 90.0 });
    assert_eq!((one[0].range_m, one[0].status), (Some(1.25), PingStatus::Echo));
    assert_eq!(one[0].ranger.as_deref(), Some("front"));
    assert_eq!(one[0].time.map(|time| time.as_millisecond()), Some(1500));
    assert_eq!((two[0].status, three[0].status), (PingStatus::NoEcho, PingStatus::MinRange));
    let found = examine(&driving(Order::Big).bytes(), Mapping::default()).expect("a recording");
    assert_eq!((found.format, found.readings, found.echoes), (Format::Mcap, 3, 1));
    assert!(found.has_poses && found.mapping.columns.is_empty());
    let array = found.assumptions.array.expect("an array");
    assert_eq!((array.rangers[0].x_m, array.rangers[0].bearing_deg), (0.2, 0.0));
}

#[test]
fn rotating_ranger_makes_scans() {
    let mut bag = Bag::new(Order::Little).mounts("base_link", "mount", [0.0, 0.1, 0.0]);
    for turn in 0..7 {
        let time_s = 10.0 + f64::from(turn);
        let azimuth_deg = f64::from(turn % 3) * 90.0;
        let moved = vec![
            transform(time_s, "map", "base_link", [1.0, 2.0, 30.0]),
            transform(time_s, "mount", "sonar", [0.0, 0.0, azimuth_deg]),
        ];
        bag = bag.add("/tf", TRANSFORMS, time_s, &moved);
        bag = bag.range("/sonar/range", time_s, "sonar", 1.0 + turn as f32);
    }
    let scans = scans(&bag.bytes(), Mapping::default()).expect("a recording");
    let message: Vec<Vec<_>> = scans
        .iter()
        .map(|(_, pings)| pings.iter().map(|ping| (ping.azimuth_deg, ping.range_m)).collect())
        .collect();
    // No echo from 4 m on.
    let turn = |ranges_m: [Option<f64>; 3]| [0.0, 90.0, 180.0].into_iter().zip(ranges_m);
    assert_eq!(message[0], turn([Some(1.0), Some(2.0), Some(3.0)]).collect::<Vec<_>>());
    assert_eq!(message[1], turn([None; 3]).collect::<Vec<_>>());
    assert_eq!(message.len(), 3);
    // Position of the rotation axis, which is off the center of the robot.
    let pose = scans[0].0.pose;
    let (sin, cos) = 30_f64.to_radians().sin_cos();
    assert!(
        (pose.x_m - (1.0 - 0.1 * sin)).abs() < 1e-8 && (pose.y_m - (2.0 + 0.1 * cos)).abs() < 1e-8
    );
    assert!((pose.heading_deg - 30.0).abs() < 1e-8);
}

#[test]
fn laser_scan_beams_have_own_times() {
    let scan = LaserScan(
        header(10.0, "laser"),
        [0.0, 1.5, std::f32::consts::FRAC_PI_2, 0.5, 1.5, 0.3, 4.0],
        vec![1.5, f32::NAN, 4.0, 0.3],
        Vec::new(),
    );
    let bag = Bag::new(Order::Little)
        .mounts("base_link", "laser", [0.0, 0.0, 90.0])
        .moves(10.0, [0.0, 0.0, 0.0])
        .add("/scan", LASER_SCAN, 10.0, &scan)
        .moves(12.0, [2.0, 0.0, 0.0]);
    let scans = scans(&bag.bytes(), Mapping::default()).expect("a recording");
    let [(start, pings)] = &scans[..] else { panic!("{scans:?}") };
    assert_eq!(start.pose, Pose { x_m: 0.0, y_m: 0.0, heading_deg: 0.0 });
    let message: Vec<_> = pings.iter().map(|ping| (ping.azimuth_deg, ping.status)).collect();
    let expected =
        [(90.0, PingStatus::Echo), (270.0, PingStatus::NoEcho), (0.0, PingStatus::MinRange)];
    assert_eq!(message, expected);
    assert_eq!(pings[1].pose, Some(Pose { x_m: 1.0, y_m: 0.0, heading_deg: 0.0 }));
    assert_eq!(pings[2].time.map(|time| time.as_millisecond()), Some(11_500));
}

#[test]
fn skips_readings_without_pose() {
    let late = driving(Order::Little).range("/front/range", 3.5, "front", 1.0).bytes();
    let found = examine(&late, Mapping::default()).expect("the rest is read");
    assert_eq!(found.readings, 3);
    let message = found.notes.join("\n");
    for part in
        ["/front/range: 1 of 4", "`base_link` in `map`", "1970-01-01T00:00:03.5Z", "00:00:02Z"]
    {
        assert!(message.contains(part), "{part}: {message}");
    }
    let never = Bag::new(Order::Little).moves(9.0, [0.0; 3]).range("/range", 1.0, "base_link", 1.0);
    let message =
        error_text(scans(&never.moves(10.0, [1.0, 0.0, 0.0]).bytes(), Mapping::default()));
    assert!(message.contains("/range: no transform of frame"), "{message}");
    let looped = driving(Order::Little).mounts("front", "map", [0.0; 3]).bytes();
    assert!(error_text(scans(&looped, Mapping::default())).contains("its own parent"));
    let twice = driving(Order::Little).mounts("odom", "front", [0.0; 3]).bytes();
    assert!(error_text(scans(&twice, Mapping::default())).contains("`base_link` and `odom`"));
}

#[test]
fn infinite_angles_and_positions() {
    let angles = [0.0, 1.0, f32::INFINITY, 0.0, 0.0, 0.3, 4.0];
    let scan = LaserScan(header(1.0, "laser"), angles, vec![1.5, 2.0], Vec::new());
    let bag = Bag::new(Order::Little).add("/scan", LASER_SCAN, 1.0, &scan).bytes();
    assert_eq!(examine(&bag, Mapping::default()).expect("a recording").readings, 0);
    for far_m in [f64::NAN, f64::INFINITY, 1e300] {
        let bag = driving(Order::Little).moves(3.0, [far_m, 0.0, 0.0]).bytes();
        assert!(
            error_text(examine(&bag, Mapping::default())).contains("no finite position"),
            "{far_m}"
        );
    }
}

#[test]
fn given_pose_replaces_missing_poses() {
    let bag = Bag::new(Order::Big).range("/range", 1.0, "sonar", 1.5).bytes();
    assert!(!examine(&bag, Mapping::default()).expect("a recording").has_poses);
    let scans = scans(&bag, Mapping::default()).expect("a recording");
    assert_eq!(scans[0].0.pose, assumptions().pose);
}

#[test]
fn selects_topics() {
    let bag = || {
        driving(Order::Little).range("/sonar/predicted/range", 1.5, "front", 9.0).range(
            "/rear/range",
            1.5,
            "front",
            2.0,
        )
    };
    let found = examine(&bag().bytes(), Mapping::default()).expect("a recording");
    assert_eq!(found.assumptions.array.expect("an array").rangers.len(), 2);
    let one = |topic: &str| Mapping { topics: vec![topic.to_owned()], ..Mapping::default() };
    let found = examine(&bag().bytes(), one("/rear/range")).expect("a recording");
    assert_eq!((found.readings, found.echoes), (1, 1));
    let message = error_text(examine(&bag().bytes(), one("/left")));
    assert!(message.contains("/left") && message.contains("/rear/range"), "{message}");
    let empty = Bag::new(Order::Little).moves(1.0, [0.0; 3]).bytes();
    assert!(error_text(examine(&empty, Mapping::default())).contains("no sensor_msgs/Range"));
}

#[test]
fn reads_several_files() {
    let one = driving(Order::Little).bytes();
    let other = Bag::new(Order::Big).range("/front/range", 1.75, "front", 2.0).bytes();
    let both = [one, other].concat();
    let found = examine(&both, Mapping::default()).expect("recordings");
    assert_eq!((found.readings, found.echoes), (4, 2));
}

#[test]
fn rejects_truncated_recordings() {
    let whole = driving(Order::Little).bytes();
    for end in 9..whole.len() {
        let message = error_text(examine(&whole[..end], Mapping::default()));
        assert!(
            message.contains("ends within a record") || message.contains("damaged"),
            "{end}: {message}"
        );
    }
    let sqlite = error_text(examine(b"SQLite format 3\0\x10\0", Mapping::default()));
    assert!(sqlite.contains("SQLite database"), "{sqlite}");
    let mapping = || Mapping {
        columns: Mapping::parse_columns("azimuth_deg=1,range_m=2").expect("columns"),
        ..Mapping::default()
    };
    assert!(error_text(examine(&whole, mapping())).contains("defines its own fields"));
}

#[test]
fn rejects_malformed_messages() {
    let message = cdr(&range(1.0, "front", 1.0), Order::Little);
    assert_eq!(read_message(RANGE, &message).expect("decodes"), 1);
    for end in 0..message.len() {
        let message = error_text(read_message(RANGE, &message[..end]));
        // The range is complete before the optional variance.
        assert!(message.contains("ends too early"), "{end}: {message}");
    }
    for encoding in [[0, 2], [0, 3], [0, 6], [1, 1]] {
        let other = [&encoding[..], &message[2..]].concat();
        assert!(error_text(read_message(RANGE, &other)).contains("not plain CDR"), "{encoding:?}");
    }
    // List with a wrong, large length.
    let long = [&[0, 1, 0, 0], &u32::MAX.to_le_bytes()[..], &[0; 64]].concat();
    assert!(error_text(read_message(TRANSFORMS, &long)).contains("ends too early"));
}

proptest! {
    #[test]
    fn any_bytes_decode_or_fail(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
        for type_name in [RANGE, LASER_SCAN, TRANSFORMS] {
            for head in [[0, 0, 0, 0], [0, 1, 0, 0]] {
                let _ = read_message(type_name, &[&head[..], &bytes].concat());
            }
        }
        let whole = [super::MAGIC, &bytes].concat();
        let _ = examine(&whole, Mapping::default());
    }

    #[test]
    fn damaged_recording_never_panics(at in 0_usize..1000, bits in 1_u8..) {
        let mut bytes = driving(Order::Little).bytes();
        let at = at % bytes.len();
        bytes[at] ^= bits;
        let _ = scans(&bytes, Mapping::default());
    }
}
