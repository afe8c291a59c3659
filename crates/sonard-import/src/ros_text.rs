//! ROS LaserScan and Range messages as text: JSON from rosbridge, or YAML from `rostopic echo`.
//!
//! Each LaserScan is a scan: beam `i` is at `angle_min + i angle_increment`, radians, with limits
//! as in a recording. Range messages are readings of a fixed ranger. Member names of ROS 1 and 2
//! are accepted.

use std::io::Read;

use jiff::Timestamp;
use serde_json::Value;
use sonard_model::reading::PingStatus;

use crate::{
    FileLocation, ImportError, ImportedReading, Mapping, json,
    limits::{LimitNotes, Limits, RangeClass, ScanAngles},
    lines::{LineEnding, LineReader, MaxLine},
    reading::RawReading,
    time::{MIN_CLOCK_S, TimeReader},
};

/// Maximum size of a message.
const MAX_MESSAGE_BYTES: usize = 16 << 20;

/// Returns the messages of a file, in order.
pub(crate) fn messages<'a>(
    source: impl Read + 'a,
    is_json: bool,
) -> Result<Box<dyn Iterator<Item = Result<Value, ImportError>> + 'a>, ImportError> {
    if is_json {
        return json::objects(source);
    }
    // A list in YAML's flow style is one line.
    let max = MaxLine { bytes: MAX_MESSAGE_BYTES, help: "messages end with a line `---`" };
    let mut lines = LineReader::with_max(source, LineEnding::Lines, max);
    let mut number = 0;
    Ok(Box::new(std::iter::from_fn(move || {
        loop {
            let (first, text, is_last) = match document(&mut lines) {
                Ok(document) => document,
                Err(error) => return Some(Err(error)),
            };
            if text.trim().is_empty() {
                if is_last {
                    return None;
                }
                continue;
            }
            number += 1;
            let read = yaml(number, first, &text);
            // `rostopic echo` that is interrupted leaves a part of a message.
            let is_cut = is_last && number > 1 && read.is_err();
            return Some(if is_cut { Ok(Value::Null) } else { read });
        }
    })))
}

/// Reads one document; returns the number of its first line, its text, and whether the file ends
/// with it.
fn document(lines: &mut LineReader<impl Read>) -> Result<(u64, String, bool), ImportError> {
    let (mut first, mut text) = (0, String::new());
    for line in lines.by_ref() {
        let line = line?;
        if line.text.trim_end() == "---" {
            return Ok((first, text, false));
        }
        if first == 0 {
            first = line.number;
        }
        // `rostopic echo` may print warnings between messages.
        if line.text.starts_with("WARNING") {
            continue;
        }
        text.push_str(&line.text);
        text.push('\n');
        if text.len() > MAX_MESSAGE_BYTES {
            let what = format!("a message of more than {} MB", MAX_MESSAGE_BYTES >> 20);
            return Err(ImportError::at(line.place(), what, "messages end with a line `---`"));
        }
    }
    Ok((first, text, true))
}

fn yaml(number: u64, first_line: u64, text: &str) -> Result<Value, ImportError> {
    let place = FileLocation::Entry { object: number, number: None };
    // `ros2 topic echo` abbreviates long lists by default.
    let is_shortened = text.lines().any(|line| matches!(line.trim(), "- '...'" | "- ..." | "..."));
    if is_shortened {
        return Err(ImportError::at(
            place,
            "the list is abbreviated with `...`",
            "print whole lists: `ros2 topic echo --full-length TOPIC`",
        ));
    }
    parse_yaml(&quote_non_finite(text)).map_err(|error| {
        let what = format!("invalid YAML from line {first_line}: {error}");
        ImportError::at(place, what, "messages are separated by lines `---`")
    })
}

#[cfg(feature = "texts")]
fn parse_yaml(text: &str) -> Result<Value, String> {
    serde_saphyr::from_str(text).map_err(|error| error.to_string())
}

#[cfg(not(feature = "texts"))]
fn parse_yaml(_: &str) -> Result<Value, String> {
    Err("this build cannot read YAML; convert the file with `sonard import`".to_owned())
}

/// Quotes YAML's infinities and NaN, which JSON cannot represent as numbers.
fn quote_non_finite(text: &str) -> String {
    let is_end = |c: char| c.is_whitespace() || matches!(c, ',' | '[' | ']');
    let word = |piece: &str| {
        let plain = piece.trim_end_matches(is_end);
        match plain.to_lowercase().as_str() {
            ".inf" | "+.inf" | "-.inf" | ".nan" => {
                format!("\"{}\"{}", plain.replace('.', ""), &piece[plain.len()..])
            }
            _ => piece.to_owned(),
        }
    };
    text.split_inclusive(is_end).map(word).collect()
}

/// Converts messages to readings, in their order.
pub(crate) struct MessageConverter<'a> {
    mapping: &'a Mapping,
    count: u64,
    pub(crate) notes: LimitNotes,
    pub(crate) times: TimeReader<'a>,
    /// Number of messages that are cut off, or other than LaserScan and Range.
    pub(crate) others: u64,
}

impl<'a> MessageConverter<'a> {
    /// # Errors
    /// Returns an error for an invalid UTC offset in the mapping.
    pub(crate) fn new(mapping: &'a Mapping, started: Timestamp) -> Result<Self, ImportError> {
        let times = TimeReader::new(mapping, started)?;
        Ok(Self { mapping, count: 0, notes: LimitNotes::default(), times, others: 0 })
    }

    /// # Errors
    /// Returns an error for a message without valid angles.
    pub(crate) fn read(&mut self, message: &Value) -> Result<Vec<ImportedReading>, ImportError> {
        self.count += 1;
        let place = FileLocation::Entry { object: self.count, number: None };
        let Some(message) = unwrap_published(message) else {
            self.others += 1;
            return Ok(Vec::new());
        };
        let number = |names: &[&str]| names.iter().find_map(|name| float(message.get(*name)?));
        let limit = |names: &[&str], default| number(names).unwrap_or(default);
        let limits = Limits {
            min: limit(&["range_min", "min_range"], 0.0),
            max: limit(&["range_max", "max_range"], f64::INFINITY),
        };
        let time = match stamp_s(message) {
            Some(_) if nanoseconds(message) >= MIN_CLOCK_NS => {
                Timestamp::from_nanosecond(nanoseconds(message)).ok()
            }
            Some(seconds) => {
                let time = self.times.number(None, seconds);
                Some(time.map_err(|(what, help)| ImportError::at(place, what, help))?)
            }
            None => None,
        };
        let topic_scan = self.count.to_string();
        let beams = message.get("ranges").and_then(Value::as_array);
        if let Some(ranges) = beams {
            self.notes.add_scan(ScanAngles {
                first_rad: number(&["angle_min"]).unwrap_or(0.0),
                step_rad: number(&["angle_increment"]).unwrap_or(0.0),
                max_rad: number(&["angle_max"]),
                beams: ranges.len(),
            });
            self.notes.add_nulls(ranges.iter().filter(|range| range.is_null()).count());
        }
        let mut convert = |number: Option<u64>,
                           direction_deg: f64,
                           range: f64,
                           delay_s: f64,
                           scan: Option<&str>| {
            let class = limits.classify(range, self.mapping, &mut self.notes);
            let (status, range) = match class {
                RangeClass::Invalid => return None,
                RangeClass::NoRange(status) => (status, None),
                RangeClass::Echo(range) => (PingStatus::Echo, Some(range)),
            };
            let sense = if self.mapping.clockwise { -1.0 } else { 1.0 };
            let delay_ns = (delay_s * 1e9).round();
            Some(ImportedReading {
                location: FileLocation::Entry { object: self.count, number },
                direction_deg: self.mapping.zero_deg + sense * direction_deg,
                is_bearing: false,
                status,
                range_m: range.map(|range| range * self.mapping.metres()),
                tof_us: None,
                time: time.and_then(|time| {
                    let time_ns = time.as_nanosecond().saturating_add(delay_ns as i128);
                    Timestamp::from_nanosecond(time_ns).ok()
                }),
                scan: scan.map(str::to_owned),
                position_m: None,
                heading_deg: None,
                air: None,
                raw: RawReading { direction: direction_deg, range },
            })
        };
        if let Some(ranges) = beams {
            let need = |name: &str| {
                number(&[name]).filter(|number| number.is_finite()).ok_or_else(|| {
                    ImportError::at(
                        place,
                        format!("the LaserScan has no valid `{name}`"),
                        "give complete messages, with angle_min, angle_increment and ranges",
                    )
                })
            };
            let (first_rad, step_rad) = (need("angle_min")?, need("angle_increment")?);
            let time_increment_s =
                number(&["time_increment"]).filter(|s| s.is_finite()).unwrap_or(0.0);
            let readings = (0_u32..).zip(ranges).filter_map(|(beam, range)| {
                let beam_at = f64::from(beam);
                let direction_deg = plain_deg(first_rad + beam_at * step_rad);
                let range = if range.is_null() { Some(f64::INFINITY) } else { float(range) };
                let range = range.unwrap_or(f64::NAN);
                convert(
                    Some(u64::from(beam) + 1),
                    direction_deg,
                    range,
                    beam_at * time_increment_s,
                    Some(&topic_scan),
                )
            });
            return Ok(readings.collect());
        }
        let range = number(&["range"]).unwrap_or(f64::NAN);
        let azimuth_deg = self.mapping.azimuth_deg.unwrap_or(0.0);
        Ok(convert(None, azimuth_deg, range, 0.0, None).into_iter().collect())
    }
}

/// Converts an angle to degrees, rounded to the few digits that were printed.
fn plain_deg(angle_rad: f64) -> f64 {
    (angle_rad.to_degrees() * 1e4).round() / 1e4
}

/// Returns the message, unwrapped from a rosbridge publication and other wrappers.
fn unwrap_published(value: &Value) -> Option<&Value> {
    let is_message = |value: &Value| value.get("ranges").is_some() || value.get("range").is_some();
    let mut value = value;
    for _ in 0..=MAX_WRAPPERS {
        if is_message(value) {
            return Some(value);
        }
        value = ["msg", "message", "data", "scan"].iter().find_map(|name| value.get(*name))?;
    }
    None
}

/// Maximum number of objects around a message.
const MAX_WRAPPERS: usize = 3;

/// Parses a number that may be a text: YAML and rosbridge use `.inf`, `inf` and `"Infinity"`.
fn float(value: &Value) -> Option<f64> {
    match value {
        Value::Number(number) => number.as_f64(),
        Value::String(text) => match text.to_lowercase().trim_start_matches(['.', '+']) {
            "inf" | "infinity" => Some(f64::INFINITY),
            "-inf" | "-.inf" | "-infinity" => Some(f64::NEG_INFINITY),
            "nan" => Some(f64::NAN),
            plain => plain.parse().ok(),
        },
        _ => None,
    }
}

/// Returns the time stamp of the message header, seconds; `None` if the message has none or 0.
fn stamp_s(message: &Value) -> Option<f64> {
    let nanoseconds = nanoseconds(message);
    (nanoseconds != 0).then_some(nanoseconds as f64 * 1e-9)
}

/// Nanoseconds since 1970 below which a stamp counts from the start of a board or a simulation.
const MIN_CLOCK_NS: i128 = MIN_CLOCK_S as i128 * 1_000_000_000;

/// Returns the time stamp of the message header, nanoseconds; 0 if the message has none.
fn nanoseconds(message: &Value) -> i128 {
    let stamp = message.get("header").and_then(|header| header.get("stamp"));
    let part = |names: [&str; 2]| names.iter().find_map(|name| stamp?.get(*name)?.as_i64());
    let seconds = part(["sec", "secs"]).unwrap_or(0);
    let nanoseconds = part(["nanosec", "nsecs"]).unwrap_or(0);
    i128::from(seconds) * 1_000_000_000 + i128::from(nanoseconds)
}

/// Returns `true` for a Range message, which has no direction.
pub(crate) fn is_range(message: &Value) -> bool {
    unwrap_published(message).is_some_and(|message| message.get("ranges").is_none())
}
