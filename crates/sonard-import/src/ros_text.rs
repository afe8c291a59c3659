//! LaserScan and Range messages of ROS as text: JSON, as rosbridge publishes them, or the YAML of `rostopic echo`.
//!
//! A LaserScan is a scan of its own: beam `i` is at `angle_min + i angle_increment`, radians, and its limits hold as in a
//! recording. Range messages are readings of a fixed ranger. Names are those of ROS 1 and 2.

use std::io::Read;

use jiff::Timestamp;
use serde_json::Value;
use sonard_model::reading::PingStatus;

use crate::{
    ImportError, Location, Mapping, Reading, json,
    limits::{LimitNotes, Limits, Told},
    lines::{Ends, Lines},
    reading::Raw,
};

/// A document of more than this is no message, bytes.
const MAX_MESSAGE_BYTES: usize = 16 << 20;

/// The messages of a file, one after the other.
pub(crate) fn messages<'a>(
    source: impl Read + 'a,
    is_json: bool,
) -> Result<Box<dyn Iterator<Item = Result<Value, ImportError>> + 'a>, ImportError> {
    if is_json {
        return json::objects(source);
    }
    let mut lines = Lines::of(source, Ends::Lines);
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
            return Some(yaml(number, first, &text));
        }
    })))
}

/// The number of the first line of a document, its text, and whether the file ends with it.
fn document(lines: &mut Lines<impl Read>) -> Result<(u64, String, bool), ImportError> {
    let (mut first, mut text) = (0, String::new());
    for line in lines.by_ref() {
        let line = line?;
        if line.text.trim_end() == "---" {
            return Ok((first, text, false));
        }
        if first == 0 {
            first = line.number;
        }
        // Between messages `rostopic echo` may warn.
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
    let place = Location::Entry { object: number, number: None };
    // `ros2 topic echo` shortens long lists unless it is told not to.
    let is_shortened = text.lines().any(|line| matches!(line.trim(), "- '...'" | "- ..." | "..."));
    if is_shortened {
        return Err(ImportError::at(
            place,
            "its list is shortened to `...`",
            "print whole lists: `ros2 topic echo --full-length TOPIC`",
        ));
    }
    parse_yaml(&with_words(text)).map_err(|error| {
        let what = format!("no YAML from line {first_line} on: {error}");
        ImportError::at(place, what, "messages are separated by lines `---`")
    })
}

#[cfg(feature = "texts")]
fn parse_yaml(text: &str) -> Result<Value, String> {
    serde_saphyr::from_str(text).map_err(|error| error.to_string())
}

#[cfg(not(feature = "texts"))]
fn parse_yaml(_: &str) -> Result<Value, String> {
    Err("this build has no reader for it; convert it with `sonard import`".to_owned())
}

/// YAML's infinities and NaN as texts, which JSON can hold.
fn with_words(text: &str) -> String {
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

/// Reads the readings of messages, in their order.
pub(crate) struct Reader<'a> {
    mapping: &'a Mapping,
    count: u64,
    pub(crate) notes: LimitNotes,
    /// Messages that are neither a LaserScan nor a Range.
    pub(crate) others: u64,
}

impl<'a> Reader<'a> {
    pub(crate) fn new(mapping: &'a Mapping) -> Self {
        Self { mapping, count: 0, notes: LimitNotes::default(), others: 0 }
    }

    /// # Errors
    /// A message whose numbers are none.
    pub(crate) fn read(&mut self, message: &Value) -> Result<Vec<Reading>, ImportError> {
        self.count += 1;
        let place = Location::Entry { object: self.count, number: None };
        let Some(message) = inner(message) else {
            self.others += 1;
            return Ok(Vec::new());
        };
        let number = |names: &[&str]| names.iter().find_map(|name| float(message.get(*name)?));
        let limit = |names: &[&str], otherwise| number(names).unwrap_or(otherwise);
        let limits = Limits {
            least: limit(&["range_min", "min_range"], 0.0),
            most: limit(&["range_max", "max_range"], f64::INFINITY),
        };
        let time = time(message);
        let topic_scan = self.count.to_string();
        let mut one = |number: Option<u64>,
                       direction_deg: f64,
                       range: f64,
                       later_s: f64,
                       scan: Option<&str>| {
            let told = limits.tell(range, self.mapping, &mut self.notes);
            let (status, range) = match told {
                Told::Nothing => return None,
                Told::Without(status) => (status, None),
                Told::Echo(range) => (PingStatus::Echo, Some(range)),
            };
            let sense = if self.mapping.clockwise { -1.0 } else { 1.0 };
            let later_ns = (later_s * 1e9).round();
            Some(Reading {
                place: Location::Entry { object: self.count, number },
                direction_deg: self.mapping.zero_deg + sense * direction_deg,
                is_bearing: false,
                status,
                range_m: range.map(|range| range * self.mapping.metres()),
                tof_us: None,
                time: time.and_then(|time| {
                    Timestamp::from_nanosecond(time.as_nanosecond() + later_ns as i128).ok()
                }),
                scan: scan.map(str::to_owned),
                place_m: None,
                heading_deg: None,
                air: None,
                raw: Raw { direction: direction_deg, range },
            })
        };
        if let Some(ranges) = message.get("ranges").and_then(Value::as_array) {
            let need = |name: &str| {
                number(&[name]).filter(|number| number.is_finite()).ok_or_else(|| {
                    ImportError::at(
                        place,
                        format!("`{name}` is no number"),
                        "give a whole LaserScan",
                    )
                })
            };
            let (first_rad, step_rad) = (need("angle_min")?, need("angle_increment")?);
            let apart_s = number(&["time_increment"]).filter(|s| s.is_finite()).unwrap_or(0.0);
            let readings = (0_u32..).zip(ranges).filter_map(|(beam, range)| {
                let beam_at = f64::from(beam);
                let direction_deg = plain_deg(first_rad + beam_at * step_rad);
                let range = float(range).unwrap_or(f64::NAN);
                one(
                    Some(u64::from(beam) + 1),
                    direction_deg,
                    range,
                    beam_at * apart_s,
                    Some(&topic_scan),
                )
            });
            return Ok(readings.collect());
        }
        let range = number(&["range"]).unwrap_or(f64::NAN);
        let azimuth_deg = self.mapping.azimuth_deg.unwrap_or(0.0);
        Ok(one(None, azimuth_deg, range, 0.0, None).into_iter().collect())
    }
}

/// Degrees of an angle that was printed with few digits.
fn plain_deg(angle_rad: f64) -> f64 {
    (angle_rad.to_degrees() * 1e4).round() / 1e4
}

/// The message itself, where it stands within a published one.
fn inner(value: &Value) -> Option<&Value> {
    let is_message = |value: &&Value| value.get("ranges").is_some() || value.get("range").is_some();
    let inner = ["msg", "message", "data", "scan"].iter().find_map(|name| value.get(*name));
    Some(value).filter(is_message).or_else(|| inner.filter(is_message))
}

/// A number, also as a text: YAML and rosbridge have `.inf`, `inf` and `"Infinity"`.
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

/// The stamp of a message's header.
fn time(message: &Value) -> Option<Timestamp> {
    let stamp = message.get("header")?.get("stamp")?;
    let part = |names: [&str; 2]| names.iter().find_map(|name| stamp.get(*name)?.as_i64());
    let seconds = part(["sec", "secs"])?;
    let nanoseconds = part(["nanosec", "nsecs"]).unwrap_or(0);
    let time = i128::from(seconds) * 1_000_000_000 + i128::from(nanoseconds);
    Timestamp::from_nanosecond(time).ok().filter(|time| time.as_second() > 0)
}

/// Checks whether each message is of a ranger that turns.
pub(crate) fn is_scan(message: &Value) -> bool {
    inner(message).is_some_and(|message| message.get("ranges").is_some())
}
