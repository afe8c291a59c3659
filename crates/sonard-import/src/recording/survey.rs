//! Survey of a recording before its readings are read: topics, frames and clocks.

use std::{
    collections::{BTreeMap, BTreeSet},
    io::Read,
};

use sonard_model::geometry::wrap_180;

use super::{
    Bag, Clock, FIXED_DEG, LASER_SCAN, MESSAGE_TYPES, MIN_CLOCK_NS, READINGS, TRANSFORMS, Topic,
    decode,
    mcap::{MessageReader, RecordedMessage},
    message::{LaserScanMessage, MessageHeader, RangeMessage, TransformMessage, timestamp},
    numbers::as_written,
    pose_error,
    transforms::{FrameTree, TransformError},
};
use crate::{Assumptions, ImportError, Mapping};

/// Names of the robot's frame, the preferred first.
const ROBOT: [&str; 3] = ["base_link", "base_footprint", "base"];
/// Maximum tilt of a level mount, degrees.
const MAX_TILT_DEG: f64 = 5.0;
/// Maximum number of frames.
const MAX_FRAMES: usize = 1 << 16;

/// Summary of a recording after the first pass, without transforms.
#[derive(Debug, Default)]
struct RecordingSummary {
    /// Topics of readings; true for LaserScan.
    kinds: BTreeMap<String, bool>,
    /// Frames of the readings of each topic.
    frames: BTreeMap<String, BTreeSet<String>>,
    parents: BTreeMap<String, String>,
    /// Minimum offset from a stamp before 2000 to the recorder's clock, nanoseconds.
    board_offset_ns: Option<i64>,
    board_stamps: u64,
}

impl RecordingSummary {
    fn read(open: &dyn Fn() -> std::io::Result<Box<dyn Read>>) -> Result<Self, ImportError> {
        let mut summary = Self::default();
        for message in MessageReader::new(open()?, &MESSAGE_TYPES) {
            let message = message?;
            if message.channel.type_name != TRANSFORMS {
                summary.add(&message)?;
                continue;
            }
            for transform in decode(&message, TransformMessage::all)? {
                if summary.parents.len() < MAX_FRAMES {
                    summary.parents.insert(transform.child, transform.header.frame);
                }
            }
        }
        Ok(summary)
    }

    fn add(&mut self, message: &RecordedMessage) -> Result<(), ImportError> {
        let channel = &message.channel;
        let is_scan = channel.type_name == LASER_SCAN;
        self.kinds.insert(channel.topic.clone(), is_scan);
        let header = decode(message, MessageHeader::decode)?;
        let frames = self.frames.entry(channel.topic.clone()).or_default();
        if frames.len() < MAX_FRAMES {
            frames.insert(header.frame);
        }
        let recorded_ns = i64::try_from(message.recorded_ns).unwrap_or(i64::MAX);
        if header.stamp_ns != 0 && header.stamp_ns < MIN_CLOCK_NS {
            self.board_stamps += 1;
            if recorded_ns >= MIN_CLOCK_NS {
                let offset_ns = recorded_ns.saturating_sub(header.stamp_ns);
                self.board_offset_ns =
                    Some(self.board_offset_ns.map_or(offset_ns, |min| min.min(offset_ns)));
            }
        }
        Ok(())
    }

    /// Returns all frames on the paths from the topics' rangers, and from the robot, to the roots
    /// of their trees.
    fn needed(&self, topics: &BTreeMap<String, bool>) -> BTreeSet<String> {
        let of_topics = self.frames.iter().filter(|(topic, _)| topics.contains_key(*topic));
        let frames = of_topics.flat_map(|(_, frames)| frames).cloned();
        let mut open: Vec<String> = frames.chain(ROBOT.map(str::to_owned)).collect();
        let mut needed = BTreeSet::new();
        while let Some(frame) = open.pop() {
            if let Some(parent) = self.parents.get(&frame)
                && needed.insert(frame)
            {
                open.push(parent.clone());
            }
        }
        needed
    }
}

impl Bag {
    /// Surveys a recording; `open` opens it at its beginning, for each pass.
    ///
    /// # Errors
    /// Returns an error for a damaged recording, one without readings or with several rangers of
    /// which one rotates, and for tilted rangers.
    pub(crate) fn survey(
        open: &dyn Fn() -> std::io::Result<Box<dyn Read>>,
        mapping: &Mapping,
        assumptions: &Assumptions,
    ) -> Result<Self, ImportError> {
        let summary = RecordingSummary::read(open)?;
        let topics = select(&summary.kinds, mapping)?;
        let clock = Clock { board_offset_ns: summary.board_offset_ns, log_offset_ns: 0 };
        let needed = summary.needed(&topics);
        let mut bag = Self {
            frames: read_frames(open, &clock, &needed)?,
            topics: BTreeMap::new(),
            rotates: false,
            has_poses: false,
            clock,
            is_in_order: true,
            notes: Vec::new(),
            max_stated_range: 0.0,
        };
        let (mut first_ns, mut last_ns) = (i64::MAX, i64::MIN);
        let mut without_place = None;
        for message in MessageReader::new(open()?, &READINGS) {
            let message = message?;
            if let Some(is_scan) = topics.get(&message.channel.topic) {
                let stamp_ns = bag.track(&message, *is_scan, &mut without_place)?;
                bag.is_in_order &= stamp_ns >= last_ns;
                (first_ns, last_ns) = (first_ns.min(stamp_ns), last_ns.max(stamp_ns));
            }
        }
        if let Some(error) = without_place.filter(|_| bag.topics.is_empty()) {
            return Err(error);
        }
        bag.rotates |= bag.topics.values().any(|source| source.is_scan);
        if bag.rotates && bag.topics.len() > 1 {
            let names: Vec<_> = bag.topics.keys().map(String::as_str).collect();
            return Err(ImportError::mapping(
                format!("several rangers, one of which rotates: {}", names.join(", ")),
                "select one: --topic TOPIC",
            ));
        }
        bag.check_robots()?;
        if !assumptions.skip_checks {
            bag.check_tilts()?;
        }
        bag.note_clock(&summary, mapping, first_ns);
        let left: Vec<&str> = summary
            .kinds
            .keys()
            .filter(|topic| !topics.contains_key(*topic))
            .map(String::as_str)
            .collect();
        if !left.is_empty() {
            bag.notes.push(format!("topics skipped: {}; select with --topic", left.join(", ")));
        }
        if !bag.is_in_order {
            bag.notes.push("messages are out of order: sorted by time stamp".to_owned());
        }
        Ok(bag)
    }

    fn note_clock(&mut self, summary: &RecordingSummary, mapping: &Mapping, first_ns: i64) {
        let count = summary.board_stamps;
        if count == 0 {
            return;
        }
        if let Some(started) = mapping.started {
            let started_ns = i64::try_from(started.as_nanosecond()).unwrap_or(i64::MAX);
            self.clock.log_offset_ns = started_ns.saturating_sub(first_ns);
            return;
        }
        self.notes.push(if self.clock.board_offset_ns.is_some() {
            format!("{count} time stamps count from the start of a board: shifted to the recorder's clock by the smallest offset")
        } else {
            format!(
                "{count} time stamps and the recorder's clock start at {} (simulation, or board without a clock); \
                                 set the time of the first with --started TIME",
                timestamp(first_ns)
            )
        });
    }

    /// Places the ranger of a topic at its first message and detects rotation; returns the time
    /// stamp.
    fn track(
        &mut self,
        message: &RecordedMessage,
        is_scan: bool,
        without_place: &mut Option<ImportError>,
    ) -> Result<i64, ImportError> {
        let channel = &message.channel;
        let mut header = decode(message, MessageHeader::decode)?;
        self.clock.stamp(&mut header, message);
        let stamp_ns = header.stamp_ns;
        let pose_error = |error: TransformError| pose_error(&channel.topic, &error);
        let max_range = match is_scan {
            true => decode(message, LaserScanMessage::decode)?.limits_m[1],
            false => decode(message, RangeMessage::decode)?.limits_m[1],
        };
        if max_range.is_finite() {
            self.max_stated_range = self.max_stated_range.max(as_written(max_range));
        }
        let Some(source) = self.topics.get(&channel.topic) else {
            match self.source(&header, is_scan) {
                Ok(source) => {
                    self.has_poses |= source.world != source.robot;
                    self.note_mount(&channel.topic, &source);
                    self.topics.insert(channel.topic.clone(), source);
                }
                // A later message may have a pose.
                Err(error @ (TransformError::Missing { .. } | TransformError::Gap { .. })) => {
                    without_place.get_or_insert(pose_error(error));
                }
                Err(error) => return Err(pose_error(error)),
            }
            return Ok(stamp_ns);
        };
        if source.frame != header.frame {
            let what = format!(
                "{}: the frame changes from `{}` to `{}`",
                channel.topic, source.frame, header.frame
            );
            return Err(ImportError::mapping(what, "cut the recording where it changes"));
        }
        match self.frames.place(&source.placed_as, &source.robot, stamp_ns) {
            Ok(now) => {
                let turned = wrap_180(now.yaw_deg() - source.mounted.yaw_deg());
                self.rotates |= turned.abs() > FIXED_DEG;
            }
            Err(TransformError::Missing { .. } | TransformError::Gap { .. }) => {}
            Err(error) => return Err(pose_error(error)),
        }
        Ok(stamp_ns)
    }

    fn source(&self, header: &MessageHeader, is_scan: bool) -> Result<Topic, TransformError> {
        let is_placed = self.frames.contains(&header.frame);
        let robot = ROBOT.into_iter().find(|name| self.frames.contains(name));
        let placed_as = match robot.filter(|_| !is_placed) {
            Some(robot) => robot,
            None => &header.frame,
        };
        let path = self.frames.path_to_root(placed_as)?;
        let world = path.last().copied().unwrap_or_default();
        let robot = robot_frame(&path).unwrap_or(world);
        // A Range reading of a rotating frame has its origin in the parent; a LaserScan in its own
        // frame.
        let above = path.get(1).copied().filter(|_| !is_scan && placed_as != robot);
        let mounted = self.frames.place(placed_as, robot, header.stamp_ns)?;
        if world != robot {
            self.frames.place(robot, world, header.stamp_ns)?;
        }
        Ok(Topic {
            is_scan,
            frame: header.frame.clone(),
            placed_as: placed_as.to_owned(),
            world: world.to_owned(),
            robot: robot.to_owned(),
            axis: above.unwrap_or(placed_as).to_owned(),
            mounted,
        })
    }

    fn note_mount(&mut self, topic: &str, source: &Topic) {
        let frame = &source.frame;
        if !self.frames.contains(frame) && !ROBOT.contains(&frame.as_str()) {
            self.notes.push(format!(
                "{topic}: no transform of frame `{frame}` on the robot: mounting assumed at the robot's origin, facing \
                                 ahead; if /tf_static is in another part of the recording, import its folder as a whole"
            ));
        }
    }

    /// Rejects rangers on several robots.
    fn check_robots(&self) -> Result<(), ImportError> {
        let mut robots: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
        // Without transforms, the root of a tree replaces the robot.
        let is_named = |source: &Topic| robot_frame(&[&source.robot]).is_some();
        for (topic, source) in self.topics.iter().filter(|(_, source)| is_named(source)) {
            robots.entry(&source.robot).or_default().push(topic);
        }
        if robots.len() < 2 {
            return Ok(());
        }
        let names: Vec<&str> = robots.keys().copied().collect();
        let option = |topics: &Vec<&str>| {
            topics.iter().map(|topic| format!("--topic {topic}")).collect::<Vec<_>>().join(" ")
        };
        let options: Vec<String> = robots.values().map(option).collect();
        Err(ImportError::mapping(
            format!("the rangers are on several robots: {}", names.join(", ")),
            format!("select the topics of one: {}", options.join(" | ")),
        ))
    }

    /// Rejects rangers whose beams leave the horizontal plane.
    fn check_tilts(&self) -> Result<(), ImportError> {
        for (topic, source) in &self.topics {
            let mounted = source.mounted;
            let (tilt_deg, what) = match source.is_scan {
                true => (mounted.tilt_deg(), "scan plane tilted"),
                false => (mounted.elevation_deg().abs(), "beam inclined"),
            };
            if tilt_deg > MAX_TILT_DEG {
                return Err(ImportError::Implausible {
                    what: format!(
                        "{topic}: {what} by {tilt_deg:.1} degrees against the robot (pitch or roll of frame `{}`), so ranges \
                                                 are not horizontal distances",
                        source.frame
                    ),
                    help: "select other rangers with --topic TOPIC; --no-unit-check keeps the ranges, with directions projected to \
                                                the floor"
                        .to_owned(),
                });
            }
        }
        Ok(())
    }
}

/// Finds the robot's frame in a path of frames, also in a namespace (`robot1/base_link`).
fn robot_frame<'a>(path: &[&'a str]) -> Option<&'a str> {
    let has_name = |frame: &str, name: &str| {
        frame == name || frame.strip_suffix(name).is_some_and(|space| space.ends_with('/'))
    };
    ROBOT.into_iter().find_map(|name| path.iter().copied().find(|frame| has_name(frame, name)))
}

/// Reads the transforms of the needed frames; those of wheels and arms are skipped.
fn read_frames(
    open: &dyn Fn() -> std::io::Result<Box<dyn Read>>,
    clock: &Clock,
    needed: &BTreeSet<String>,
) -> Result<FrameTree, ImportError> {
    let mut transforms = FrameTree::default();
    for message in MessageReader::new(open()?, &[TRANSFORMS]) {
        let message = message?;
        let is_fixed = message.channel.topic.ends_with("tf_static");
        for mut transform in decode(&message, TransformMessage::all)? {
            if !needed.contains(&transform.child) {
                continue;
            }
            if !is_fixed {
                clock.stamp(&mut transform.header, &message);
            }
            let added = transforms.add(transform, is_fixed);
            added.map_err(|error| pose_error(&message.channel.topic, &error))?;
        }
    }
    transforms.sort();
    Ok(transforms)
}

/// Selects the topics to read: the requested ones, or else all ranges except predictions, or else
/// the scans.
fn select(
    kinds: &BTreeMap<String, bool>,
    mapping: &Mapping,
) -> Result<BTreeMap<String, bool>, ImportError> {
    let names: Vec<String> = kinds.keys().cloned().collect();
    let all = || if names.is_empty() { "none".to_owned() } else { names.join(", ") };
    if let Some(lacks) = mapping.topics.iter().find(|topic| !kinds.contains_key(*topic)) {
        return Err(ImportError::mapping(
            format!("no topic {lacks} with Range or LaserScan messages"),
            format!("the recording has {}", all()),
        ));
    }
    let is_selected = |topic: &str| match mapping.topics.is_empty() {
        true => !topic.contains("/predicted/"),
        false => mapping.topics.iter().any(|named| named == topic),
    };
    let selected = kinds.iter().filter(|(topic, _)| is_selected(topic));
    let mut selected: BTreeMap<String, bool> =
        selected.map(|(topic, is_scan)| (topic.clone(), *is_scan)).collect();
    if mapping.topics.is_empty() && selected.values().any(|is_scan| !is_scan) {
        selected.retain(|_, is_scan| !*is_scan);
    }
    if selected.is_empty() {
        return Err(ImportError::mapping(
            "the recording has no sensor_msgs/Range or sensor_msgs/LaserScan messages",
            "give a recording of a sonar",
        ));
    }
    Ok(selected)
}
