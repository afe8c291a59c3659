//! Rounds of an array's rangers, as logs of robots have them: all ranges in one message.

use std::collections::BTreeMap;

use jiff::Timestamp;
use sonard_model::{
    array::{MountedRanger, RangerArray},
    geometry::Pose,
};

use crate::{ImportError, Location, Mapping, time::Times};

/// Measurements of all rangers at one time.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Round {
    pub(crate) place: Location,
    pub(crate) time: Option<Timestamp>,
    /// Where the robot stood, if the log said so before.
    pub(crate) pose: Option<Pose>,
    /// `None` of a ranger without an echo.
    pub(crate) ranges_m: Vec<Option<f64>>,
    /// The same as the file has them, those that stand for no echo among them.
    pub(crate) raw: Vec<Option<f64>>,
}

/// Content of a message of a robot's log.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Content {
    /// Places of the rangers: ahead, to the left, metres, and their directions, radians.
    Geometry(Vec<[f64; 3]>),
    /// Place of the robot, and whether it is known better than by its wheels.
    Pose { pose: Pose, is_true: bool },
    /// Ranges in the log's unit, with the rangers' places where the line has them.
    Ranges { seconds: Option<f64>, ranges: Vec<f64>, geometry: Option<Vec<[f64; 3]>> },
}

/// A message of a robot's log.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Message {
    /// The device that sent it; of a log of one robot, nothing.
    pub(crate) device: Device,
    pub(crate) content: Content,
}

/// A device of a robot.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Default)]
pub(crate) struct Device {
    /// Host and robot, `HOST:ROBOT`.
    pub(crate) robot: String,
    pub(crate) interface: String,
    pub(crate) index: String,
}

impl Device {
    /// Checks whether an option means it: its whole name, or the end of it.
    fn is_meant(&self, wanted: &str) -> bool {
        let name = format!(":{}:{}", self.robot, self.index);
        name.ends_with(&format!(":{wanted}")) || self.robot.ends_with(wanted)
    }
}

impl std::fmt::Display for Device {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} {}:{}", self.interface, self.robot, self.index)
    }
}

/// The devices of a log, with counts of their messages.
#[derive(Debug, Default)]
pub(crate) struct Devices {
    /// Devices of ranges, in the order in which they first come.
    ranges: Vec<(Device, u64)>,
    poses: BTreeMap<Device, u64>,
}

/// The devices that are imported.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Chosen {
    ranges: Option<Device>,
    pose: Option<Device>,
}

impl Devices {
    pub(crate) fn add(&mut self, message: &Message) {
        let device = &message.device;
        match message.content {
            Content::Ranges { .. } => {
                match self.ranges.iter().position(|(known, _)| known == device) {
                    Some(place) => self.ranges[place].1 += 1,
                    None if self.ranges.len() < MAX_RANGERS => {
                        self.ranges.push((device.clone(), 1));
                    }
                    None => {}
                }
            }
            Content::Pose { .. }
                if self.poses.len() < MAX_RANGERS || self.poses.contains_key(device) =>
            {
                *self.poses.entry(device.clone()).or_default() += 1;
            }
            _ => {}
        }
    }

    /// The devices to import, and a note about those left out.
    ///
    /// # Errors
    /// The device that is asked for is not in the log.
    pub(crate) fn choose(
        &self,
        wanted: Option<&str>,
    ) -> Result<(Chosen, Vec<String>), ImportError> {
        let is_wanted = |device: &Device| wanted.is_none_or(|wanted| device.is_meant(wanted));
        let ranges = self.ranges.iter().map(|(device, _)| device).find(|device| is_wanted(device));
        if let (Some(wanted), None) = (wanted, ranges) {
            let known: Vec<String> =
                self.ranges.iter().map(|(device, _)| device.to_string()).collect();
            return Err(ImportError::mapping(
                format!("there is no device {wanted} of ranges"),
                format!("those in the log are: {}", known.join(", ")),
            ));
        }
        let of_robot = |device: &&Device| ranges.is_some_and(|ranges| device.robot == ranges.robot);
        let pose = self.poses.keys().find(of_robot);
        let others = self.ranges.iter().filter(|(device, _)| Some(device) != ranges);
        let others: Vec<String> =
            others.map(|(device, count)| format!("{device} ({count} messages)")).collect();
        let other_poses = self.poses.iter().filter(|(device, _)| Some(*device) != pose);
        let other_poses: Vec<String> =
            other_poses.map(|(device, count)| format!("{device} ({count} messages)")).collect();
        let mut notes = Vec::new();
        if let Some(ranges) = ranges.filter(|_| !others.is_empty()) {
            notes.push(format!(
                "of several devices {ranges} is imported; left out: {}; --device ROBOT:INDEX chooses another",
                others.join(", ")
            ));
        }
        if ranges.is_some() && !other_poses.is_empty() {
            let used = pose.map_or("none".to_owned(), ToString::to_string);
            notes.push(format!("poses are those of {used}; left out: {}", other_poses.join(", ")));
        }
        Ok((Chosen { ranges: ranges.cloned(), pose: pose.cloned() }, notes))
    }
}

/// Messages in order, as rounds.
#[derive(Debug)]
pub(crate) struct Rounds<'a> {
    mapping: &'a Mapping,
    chosen: &'a Chosen,
    /// The array's rangers by the log.
    pub(crate) geometry: Option<Vec<[f64; 3]>>,
    pose: Option<Pose>,
    has_true: bool,
    /// Of the first message with ranges.
    pub(crate) rangers: Option<usize>,
    pub(crate) times: Times<'a>,
}

impl<'a> Rounds<'a> {
    /// # Errors
    /// The mapping has an offset from UTC that is none.
    pub(crate) fn new(
        mapping: &'a Mapping,
        chosen: &'a Chosen,
        started: Timestamp,
    ) -> Result<Self, ImportError> {
        let times = Times::new(mapping, started)?;
        Ok(Self {
            mapping,
            chosen,
            geometry: None,
            pose: None,
            has_true: false,
            rangers: None,
            times,
        })
    }

    /// Takes a message in; the round that it is.
    ///
    /// # Errors
    /// The rangers are others than before.
    pub(crate) fn take(
        &mut self,
        place: Location,
        message: Message,
    ) -> Result<Option<Round>, ImportError> {
        let Message { device, content } = message;
        let is_of = |chosen: &Option<Device>| chosen.as_ref() == Some(&device);
        match content {
            Content::Geometry(geometry) => {
                if is_of(&self.chosen.ranges) {
                    self.know(place, geometry)?;
                }
                Ok(None)
            }
            Content::Pose { pose, is_true } => {
                if is_of(&self.chosen.pose) {
                    self.has_true |= is_true;
                    // Where a log has true poses, those by the wheels beside them are left alone.
                    if is_true || !self.has_true {
                        self.pose = Some(pose);
                    }
                }
                Ok(None)
            }
            Content::Ranges { .. } if !is_of(&self.chosen.ranges) => Ok(None),
            Content::Ranges { seconds, ranges, geometry } => {
                if let Some(geometry) = geometry {
                    self.know(place, geometry)?;
                }
                let known = *self.rangers.get_or_insert(ranges.len());
                if known != ranges.len() {
                    let what = format!("{} ranges, and {known} before", ranges.len());
                    return Err(ImportError::at(
                        place,
                        what,
                        "import the log of one array at a time",
                    ));
                }
                let time = seconds.map(|seconds| self.times.number(None, seconds));
                let time = time
                    .transpose()
                    .map_err(|(what, _)| ImportError::at(place, what, "correct that time"))?;
                let metres = self.mapping.metres();
                let range_m = |range: &f64| {
                    let is_echo =
                        range.is_finite() && *range > 0.0 && !self.mapping.is_no_echo(*range);
                    is_echo.then_some(range * metres)
                };
                let ranges_m = ranges.iter().map(range_m).collect();
                let raw = ranges.iter().map(|range| Some(*range).filter(|range| range.is_finite()));
                let raw = raw.collect();
                Ok(Some(Round { place, time, pose: self.pose, ranges_m, raw }))
            }
        }
    }

    fn know(&mut self, place: Location, geometry: Vec<[f64; 3]>) -> Result<(), ImportError> {
        match &self.geometry {
            Some(known) if *known != geometry => Err(ImportError::at(
                place,
                "the rangers are elsewhere than before",
                "import the log of one array at a time",
            )),
            _ => {
                self.geometry = Some(geometry);
                Ok(())
            }
        }
    }
}

/// The array of such rangers, `s0` and so on.
pub(crate) fn array(geometry: &[[f64; 3]], sensor: &str) -> RangerArray {
    let ranger = |(number, &[x_m, y_m, turn_rad]): (usize, &[f64; 3])| MountedRanger {
        id: format!("s{number}"),
        x_m,
        y_m,
        bearing_deg: turn_rad.to_degrees(),
        z_m: None,
    };
    RangerArray {
        name: "imported".to_owned(),
        description: "The rangers of an imported log, at the places that it states".to_owned(),
        sensor: sensor.to_owned(),
        interval_ms: 40.0,
        rangers: geometry.iter().enumerate().map(ranger).collect(),
        firing_order: Vec::new(),
        body: None,
        sources: BTreeMap::from([
            ("rangers".to_owned(), "the log".to_owned()),
            ("interval_ms".to_owned(), "assumed: such logs do not state it".to_owned()),
        ]),
    }
}

/// A pose in metres and radians.
pub(crate) fn pose(x_m: f64, y_m: f64, heading_rad: f64) -> Pose {
    Pose { x_m, y_m, heading_deg: heading_rad.to_degrees() }
}

/// A word of a line as a number.
pub(crate) fn number(
    place: Location,
    words: &[&str],
    at: usize,
    what: &str,
) -> Result<f64, ImportError> {
    let word = words.get(at).ok_or_else(|| {
        ImportError::at(place, format!("the line ends before its {what}"), "is the log whole?")
    })?;
    let number: Option<f64> = word.parse().ok();
    number.filter(|number| number.is_finite()).ok_or_else(|| {
        let what = format!("`{word}`, its {what}, is no number");
        ImportError::at(place, what, "correct that line")
    })
}

/// Ranges from a place on; `inf` and `nan`, as C prints them, are no distance.
pub(crate) fn ranges(
    place: Location,
    words: &[&str],
    from: usize,
    count: usize,
) -> Result<Vec<f64>, ImportError> {
    let range = |at: usize| match words.get(at).map(|word| word.trim_start_matches(['+', '-'])) {
        Some("inf" | "Inf" | "INF" | "nan" | "NaN" | "NAN" | "infinity") => Ok(f64::INFINITY),
        _ => number(place, words, at, "range"),
    };
    (from..from + count).map(range).collect()
}

/// So many numbers from a place on.
pub(crate) fn numbers(
    place: Location,
    words: &[&str],
    from: usize,
    count: usize,
    what: &str,
) -> Result<Vec<f64>, ImportError> {
    (from..from + count).map(|at| number(place, words, at, what)).collect()
}

/// Most rangers of a message or a row.
pub(crate) const MAX_RANGERS: usize = 256;

/// The count of rangers that a line begins with.
pub(crate) fn count(place: Location, words: &[&str], at: usize) -> Result<usize, ImportError> {
    let count = number(place, words, at, "count of rangers")?;
    if count.fract() == 0.0 && (1.0..=MAX_RANGERS as f64).contains(&count) {
        return Ok(count as usize);
    }
    let what = format!("{count} is no count of rangers");
    Err(ImportError::at(place, what, "correct that line"))
}
