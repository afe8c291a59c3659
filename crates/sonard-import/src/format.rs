//! Registry of formats: one row each drives detection, help, documentation and tests.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{ImportError, Location, carmen, player, recording::MAGIC, rounds::Message};

/// Format of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Format {
    /// Lines of values separated by commas, semicolons, tabs or blanks.
    Csv,
    /// JSON: a list of objects, or an object a line; numbers or lists of numbers in them.
    Json,
    /// LaserScan and Range messages of ROS as text: JSON, or YAML as `rostopic echo` prints it.
    RosText,
    /// The log of CARMEN.
    Carmen,
    /// The log of Player.
    Player,
    /// A recording of ROS 2.
    Mcap,
}

/// Reads the message of a line of a robot's log, if it is one of ranges or poses.
pub(crate) type ReadLine = fn(Location, &str) -> Result<Option<Message>, ImportError>;

/// Structure of a format, which decides who reads it.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Kind {
    /// Rows of named or numbered columns.
    Rows,
    /// Messages of ROS as text.
    RosText,
    /// A message a line.
    Lines(ReadLine),
    /// Bytes of a recording.
    Recording,
}

/// A row of the registry.
#[derive(Debug, Clone, Copy)]
pub struct FormatEntry {
    /// The format.
    pub format: Format,
    /// Its name on the command line and in mapping files.
    pub name: &'static str,
    /// Content of such files, for the help and the documentation.
    pub about: &'static str,
    /// True if `--columns` gives its columns a meaning.
    pub has_columns: bool,
    pub(crate) kind: Kind,
    /// True if the first bytes, and their text if they are one, are of this format.
    is: fn(&[u8], &str) -> bool,
}

/// The formats, in the order in which they are looked for.
pub const FORMATS: [FormatEntry; 6] = [
    FormatEntry {
        format: Format::Mcap,
        name: "mcap",
        about: "Recording of ROS 2 (MCAP or SQLite) with sensor_msgs/Range or LaserScan",
        has_columns: false,
        kind: Kind::Recording,
        is: |bytes, _| bytes.starts_with(MAGIC),
    },
    FormatEntry {
        format: Format::RosText,
        name: "ros_text",
        about: "LaserScan or Range messages as JSON, or as YAML from `rostopic echo` and `ros2 topic echo`",
        has_columns: false,
        kind: Kind::RosText,
        is: |_, text| is_ros_text(text),
    },
    FormatEntry {
        format: Format::Json,
        name: "json",
        about: "JSON: a list of objects or of lists, or one a line; numbers or lists of numbers in them",
        has_columns: true,
        kind: Kind::Rows,
        is: |_, text| text.trim_start().starts_with(['{', '[']),
    },
    FormatEntry {
        format: Format::Carmen,
        name: "carmen",
        about: "Log of CARMEN (SONAR, ODOM and TRUEPOS lines)",
        has_columns: false,
        kind: Kind::Lines(carmen::message),
        is: |_, text| text.lines().any(is_carmen),
    },
    FormatEntry {
        format: Format::Player,
        name: "player",
        about: "Log of Player 1 to 3 (sonar, ranger, position and position2d)",
        has_columns: false,
        kind: Kind::Lines(player::message),
        is: |_, text| text.lines().any(is_player),
    },
    FormatEntry {
        format: Format::Csv,
        name: "csv",
        about: "Table: lines of values separated by commas, semicolons, tabs, bars or blanks",
        has_columns: true,
        kind: Kind::Rows,
        is: |_, _| true,
    },
];

impl Format {
    /// Its row of the registry.
    #[must_use]
    pub fn entry(self) -> &'static FormatEntry {
        let found = FORMATS.iter().find(|entry| entry.format == self);
        found.unwrap_or(&FORMATS[FORMATS.len() - 1])
    }

    /// The format of that name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        FORMATS.iter().find(|entry| entry.name == name).map(|entry| entry.format)
    }

    /// The format of a file that begins so.
    pub(crate) fn detect(bytes: &[u8], text: &str) -> Self {
        let found = FORMATS.iter().find(|entry| (entry.is)(bytes, text));
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

/// Members of LaserScan beside `ranges`, or of Range beside `range`, as JSON or as YAML writes their names.
fn is_ros_text(text: &str) -> bool {
    let has = |name: &str| {
        text.match_indices(name).any(|(at, _)| {
            let before = text[..at].chars().next_back().unwrap_or('\n');
            let after = text[at + name.len()..].trim_start_matches(['"', '\'']).trim_start();
            matches!(before, '"' | '\'' | '\n' | ' ' | '{' | ',') && after.starts_with(':')
        })
    };
    (has("angle_min") && has("angle_increment") && has("ranges"))
        || (has("radiation_type") && has("min_range") && has("range"))
}

/// A kind of file that is known but holds no readings that can be read here.
struct Foreign {
    /// Name of the kind.
    what: &'static str,
    /// The way in.
    help: &'static str,
    is: fn(&[u8], &str) -> bool,
}

const FOREIGN: &[Foreign] = &[
    Foreign {
        what: "a recording of ROS 1",
        help: "convert it: `rosbags-convert --src FILE.bag --dst FOLDER --dst-storage mcap`, then import the folder",
        is: |bytes, _| bytes.starts_with(b"#ROSBAG V"),
    },
    Foreign {
        what: "an SQLite database, as some recordings of ROS 2 are",
        help: "give the file by its name: it can't be read from its beginning to its end",
        is: |bytes, _| bytes.starts_with(b"SQLite format 3\0"),
    },
    Foreign {
        what: "an array of NumPy",
        help: "write it as text: python3 -c \"import numpy as np; np.savetxt('FILE.csv', np.load('FILE.npy'), delimiter=',')\"",
        is: |bytes, _| bytes.starts_with(b"\x93NUMPY"),
    },
    Foreign {
        what: "compressed by gzip",
        help: "unpack it first: `gunzip FILE`",
        is: |bytes, _| bytes.starts_with(b"\x1f\x8b"),
    },
    Foreign {
        what: "compressed by Zstandard",
        help: "unpack it first: `zstd -d FILE`",
        is: |bytes, _| bytes.starts_with(b"\x28\xb5\x2f\xfd"),
    },
    Foreign {
        what: "compressed by bzip2",
        help: "unpack it first: `bunzip2 FILE`",
        is: |bytes, _| bytes.starts_with(b"BZh"),
    },
    Foreign {
        what: "compressed by xz",
        help: "unpack it first: `unxz FILE`",
        is: |bytes, _| bytes.starts_with(b"\xfd7zXZ\0"),
    },
    Foreign {
        what: "a spreadsheet",
        help: "save it as CSV in the spreadsheet program",
        is: |bytes, _| {
            let is_zip = bytes.starts_with(b"PK\x03\x04");
            let has = |name: &[u8]| bytes.windows(name.len()).any(|part| part == name);
            is_zip
                && (has(b"[Content_Types].xml") || has(b"xl/") || has(b"opendocument.spreadsheet"))
                || bytes.starts_with(b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1")
        },
    },
    Foreign {
        what: "an archive of NumPy arrays (npz)",
        help: "write an array of it as text: np.savetxt('FILE.csv', np.load('FILE.npz')['NAME'], delimiter=',')",
        is: |bytes, _| {
            bytes.starts_with(b"PK\x03\x04")
                && bytes.windows(4).take(200).any(|part| part == b".npy")
        },
    },
    Foreign {
        what: "a ZIP archive",
        help: "unpack it first: `unzip FILE`",
        is: |bytes, _| bytes.starts_with(b"PK\x03\x04"),
    },
    Foreign {
        what: "a file of HDF5 or of MATLAB 7.3",
        help: "write the readings as text: in MATLAB `writematrix(x, 'FILE.csv')`",
        is: |bytes, _| bytes.starts_with(b"\x89HDF") || bytes.starts_with(b"MATLAB 7.3 MAT-file"),
    },
    Foreign {
        what: "a file of MATLAB",
        help: "write the readings as text: in MATLAB `writematrix(x, 'FILE.csv')`",
        is: |bytes, _| bytes.starts_with(b"MATLAB 5.0 MAT-file"),
    },
    Foreign {
        what: "a Parquet file",
        help: "write it as CSV: python3 -c \"import pandas; pandas.read_parquet('FILE').to_csv('FILE.csv', index=False)\"",
        is: |bytes, _| bytes.starts_with(b"PAR1"),
    },
    Foreign {
        what: "a picture or a PDF",
        help: "give the readings, not a picture of them; a map's image goes to `sonard scene from-grid`",
        is: |bytes, _| {
            [&b"\x89PNG"[..], b"\xff\xd8\xff", b"GIF8", b"%PDF-", b"P5\n", b"P5 ", b"P2\n"]
                .iter()
                .any(|magic| bytes.starts_with(magic))
        },
    },
    Foreign {
        what: "a world of Gazebo (SDF)",
        help: "make a scene of it: `sonard scene from-sdf FILE`",
        is: |_, text| is_xml(text, "sdf"),
    },
    Foreign {
        what: "a drawing (SVG)",
        help: "make a scene of it: `sonard scene from-svg FILE --width-m M`",
        is: |_, text| is_xml(text, "svg"),
    },
    Foreign {
        what: "an XML document",
        help: "give a table, JSON, a log or a recording",
        is: |_, text| text.trim_start().starts_with("<?xml"),
    },
    Foreign {
        what: "a world of Stage",
        help: "import the log of readings that Player wrote beside it; a floor plan of it that is a bitmap goes to \
               `sonard scene from-grid`",
        is: |_, text| is_stage_world(text),
    },
    Foreign {
        what: "the description of a map",
        help: "make a scene of it: `sonard scene from-grid FILE`",
        is: |_, text| {
            let has = |key: &str| text.lines().any(|line| line.trim_start().starts_with(key));
            has("image:") && has("resolution:") && has("origin:")
        },
    },
    Foreign {
        what: "a drawing (DXF)",
        help: "make a scene of it: `sonard scene from-dxf FILE`",
        is: |bytes, text| {
            let mut lines = text.lines().map(str::trim).filter(|line| !line.is_empty());
            bytes.starts_with(b"AutoCAD Binary DXF")
                || (lines.next() == Some("0") && lines.next() == Some("SECTION"))
        },
    },
    Foreign {
        what: "a scene or a sensor of this program",
        help: "give readings; a scene goes to --scene, a sensor to --sensor",
        is: |_, text| {
            let text = text.trim_start();
            let has = |name: &str| text.contains(&format!("\"{name}\""));
            text.starts_with('{')
                && ((has("walls") && has("materials"))
                    || (has("blanking_us") && has("frequency_hz")))
                && !has("type")
        },
    },
    Foreign {
        what: "already a log of this program",
        help: "use it as it is: `sonard log show FILE`",
        is: |_, text| {
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

/// Stage describes models by `name ( property value ... )`.
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

/// Names a file that holds no readings which can be read here, and the way in.
pub(crate) fn foreign(bytes: &[u8], text: &str) -> Option<ImportError> {
    let found = FOREIGN.iter().find(|foreign| (foreign.is)(bytes, text))?;
    Some(ImportError::mapping(format!("it is {}", found.what), found.help))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_format_has_one_row_and_its_name_is_that_of_mapping_files() {
        for entry in &FORMATS {
            assert_eq!(Format::named(entry.name), Some(entry.format));
            assert_eq!(serde_json::to_value(entry.format).expect("a name"), entry.name);
            assert_eq!(FORMATS.iter().filter(|other| other.format == entry.format).count(), 1);
        }
    }

    #[test]
    fn files_are_identified_by_their_content() {
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
            assert!(foreign(text.as_bytes(), text).is_none(), "{text}");
        }
    }

    #[test]
    fn files_of_other_kinds_are_named_with_the_way_in() {
        for (bytes, what, way) in [
            (&b"#ROSBAG V2.0\nE\0"[..], "ROS 1", "rosbags-convert"),
            (b"\x93NUMPY\x01\0", "NumPy", "np.savetxt"),
            (b"\x1f\x8b\x08\0", "gzip", "gunzip"),
            (b"PK\x03\x04....[Content_Types].xml", "spreadsheet", "CSV"),
            (b"PK\x03\x04....arr_0.npy", "npz", "savetxt"),
            (b"PK\x03\x04....a.csv", "ZIP", "unzip"),
            (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "spreadsheet", "CSV"),
            (b"\x89PNG\r\n\x1a\n", "picture", "from-grid"),
            (b"SQLite format 3\0", "SQLite", "by its name"),
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
            (b"{\"type\": \"session\", \"format\": 2}", "log of this program", "log show"),
        ] {
            let text = String::from_utf8_lossy(bytes);
            let error = foreign(bytes, &text).expect("known");
            let said = format!("{error}; {}", error.help());
            assert!(said.contains(what) && said.contains(way), "{said}");
        }
    }
}
