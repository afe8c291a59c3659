//! ROS 2 recordings: Range and LaserScan messages of sonars, placed by the recorded frames.
//!
//! A transducer that rotates on the robot is a ranger on a stepper, with one scan per revolution.
//! Fixed transducers form an array. Poses are those of `base_link` in the root of the frame tree.

mod cdr;
mod mcap;
mod message;
mod numbers;
mod order;
mod scan;
mod survey;
mod transforms;

use std::{
    collections::{BTreeMap, BTreeSet, VecDeque},
    io::Read,
};

use sonard_model::{
    array::{MountedRanger, RangerArray},
    geometry::Pose,
    reading::PingStatus,
};
use sonard_records::Record;

use crate::{
    Assumptions, FileLocation, ImportError, Mapping,
    examine::check_messages,
    limits::{LimitNotes, Limits, MAX_STATED_M, RangeClass, ScanAngles},
    unit_check::{RangeStats, UnitContext},
};
use cdr::{CdrError, CdrReader, Decoded};
use mcap::{MessageReader, RecordedMessage};
use message::{LaserScanMessage, MessageHeader, RangeMessage, TransformMessage};
use numbers::{as_written, billionths, plain_deg};
use order::sort_by_stamp;
use scan::ScanCollector;
use transforms::{FrameTree, Placement, TransformError};

pub(crate) use mcap::MAGIC;

/// Frames, topics and clock of a recording.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Bag {
    frames: FrameTree,
    topics: BTreeMap<String, Topic>,
    /// True if the ranger rotates; false for an array of fixed rangers.
    rotates: bool,
    pub(crate) has_poses: bool,
    clock: Clock,
    /// True if messages are in the order of their time stamps.
    is_in_order: bool,
    /// Notes on assumptions, one line each.
    notes: Vec<String>,
    /// Greatest `range_max` of the messages, in their unit.
    max_stated_range: f64,
}

/// Offsets between time stamps, the recorder's clock and the log.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Clock {
    /// Offset from stamps before 2000 to the recorder's clock, nanoseconds.
    board_offset_ns: Option<i64>,
    /// Offset from stamps to the times of the log, nanoseconds.
    log_offset_ns: i64,
}

/// Topic of readings, with its frames.
#[derive(Debug, Clone, PartialEq)]
struct Topic {
    is_scan: bool,
    frame: String,
    /// Frame that places the ranger: its own, or the robot's if no transform places it.
    placed_as: String,
    /// Frames of the world (the root of the tree) and of the robot, and the origin frame of the
    /// readings.
    world: String,
    robot: String,
    axis: String,
    /// Initial position and rotation in the robot's frame.
    mounted: Placement,
}

/// Reading with its pose.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PlacedReading {
    pub(crate) time_ns: i64,
    pub(crate) pose: Option<Pose>,
    pub(crate) direction_deg: f64,
    pub(crate) status: PingStatus,
    pub(crate) range_m: Option<f64>,
    /// Range in the unit of the message, if there is one.
    raw: Option<f64>,
}

/// Readings of a message, and the number of readings without a pose.
#[derive(Debug, Default)]
struct MessageReadings {
    readings: Vec<PlacedReading>,
    skipped: u64,
    why: Option<TransformError>,
    /// Greatest tilt of the robot in the world, degrees.
    tilt_deg: f64,
}

const RANGE: &str = "sensor_msgs/msg/Range";
const LASER_SCAN: &str = "sensor_msgs/msg/LaserScan";
const TRANSFORMS: &str = "tf2_msgs/msg/TFMessage";
const READINGS: [&str; 2] = [RANGE, LASER_SCAN];
/// Message types read from recordings; messages of other types are skipped.
pub const MESSAGE_TYPES: [&str; 3] = [RANGE, LASER_SCAN, TRANSFORMS];

/// Rotation below which a ranger counts as fixed, degrees.
const FIXED_DEG: f64 = 0.05;
/// Tilt of the robot from which a note is printed, degrees.
const MAX_TILT_DEG: f64 = 5.0;

impl Bag {
    /// Reads all readings once; adds their ranges to `ranges` and returns notes on skipped
    /// readings.
    ///
    /// # Errors
    /// Returns an error for a damaged message, or if no reading has a pose.
    pub(crate) fn examine(
        &self,
        open: &dyn Fn() -> std::io::Result<Box<dyn Read>>,
        (units, assumptions): (&UnitContext, &Assumptions),
        ranges: &mut RangeStats,
    ) -> Result<Vec<String>, ImportError> {
        let mut limits = LimitNotes::default();
        let mut tilt_deg: f64 = 0.0;
        let mut skipped: BTreeMap<&str, (u64, u64, Option<TransformError>)> = BTreeMap::new();
        let stated_m = Some(self.max_stated_range * units.mapping.metres());
        let stated_m = stated_m.filter(|stated_m| *stated_m <= MAX_STATED_M).unwrap_or(0.0);
        let assumptions = &Assumptions {
            max_range_m: assumptions.max_range_m.max(stated_m),
            ..assumptions.clone()
        };
        for (number, message) in (1..).zip(MessageReader::new(open()?, &READINGS)) {
            let message = message?;
            let Some((ranger, topic, source)) = self.topic_of(&message) else { continue };
            let found = self.readings(&message, source, units.mapping, &mut limits)?;
            let counts = skipped.entry(topic).or_default();
            counts.0 += found.skipped;
            counts.1 += found.skipped + found.readings.len() as u64;
            counts.2 = counts.2.take().or(found.why);
            tilt_deg = tilt_deg.max(found.tilt_deg);
            for readings in found.readings {
                let direction = if self.rotates { readings.direction_deg } else { ranger as f64 };
                let place = FileLocation::Message(number);
                ranges.add(place, direction, readings.raw, readings.range_m, (units, assumptions));
            }
        }
        check_messages(&limits, assumptions)?;
        let mut notes = self.notes.clone();
        for (topic, (missing, of, why)) in skipped {
            let Some(why) = why else { continue };
            if ranges.readings == 0 {
                return Err(pose_error(topic, &why));
            }
            notes.push(format!(
                "{topic}: {missing} of {of} readings skipped, position unknown: {why}"
            ));
        }
        if tilt_deg > MAX_TILT_DEG {
            notes.push(format!(
                "the robot is tilted by up to {tilt_deg:.1} degrees; its ranges are taken as horizontal"
            ));
        }
        notes.extend(limits.lines());
        Ok(notes)
    }

    /// Returns the topic of a message with its index.
    fn topic_of(&self, message: &RecordedMessage) -> Option<(usize, &str, &Topic)> {
        let mut topics = self.topics.iter().enumerate();
        let found = topics.find(|(_, (topic, _))| **topic == message.channel.topic);
        found.map(|(ranger, (topic, source))| (ranger, topic.as_str(), source))
    }

    /// Returns the array of fixed rangers; `None` for a rotating ranger.
    pub(crate) fn array(&self, sensor: &str) -> Option<RangerArray> {
        if self.rotates {
            return None;
        }
        let ranger = |(id, source): (String, &Topic)| MountedRanger {
            id,
            x_m: source.mounted.at.x,
            y_m: source.mounted.at.y,
            bearing_deg: source.mounted.yaw_deg(),
            z_m: Some(source.mounted.at.z).filter(|z_m| *z_m != 0.0),
        };
        Some(RangerArray {
            rangers: self.ids().zip(self.topics.values()).map(ranger).collect(),
            ..crate::array_rounds::array(&[], sensor)
        })
    }

    /// Derives ranger names from topics: `/sonar/left/range` becomes `left`.
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

    /// Returns the records of each scan in turn; `source` is the recording, opened again.
    ///
    /// # Errors
    /// Returns an error if messages are out of order and exceed the memory limit for sorting.
    pub(crate) fn scans<'a>(
        &'a self,
        source: impl Read + 'a,
        mapping: &'a Mapping,
        assumptions: &'a Assumptions,
    ) -> Result<impl Iterator<Item = Result<Vec<Record>, ImportError>> + 'a, ImportError> {
        let ids = if self.rotates { Vec::new() } else { self.ids().collect() };
        let mut collector = ScanCollector::new(assumptions, mapping.sound_speed_m_s, ids);
        let messages = MessageReader::new(source, &READINGS);
        let mut messages: Box<dyn Iterator<Item = Result<RecordedMessage, ImportError>> + 'a> =
            match self.is_in_order {
                true => Box::new(messages),
                false => {
                    let used = messages.filter(|message| {
                        message.as_ref().map_or(true, |message| self.topic_of(message).is_some())
                    });
                    Box::new(sort_by_stamp(used, |message| self.stamp_of(message))?)
                }
            };
        let mut limits = LimitNotes::default();
        let mut ready = VecDeque::new();
        let mut is_over = false;
        Ok(std::iter::from_fn(move || {
            while ready.is_empty() && !is_over {
                match messages.next() {
                    Some(message) => {
                        let scans = message.and_then(|message| {
                            self.process(&message, mapping, &mut limits, &mut collector)
                        });
                        match scans {
                            Ok(scans) => ready.extend(scans),
                            Err(error) => return Some(Err(error)),
                        }
                    }
                    None => {
                        is_over = true;
                        ready.extend(collector.finish());
                    }
                }
            }
            ready.pop_front().map(Ok)
        }))
    }

    /// Returns the time stamp of a message of readings.
    fn stamp_of(&self, message: &RecordedMessage) -> Result<i64, ImportError> {
        let mut header = decode(message, MessageHeader::decode)?;
        self.clock.stamp(&mut header, message);
        Ok(header.stamp_ns)
    }

    /// Processes a message and returns the scans that it completes.
    fn process(
        &self,
        message: &RecordedMessage,
        mapping: &Mapping,
        limits: &mut LimitNotes,
        collector: &mut ScanCollector<'_>,
    ) -> Result<Vec<Vec<Record>>, ImportError> {
        let Some((ranger, _, source)) = self.topic_of(message) else { return Ok(Vec::new()) };
        let mut readings = self.readings(message, source, mapping, limits)?.readings;
        for readings in &mut readings {
            readings.time_ns = readings.time_ns.saturating_add(self.clock.log_offset_ns);
        }
        if source.is_scan {
            return Ok(collector.complete_scan(readings).into_iter().collect());
        }
        Ok(readings.into_iter().filter_map(|readings| collector.add(ranger, readings)).collect())
    }

    /// Converts a message to readings with poses, and counts readings without a pose.
    fn readings(
        &self,
        message: &RecordedMessage,
        source: &Topic,
        mapping: &Mapping,
        notes: &mut LimitNotes,
    ) -> Result<MessageReadings, ImportError> {
        let metres = mapping.metres();
        let mut found = MessageReadings::default();
        let scan = match source.is_scan {
            true => Some(decode(message, LaserScanMessage::decode)?),
            false => None,
        };
        if let Some(scan) = &scan {
            notes.add_scan(ScanAngles {
                first_rad: f64::from(scan.first_rad),
                step_rad: f64::from(scan.step_rad),
                max_rad: Some(f64::from(scan.max_rad)),
                beams: scan.ranges_m.len(),
            });
        }
        let mut place = |time_ns: i64, turned_deg: f64, range: f32, limits: Limits| {
            let (status, raw) = match limits.classify(as_written(range), mapping, notes) {
                RangeClass::Invalid => return Ok(()),
                RangeClass::NoRange(status) => (status, None),
                RangeClass::Echo(range) => (PingStatus::Echo, Some(range)),
            };
            let (in_robot, pose, tilt_deg) = match self.placed(source, time_ns) {
                Ok(placed) => placed,
                Err(why @ (TransformError::Missing { .. } | TransformError::Gap { .. })) => {
                    found.skipped += 1;
                    found.why.get_or_insert(why);
                    return Ok(());
                }
                Err(error) => return Err(pose_error(&message.channel.topic, &error)),
            };
            found.tilt_deg = found.tilt_deg.max(tilt_deg);
            let direction_deg = billionths(in_robot.beam_deg(turned_deg));
            // An infinite angle is not a direction.
            if direction_deg.is_finite() {
                let range_m = raw.map(|range| range * metres);
                found.readings.push(PlacedReading {
                    time_ns,
                    pose,
                    direction_deg,
                    status,
                    range_m,
                    raw,
                });
            }
            Ok(())
        };
        let limits = |[min, max]: [f32; 2]| Limits { min: as_written(min), max: as_written(max) };
        let Some(mut scan) = scan else {
            let mut range = decode(message, RangeMessage::decode)?;
            self.clock.stamp(&mut range.header, message);
            place(range.header.stamp_ns, 0.0, range.range_m, limits(range.limits_m))?;
            return Ok(found);
        };
        self.clock.stamp(&mut scan.header, message);
        let limits = limits(scan.limits_m);
        for (beam, range) in (0_u32..).zip(&scan.ranges_m) {
            let later_ns = f64::from(scan.time_increment_s) * f64::from(beam) * 1e9;
            let turned_rad = f64::from(scan.first_rad) + f64::from(scan.step_rad) * f64::from(beam);
            let time_ns = scan.header.stamp_ns.saturating_add(later_ns as i64);
            place(time_ns, plain_deg(turned_rad), *range, limits)?;
        }
        Ok(found)
    }

    /// Returns the placement of a ranger on its robot, and the pose and the tilt (degrees) of the
    /// robot.
    fn placed(
        &self,
        source: &Topic,
        time_ns: i64,
    ) -> Result<(Placement, Option<Pose>, f64), TransformError> {
        let in_robot = self.frames.place(&source.placed_as, &source.robot, time_ns)?;
        if source.world == source.robot {
            return Ok((in_robot, None, 0.0));
        }
        let (pose, tilt_deg) = self.pose(source, time_ns)?;
        Ok((in_robot, Some(pose), tilt_deg))
    }

    /// Returns the pose and the tilt (degrees) of the robot; for a rotating ranger, with the
    /// position of its rotation axis.
    fn pose(&self, source: &Topic, time_ns: i64) -> Result<(Pose, f64), TransformError> {
        let robot = self.frames.place(&source.robot, &source.world, time_ns)?;
        let at = match self.rotates {
            true => self.frames.place(&source.axis, &source.world, time_ns)?.at,
            false => robot.at,
        };
        let pose = Pose {
            x_m: billionths(at.x),
            y_m: billionths(at.y),
            heading_deg: billionths(robot.yaw_deg()),
        };
        Ok((pose, robot.tilt_deg()))
    }
}

impl Clock {
    /// Replaces the time stamp by the recorder's clock if the sender has none: for a stamp of zero,
    /// or one that counts from the start of a board.
    fn stamp(&self, header: &mut MessageHeader, message: &RecordedMessage) {
        if header.stamp_ns == 0 {
            header.stamp_ns = i64::try_from(message.recorded_ns).unwrap_or(i64::MAX);
        } else if let Some(board_offset_ns) =
            self.board_offset_ns.filter(|_| header.stamp_ns < MIN_CLOCK_NS)
        {
            header.stamp_ns = header.stamp_ns.saturating_add(board_offset_ns);
        }
    }
}

/// Nanoseconds since 1970 below which a stamp is not of a wall clock: 2000-01-01.
const MIN_CLOCK_NS: i64 = 946_684_800_000_000_000;

/// Decodes a message of a supported type and returns its number of ranges or transforms.
///
/// # Errors
/// Returns an error for bytes that are not such a message.
pub fn read_message(type_name: &str, bytes: &[u8]) -> Result<usize, ImportError> {
    let channel = mcap::ChannelInfo {
        topic: String::new(),
        type_name: type_name.to_owned(),
        encoding: "cdr".to_owned(),
    };
    let message =
        RecordedMessage { channel: channel.into(), recorded_ns: 0, bytes: bytes.to_vec() };
    match type_name {
        TRANSFORMS => decode(&message, TransformMessage::all).map(|all| all.len()),
        LASER_SCAN => decode(&message, LaserScanMessage::decode).map(|scan| scan.ranges_m.len()),
        _ => decode(&message, RangeMessage::decode).map(|_| 1),
    }
}

fn decode<T>(
    message: &RecordedMessage,
    read: impl FnOnce(&mut CdrReader<'_>) -> Decoded<T>,
) -> Result<T, ImportError> {
    let channel = &message.channel;
    let refuse = |error: CdrError| {
        let what = format!("{}: cannot decode a {}: {error}", channel.topic, channel.type_name);
        ImportError::mapping(what, "is it a ROS 2 recording? Convert others with `rosbags-convert`")
    };
    if channel.encoding != "cdr" {
        let what = format!("{}: messages are encoded as `{}`", channel.topic, channel.encoding);
        return Err(ImportError::mapping(what, "give a ROS 2 recording with CDR messages"));
    }
    CdrReader::new(&message.bytes).and_then(|mut cdr| read(&mut cdr)).map_err(refuse)
}

fn pose_error(topic: &str, error: &TransformError) -> ImportError {
    ImportError::mapping(
        format!("{topic}: {error}"),
        "record /tf and /tf_static as well, or cut the recording to their time span",
    )
}

#[cfg(test)]
mod tests;
