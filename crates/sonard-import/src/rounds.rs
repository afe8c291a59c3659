//! Rounds of an array's rangers, as logs of robots have them: all ranges in one message.

use std::collections::BTreeMap;

use jiff::Timestamp;
use sonard_model::{
    array::{MountedRanger, RangerArray},
    geometry::Pose,
};

use crate::{ImportError, Location, Mapping};

/// What all rangers said at one time.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Round {
    pub(crate) time: Option<Timestamp>,
    /// Where the robot stood, if the log said so before.
    pub(crate) pose: Option<Pose>,
    /// `None` of a ranger that heard nothing.
    pub(crate) ranges_m: Vec<Option<f64>>,
}

/// A message of a robot's log.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Message {
    /// Where the rangers are: ahead, to the left, metres, and where they look, radians.
    Geometry(Vec<[f64; 3]>),
    /// Where the robot is, and whether it is known better than by its wheels.
    Pose { pose: Pose, is_true: bool },
    /// What they read, metres, with their places where the line has them.
    Ranges { seconds: Option<f64>, ranges_m: Vec<f64>, geometry: Option<Vec<[f64; 3]>> },
}

/// Messages in order, as rounds.
#[derive(Debug)]
pub(crate) struct Rounds<'a> {
    mapping: &'a Mapping,
    /// The array's rangers as the log tells them.
    pub(crate) geometry: Option<Vec<[f64; 3]>>,
    pose: Option<Pose>,
    has_true: bool,
    /// Of the first message with ranges.
    pub(crate) rangers: Option<usize>,
}

impl<'a> Rounds<'a> {
    pub(crate) fn new(mapping: &'a Mapping) -> Self {
        Self { mapping, geometry: None, pose: None, has_true: false, rangers: None }
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
        match message {
            Message::Geometry(geometry) => {
                self.know(place, geometry)?;
                Ok(None)
            }
            Message::Pose { pose, is_true } => {
                self.has_true |= is_true;
                // Where a log has true poses, those by the wheels beside them are left alone.
                if is_true || !self.has_true {
                    self.pose = Some(pose);
                }
                Ok(None)
            }
            Message::Ranges { seconds, ranges_m, geometry } => {
                if let Some(geometry) = geometry {
                    self.know(place, geometry)?;
                }
                let known = *self.rangers.get_or_insert(ranges_m.len());
                if known != ranges_m.len() {
                    let what = format!("{} ranges, and {known} before", ranges_m.len());
                    return Err(ImportError::at(
                        place,
                        what,
                        "import the log of one array at a time",
                    ));
                }
                let time = seconds
                    .map(|seconds| Timestamp::from_nanosecond((seconds * 1e9) as i128))
                    .transpose()
                    .map_err(|error| {
                        ImportError::at(place, error.to_string(), "correct that time")
                    })?;
                let heard = |range_m: f64| {
                    let silent = self.mapping.is_silence(range_m);
                    (!silent && range_m.is_finite() && range_m > 0.0).then_some(range_m)
                };
                let ranges_m = ranges_m.into_iter().map(heard).collect();
                Ok(Some(Round { time, pose: self.pose, ranges_m }))
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
        description: "The rangers of an imported log, where it says that they are".to_owned(),
        sensor: sensor.to_owned(),
        interval_ms: 40.0,
        rangers: geometry.iter().enumerate().map(ranger).collect(),
        firing_order: Vec::new(),
        body: None,
        sources: BTreeMap::from([
            ("rangers".to_owned(), "the log".to_owned()),
            ("interval_ms".to_owned(), "a guess: such logs do not say it".to_owned()),
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

/// Most rangers of a message.
pub(crate) const MOST_RANGERS: f64 = 256.0;

/// The count of rangers that a line begins with.
pub(crate) fn count(place: Location, words: &[&str], at: usize) -> Result<usize, ImportError> {
    let count = number(place, words, at, "count of rangers")?;
    if count.fract() == 0.0 && (1.0..=MOST_RANGERS).contains(&count) {
        return Ok(count as usize);
    }
    let what = format!("{count} is no count of rangers");
    Err(ImportError::at(place, what, "correct that line"))
}
