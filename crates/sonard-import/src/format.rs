//! Registry of formats: one row each drives detection, help, documentation and tests.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{
    FileLocation, ImportError, array_rounds::LogMessage, carmen, player, recording::MAGIC,
};

/// Format of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Format {
    /// Lines of values separated by commas, semicolons, tabs or blanks.
    Csv,
    /// JSON: a list of objects, or one object per line; members are numbers or lists of numbers.
    Json,
    /// ROS LaserScan and Range messages as text: JSON, or YAML as printed by `rostopic echo`.
    RosText,
    /// CARMEN log, with SONAR, ODOM and TRUEPOS lines.
    Carmen,
    /// Player log, with lines of sonars, rangers and positions.
    Player,
    /// ROS 2 recording in MCAP or SQLite.
    Mcap,
}

/// Parses one line of a robot's log; `None` for lines without ranges or a pose.
pub(crate) type ReadLine = fn(FileLocation, &str) -> Result<Option<LogMessage>, ImportError>;

/// Structure of a format, which selects its reader.
#[derive(Debug, Clone, Copy)]
pub(crate) enum FormatKind {
    /// Rows of named or numbered columns.
    Rows,
    /// ROS messages as text.
    RosText,
    /// Messages of one line each, with their parser.
    Lines(ReadLine),
    /// Binary recording of messages.
    Recording,
}

/// Row of the registry.
#[derive(Debug, Clone, Copy)]
pub struct FormatEntry {
    /// Format described by this row.
    pub format: Format,
    /// Name on the command line and in mapping files.
    pub name: &'static str,
    /// Description of the content, for help and documentation.
    pub about: &'static str,
    /// True if `--columns` maps the columns of this format.
    pub has_columns: bool,
    pub(crate) kind: FormatKind,
    /// Detector, given the first bytes and their text if they are text.
    matches: fn(&[u8], &str) -> bool,
}

/// All formats, in the order of detection.
pub const FORMATS: [FormatEntry; 6] = [
    FormatEntry {
        format: Format::Mcap,
        name: "mcap",
        about: "Recording of ROS 2 (MCAP or SQLite) with sensor_msgs/Range or LaserScan",
        has_columns: false,
        kind: FormatKind::Recording,
        matches: |bytes, _| bytes.starts_with(MAGIC),
    },
    FormatEntry {
        format: Format::RosText,
        name: "ros_text",
        about: "LaserScan or Range messages as JSON, or as YAML from `rostopic echo` and `ros2 topic echo`",
        has_columns: false,
        kind: FormatKind::RosText,
        matches: |_, text| is_ros_text(text),
    },
    FormatEntry {
        format: Format::Json,
        name: "json",
        about: "JSON: a list of objects or of lists, or one a line; numbers or lists of numbers in them",
        has_columns: true,
        kind: FormatKind::Rows,
        matches: |_, text| text.trim_start().starts_with(['{', '[']),
    },
    FormatEntry {
        format: Format::Carmen,
        name: "carmen",
        about: "Log of CARMEN (SONAR, ODOM and TRUEPOS lines)",
        has_columns: false,
        kind: FormatKind::Lines(carmen::message),
        matches: |_, text| text.lines().any(is_carmen),
    },
    FormatEntry {
        format: Format::Player,
        name: "player",
        about: "Log of Player 1 to 3 (sonar, ranger, position and position2d)",
        has_columns: false,
        kind: FormatKind::Lines(player::message),
        matches: |_, text| text.lines().any(is_player),
    },
    FormatEntry {
        format: Format::Csv,
        name: "csv",
        about: "Table: lines of values separated by commas, semicolons, tabs, bars or blanks",
        has_columns: true,
        kind: FormatKind::Rows,
        matches: |_, _| true,
    },
];

impl Format {
    /// Returns the format's row of the registry.
    #[must_use]
    pub fn entry(self) -> &'static FormatEntry {
        let found = FORMATS.iter().find(|entry| entry.format == self);
        found.unwrap_or(&FORMATS[FORMATS.len() - 1])
    }

    /// Returns the format with this name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        FORMATS.iter().find(|entry| entry.name == name).map(|entry| entry.format)
    }

    /// Detects the format from the beginning of a file.
    pub(crate) fn detect(bytes: &[u8], text: &str) -> Self {
        let found = FORMATS.iter().find(|entry| (entry.matches)(bytes, text));
        found.map_or(Self::Csv, |entry| entry.format)
    }
}

fn is_carmen(line: &str) -> bool {
    const WORDS: [&str; 5] = ["SONAR ", "ODOM ", "TRUEPOS ", "PARAM ", "# CARMEN"];
    WORDS.iter().any(|word| line.trim_start().starts_with(word))
}

fn is_player(line: &str) -> bool {
    let words: Vec<&str> = line.split_whitespace().take(4).collect();
    let is_interface = |word: &str| player::INTERFACES.contains(&word);
    line.starts_with("## Player")
        || matches!(words[..], [time, _, _, interface] if is_interface(interface) && time.parse::<f64>().is_ok())
}

/// Returns `true` if a text has the members of a LaserScan or Range message, in JSON or YAML.
fn is_ros_text(text: &str) -> bool {
    let has = |name: &str| {
        text.match_indices(name).any(|(at, _)| {
            let before = text[..at].chars().next_back().unwrap_or('\n');
            let after = text[at + name.len()..].trim_start_matches(['"', '\'']).trim_start();
            matches!(before, '"' | '\'' | '\n' | ' ' | '{' | ',') && after.starts_with(':')
        })
    };
    (has("angle_min") && (has("angle_increment") || has("angle_max")) && has("ranges"))
        || (has("radiation_type") && has("min_range") && has("range"))
}

/// Recognized kind of file that contains no importable readings.
struct UnsupportedKind {
    /// Description of the kind, after "the file is".
    what: &'static str,
    /// Advice for the user: conversion, or the command that reads the file.
    help: &'static str,
    matches: fn(&[u8], &str) -> bool,
}

const UNSUPPORTED_KINDS: &[UnsupportedKind] = &[
    UnsupportedKind {
        what: "a ROS 1 recording",
        help: "convert it: `rosbags-convert --src FILE.bag --dst FOLDER --dst-storage mcap`, then import the folder",
        matches: |bytes, _| bytes.starts_with(b"#ROSBAG V"),
    },
    UnsupportedKind {
        what: "a ROS 1 recording of an old version",
        help: "convert it: `rosbag fix FILE.bag NEW.bag` with ROS 1, then `rosbags-convert --src NEW.bag --dst FOLDER --dst-storage mcap`",
        matches: |bytes, _| bytes.starts_with(b"#ROSRECORD") || bytes.starts_with(b"#ROSLOG"),
    },
    UnsupportedKind {
        what: "the description of a ROS 2 recording",
        help: "give the folder that contains it",
        matches: |_, text| text.trim_start().starts_with("rosbag2_bagfile_information:"),
    },
    UnsupportedKind {
        what: "a text in UTF-32",
        help: "save it as UTF-8: `iconv -f UTF-32 -t UTF-8 FILE`",
        matches: |bytes, _| {
            bytes.starts_with(b"\xff\xfe\0\0") || bytes.starts_with(b"\0\0\xfe\xff")
        },
    },
    UnsupportedKind {
        what: "a point cloud (PCD, PLY or LAS)",
        help: "give the readings from which it was made: directions and ranges",
        matches: |bytes, text| {
            let first = text.trim_start().trim_start_matches("# ");
            first.starts_with(".PCD v")
                || text.starts_with("ply\n")
                || text.starts_with("ply\r")
                || bytes.starts_with(b"LASF")
        },
    },
    UnsupportedKind {
        what: "compressed by 7-Zip, RAR or LZ4, or a tar archive",
        help: "unpack it first",
        matches: |bytes, _| {
            let starts = [&b"7z\xbc\xaf\x27\x1c"[..], b"Rar!\x1a\x07", b"\x04\x22\x4d\x18"];
            starts.iter().any(|magic| bytes.starts_with(magic))
                || bytes.get(257..262) == Some(&b"ustar"[..])
        },
    },
    UnsupportedKind {
        what: "a Python pickle",
        help: "write its readings as text: `json.dump(readings, open('FILE.json', 'w'))`",
        matches: |bytes, _| matches!(bytes, [0x80, 2..=5, ..]),
    },
    UnsupportedKind {
        what: "an Arrow or Feather file",
        help: "write it as CSV: python3 -c \"import pandas; pandas.read_feather('FILE').to_csv('FILE.csv', index=False)\"",
        matches: |bytes, _| bytes.starts_with(b"ARROW1"),
    },
    UnsupportedKind {
        what: "a NetCDF file",
        help: "write the readings as text: `ncdump FILE`",
        matches: |bytes, _| bytes.starts_with(b"CDF\x01") || bytes.starts_with(b"CDF\x02"),
    },
    UnsupportedKind {
        what: "a sound recording",
        help: "give ranges or times of flight that were measured in it",
        matches: |bytes, _| {
            (bytes.starts_with(b"RIFF") && bytes.get(8..12) == Some(&b"WAVE"[..]))
                || bytes.starts_with(b"fLaC")
                || bytes.starts_with(b"OggS")
        },
    },
    UnsupportedKind {
        what: "a formatted document (RTF)",
        help: "save it as plain text",
        matches: |bytes, _| bytes.starts_with(b"{\\rtf"),
    },
    UnsupportedKind {
        what: "a web page",
        help: "save the data of its table as CSV",
        matches: |_, text| {
            let start: String = text.trim_start().chars().take(14).collect();
            let start = start.to_lowercase();
            start.starts_with("<!doctype html") || start.starts_with("<html")
        },
    },
    UnsupportedKind {
        what: "an SQLite database, as used by some ROS 2 recordings",
        help: "give the file by name: it cannot be read as a stream",
        matches: |bytes, _| bytes.starts_with(b"SQLite format 3\0"),
    },
    UnsupportedKind {
        what: "a NumPy array",
        help: "write it as text: python3 -c \"import numpy as np; np.savetxt('FILE.csv', np.load('FILE.npy'), delimiter=',')\"",
        matches: |bytes, _| bytes.starts_with(b"\x93NUMPY"),
    },
    UnsupportedKind {
        what: "compressed by gzip",
        help: "unpack it first: `gunzip FILE`",
        matches: |bytes, _| bytes.starts_with(b"\x1f\x8b"),
    },
    UnsupportedKind {
        what: "compressed by Zstandard",
        help: "unpack it first: `zstd -d FILE`",
        matches: |bytes, _| bytes.starts_with(b"\x28\xb5\x2f\xfd"),
    },
    UnsupportedKind {
        what: "compressed by bzip2",
        help: "unpack it first: `bunzip2 FILE`",
        matches: |bytes, _| bytes.starts_with(b"BZh"),
    },
    UnsupportedKind {
        what: "compressed by xz",
        help: "unpack it first: `unxz FILE`",
        matches: |bytes, _| bytes.starts_with(b"\xfd7zXZ\0"),
    },
    UnsupportedKind {
        what: "a spreadsheet",
        help: "save it as CSV in the spreadsheet program",
        matches: |bytes, _| {
            let is_zip = bytes.starts_with(b"PK\x03\x04");
            let has = |name: &[u8]| bytes.windows(name.len()).any(|part| part == name);
            is_zip
                && (has(b"[Content_Types].xml") || has(b"xl/") || has(b"opendocument.spreadsheet"))
                || bytes.starts_with(b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1")
        },
    },
    UnsupportedKind {
        what: "an archive of NumPy arrays (npz)",
        help: "write one of its arrays as text: np.savetxt('FILE.csv', np.load('FILE.npz')['NAME'], delimiter=',')",
        matches: |bytes, _| {
            bytes.starts_with(b"PK\x03\x04")
                && bytes.windows(4).take(200).any(|part| part == b".npy")
        },
    },
    UnsupportedKind {
        what: "a ZIP archive",
        help: "unpack it first: `unzip FILE`",
        matches: |bytes, _| bytes.starts_with(b"PK\x03\x04"),
    },
    UnsupportedKind {
        what: "an HDF5 or MATLAB 7.3 file",
        help: "write the readings as text: in MATLAB `writematrix(x, 'FILE.csv')`",
        matches: |bytes, _| {
            bytes.starts_with(b"\x89HDF") || bytes.starts_with(b"MATLAB 7.3 MAT-file")
        },
    },
    UnsupportedKind {
        what: "a MATLAB file",
        help: "write the readings as text: in MATLAB `writematrix(x, 'FILE.csv')`",
        matches: |bytes, _| bytes.starts_with(b"MATLAB 5.0 MAT-file"),
    },
    UnsupportedKind {
        what: "a Parquet file",
        help: "write it as CSV: python3 -c \"import pandas; pandas.read_parquet('FILE').to_csv('FILE.csv', index=False)\"",
        matches: |bytes, _| bytes.starts_with(b"PAR1"),
    },
    UnsupportedKind {
        what: "a picture or a PDF",
        help: "give readings instead; a map image is read by `sonard scene from-grid`",
        matches: |bytes, _| {
            [&b"\x89PNG"[..], b"\xff\xd8\xff", b"GIF8", b"%PDF-", b"P5\n", b"P5 ", b"P2\n"]
                .iter()
                .any(|magic| bytes.starts_with(magic))
        },
    },
    UnsupportedKind {
        what: "a Gazebo world (SDF)",
        help: "convert it to a scene: `sonard scene from-sdf FILE`",
        matches: |_, text| is_xml(text, "sdf"),
    },
    UnsupportedKind {
        what: "an SVG drawing",
        help: "convert it to a scene: `sonard scene from-svg FILE --width-m M`",
        matches: |_, text| is_xml(text, "svg"),
    },
    UnsupportedKind {
        what: "an XML document",
        help: "give a table, JSON, a log or a recording",
        matches: |_, text| text.trim_start().starts_with("<?xml"),
    },
    UnsupportedKind {
        what: "a Stage world",
        help: "import the log of readings that Player wrote; a floor plan bitmap of the world is read by \
                       `sonard scene from-grid`",
        matches: |_, text| is_stage_world(text),
    },
    UnsupportedKind {
        what: "a map description",
        help: "convert it to a scene: `sonard scene from-grid FILE`",
        matches: |_, text| {
            let has = |key: &str| text.lines().any(|line| line.trim_start().starts_with(key));
            has("image:") && has("resolution:") && has("origin:")
        },
    },
    UnsupportedKind {
        what: "a DXF drawing",
        help: "convert it to a scene: `sonard scene from-dxf FILE`",
        matches: |bytes, text| {
            let mut lines = text.lines().map(str::trim).filter(|line| !line.is_empty());
            bytes.starts_with(b"AutoCAD Binary DXF")
                || (lines.next() == Some("0") && lines.next() == Some("SECTION"))
        },
    },
    UnsupportedKind {
        what: "a sonard scene or sensor",
        help: "give readings; a scene is given with --scene, a sensor with --sensor",
        matches: |_, text| {
            let text = text.trim_start();
            let has = |name: &str| text.contains(&format!("\"{name}\""));
            text.starts_with('{')
                && ((has("walls") && has("materials"))
                    || (has("blanking_us") && has("frequency_hz")))
                && !has("type")
        },
    },
    UnsupportedKind {
        what: "already a sonard log",
        help: "use it directly: `sonard log show FILE`",
        matches: |_, text| {
            text.starts_with("{\"type\":\"session\"") || text.starts_with("{\"type\": \"session\"")
        },
    },
];

fn is_xml(text: &str, root: &str) -> bool {
    let text = text.trim_start();
    let tags = text.split('<').skip(1).find(|tag| !tag.starts_with(['?', '!']));
    text.starts_with('<')
        && tags.is_some_and(|tag| {
            tag.strip_prefix(root)
                .is_some_and(|rest| rest.starts_with([' ', '>', '\n', '\r', '\t', '/']))
        })
}

/// Detects a Stage world, which describes models as `name ( property value ... )`.
fn is_stage_world(text: &str) -> bool {
    const MODELS: [&str; 8] =
        ["floorplan", "position", "window", "pioneer2dx", "map", "ranger", "model", "sensor"];
    let opens = |line: &str| {
        let words: Vec<&str> = line.split_whitespace().take(2).collect();
        let first = words.first().copied().unwrap_or_default();
        let name = first.strip_suffix('(').unwrap_or(first);
        (MODELS.contains(&name)
            && (first.ends_with('(') || words.get(1).is_none_or(|word| *word == "(")))
            || (first == "define" && words.len() == 2)
    };
    let has_bracket = text.split_whitespace().any(|word| word == "(" || word.ends_with("( "));
    (has_bracket || text.contains("(\n")) && text.lines().map(str::trim_start).any(opens)
}

/// Returns an error with advice for a recognized file without importable readings.
pub(crate) fn unsupported(bytes: &[u8], text: &str) -> Option<ImportError> {
    let found = UNSUPPORTED_KINDS.iter().find(|unsupported| (unsupported.matches)(bytes, text))?;
    Some(ImportError::mapping(format!("the file is {}", found.what), found.help))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn registry_is_consistent() {
        for entry in &FORMATS {
            assert_eq!(Format::from_name(entry.name), Some(entry.format));
            assert_eq!(serde_json::to_value(entry.format).expect("a name"), entry.name);
            assert_eq!(FORMATS.iter().filter(|other| other.format == entry.format).count(), 1);
        }
    }

    #[test]
    fn detected_by_content() {
        for (text, format) in [
            ("angle_deg,distance_cm\n0,1\n", Format::Csv),
            ("\n  [{\"a\": 1}]", Format::Json),
            ("[[0, 1.0]]", Format::Json),
            ("# CARMEN Logfile\n", Format::Carmen),
            ("SONAR 2 1 1 1 h 1\n", Format::Carmen),
            ("## Player version 3.0.2\n", Format::Player),
            ("10 h 6665 ranger 00 001 001 0\n", Format::Player),
            ("{\"angle_min\": 0, \"angle_increment\": 1, \"ranges\": []}", Format::RosText),
            (
                "header:\n  seq: 1\nangle_min: 0\nangle_increment: 1\nranges: []\n---\n",
                Format::RosText,
            ),
            (
                "radiation_type: 0\nfield_of_view: 0.1\nmin_range: 0.0\nmax_range: 1\nrange: 1\n",
                Format::RosText,
            ),
            ("{\"angle\": 0, \"ranges\": [1]}", Format::Json),
        ] {
            assert_eq!(Format::detect(text.as_bytes(), text), format, "{text}");
            assert!(unsupported(text.as_bytes(), text).is_none(), "{text}");
        }
    }

    #[test]
    fn rejects_other_files_with_advice() {
        for (bytes, what, advice) in [
            (&b"#ROSBAG V2.0\nE\0"[..], "ROS 1", "rosbags-convert"),
            (b"\x93NUMPY\x01\0", "NumPy", "np.savetxt"),
            (b"\x1f\x8b\x08\0", "gzip", "gunzip"),
            (b"#ROSRECORD V1.1\n", "ROS 1", "rosbag fix"),
            (b"\xff\xfe\0\0a\0\0\0", "UTF-32", "iconv"),
            (b"7z\xbc\xaf\x27\x1c\0\x04", "7-Zip", "unpack"),
            (b"\x80\x04\x95", "pickle", "json.dump"),
            (b"# .PCD v0.7\nVERSION 0.7\n", "point cloud", "ranges"),
            (b"{\\rtf1 0,100}", "RTF", "plain text"),
            (b"<!DOCTYPE html>\n<html>", "web page", "CSV"),
            (b"rosbag2_bagfile_information:\n  version: 5\n", "ROS 2", "folder"),
            (b"PK\x03\x04....[Content_Types].xml", "spreadsheet", "CSV"),
            (b"PK\x03\x04....arr_0.npy", "npz", "savetxt"),
            (b"PK\x03\x04....a.csv", "ZIP", "unzip"),
            (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "spreadsheet", "CSV"),
            (b"\x89PNG\r\n\x1a\n", "picture", "from-grid"),
            (b"SQLite format 3\0", "SQLite", "by name"),
            (b"<?xml version='1.0'?>\n<!-- w --><sdf version='1.6'>", "Gazebo", "from-sdf"),
            (b"<svg xmlns='x'>", "SVG", "from-svg"),
            (
                b"window\n(\n size [ 600 600 ]\n)\nfloorplan\n(\n bitmap \"a.png\"\n)\n",
                "Stage",
                "Player",
            ),
            (b"define pioneer position\n(\n)\nposition ( pose [1 2 0 0] )\n", "Stage", "Player"),
            (b"image: a.pgm\nresolution: 0.05\norigin: [0, 0, 0]\n", "map", "from-grid"),
            (b"  0\nSECTION\n  2\nHEADER\n", "DXF", "from-dxf"),
            (b"{\"type\": \"session\", \"format\": 2}", "sonard log", "log show"),
        ] {
            let text = String::from_utf8_lossy(bytes);
            let error = unsupported(bytes, &text).expect("known");
            let message = format!("{error}; {}", error.help());
            assert!(message.contains(what) && message.contains(advice), "{message}");
        }
    }
}
