//! Recordings of ROS 2: ranges and scans of a sonar, with the frames that say where it was.
//!
//! A transducer that turns on the robot is a ranger on a stepper, and each turn of it a scan; one or more that
//! do not are an array. Poses are those of `base_link` in the root of the tree of frames.

mod cdr;
mod mcap;
mod message;
mod numbers;
mod scan;
mod transforms;

use std::{
    collections::{BTreeMap, BTreeSet, VecDeque},
    io::Read,
};

use sonard_model::{
    array::{MountedRanger, RangerArray},
    geometry::{Pose, wrap_180},
    reading::PingStatus,
};
use sonard_records::Record;

use crate::{ImportError, Mapping, Taken};
use cdr::{Cdr, CdrError, Part};
use mcap::{Message, Messages};
use message::{Header, LaserScan, Range, Transform};
use numbers::{as_written, billionths, plain_deg};
use scan::Gathered;
use transforms::{Placed, TransformError, Transforms};

pub(crate) use mcap::MAGIC;

/// What a recording's readings come from.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Bag {
    transforms: Transforms,
    topics: BTreeMap<String, Source>,
    /// Whether the ranger turns: if not, they are an array.
    turns: bool,
    pub(crate) has_poses: bool,
}

/// A topic of readings.
#[derive(Debug, Clone, PartialEq)]
struct Source {
    is_scan: bool,
    frame: String,
    /// From the root of the tree: frame of the world, of the robot, and of what the readings are told from.
    world: String,
    robot: String,
    axis: String,
    /// Where it was in the robot's frame at first.
    mounted: Placed,
}

/// A reading in its place.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Heard {
    pub(crate) time_ns: i64,
    pub(crate) pose: Option<Pose>,
    pub(crate) direction_deg: f64,
    pub(crate) status: PingStatus,
    pub(crate) range_m: Option<f64>,
}

const RANGE: &str = "sensor_msgs/msg/Range";
const LASER_SCAN: &str = "sensor_msgs/msg/LaserScan";
const TRANSFORMS: &str = "tf2_msgs/msg/TFMessage";
const READINGS: [&str; 2] = [RANGE, LASER_SCAN];
/// The types of the messages that are read; all others in a recording are passed over.
pub const MESSAGE_TYPES: [&str; 3] = [RANGE, LASER_SCAN, TRANSFORMS];

/// Rangers that turn by less than this stand still, degrees.
const STILL_DEG: f64 = 0.05;
/// Frames that are a robot's, the best first.
const ROBOT: [&str; 3] = ["base_link", "base_footprint", "base"];

impl Bag {
    /// Looks a recording through; `open` gives it from its beginning, as often as is asked.
    ///
    /// # Errors
    /// A damaged recording, one without readings or with several rangers that turn.
    pub(crate) fn look(
        open: &dyn Fn() -> std::io::Result<Box<dyn Read>>,
        mapping: &Mapping,
    ) -> Result<Self, ImportError> {
        let mut transforms = Transforms::default();
        let mut kinds: BTreeMap<String, bool> = BTreeMap::new();
        for message in Messages::of(open()?, &MESSAGE_TYPES) {
            let message = message?;
            let channel = &message.channel;
            if channel.type_name != TRANSFORMS {
                kinds.insert(channel.topic.clone(), channel.type_name == LASER_SCAN);
                continue;
            }
            for transform in decode(&message, Transform::all)? {
                let added = transforms.add(transform, channel.topic.ends_with("tf_static"));
                added.map_err(|error| misplaced(&channel.topic, &error))?;
            }
        }
        transforms.sort();
        let topics = choose(kinds, mapping)?;
        let mut bag = Self { transforms, topics: BTreeMap::new(), turns: false, has_poses: false };
        for message in Messages::of(open()?, &READINGS) {
            let message = message?;
            if let Some(is_scan) = topics.get(&message.channel.topic) {
                bag.know(&message, *is_scan)?;
            }
        }
        bag.turns |= bag.topics.values().any(|source| source.is_scan);
        if bag.turns && bag.topics.len() > 1 {
            let names: Vec<_> = bag.topics.keys().map(String::as_str).collect();
            return Err(ImportError::mapping(
                format!("several rangers, one of which turns: {}", names.join(", ")),
                "choose one: --topic TOPIC",
            ));
        }
        Ok(bag)
    }

    /// Where a topic's ranger is, by its first message, and whether it turns.
    fn know(&mut self, message: &Message, is_scan: bool) -> Result<(), ImportError> {
        let channel = &message.channel;
        let mut header = decode(message, Header::decode)?;
        stamp(&mut header, message);
        let misplaced = |error: TransformError| misplaced(&channel.topic, &error);
        let Some(source) = self.topics.get(&channel.topic) else {
            let source = self.source(&header, is_scan).map_err(misplaced)?;
            self.has_poses |= source.world != source.robot;
            self.topics.insert(channel.topic.clone(), source);
            return Ok(());
        };
        if source.frame != header.frame {
            let what = format!(
                "{}: the frame is `{}`, and `{}` before",
                channel.topic, header.frame, source.frame
            );
            return Err(ImportError::mapping(what, "cut the recording where that changes"));
        }
        let now = self.transforms.place(&source.frame, &source.robot, header.stamp_ns);
        let turned = wrap_180(now.map_err(misplaced)?.yaw_deg() - source.mounted.yaw_deg());
        self.turns |= turned.abs() > STILL_DEG;
        Ok(())
    }

    fn source(&self, header: &Header, is_scan: bool) -> Result<Source, TransformError> {
        let way = self.transforms.way_up(&header.frame)?;
        let world = way.last().copied().unwrap_or_default();
        let robot = ROBOT.into_iter().find(|name| way.contains(name)).unwrap_or(world);
        // What turns stands on the frame above it; a scan is told from its own.
        let above = way.get(1).copied().filter(|_| !is_scan && header.frame != robot);
        let mounted = self.transforms.place(&header.frame, robot, header.stamp_ns)?;
        Ok(Source {
            is_scan,
            frame: header.frame.clone(),
            world: world.to_owned(),
            robot: robot.to_owned(),
            axis: above.unwrap_or(&header.frame).to_owned(),
            mounted,
        })
    }

    /// The array that the recording is of; `None` of a ranger that turns.
    pub(crate) fn array(&self, sensor: &str) -> Option<RangerArray> {
        if self.turns {
            return None;
        }
        let ranger = |(id, source): (String, &Source)| MountedRanger {
            id,
            x_m: source.mounted.at.x,
            y_m: source.mounted.at.y,
            bearing_deg: source.mounted.yaw_deg(),
            z_m: Some(source.mounted.at.z).filter(|z_m| *z_m != 0.0),
        };
        Some(RangerArray {
            rangers: self.ids().zip(self.topics.values()).map(ranger).collect(),
            ..crate::rounds::array(&[], sensor)
        })
    }

    /// What the rangers are called: `/sonar/left/range` is `left`.
    fn ids(&self) -> impl Iterator<Item = String> {
        let name = |topic: &String| {
            let words: Vec<&str> = topic.split('/').filter(|word| !word.is_empty()).collect();
            let words = words.strip_suffix(&["range"]).unwrap_or(&words);
            words.last().map_or_else(|| "range".to_owned(), |word| (*word).to_owned())
        };
        let names: Vec<String> = self.topics.keys().map(name).collect();
        let unique = names.iter().collect::<BTreeSet<_>>().len() == names.len();
        let topics: Vec<_> = self.topics.keys().cloned().collect();
        if unique { names.into_iter() } else { topics.into_iter() }
    }

    /// The records of each scan, one after the other; `source` is the recording again.
    pub(crate) fn scans<'a>(
        &'a self,
        source: impl Read + 'a,
        mapping: &Mapping,
        taken: &'a Taken,
    ) -> impl Iterator<Item = Result<Vec<Record>, ImportError>> + 'a {
        let ids = if self.turns { Vec::new() } else { self.ids().collect() };
        let mut gathered = Gathered::new(taken, mapping.sound_speed_m_s, ids);
        let mut messages = Messages::of(source, &READINGS);
        let mut ready = VecDeque::new();
        let mut is_over = false;
        std::iter::from_fn(move || {
            while ready.is_empty() && !is_over {
                match messages.next() {
                    Some(message) => {
                        match message.and_then(|message| self.take(&message, &mut gathered)) {
                            Ok(scans) => ready.extend(scans),
                            Err(error) => return Some(Err(error)),
                        }
                    }
                    None => {
                        is_over = true;
                        ready.extend(gathered.finish());
                    }
                }
            }
            ready.pop_front().map(Ok)
        })
    }

    /// Takes a message in; the scans that end with it.
    fn take(
        &self,
        message: &Message,
        gathered: &mut Gathered<'_>,
    ) -> Result<Vec<Vec<Record>>, ImportError> {
        let mut topics = self.topics.iter().enumerate();
        let found = topics.find(|(_, (topic, _))| **topic == message.channel.topic);
        let Some((place, (_, source))) = found else { return Ok(Vec::new()) };
        let heard = self.readings(message, source)?;
        if source.is_scan {
            return Ok(gathered.whole(heard).into_iter().collect());
        }
        Ok(heard.into_iter().filter_map(|heard| gathered.add(place, heard)).collect())
    }

    /// The readings of a message, in their places.
    fn readings(&self, message: &Message, source: &Source) -> Result<Vec<Heard>, ImportError> {
        let place = |time_ns: i64, turned_deg: f64, range_m: f32, limits_m: [f32; 2]| {
            let Some((status, range_m)) = told(range_m, limits_m) else { return Ok(None) };
            let in_robot = self.transforms.place(&source.frame, &source.robot, time_ns)?;
            let pose = match source.world == source.robot {
                true => None,
                false => Some(self.pose(source, time_ns)?),
            };
            let direction_deg = billionths(in_robot.yaw_deg() + turned_deg);
            // A beam of no angle is none.
            if !direction_deg.is_finite() {
                return Ok(None);
            }
            Ok(Some(Heard { time_ns, pose, direction_deg, status, range_m }))
        };
        let misplaced = |error: TransformError| misplaced(&message.channel.topic, &error);
        if !source.is_scan {
            let mut range = decode(message, Range::decode)?;
            stamp(&mut range.header, message);
            let heard = place(range.header.stamp_ns, 0.0, range.range_m, range.limits_m);
            return Ok(heard.map_err(misplaced)?.into_iter().collect());
        }
        let mut scan = decode(message, LaserScan::decode)?;
        stamp(&mut scan.header, message);
        let beams = (0_u32..).zip(&scan.ranges_m).filter_map(|(beam, range_m)| {
            let later_ns = f64::from(scan.apart_s) * f64::from(beam) * 1e9;
            let turned_rad = f64::from(scan.first_rad) + f64::from(scan.step_rad) * f64::from(beam);
            let time_ns = scan.header.stamp_ns.saturating_add(later_ns as i64);
            place(time_ns, plain_deg(turned_rad), *range_m, scan.limits_m).transpose()
        });
        beams.collect::<Result<_, _>>().map_err(misplaced)
    }

    /// Of the robot; of a ranger that turns on an axis beside its middle, of that axis.
    fn pose(&self, source: &Source, time_ns: i64) -> Result<Pose, TransformError> {
        let robot = self.transforms.place(&source.robot, &source.world, time_ns)?;
        let at = match self.turns {
            true => self.transforms.place(&source.axis, &source.world, time_ns)?.at,
            false => robot.at,
        };
        Ok(Pose {
            x_m: billionths(at.x),
            y_m: billionths(at.y),
            heading_deg: billionths(robot.yaw_deg()),
        })
    }
}

/// Decodes a message of one of the types that are read; how many numbers and frames it has.
///
/// # Errors
/// Bytes that are no such message.
pub fn read_message(type_name: &str, bytes: &[u8]) -> Result<usize, ImportError> {
    let channel = mcap::Channel {
        topic: String::new(),
        type_name: type_name.to_owned(),
        encoding: "cdr".to_owned(),
    };
    let message = Message { channel: channel.into(), recorded_ns: 0, bytes: bytes.to_vec() };
    match type_name {
        TRANSFORMS => decode(&message, Transform::all).map(|all| all.len()),
        LASER_SCAN => decode(&message, LaserScan::decode).map(|scan| scan.ranges_m.len()),
        _ => decode(&message, Range::decode).map(|_| 1),
    }
}

/// Which topics are read: those that are named, else all ranges but predictions, else the scans.
fn choose(
    kinds: BTreeMap<String, bool>,
    mapping: &Mapping,
) -> Result<BTreeMap<String, bool>, ImportError> {
    let names: Vec<String> = kinds.keys().cloned().collect();
    let all = || if names.is_empty() { "none".to_owned() } else { names.join(", ") };
    if let Some(lacks) = mapping.topics.iter().find(|topic| !kinds.contains_key(*topic)) {
        return Err(ImportError::mapping(
            format!("there is no topic {lacks} of ranges or scans"),
            format!("those in it are: {}", all()),
        ));
    }
    let is_meant = |topic: &str| match mapping.topics.is_empty() {
        true => !topic.contains("/predicted/"),
        false => mapping.topics.iter().any(|named| named == topic),
    };
    let mut meant: BTreeMap<_, _> =
        kinds.into_iter().filter(|(topic, _)| is_meant(topic)).collect();
    if mapping.topics.is_empty() && meant.values().any(|is_scan| !is_scan) {
        meant.retain(|_, is_scan| !*is_scan);
    }
    if meant.is_empty() {
        return Err(ImportError::mapping(
            "there is no message of sensor_msgs/Range or sensor_msgs/LaserScan in it",
            "give a recording of a sonar",
        ));
    }
    Ok(meant)
}

fn decode<T>(
    message: &Message,
    read: impl FnOnce(&mut Cdr<'_>) -> Part<T>,
) -> Result<T, ImportError> {
    let channel = &message.channel;
    let refuse = |error: CdrError| {
        let what = format!("{}: a {} can't be decoded: {error}", channel.topic, channel.type_name);
        ImportError::mapping(what, "is it a recording of ROS 2? Convert others: `rosbags-convert`")
    };
    if channel.encoding != "cdr" {
        let what = format!("{}: messages are encoded as `{}`", channel.topic, channel.encoding);
        return Err(ImportError::mapping(
            what,
            "give a recording of ROS 2, whose messages are CDR",
        ));
    }
    Cdr::new(&message.bytes).and_then(|mut cdr| read(&mut cdr)).map_err(refuse)
}

fn misplaced(topic: &str, error: &TransformError) -> ImportError {
    ImportError::mapping(
        format!("{topic}: {error}"),
        "record /tf and /tf_static beside it, or cut the recording to where they are",
    )
}

/// A driver without a clock leaves the stamp out: then it was when it was recorded.
fn stamp(header: &mut Header, message: &Message) {
    if header.stamp_ns == 0 {
        header.stamp_ns = i64::try_from(message.recorded_ns).unwrap_or(i64::MAX);
    }
}

/// What a range says, by REP 117 and by the limits beside it; `None` of one that is none.
fn told(range_m: f32, [least_m, most_m]: [f32; 2]) -> Option<(PingStatus, Option<f64>)> {
    if range_m.is_nan() {
        return None;
    }
    let near = range_m == f32::NEG_INFINITY || range_m <= least_m.max(0.0);
    let far = range_m == f32::INFINITY || range_m >= most_m;
    Some(match (near, far) {
        (true, _) => (PingStatus::MinRange, None),
        (_, true) => (PingStatus::NoEcho, None),
        _ => (PingStatus::Echo, Some(as_written(range_m))),
    })
}

#[cfg(test)]
mod tests;
