//! Errors in a scene file, with their positions.

use std::{error::Error, fmt, ops::Range};

use thiserror::Error;

use super::pose::PoseError;

/// Error in a scene file: position, description and hint.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneError {
    /// Line, counted from 1.
    pub line: usize,
    /// Column in characters, counted from 1.
    pub column: usize,
    /// Byte range of the offending text.
    pub span: Range<usize>,
    /// Path of the value in the document, such as `walls[2].to`; empty for the document itself.
    pub path: String,
    /// Kind of the error.
    pub problem: Box<SceneProblem>,
}

impl SceneError {
    pub(super) fn new(
        text: &str,
        span: Range<usize>,
        path: &impl ToString,
        problem: SceneProblem,
    ) -> Self {
        let (line, column) = line_and_column(text, span.start);
        Self { line, column, span, path: path.to_string(), problem: Box::new(problem) }
    }

    /// Description of the error, with the offending text.
    #[must_use]
    pub fn message(&self) -> String {
        sanitize(&self.problem.to_string())
    }

    /// Hint for correcting the error.
    #[must_use]
    pub fn help(&self) -> String {
        sanitize(&self.problem.help())
    }
}

impl fmt::Display for SceneError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}: ", self.line, self.column)?;
        if !self.path.is_empty() {
            write!(f, "{}: ", sanitize(&self.path))?;
        }
        f.write_str(&self.message())
    }
}

impl Error for SceneError {}

/// Maximum length of a message, characters.
const MAX_SHOWN: usize = 1000;

/// Sanitizes a text for a terminal: escapes control characters and truncates the middle of a long
/// text.
#[must_use]
pub fn sanitize(text: &str) -> String {
    let written = |found: char| {
        let escaped = found.is_control().then(|| found.escape_debug());
        escaped.into_iter().flatten().chain((!found.is_control()).then_some(found))
    };
    if text.len() <= MAX_SHOWN {
        return text.chars().flat_map(written).collect();
    }
    let start = text.chars().take(MAX_SHOWN / 2).flat_map(written);
    let end: String = text.chars().rev().take(MAX_SHOWN / 4).collect();
    start.chain(" [...] ".chars()).chain(end.chars().rev().flat_map(written)).collect()
}

/// Line and column (in characters) of a byte offset, both counted from 1.
pub(super) fn line_and_column(text: &str, offset: usize) -> (usize, usize) {
    let before = &text[..floor_char_boundary(text, offset)];
    let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
    (before.matches('\n').count() + 1, before[line_start..].chars().count() + 1)
}

/// Last character boundary at or before `offset`.
pub(super) fn floor_char_boundary(text: &str, offset: usize) -> usize {
    let offset = offset.min(text.len());
    (0..=offset).rev().find(|at| text.is_char_boundary(*at)).unwrap_or(0)
}

/// Kind of an error in a scene file.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum SceneProblem {
    /// Text that is not valid JSON.
    #[error("this is not JSON: {0}")]
    Syntax(String),
    /// Bracket or brace that is never closed.
    #[error("this `{0}` is never closed")]
    Unclosed(char),
    /// Duplicate member of an object.
    #[error("`{0}` is given twice")]
    DuplicateKey(String),
    /// Unknown field of an object.
    #[error("unknown field `{field}`")]
    UnknownField {
        /// Name of the unknown field.
        field: String,
        /// Fields allowed at that position.
        known: Vec<String>,
    },
    /// Object without a required field.
    #[error("the field `{0}` is missing")]
    MissingField(String),
    /// Value of the wrong type.
    #[error("{0}")]
    Type(String),
    /// Empty or blank name.
    #[error("this name is empty")]
    EmptyName,
    /// Name with a control character, which a terminal would interpret.
    #[error("this name has the character {} in it", .0.escape_debug())]
    ControlCharacter(char),
    /// Pose name that looks like coordinates.
    #[error("the pose name `{0}` contains a comma")]
    CommaInName(String),
    /// Material that is not in `materials`.
    #[error("there is no material `{name}` in this scene")]
    UnknownMaterial {
        /// Name of the unknown material.
        name: String,
        /// Materials of the scene.
        known: Vec<String>,
    },
    /// Two reflectors with the same id.
    #[error("the id `{id}` is already the name of {first}")]
    DuplicateId {
        /// Id that both reflectors have.
        id: String,
        /// Path of the first reflector.
        first: String,
    },
    /// Wall with neither both ends nor a polyline, or with both.
    #[error("{0}")]
    WallShape(&'static str),
    /// Body with neither circle nor outline, or with both.
    #[error("a robot has either a `circle` or an `outline`")]
    RobotShape,
    /// Ranger inside the robot's body.
    #[error("the ranger, at [0, 0], is inside the body or on its surface: no sound could leave")]
    RangerInBody,
    /// Wall whose ends coincide.
    #[error("this wall has no length: it goes from {from:?} to {to:?}")]
    NoLength {
        /// Position of the first end, metres.
        from: [f64; 2],
        /// Position of the second end, metres.
        to: [f64; 2],
    },
    /// Polyline with too few points.
    #[error("{points} points are too few")]
    TooFewPoints {
        /// Actual number of points.
        points: usize,
        /// Minimum number of points.
        needed: usize,
    },
    /// Coordinate out of bounds, or not a number.
    #[error("{value} m is out of bounds")]
    OutOfBounds {
        /// Value outside the range, metres.
        value: f64,
    },
    /// Heading out of bounds.
    #[error("a heading of {0} degrees is out of bounds")]
    Heading(f64),
    /// Radius of zero or less, or too large.
    #[error("a radius of {0} m is not possible")]
    Radius(f64),
    /// Snap tolerance out of bounds.
    #[error("snap_m is {0}")]
    Snap(f64),
    /// Fraction outside 0 to 1.
    #[error("{field} is {value}")]
    Share {
        /// Name of the field.
        field: &'static str,
        /// Value outside the range.
        value: f64,
    },
    /// Upper height not above the lower height.
    #[error("{upper_name} ({upper} m) is not above {lower_name} ({lower} m)")]
    HeightsReversed {
        /// Name of the lower height.
        lower_name: &'static str,
        /// Value of the lower height, metres.
        lower: f64,
        /// Name of the upper height.
        upper_name: &'static str,
        /// Value of the upper height, metres.
        upper: f64,
    },
    /// Material of an absent floor or ceiling; holds the field of the missing height.
    #[error("the scene has no {0}")]
    NoSuchLevel(&'static str),
    /// Named pose that is inaccessible.
    #[error(transparent)]
    Pose(#[from] PoseError),
}

/// Maximum magnitude of a coordinate, metres. The range of a ranger is 10.7 m.
pub(super) const MAX_COORDINATE_M: f64 = 1000.0;

impl SceneProblem {
    /// Hint for correcting the error.
    #[must_use]
    pub fn help(&self) -> String {
        match self {
            Self::Syntax(found) => syntax_help(found),
            Self::Unclosed(open) => unclosed_help(*open),
            Self::UnknownField { field, known } => suggest(field, known, "fields here"),
            Self::MissingField(field) => format!("add \"{field}\" to this object"),
            Self::UnknownMaterial { name, known } => suggest(name, known, "materials"),
            Self::TooFewPoints { needed, .. } => format!("give at least {needed}"),
            Self::OutOfBounds { .. } => format!(
                "lengths are in metres, at most {MAX_COORDINATE_M} from the origin; is this in millimetres?"
            ),
            Self::Radius(_) => {
                format!("use metres, greater than 0 and at most {MAX_COORDINATE_M}")
            }
            Self::NoSuchLevel(height) => {
                format!("give its height as `{height}`, in metres, or leave the material out")
            }
            Self::Pose(error) => error.help(),
            other => other.fixed_help().to_owned(),
        }
    }

    /// Hint that does not depend on the offending value.
    const fn fixed_help(&self) -> &'static str {
        match self {
            Self::DuplicateKey(_) => "keep one of the two",
            Self::Type(_) => {
                "`sonard scene schema` prints the type of each field; numbers are written without quotes"
            }
            Self::EmptyName => "give it a name of one character or more",
            Self::ControlCharacter(_) => "remove tabs, line ends and other control characters",
            Self::CommaInName(_) => {
                "remove the comma: on the command line X,Y,DEG denotes coordinates"
            }
            Self::DuplicateId { .. } => {
                "give each wall, cylinder and body a unique name, by which records refer to it \
                 (segments of a polyline are `id.0`, `id.1`, ...)"
            }
            Self::WallShape(_) => {
                "write \"from\": [x, y] and \"to\": [x, y] for one wall, or \"polyline\": \
                 [[x, y], [x, y], ...] (with \"closed\": true if it returns to its beginning)"
            }
            Self::RobotShape => {
                "write \"circle\": {\"center\": [forward, left], \"radius_m\": r} or \"outline\": \
                 [[forward, left], ...]"
            }
            Self::RangerInBody => {
                "the origin of the robot's frame is the ranger's rotation axis: move the body, as \
                 in \"center\": [-0.16, 0] for a round body 0.16 m behind the ranger"
            }
            Self::NoLength { .. } => {
                "its ends must differ by at least 0.1 mm; a closed polyline does not repeat its \
                 first point"
            }
            Self::Heading(_) => "use degrees between -360 and 360",
            Self::Snap(_) => "use metres, from 0 (plan as drawn) to 0.005; default 0.002",
            Self::Share { .. } => "use a number from 0 to 1",
            Self::HeightsReversed { .. } => "write the lower height first, in metres",
            Self::Syntax(_)
            | Self::Unclosed(_)
            | Self::UnknownField { .. }
            | Self::MissingField(_)
            | Self::UnknownMaterial { .. }
            | Self::TooFewPoints { .. }
            | Self::OutOfBounds { .. }
            | Self::Radius(_)
            | Self::NoSuchLevel(_)
            | Self::Pose(_) => "",
        }
    }
}

fn unclosed_help(open: char) -> String {
    let close = if open == '[' { ']' } else { '}' };
    format!("add the matching `{close}`, and check for a missing comma before it")
}

fn syntax_help(found: &str) -> String {
    if found.contains("recursion limit") {
        "a scene needs no more than five levels of brackets".to_owned()
    } else if found.contains("number out of range") {
        "use a finite number of metres".to_owned()
    } else if found.contains("expected value") {
        "expected a number, a \"text\", [ ... ], { ... }, true, false or null (JSON has no NaN, no \
         Infinity, no comments and no comma before a closing bracket)"
            .to_owned()
    } else {
        "check the commas, quotes and brackets at and before this position".to_owned()
    }
}

/// Hint for an unknown name: the most similar known name, if there is one, and all known names.
/// `what` is the plural of the kind ("poses").
#[must_use]
pub fn suggest(given: &str, known: &[String], what: &str) -> String {
    let near = known
        .iter()
        .map(|name| (strsim::jaro_winkler(&given.to_lowercase(), &name.to_lowercase()), name))
        .filter(|(similarity, _)| *similarity > 0.75)
        .max_by(|a, b| a.0.total_cmp(&b.0));
    let all = known.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
    match near {
        _ if known.is_empty() => format!("no {what} are defined"),
        Some((_, name)) => format!("did you mean `{name}`? {what}: {all}"),
        None => format!("{what}: {all}"),
    }
}
