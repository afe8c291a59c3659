//! A recording looked through before its readings are read: topics, frames and clocks.

use std::{
    collections::{BTreeMap, BTreeSet},
    io::Read,
};

use sonard_model::geometry::wrap_180;

use super::{
    Bag, Clock, LASER_SCAN, MESSAGE_TYPES, MIN_CLOCK_NS, READINGS, STILL_DEG, Source, TRANSFORMS,
    decode,
    mcap::{Message, Messages},
    message::{Header, LaserScan, Range, Transform, moment},
    misplaced,
    numbers::as_written,
    transforms::{TransformError, Transforms},
};
use crate::{ImportError, Mapping, Taken};

/// Frames that are a robot's, the best first.
const ROBOT: [&str; 3] = ["base_link", "base_footprint", "base"];
/// A mount is level if it is tilted by no more than this, degrees.
const MAX_TILT_DEG: f64 = 5.0;
/// Frames of a recording, at most.
const MAX_FRAMES: usize = 1 << 16;

/// Outline of a recording after one pass, which keeps no transform.
#[derive(Debug, Default)]
struct Outline {
    /// Topics of readings, and whether they are of LaserScan.
    kinds: BTreeMap<String, bool>,
    /// Frames of their readings.
    frames: BTreeMap<String, BTreeSet<String>>,
    parents: BTreeMap<String, String>,
    /// The least way from a stamp before 2000 to a recorder's clock after it, nanoseconds.
    of_board_ns: Option<i64>,
    stamps_of_board: u64,
}

impl Outline {
    fn of(open: &dyn Fn() -> std::io::Result<Box<dyn Read>>) -> Result<Self, ImportError> {
        let mut outline = Self::default();
        for message in Messages::of(open()?, &MESSAGE_TYPES) {
            let message = message?;
            if message.channel.type_name != TRANSFORMS {
                outline.add(&message)?;
                continue;
            }
            for transform in decode(&message, Transform::all)? {
                if outline.parents.len() < MAX_FRAMES {
                    outline.parents.insert(transform.child, transform.header.frame);
                }
            }
        }
        Ok(outline)
    }

    fn add(&mut self, message: &Message) -> Result<(), ImportError> {
        let channel = &message.channel;
        let is_scan = channel.type_name == LASER_SCAN;
        self.kinds.insert(channel.topic.clone(), is_scan);
        let header = decode(message, Header::decode)?;
        let frames = self.frames.entry(channel.topic.clone()).or_default();
        if frames.len() < MAX_FRAMES {
            frames.insert(header.frame);
        }
        let recorded_ns = i64::try_from(message.recorded_ns).unwrap_or(i64::MAX);
        if header.stamp_ns != 0 && header.stamp_ns < MIN_CLOCK_NS {
            self.stamps_of_board += 1;
            if recorded_ns >= MIN_CLOCK_NS {
                let way_ns = recorded_ns.saturating_sub(header.stamp_ns);
                self.of_board_ns = Some(self.of_board_ns.map_or(way_ns, |least| least.min(way_ns)));
            }
        }
        Ok(())
    }

    /// Every frame between the rangers of these topics and the roots of their trees, and between the robot and its.
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
    /// Looks a recording through; `open` gives it from its beginning, as often as is asked.
    ///
    /// # Errors
    /// A damaged recording, one without readings or with several rangers that turn, or a ranger that is tilted.
    pub(crate) fn look(
        open: &dyn Fn() -> std::io::Result<Box<dyn Read>>,
        mapping: &Mapping,
        taken: &Taken,
    ) -> Result<Self, ImportError> {
        let outline = Outline::of(open)?;
        let topics = choose(&outline.kinds, mapping)?;
        let clock = Clock { of_board_ns: outline.of_board_ns, shown_ns: 0 };
        let needed = outline.needed(&topics);
        let mut bag = Self {
            transforms: transforms(open, &clock, &needed)?,
            topics: BTreeMap::new(),
            turns: false,
            has_poses: false,
            clock,
            is_in_order: true,
            notes: Vec::new(),
            stated_most: 0.0,
        };
        let (mut first_ns, mut last_ns) = (i64::MAX, i64::MIN);
        let mut without_place = None;
        for message in Messages::of(open()?, &READINGS) {
            let message = message?;
            if let Some(is_scan) = topics.get(&message.channel.topic) {
                let stamp_ns = bag.know(&message, *is_scan, &mut without_place)?;
                bag.is_in_order &= stamp_ns >= last_ns;
                (first_ns, last_ns) = (first_ns.min(stamp_ns), last_ns.max(stamp_ns));
            }
        }
        if let Some(error) = without_place.filter(|_| bag.topics.is_empty()) {
            return Err(error);
        }
        bag.turns |= bag.topics.values().any(|source| source.is_scan);
        if bag.turns && bag.topics.len() > 1 {
            let names: Vec<_> = bag.topics.keys().map(String::as_str).collect();
            return Err(ImportError::mapping(
                format!("several rangers, one of which turns: {}", names.join(", ")),
                "choose one: --topic TOPIC",
            ));
        }
        if !taken.as_said {
            bag.check_tilts()?;
        }
        bag.note_clock(&outline, mapping, first_ns);
        let left: Vec<&str> = outline
            .kinds
            .keys()
            .filter(|topic| !topics.contains_key(*topic))
            .map(String::as_str)
            .collect();
        if !left.is_empty() {
            bag.notes.push(format!("topics left out: {}; --topic chooses", left.join(", ")));
        }
        if !bag.is_in_order {
            bag.notes.push("messages are out of order: sorted by their stamps".to_owned());
        }
        Ok(bag)
    }

    fn note_clock(&mut self, outline: &Outline, mapping: &Mapping, first_ns: i64) {
        let count = outline.stamps_of_board;
        if count == 0 {
            return;
        }
        if let Some(started) = mapping.started {
            let started_ns = i64::try_from(started.as_nanosecond()).unwrap_or(i64::MAX);
            self.clock.shown_ns = started_ns.saturating_sub(first_ns);
            return;
        }
        self.notes.push(if self.clock.of_board_ns.is_some() {
            format!("{count} stamps count from the start of a board: taken on the recorder's clock, which they are nearest to")
        } else {
            format!(
                "{count} stamps, and the recorder's clock, are of {}: of a simulation, or of a board without a clock; \
                 --started TIME gives the time of the first",
                moment(first_ns)
            )
        });
    }

    /// Places a topic's ranger by its first message, and notices whether it turns; returns the message's time.
    fn know(
        &mut self,
        message: &Message,
        is_scan: bool,
        without_place: &mut Option<ImportError>,
    ) -> Result<i64, ImportError> {
        let channel = &message.channel;
        let mut header = decode(message, Header::decode)?;
        self.clock.stamp(&mut header, message);
        let stamp_ns = header.stamp_ns;
        let misplaced = |error: TransformError| misplaced(&channel.topic, &error);
        let most = match is_scan {
            true => decode(message, LaserScan::decode)?.limits_m[1],
            false => decode(message, Range::decode)?.limits_m[1],
        };
        if most.is_finite() {
            self.stated_most = self.stated_most.max(as_written(most));
        }
        let Some(source) = self.topics.get(&channel.topic) else {
            match self.source(&header, is_scan) {
                Ok(source) => {
                    self.has_poses |= source.world != source.robot;
                    self.note_mount(&channel.topic, &source);
                    self.topics.insert(channel.topic.clone(), source);
                }
                // A later message may have a place.
                Err(error @ (TransformError::Lacks { .. } | TransformError::Gap { .. })) => {
                    without_place.get_or_insert(misplaced(error));
                }
                Err(error) => return Err(misplaced(error)),
            }
            return Ok(stamp_ns);
        };
        if source.frame != header.frame {
            let what = format!(
                "{}: the frame is `{}`, and `{}` before",
                channel.topic, header.frame, source.frame
            );
            return Err(ImportError::mapping(what, "cut the recording where that changes"));
        }
        match self.transforms.place(&source.placed_as, &source.robot, stamp_ns) {
            Ok(now) => {
                let turned = wrap_180(now.yaw_deg() - source.mounted.yaw_deg());
                self.turns |= turned.abs() > STILL_DEG;
            }
            Err(TransformError::Lacks { .. } | TransformError::Gap { .. }) => {}
            Err(error) => return Err(misplaced(error)),
        }
        Ok(stamp_ns)
    }

    fn source(&self, header: &Header, is_scan: bool) -> Result<Source, TransformError> {
        let is_placed = self.transforms.knows(&header.frame);
        let robot = ROBOT.into_iter().find(|name| self.transforms.knows(name));
        let placed_as = match robot.filter(|_| !is_placed) {
            Some(robot) => robot,
            None => &header.frame,
        };
        let way = self.transforms.way_up(placed_as)?;
        let world = way.last().copied().unwrap_or_default();
        let robot = ROBOT.into_iter().find(|name| way.contains(name)).unwrap_or(world);
        // What turns stands on the frame above it; a scan is told from its own.
        let above = way.get(1).copied().filter(|_| !is_scan && placed_as != robot);
        let mounted = self.transforms.place(placed_as, robot, header.stamp_ns)?;
        if world != robot {
            self.transforms.place(robot, world, header.stamp_ns)?;
        }
        Ok(Source {
            is_scan,
            frame: header.frame.clone(),
            placed_as: placed_as.to_owned(),
            world: world.to_owned(),
            robot: robot.to_owned(),
            axis: above.unwrap_or(placed_as).to_owned(),
            mounted,
        })
    }

    fn note_mount(&mut self, topic: &str, source: &Source) {
        let frame = &source.frame;
        if !self.transforms.knows(frame) && !ROBOT.contains(&frame.as_str()) {
            self.notes.push(format!(
                "{topic}: no transform places the frame `{frame}` on the robot: taken to be at its middle, looking \
                 ahead; /tf_static may be in another part of the recording, whose folder can be imported as a whole"
            ));
        }
    }

    /// Refuses rangers whose beams leave the plane.
    fn check_tilts(&self) -> Result<(), ImportError> {
        for (topic, source) in &self.topics {
            let mounted = source.mounted;
            let (tilt_deg, what) = match source.is_scan {
                true => (mounted.tilt_deg(), "its plane is tilted"),
                false => (mounted.elevation_deg().abs(), "its beam is inclined"),
            };
            if tilt_deg > MAX_TILT_DEG {
                return Err(ImportError::Doubtful {
                    what: format!(
                        "{topic}: {what} by {tilt_deg:.1} degrees against the robot (pitch or roll of the frame `{}`), so \
                         that ranges are not those over the floor",
                        source.frame
                    ),
                    help: "choose other rangers with --topic TOPIC; --no-unit-check takes the ranges as they are, with directions \
                           over the floor"
                        .to_owned(),
                });
            }
        }
        Ok(())
    }
}

/// The transforms of frames that matter; those of wheels and arms are passed over.
fn transforms(
    open: &dyn Fn() -> std::io::Result<Box<dyn Read>>,
    clock: &Clock,
    needed: &BTreeSet<String>,
) -> Result<Transforms, ImportError> {
    let mut transforms = Transforms::default();
    for message in Messages::of(open()?, &[TRANSFORMS]) {
        let message = message?;
        let is_fixed = message.channel.topic.ends_with("tf_static");
        for mut transform in decode(&message, Transform::all)? {
            if !needed.contains(&transform.child) {
                continue;
            }
            if !is_fixed {
                clock.stamp(&mut transform.header, &message);
            }
            let added = transforms.add(transform, is_fixed);
            added.map_err(|error| misplaced(&message.channel.topic, &error))?;
        }
    }
    transforms.sort();
    Ok(transforms)
}

/// Which topics are read: those that are named, else all ranges but predictions, else the scans.
fn choose(
    kinds: &BTreeMap<String, bool>,
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
    let meant = kinds.iter().filter(|(topic, _)| is_meant(topic));
    let mut meant: BTreeMap<String, bool> =
        meant.map(|(topic, is_scan)| (topic.clone(), *is_scan)).collect();
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
