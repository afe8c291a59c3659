//! Rounds of an array: all of its ranges in one message of a robot's log, or in one row of a table.

use std::collections::{BTreeMap, BTreeSet};

use jiff::Timestamp;
use sonard_model::{
    array::{MountedRanger, RangerArray},
    geometry::Pose,
};

use crate::{FileLocation, ImportError, Mapping, time::TimeReader};

/// Ranges of all rangers of an array at one time.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ArrayRound {
    pub(crate) place: FileLocation,
    pub(crate) time: Option<Timestamp>,
    /// Pose of the robot, if the log stated one before.
    pub(crate) pose: Option<Pose>,
    /// Range of each ranger, `None` without an echo.
    pub(crate) ranges_m: Vec<Option<f64>>,
    /// Ranges as in the file, including no-echo values.
    pub(crate) raw: Vec<Option<f64>>,
}

/// Content of a message of a robot's log.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum MessageContent {
    /// Positions of the rangers, forward and left in metres, and their directions in radians.
    Geometry(Vec<[f64; 3]>),
    /// Pose of the robot; `is_true` if it is better than odometry.
    Pose { pose: Pose, is_true: bool },
    /// Ranges in the log's unit, with the positions of the rangers if the line contains them.
    Ranges { seconds: Option<f64>, ranges: Vec<f64>, geometry: Option<Vec<[f64; 3]>> },
}

/// Message of a robot's log.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LogMessage {
    /// Sending device; empty in logs of a single robot.
    pub(crate) device: LogDevice,
    pub(crate) content: MessageContent,
}

/// Interface of the sonars in a CARMEN log.
pub(crate) const CARMEN_SONAR: &str = "SONAR";

/// Device of a robot.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Default)]
pub(crate) struct LogDevice {
    /// Host and robot, `HOST:ROBOT`; the sending host in CARMEN logs.
    pub(crate) robot: String,
    pub(crate) interface: String,
    pub(crate) index: String,
}

impl LogDevice {
    /// Returns the option value that selects the device.
    fn selector(&self) -> String {
        match self.index.as_str() {
            "" => self.robot.clone(),
            index => format!("{}:{index}", self.robot),
        }
    }

    /// Returns `true` if an option selects this device, by its full name or the end of it.
    fn is_selected_by(&self, requested: &str) -> bool {
        let name = format!(":{}:{}", self.robot, self.index);
        name.ends_with(&format!(":{requested}")) || self.robot.ends_with(requested)
    }
}

impl std::fmt::Display for LogDevice {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} {}", self.interface, self.selector())
    }
}

/// Devices of a log, with counts of their messages.
#[derive(Debug, Default)]
pub(crate) struct DeviceCounts {
    /// Ranging devices, in order of first appearance.
    ranges: Vec<(LogDevice, u64)>,
    poses: BTreeMap<LogDevice, u64>,
    /// Devices with poses better than odometry.
    true_poses: BTreeSet<LogDevice>,
}

/// Devices selected for the import.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct SelectedDevices {
    ranges: Option<LogDevice>,
    pose: Option<LogDevice>,
    /// True if the poses are those of any device: programs of one robot may run on several hosts.
    is_any_pose: bool,
    /// True if the log has poses better than odometry, which is then ignored.
    has_true_poses: bool,
}

impl DeviceCounts {
    pub(crate) fn add(&mut self, message: &LogMessage) {
        let device = &message.device;
        if matches!(message.content, MessageContent::Pose { is_true: true, .. })
            && self.true_poses.len() < MAX_RANGERS
        {
            self.true_poses.insert(device.clone());
        }
        match message.content {
            MessageContent::Ranges { .. } => {
                match self.ranges.iter().position(|(known, _)| known == device) {
                    Some(place) => self.ranges[place].1 += 1,
                    None if self.ranges.len() < MAX_RANGERS => {
                        self.ranges.push((device.clone(), 1));
                    }
                    None => {}
                }
            }
            MessageContent::Pose { .. }
                if self.poses.len() < MAX_RANGERS || self.poses.contains_key(device) =>
            {
                *self.poses.entry(device.clone()).or_default() += 1;
            }
            _ => {}
        }
    }

    /// Selects the devices to import, with notes on the skipped ones.
    ///
    /// # Errors
    /// Returns an error if the requested device is not in the log.
    pub(crate) fn select(
        &self,
        requested: Option<&str>,
    ) -> Result<(SelectedDevices, Vec<String>), ImportError> {
        let is_requested =
            |device: &LogDevice| requested.is_none_or(|requested| device.is_selected_by(requested));
        let ranges =
            self.ranges.iter().map(|(device, _)| device).find(|device| is_requested(device));
        if let (Some(requested), None) = (requested, ranges) {
            let known: Vec<String> =
                self.ranges.iter().map(|(device, _)| device.to_string()).collect();
            return Err(ImportError::mapping(
                format!("no ranging device {requested} in the log"),
                format!("the log has {}", known.join(", ")),
            ));
        }
        let of_robot =
            |device: &&LogDevice| ranges.is_some_and(|ranges| device.robot == ranges.robot);
        let is_any_pose = matches!(&self.ranges[..], [(only, _)] if only.interface == CARMEN_SONAR);
        let pose = self.poses.keys().find(|device| is_any_pose || of_robot(device));
        let has_true_poses = match (is_any_pose, pose) {
            (true, _) => !self.true_poses.is_empty(),
            (false, Some(pose)) => self.true_poses.contains(pose),
            (false, None) => false,
        };
        let others = self.ranges.iter().filter(|(device, _)| Some(device) != ranges);
        let another = others.clone().next().map(|(device, _)| device.selector());
        let others: Vec<String> =
            others.map(|(device, count)| format!("{device} ({count} messages)")).collect();
        let other_poses =
            self.poses.iter().filter(|(device, _)| !is_any_pose && Some(*device) != pose);
        let other_poses: Vec<String> =
            other_poses.map(|(device, count)| format!("{device} ({count} messages)")).collect();
        let mut notes = Vec::new();
        if let Some(ranges) = ranges.filter(|_| !others.is_empty()) {
            notes.push(format!(
                "several devices: importing {ranges}; skipped: {}; select another with --device {}",
                others.join(", "),
                another.unwrap_or_default()
            ));
        }
        if ranges.is_some() && !other_poses.is_empty() {
            let used = pose.map_or("none".to_owned(), ToString::to_string);
            notes.push(format!("poses taken from {used}; skipped: {}", other_poses.join(", ")));
        }
        let (ranges, pose) = (ranges.cloned(), pose.cloned());
        Ok((SelectedDevices { ranges, pose, is_any_pose, has_true_poses }, notes))
    }
}

/// Converts the messages of a log, in order, to rounds.
#[derive(Debug)]
pub(crate) struct RoundReader<'a> {
    mapping: &'a Mapping,
    selected: &'a SelectedDevices,
    /// Positions of the rangers, from the log.
    pub(crate) geometry: Option<Vec<[f64; 3]>>,
    pose: Option<Pose>,
    /// Number of rounds before the first pose of a log with poses.
    pub(crate) skipped: u64,
    /// Number of ranges in the first message with ranges.
    pub(crate) rangers: Option<usize>,
    pub(crate) times: TimeReader<'a>,
}

impl<'a> RoundReader<'a> {
    /// # Errors
    /// Returns an error for an invalid UTC offset in the mapping.
    pub(crate) fn new(
        mapping: &'a Mapping,
        selected: &'a SelectedDevices,
        started: Timestamp,
    ) -> Result<Self, ImportError> {
        let times = TimeReader::new(mapping, started)?;
        Ok(Self { mapping, selected, geometry: None, pose: None, skipped: 0, rangers: None, times })
    }

    /// Processes a message and returns the round that it contains, if any.
    ///
    /// # Errors
    /// Returns an error if the number or the positions of the rangers change.
    pub(crate) fn push(
        &mut self,
        place: FileLocation,
        message: LogMessage,
    ) -> Result<Option<ArrayRound>, ImportError> {
        let LogMessage { device, content } = message;
        let is_of = |selected: &Option<LogDevice>| selected.as_ref() == Some(&device);
        match content {
            MessageContent::Geometry(geometry) => {
                if is_of(&self.selected.ranges) {
                    self.set_geometry(place, geometry)?;
                }
                Ok(None)
            }
            MessageContent::Pose { pose, is_true } => {
                // A log with true poses also contains odometry, which is ignored.
                let is_better = is_true || !self.selected.has_true_poses;
                if is_better && (self.selected.is_any_pose || is_of(&self.selected.pose)) {
                    self.pose = Some(pose);
                }
                Ok(None)
            }
            MessageContent::Ranges { .. } if !is_of(&self.selected.ranges) => Ok(None),
            MessageContent::Ranges { seconds, ranges, geometry } => {
                if let Some(geometry) = geometry {
                    self.set_geometry(place, geometry)?;
                }
                let known = *self.rangers.get_or_insert(ranges.len());
                if known != ranges.len() {
                    let what = format!("{} ranges, but {known} before", ranges.len());
                    return Err(ImportError::at(
                        place,
                        what,
                        "import the log of one array at a time",
                    ));
                }
                if self.selected.pose.is_some() && self.pose.is_none() {
                    self.skipped += 1;
                    return Ok(None);
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
                Ok(Some(ArrayRound { place, time, pose: self.pose, ranges_m, raw }))
            }
        }
    }

    fn set_geometry(
        &mut self,
        place: FileLocation,
        geometry: Vec<[f64; 3]>,
    ) -> Result<(), ImportError> {
        match &self.geometry {
            Some(known) if *known != geometry => Err(ImportError::at(
                place,
                "the positions of the rangers differ from those before",
                "import the log of one array at a time",
            )),
            _ => {
                self.geometry = Some(geometry);
                Ok(())
            }
        }
    }
}

/// Builds an array of rangers `s0`, `s1`, ... at these positions.
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
        description: "Rangers of an imported log, at the positions in the log".to_owned(),
        sensor: sensor.to_owned(),
        interval_ms: 40.0,
        rangers: geometry.iter().enumerate().map(ranger).collect(),
        firing_order: Vec::new(),
        body: None,
        sources: BTreeMap::from([
            ("rangers".to_owned(), "the log".to_owned()),
            ("interval_ms".to_owned(), "assumed: the log does not contain it".to_owned()),
        ]),
    }
}

/// Builds a pose from metres and radians.
pub(crate) fn pose(x_m: f64, y_m: f64, heading_rad: f64) -> Pose {
    Pose { x_m, y_m, heading_deg: heading_rad.to_degrees() }
}

/// Parses one word of a line as a number.
pub(crate) fn number(
    place: FileLocation,
    words: &[&str],
    at: usize,
    what: &str,
) -> Result<f64, ImportError> {
    let word = words.get(at).ok_or_else(|| {
        ImportError::at(place, format!("the line ends before the {what}"), "is the log complete?")
    })?;
    let number: Option<f64> = word.parse().ok();
    number.filter(|number| number.is_finite()).ok_or_else(|| {
        let what = format!("the {what}, `{word}`, is not a number");
        ImportError::at(place, what, "correct that line")
    })
}

/// Parses ranges; `inf` and `nan`, as printed by C, become infinite.
pub(crate) fn ranges(
    place: FileLocation,
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

/// Parses `count` consecutive words as numbers.
pub(crate) fn numbers(
    place: FileLocation,
    words: &[&str],
    from: usize,
    count: usize,
    what: &str,
) -> Result<Vec<f64>, ImportError> {
    (from..from + count).map(|at| number(place, words, at, what)).collect()
}

/// Maximum number of rangers of a message or a row.
pub(crate) const MAX_RANGERS: usize = 256;

/// Parses the number of rangers at the beginning of a line.
pub(crate) fn count(place: FileLocation, words: &[&str], at: usize) -> Result<usize, ImportError> {
    let count = number(place, words, at, "number of rangers")?;
    if count.fract() == 0.0 && (1.0..=MAX_RANGERS as f64).contains(&count) {
        return Ok(count as usize);
    }
    let what = format!("invalid number of rangers: {count}");
    Err(ImportError::at(place, what, "correct that line"))
}
