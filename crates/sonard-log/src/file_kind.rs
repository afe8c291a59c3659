//! Detection of file kinds by their first bytes, for error messages about wrong files and to
//! distinguish earlier outputs from other data.

use std::fmt;

use serde_json::{Map, Value};
use sonard_records::decode_line;

/// Number of bytes that [`FileKind`] examines at the start of a file.
pub const HEAD_BYTES: usize = 1 << 16;

/// Kind of a file, detected by its first bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileKind {
    /// File without content.
    Empty,
    /// Log of `sonard`.
    Log,
    /// Scene in JSON.
    Scene,
    /// Sensor data in JSON.
    Sensor,
    /// Array data in JSON.
    Array,
    /// Other JSON objects, one per line.
    JsonLines,
    /// Other JSON document.
    Json,
    /// PNG image.
    Png,
    /// SVG image.
    Svg,
    /// PGM image, for instance of an occupancy grid.
    Pgm,
    /// Description of an occupancy grid in YAML.
    MapYaml,
    /// TOML, for instance a plan or a configuration.
    Toml,
    /// Comma-separated values.
    Csv,
    /// File compressed with gzip.
    Gzip,
    /// Other compressed file or archive.
    Compressed,
    /// MCAP recording.
    Mcap,
    /// Parquet table.
    Parquet,
    /// ROS 1 bag.
    RosBag,
    /// `SQLite` database, for instance of a ROS 2 bag.
    Sqlite,
    /// PDF document.
    Pdf,
    /// Other text file.
    Text,
    /// Other binary data.
    Binary,
}

/// Magic bytes of binary formats.
const SIGNATURES: [(&[u8], FileKind); 15] = [
    (b"\x89PNG\r\n\x1a\n", FileKind::Png),
    (b"\x1f\x8b", FileKind::Gzip),
    (b"\x28\xb5\x2f\xfd", FileKind::Compressed),
    (b"\xfd7zXZ\0", FileKind::Compressed),
    (b"BZh", FileKind::Compressed),
    (b"PK\x03\x04", FileKind::Compressed),
    (b"\x04\x22\x4d\x18", FileKind::Compressed),
    (b"\x89MCAP0\r\n", FileKind::Mcap),
    (b"PAR1", FileKind::Parquet),
    (b"#ROSBAG V", FileKind::RosBag),
    (b"SQLite format 3\0", FileKind::Sqlite),
    (b"%PDF-", FileKind::Pdf),
    (b"P5\n", FileKind::Pgm),
    (b"P5 ", FileKind::Pgm),
    (b"P5\r", FileKind::Pgm),
];

/// Prefix of every record.
const RECORD_PREFIX: &str = r#"{"type":""#;

impl FileKind {
    /// Detects the kind of a file by its first [`HEAD_BYTES`] bytes, or all of a shorter file.
    #[must_use]
    pub fn detect(head: &[u8]) -> Self {
        let head = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head);
        if head.is_empty() {
            return Self::Empty;
        }
        // Any valid record identifies a log, even after a damaged start.
        if head.split(|&byte| byte == b'\n').any(|line| decode_line(line).is_ok()) {
            return Self::Log;
        }
        if let Some((_, kind)) = SIGNATURES.iter().find(|(magic, _)| head.starts_with(magic)) {
            return *kind;
        }
        match text_of(head) {
            Some(text) => kind_of_text(text),
            None => Self::Binary,
        }
    }

    /// Returns `true` if the file cannot be a log, not even a damaged one.
    #[must_use]
    pub const fn cannot_be_log(self) -> bool {
        !matches!(
            self,
            Self::Empty | Self::Log | Self::JsonLines | Self::Text | Self::Csv | Self::Binary
        )
    }

    /// Remedy for a file of this kind where a log is expected.
    #[must_use]
    pub const fn help_for_log(self) -> &'static str {
        match self {
            Self::Gzip => "unpack it: zcat FILE | sonard ... -",
            Self::Compressed => "unpack it first",
            Self::Scene => "use --scene for it; logs are written by `sonard scan` or `simulate`",
            Self::Sensor => "use --sensor for it; logs are written by `sonard scan` or `simulate`",
            Self::Array => "use --array for it; logs are written by `sonard scan` or `simulate`",
            Self::Empty => "the file is empty; name a log written by `sonard scan`",
            _ => {
                "name a log written by `sonard scan` or `sonard simulate`: one JSON object per line"
            }
        }
    }
}

impl fmt::Display for FileKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Empty => "an empty file",
            Self::Log => "a log",
            Self::Scene => "a scene (JSON)",
            Self::Sensor => "a sensor's data (JSON)",
            Self::Array => "an array's data (JSON)",
            Self::JsonLines => "JSON lines that are not records of a log",
            Self::Json => "JSON, but not a log, scene, sensor or array",
            Self::Png => "a PNG image",
            Self::Svg => "an SVG image",
            Self::Pgm => "a PGM image",
            Self::MapYaml => "a map's description (YAML)",
            Self::Toml => "TOML, like a plan or a configuration",
            Self::Csv => "a table of comma-separated values",
            Self::Gzip => "compressed with gzip",
            Self::Compressed => "compressed",
            Self::Mcap => "an MCAP recording",
            Self::Parquet => "a table in Parquet",
            Self::RosBag => "a ROS bag",
            Self::Sqlite => "an SQLite database (a ROS 2 bag?)",
            Self::Pdf => "a PDF",
            Self::Text => "text, but not a log",
            Self::Binary => "binary data",
        })
    }
}

/// Decodes text, without a character that is cut off at the end; `None` for binary data.
fn text_of(head: &[u8]) -> Option<&str> {
    let text = match std::str::from_utf8(head) {
        Ok(text) => text,
        Err(error) if error.error_len().is_none() => {
            std::str::from_utf8(head.get(..error.valid_up_to())?).ok()?
        }
        Err(_) => return None,
    };
    let control = |c: char| c.is_control() && !c.is_whitespace() && c != '\u{1b}';
    (!text.contains(control)).then_some(text)
}

fn kind_of_text(text: &str) -> FileKind {
    let text = text.trim_start();
    let first = text.lines().next().unwrap_or_default();
    // First record longer than the examined bytes, or torn.
    if text.starts_with(RECORD_PREFIX) || RECORD_PREFIX.starts_with(text) {
        return FileKind::Log;
    }
    if text.starts_with(['{', '[']) && !first.trim_end().ends_with(']') {
        return kind_of_json(text, first);
    }
    if text.starts_with('<') {
        return if text.contains("<svg") { FileKind::Svg } else { FileKind::Text };
    }
    if first.starts_with("image:") {
        return FileKind::MapYaml;
    }
    let mut lines = text.lines().map(str::trim);
    let mut content = lines.clone().filter(|line| !line.is_empty() && !line.starts_with('#'));
    let is_table = |line: &str| line.starts_with('[') && line.ends_with(']');
    let is_key = |line: &str| {
        let key = line.split_once('=').map(|(key, _)| key.trim());
        key.is_some_and(|key| {
            !key.is_empty() && key.chars().all(|c| c.is_alphanumeric() || "_-.\"".contains(c))
        })
    };
    if content.next().is_some_and(|line| is_table(line) || is_key(line)) {
        return FileKind::Toml;
    }
    let commas = first.matches(',').count();
    if commas > 0 && lines.nth(1).is_none_or(|line| line.matches(',').count() == commas) {
        return FileKind::Csv;
    }
    FileKind::Text
}

fn kind_of_json(text: &str, first: &str) -> FileKind {
    if first.len() < text.trim_end().len()
        && serde_json::from_str::<Map<String, Value>>(first).is_ok()
    {
        return FileKind::JsonLines;
    }
    // The text may be incomplete, so keys are matched instead of parsing it.
    let has = |name: &str| text.contains(&format!("\"{name}\""));
    match () {
        () if has("walls") || has("materials") => FileKind::Scene,
        () if has("rangers") => FileKind::Array,
        () if has("frequency_hz") => FileKind::Sensor,
        () if serde_json::from_str::<Value>(first).is_ok() => FileKind::JsonLines,
        () => FileKind::Json,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOG: &[u8] = include_bytes!("../../../tests/fixtures/small.jsonl");

    #[track_caller]
    fn check(head: impl AsRef<[u8]>, kind: FileKind) {
        let head = head.as_ref();
        assert_eq!(
            FileKind::detect(head),
            kind,
            "{:?}",
            String::from_utf8_lossy(&head[..head.len().min(80)])
        );
    }

    #[test]
    fn detects_each_kind() {
        check("", FileKind::Empty);
        check(LOG, FileKind::Log);
        check(include_bytes!("../../../scenes/mcgill-lab.json"), FileKind::Scene);
        check(include_bytes!("../../../sensors/senscomp-6500.json"), FileKind::Sensor);
        check(include_bytes!("../../../arrays/ring-12.json"), FileKind::Array);
        check(include_bytes!("../../../docs/pictures/simple-room-fig9.png"), FileKind::Png);
        check(include_bytes!("../../../docs/wiring/wiring.svg"), FileKind::Svg);
        check(include_bytes!("../../../config/sonard.toml"), FileKind::Toml);
        check("[plan]\nname = 1\n", FileKind::Toml);
        check("P5\n4 4\n255\n\0\0", FileKind::Pgm);
        check("image: map.pgm\nresolution: 0.05\n", FileKind::MapYaml);
        check("x,y,deg\n1,2,3\n", FileKind::Csv);
        check("{\"pose\":1}\n{\"pose\":2}\n", FileKind::JsonLines);
        check("{\"a\": [1,\n 2]}", FileKind::Json);
        check("\x1f\u{8}".as_bytes(), FileKind::Binary);
        check(b"\x1f\x8b\x08\0\0", FileKind::Gzip);
        check(b"\x89MCAP0\r\n\x01\x2a", FileKind::Mcap);
        check(b"PAR1\x15\x04\x15", FileKind::Parquet);
        check(b"#ROSBAG V2.0\nE\0\0\0", FileKind::RosBag);
        check(b"SQLite format 3\0\x10\0", FileKind::Sqlite);
        check("Dear log,\ntoday nothing.\n", FileKind::Text);
        check([7_u8; 300], FileKind::Binary);
        check(b"text that is cut in a char \xc3", FileKind::Text);
    }

    #[test]
    fn damaged_start_of_a_log() {
        check([&[0; 4096][..], b"\n", LOG].concat(), FileKind::Log);
        check([&b"PK\x03\x04 garbage\n"[..], LOG].concat(), FileKind::Log);
        for length in 1..200 {
            assert!(!FileKind::detect(&LOG[..length]).cannot_be_log(), "{length} bytes");
        }
    }
}
