//! Encoding and decoding of log lines: one record per line.

use std::{borrow::Cow, fmt};

use serde::{Deserialize, de::DeserializeOwned};
use thiserror::Error;

use super::{LOG_FORMAT, PathRecord, Point, Record};

/// Maximum length of a line, bytes. A record with 65535 echo times fits.
pub const MAX_LINE_BYTES: usize = 1 << 20;

/// Kind of an error in a log line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum RecordErrorKind {
    /// Blank line without a record.
    Empty,
    /// Line longer than [`MAX_LINE_BYTES`].
    TooLong,
    /// Invalid UTF-8, or NUL bytes.
    NotText,
    /// Text that is not a JSON object.
    NotJson,
    /// JSON object without a string `type`.
    NoType,
    /// JSON object with an unknown `type`.
    UnknownType,
    /// Record with a missing field or a field of the wrong type.
    BadField,
    /// Session of a log format other than [`LOG_FORMAT`].
    UnsupportedFormat,
    /// Incomplete last line, truncated within the record.
    Truncated,
}

/// Error of a line that is not a valid record.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub struct RecordError {
    /// Kind of the error.
    pub kind: RecordErrorKind,
    /// Byte position on the line, from 1, where the error was detected, if it has a position.
    pub column: Option<usize>,
    /// Path of the field, such as `sim.path.interactions[2]`.
    pub field: Option<String>,
    /// Description of the error and the expected form.
    pub message: String,
}

impl fmt::Display for RecordError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(column) = self.column {
            write!(f, "column {column}: ")?;
        }
        if let Some(field) = &self.field {
            write!(f, "{field}: ")?;
        }
        f.write_str(&self.message)
    }
}

impl RecordError {
    /// Returns `true` if the line is a complete JSON object with a `type`, which another version of
    /// the program may support.
    #[must_use]
    pub fn is_complete_object(&self) -> bool {
        use RecordErrorKind as Kind;
        matches!(self.kind, Kind::UnknownType | Kind::BadField | Kind::UnsupportedFormat)
    }
}

/// Error of a record that cannot be encoded.
#[derive(Debug, Error)]
pub enum EncodeError {
    /// Non-finite number in a field that may not be `null`.
    #[error("{field} is {value}: it must be a finite number")]
    NotFinite {
        /// Name of the field.
        field: &'static str,
        /// Value that is not finite.
        value: f64,
    },
    /// Record longer than a line may be.
    #[error("the record is {0} bytes long; a line has at most {MAX_LINE_BYTES}")]
    TooLong(usize),
    /// Map with a key that JSON does not support.
    #[error("the record can't be written as JSON: {0}")]
    Json(#[from] serde_json::Error),
}

/// Appends one record and a newline to `line`.
///
/// # Errors
/// If a number that may not be `null` is not finite, or the line is too long. `line` is then
/// unchanged.
pub fn encode_line(record: &Record, line: &mut Vec<u8>) -> Result<(), EncodeError> {
    if let Some((field, value)) = first_not_finite(record) {
        return Err(EncodeError::NotFinite { field, value });
    }
    let before = line.len();
    let result = serde_json::to_writer(&mut *line, record).map_err(EncodeError::from);
    let length = line.len() - before;
    let result = match result {
        Ok(()) if length > MAX_LINE_BYTES => Err(EncodeError::TooLong(length)),
        other => other,
    };
    match result {
        Ok(()) => line.push(b'\n'),
        Err(_) => line.truncate(before),
    }
    result
}

/// Decodes one line, without its newline. A carriage return at its end is ignored.
///
/// # Errors
/// Names the position on the line, the field, and the expected form.
pub fn decode_line(bytes: &[u8]) -> Result<Record, RecordError> {
    let bytes = bytes.strip_suffix(b"\r").unwrap_or(bytes);
    let text = as_text(bytes)?;
    let tag: Tag = serde_json::from_str(text).map_err(|error| tag_fault(text, &error))?;
    match &*tag.kind {
        "session" => decode_session(text),
        "scan_start" => decode_fields(text).map(Record::ScanStart),
        "ping" => decode_fields(text).map(Record::Ping),
        "scan_end" => decode_fields(text).map(Record::ScanEnd),
        "event" => decode_fields(text).map(Record::Event),
        other => Err(RecordError {
            kind: RecordErrorKind::UnknownType,
            column: None,
            field: Some("type".into()),
            message: format!(
                "unknown type {other:?}: expected session, scan_start, ping, scan_end or event"
            ),
        }),
    }
}

/// Type tag common to all records.
#[derive(Deserialize)]
struct Tag<'a> {
    #[serde(rename = "type", borrow)]
    kind: Cow<'a, str>,
}

fn as_text(bytes: &[u8]) -> Result<&str, RecordError> {
    let fault =
        |kind, column, message: String| Err(RecordError { kind, column, field: None, message });
    if bytes.trim_ascii().is_empty() {
        return fault(
            RecordErrorKind::Empty,
            None,
            "empty line: expected one record per line".into(),
        );
    }
    if let Some(at) = bytes.iter().position(|&byte| byte == 0) {
        let count = bytes.iter().filter(|&&byte| byte == 0).count();
        let message =
            format!("{count} NUL byte(s): space reserved but not written before a power failure");
        return fault(RecordErrorKind::NotText, Some(at + 1), message);
    }
    match std::str::from_utf8(bytes) {
        // serde would accept an array for a struct.
        Ok(text) if !text.trim_start().starts_with('{') => {
            fault(RecordErrorKind::NotJson, Some(1), "expected a JSON object, { ... }".into())
        }
        Ok(text) => Ok(text),
        Err(error) => {
            let at = error.valid_up_to();
            let message = format!("byte 0x{:02x} is not UTF-8", bytes[at]);
            fault(RecordErrorKind::NotText, Some(at + 1), message)
        }
    }
}

/// Distinguishes damaged JSON from a complete object without a usable `type`.
fn tag_fault(text: &str, error: &serde_json::Error) -> RecordError {
    if serde_json::from_str::<serde::de::IgnoredAny>(text).is_ok() {
        return RecordError {
            kind: RecordErrorKind::NoType,
            column: None,
            field: Some("type".into()),
            message: format!("{}: expected \"type\":\"ping\" or another record", plain(error)),
        };
    }
    let message = match error.classify() {
        serde_json::error::Category::Eof => "the JSON object is not closed".into(),
        _ => plain(error),
    };
    RecordError {
        kind: RecordErrorKind::NotJson,
        column: Some(error.column()),
        field: None,
        message,
    }
}

/// Decodes a session. The format is checked first, because fields of another format may differ.
fn decode_session(text: &str) -> Result<Record, RecordError> {
    #[derive(Deserialize)]
    struct Version {
        format: u64,
        #[serde(default)]
        sonard: String,
    }
    match serde_json::from_str(text) {
        Ok(Version { format, sonard }) if format != u64::from(LOG_FORMAT) => {
            let writer =
                if sonard.is_empty() { "its writer".into() } else { format!("sonard {sonard}") };
            Err(RecordError {
                kind: RecordErrorKind::UnsupportedFormat,
                column: None,
                field: Some("format".into()),
                message: format!(
                    "log format {format} is not supported, only format {LOG_FORMAT}: read the log with the version that \
                     wrote it, {writer}"
                ),
            })
        }
        _ => decode_fields(text).map(Record::Session),
    }
}

/// Decodes a record's fields. The path of an error is tracked only in a second pass after a
/// failure.
fn decode_fields<T: DeserializeOwned>(text: &str) -> Result<T, RecordError> {
    serde_json::from_str(text).or_else(|_| {
        let mut json = serde_json::Deserializer::from_str(text);
        serde_path_to_error::deserialize(&mut json).map_err(|error| {
            let path = error.path().to_string();
            let error = error.inner();
            RecordError {
                kind: RecordErrorKind::BadField,
                column: Some(error.column()),
                field: (path != ".").then_some(path),
                message: plain(error),
            }
        })
    })
}

/// Message without serde_json's position, which counts lines within the line.
fn plain(error: &serde_json::Error) -> String {
    let text = error.to_string();
    let position = format!(" at line {} column {}", error.line(), error.column());
    text.strip_suffix(&position).unwrap_or(&text).to_owned()
}

/// First required number that is not finite.
fn first_not_finite(record: &Record) -> Option<(&'static str, f64)> {
    let numbers: &[(&'static str, f64)] = match record {
        Record::Session(session) => {
            let air = session.air;
            &[
                ("air.temperature_c", air.temperature_c),
                ("air.humidity_percent", air.humidity_percent),
                ("air.pressure_kpa", air.pressure_kpa),
                ("air.sound_speed_m_s", air.sound_speed_m_s),
                ("sensor.frequency_hz", session.sensor.frequency_hz),
                ("sensor.blanking_us", session.sensor.blanking_us),
                ("sensor.max_range_m", session.sensor.max_range_m),
                ("sensor.threshold", session.sensor.threshold),
            ]
        }
        Record::ScanStart(start) => &[
            ("pose.x_m", start.pose.x_m),
            ("pose.y_m", start.pose.y_m),
            ("pose.heading_deg", start.pose.heading_deg),
            ("plan.from_deg", start.plan.from_deg),
            ("plan.to_deg", start.plan.to_deg),
            ("plan.step_deg", start.plan.step_deg),
        ],
        Record::Ping(ping) => {
            let length = |path: Option<&PathRecord>| path.map_or(0.0, |path| path.length_m);
            let place = |path: Option<&PathRecord>| {
                let interactions = path.into_iter().flat_map(|path| &path.interactions);
                let is_finite =
                    interactions.map(|interaction| interaction.point).all(Point::is_finite);
                if is_finite { 0.0 } else { f64::NAN }
            };
            let path = ping.path.as_ref();
            let sim_path = ping.sim.as_ref().and_then(|sim| sim.path.as_ref());
            &[
                ("azimuth_deg", ping.azimuth_deg),
                ("pose.x_m", ping.pose.map_or(0.0, |pose| pose.x_m)),
                ("pose.y_m", ping.pose.map_or(0.0, |pose| pose.y_m)),
                ("pose.heading_deg", ping.pose.map_or(0.0, |pose| pose.heading_deg)),
                ("path.length_m", length(path)),
                ("path.interactions.point", place(path)),
                ("sim.path.length_m", length(sim_path)),
                ("sim.path.interactions.point", place(sim_path)),
            ]
        }
        Record::ScanEnd(end) => {
            &[("duration_s", end.duration_s), ("acoustic_limit_s", end.acoustic_limit_s)]
        }
        Record::Event(_) => &[],
    };
    numbers.iter().copied().find(|(_, value)| !value.is_finite())
}

#[cfg(test)]
mod tests;
