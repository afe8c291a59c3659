//! Recordings of ROS 2: ranges and scans of a sonar, with the frames that say where it was.
//!
//! A transducer that turns on the robot is a ranger on a stepper, and each turn of it a scan; one or more that
//! do not are an array. Poses are those of `base_link` in the root of the tree of frames.

mod cdr;
mod look;
mod mcap;
mod message;
mod numbers;
mod order;
mod scan;
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
    ImportError, Location, Mapping, Taken,
    doubt::{Ranges, Ways},
    examine::check_beyond,
    limits::{LimitNotes, Limits, Told},
};
use cdr::{Cdr, CdrError, Part};
use mcap::{Message, Messages};
use message::{Header, LaserScan, Range, Transform};
use numbers::{as_written, billionths, plain_deg};
use order::in_order;
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
    clock: Clock,
    /// True if messages stand in the order of their stamps.
    is_in_order: bool,
    /// Assumptions that were made, a line each.
    notes: Vec<String>,
    /// The greatest range that a message states, in its unit.
    stated_most: f64,
}

/// The recording's clock, where stamps count from the start of a board.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Clock {
    /// From stamps before 2000 to the recorder's clock, nanoseconds.
    of_board_ns: Option<i64>,
    /// From stamps to what the log shall have, nanoseconds.
    shown_ns: i64,
}

/// A topic of readings.
#[derive(Debug, Clone, PartialEq)]
struct Source {
    is_scan: bool,
    frame: String,
    /// The frame by which its place is known: its own, or the robot's where nothing places it.
    placed_as: String,
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
    /// The range in the message's unit, unless it stands for none.
    raw: Option<f64>,
}

/// Readings of a message, and those that have no place.
#[derive(Debug, Default)]
struct Placeable {
    heard: Vec<Heard>,
    left_out: u64,
    why: Option<TransformError>,
}

const RANGE: &str = "sensor_msgs/msg/Range";
const LASER_SCAN: &str = "sensor_msgs/msg/LaserScan";
const TRANSFORMS: &str = "tf2_msgs/msg/TFMessage";
const READINGS: [&str; 2] = [RANGE, LASER_SCAN];
/// The types of the messages that are read; all others in a recording are passed over.
pub const MESSAGE_TYPES: [&str; 3] = [RANGE, LASER_SCAN, TRANSFORMS];

/// Rangers that turn by less than this stand still, degrees.
const STILL_DEG: f64 = 0.05;
/// No ranger of sound reaches so far, metres: limits beyond it are in another unit.
const MAX_STATED_M: f64 = 60.0;

impl Bag {
    /// Reads all readings once: what is left out, and what their ranges say.
    ///
    /// # Errors
    /// A damaged message, or no reading with a place.
    pub(crate) fn examine(
        &self,
        open: &dyn Fn() -> std::io::Result<Box<dyn Read>>,
        (ways, taken): (&Ways, &Taken),
        ranges: &mut Ranges,
    ) -> Result<Vec<String>, ImportError> {
        let mut limits = LimitNotes::default();
        let mut left_out: BTreeMap<&str, (u64, u64, Option<TransformError>)> = BTreeMap::new();
        let stated_m = Some(self.stated_most * ways.mapping.metres());
        let stated_m = stated_m.filter(|stated_m| *stated_m <= MAX_STATED_M).unwrap_or(0.0);
        let taken = &Taken { longest_m: taken.longest_m.max(stated_m), ..taken.clone() };
        for (number, message) in (1..).zip(Messages::of(open()?, &READINGS)) {
            let message = message?;
            let Some((ranger, topic, source)) = self.source_of(&message) else { continue };
            let found = self.readings(&message, source, ways.mapping, &mut limits)?;
            let counts = left_out.entry(topic).or_default();
            counts.0 += found.left_out;
            counts.1 += found.left_out + found.heard.len() as u64;
            counts.2 = counts.2.take().or(found.why);
            for heard in found.heard {
                let direction = if self.turns { heard.direction_deg } else { ranger as f64 };
                let place = Location::Message(number);
                ranges.add(place, direction, heard.raw, heard.range_m, (ways, taken));
            }
        }
        check_beyond(&limits, taken)?;
        let mut notes = self.notes.clone();
        for (topic, (missing, of, why)) in left_out {
            let Some(why) = why else { continue };
            if ranges.readings == 0 {
                return Err(misplaced(topic, &why));
            }
            notes.push(format!(
                "{topic}: {missing} of {of} readings are left out, because their place is not known: {why}"
            ));
        }
        notes.extend(limits.lines());
        Ok(notes)
    }

    /// The ranger of a message, with its number.
    fn source_of(&self, message: &Message) -> Option<(usize, &str, &Source)> {
        let mut topics = self.topics.iter().enumerate();
        let found = topics.find(|(_, (topic, _))| **topic == message.channel.topic);
        found.map(|(ranger, (topic, source))| (ranger, topic.as_str(), source))
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
    ///
    /// # Errors
    /// Messages out of order are more than fit into memory.
    pub(crate) fn scans<'a>(
        &'a self,
        source: impl Read + 'a,
        mapping: &'a Mapping,
        taken: &'a Taken,
    ) -> Result<impl Iterator<Item = Result<Vec<Record>, ImportError>> + 'a, ImportError> {
        let ids = if self.turns { Vec::new() } else { self.ids().collect() };
        let mut gathered = Gathered::new(taken, mapping.sound_speed_m_s, ids);
        let messages = Messages::of(source, &READINGS);
        let mut messages: Box<dyn Iterator<Item = Result<Message, ImportError>> + 'a> =
            match self.is_in_order {
                true => Box::new(messages),
                false => {
                    let wanted = messages.filter(|message| {
                        message.as_ref().map_or(true, |message| self.source_of(message).is_some())
                    });
                    Box::new(in_order(wanted, |message| self.stamp_of(message))?)
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
                            self.take(&message, mapping, &mut limits, &mut gathered)
                        });
                        match scans {
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
        }))
    }

    /// The time of a message of readings.
    fn stamp_of(&self, message: &Message) -> Result<i64, ImportError> {
        let mut header = decode(message, Header::decode)?;
        self.clock.stamp(&mut header, message);
        Ok(header.stamp_ns)
    }

    /// Takes a message in; the scans that end with it.
    fn take(
        &self,
        message: &Message,
        mapping: &Mapping,
        limits: &mut LimitNotes,
        gathered: &mut Gathered<'_>,
    ) -> Result<Vec<Vec<Record>>, ImportError> {
        let Some((ranger, _, source)) = self.source_of(message) else { return Ok(Vec::new()) };
        let mut heard = self.readings(message, source, mapping, limits)?.heard;
        for heard in &mut heard {
            heard.time_ns = heard.time_ns.saturating_add(self.clock.shown_ns);
        }
        if source.is_scan {
            return Ok(gathered.whole(heard).into_iter().collect());
        }
        Ok(heard.into_iter().filter_map(|heard| gathered.add(ranger, heard)).collect())
    }

    /// The readings of a message, in their places; those without a place are counted.
    fn readings(
        &self,
        message: &Message,
        source: &Source,
        mapping: &Mapping,
        notes: &mut LimitNotes,
    ) -> Result<Placeable, ImportError> {
        let metres = mapping.metres();
        let mut found = Placeable::default();
        let mut place = |time_ns: i64, turned_deg: f64, range: f32, limits: Limits| {
            let (status, raw) = match limits.tell(as_written(range), mapping, notes) {
                Told::Nothing => return Ok(()),
                Told::Without(status) => (status, None),
                Told::Echo(range) => (PingStatus::Echo, Some(range)),
            };
            let (in_robot, pose) = match self.placed(source, time_ns) {
                Ok(placed) => placed,
                Err(why @ (TransformError::Lacks { .. } | TransformError::Gap { .. })) => {
                    found.left_out += 1;
                    found.why.get_or_insert(why);
                    return Ok(());
                }
                Err(error) => return Err(misplaced(&message.channel.topic, &error)),
            };
            let direction_deg = billionths(in_robot.beam_deg(turned_deg));
            // A beam of no angle is none.
            if direction_deg.is_finite() {
                let range_m = raw.map(|range| range * metres);
                found.heard.push(Heard { time_ns, pose, direction_deg, status, range_m, raw });
            }
            Ok(())
        };
        let limits =
            |[least, most]: [f32; 2]| Limits { least: as_written(least), most: as_written(most) };
        if !source.is_scan {
            let mut range = decode(message, Range::decode)?;
            self.clock.stamp(&mut range.header, message);
            place(range.header.stamp_ns, 0.0, range.range_m, limits(range.limits_m))?;
            return Ok(found);
        }
        let mut scan = decode(message, LaserScan::decode)?;
        self.clock.stamp(&mut scan.header, message);
        let limits = limits(scan.limits_m);
        for (beam, range) in (0_u32..).zip(&scan.ranges_m) {
            let later_ns = f64::from(scan.apart_s) * f64::from(beam) * 1e9;
            let turned_rad = f64::from(scan.first_rad) + f64::from(scan.step_rad) * f64::from(beam);
            let time_ns = scan.header.stamp_ns.saturating_add(later_ns as i64);
            place(time_ns, plain_deg(turned_rad), *range, limits)?;
        }
        Ok(found)
    }

    /// Place of a ranger in its robot, and the robot's pose.
    fn placed(
        &self,
        source: &Source,
        time_ns: i64,
    ) -> Result<(Placed, Option<Pose>), TransformError> {
        let in_robot = self.transforms.place(&source.placed_as, &source.robot, time_ns)?;
        let pose = match source.world == source.robot {
            true => None,
            false => Some(self.pose(source, time_ns)?),
        };
        Ok((in_robot, pose))
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

impl Clock {
    /// Sets the time of a header on the recorder's clock where the sender has none: no stamp at all, or one that counts
    /// from the start of a board.
    fn stamp(&self, header: &mut Header, message: &Message) {
        if header.stamp_ns == 0 {
            header.stamp_ns = i64::try_from(message.recorded_ns).unwrap_or(i64::MAX);
        } else if let Some(of_board_ns) =
            self.of_board_ns.filter(|_| header.stamp_ns < MIN_CLOCK_NS)
        {
            header.stamp_ns = header.stamp_ns.saturating_add(of_board_ns);
        }
    }
}

/// Stamps before 2000-01-01 are of no clock, nanoseconds since 1970.
const MIN_CLOCK_NS: i64 = 946_684_800_000_000_000;

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

#[cfg(test)]
mod tests;
