//! What can be wrong with a scene file, and where.

use std::{error::Error, fmt, ops::Range};

use thiserror::Error;

use super::pose::PoseError;

/// An error in a scene file: where, what, and the remedy.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneError {
    /// Line, counted from 1.
    pub line: usize,
    /// Column in characters, counted from 1.
    pub column: usize,
    /// Bytes of the text that are meant.
    pub span: Range<usize>,
    /// The way to the value in the document, as `walls[2].to`; empty for the document itself.
    pub path: String,
    /// What is wrong.
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

    /// What is wrong, with the offending text.
    #[must_use]
    pub fn message(&self) -> String {
        shown(&self.problem.to_string())
    }

    /// What would be right.
    #[must_use]
    pub fn help(&self) -> String {
        shown(&self.problem.help())
    }
}

impl fmt::Display for SceneError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}: ", self.line, self.column)?;
        if !self.path.is_empty() {
            write!(f, "{}: ", shown(&self.path))?;
        }
        f.write_str(&self.message())
    }
}

impl Error for SceneError {}

/// Longest part of a message, characters.
const LONGEST: usize = 1000;

/// What of a text can go to a terminal: its control characters written out, and the middle of a long one left out.
#[must_use]
pub fn shown(text: &str) -> String {
    let written = |found: char| {
        let escaped = found.is_control().then(|| found.escape_debug());
        escaped.into_iter().flatten().chain((!found.is_control()).then_some(found))
    };
    if text.len() <= LONGEST {
        return text.chars().flat_map(written).collect();
    }
    let start = text.chars().take(LONGEST / 2).flat_map(written);
    let end: String = text.chars().rev().take(LONGEST / 4).collect();
    start.chain(" [...] ".chars()).chain(end.chars().rev().flat_map(written)).collect()
}

/// Line and column (in characters) of a byte offset, both counted from 1.
pub(super) fn line_and_column(text: &str, offset: usize) -> (usize, usize) {
    let before = &text[..floor_char_boundary(text, offset)];
    let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
    (before.matches('\n').count() + 1, before[line_start..].chars().count() + 1)
}

/// The last character boundary at or before `offset`.
pub(super) fn floor_char_boundary(text: &str, offset: usize) -> usize {
    let offset = offset.min(text.len());
    (0..=offset).rev().find(|at| text.is_char_boundary(*at)).unwrap_or(0)
}

/// The kind of an error in a scene file.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum SceneProblem {
    /// Not JSON.
    #[error("this is not JSON: {0}")]
    Syntax(String),
    /// A bracket or brace that is never closed.
    #[error("this `{0}` is never closed")]
    Unclosed(char),
    /// The same name twice in one object.
    #[error("`{0}` is given twice")]
    DuplicateKey(String),
    /// A field that scene files don't have.
    #[error("unknown field `{field}`")]
    UnknownField {
        /// The field.
        field: String,
        /// Fields that may stand there.
        known: Vec<String>,
    },
    /// A field that must be there.
    #[error("the field `{0}` is missing")]
    MissingField(String),
    /// A value of the wrong type.
    #[error("{0}")]
    Type(String),
    /// A name without a character.
    #[error("this name is empty")]
    EmptyName,
    /// A name that a terminal would obey, and no one could read.
    #[error("this name has the character {} in it", .0.escape_debug())]
    ControlCharacter(char),
    /// A pose name that reads like coordinates.
    #[error("the pose name `{0}` contains a comma")]
    CommaInName(String),
    /// A material that is not in `materials`.
    #[error("there is no material `{name}` in this scene")]
    UnknownMaterial {
        /// The name.
        name: String,
        /// The materials of the scene.
        known: Vec<String>,
    },
    /// Two reflectors of the same name.
    #[error("the id `{id}` is already the name of {first}")]
    DuplicateId {
        /// The id.
        id: String,
        /// Path of the first one.
        first: String,
    },
    /// A wall with neither both ends nor a polyline, or with both.
    #[error("{0}")]
    WallShape(&'static str),
    /// A body with neither circle nor outline, or with both.
    #[error("a robot has either a `circle` or an `outline`")]
    RobotShape,
    /// The ranger is inside the robot's body.
    #[error("the ranger, at [0, 0], is inside the body or on its surface: no sound could leave")]
    RangerInBody,
    /// Two points where one is enough.
    #[error("this wall has no length: it goes from {from:?} to {to:?}")]
    NoLength {
        /// One end, metres.
        from: [f64; 2],
        /// The other end, metres.
        to: [f64; 2],
    },
    /// Too few points.
    #[error("{points} points are too few")]
    TooFewPoints {
        /// How many there are.
        points: usize,
        /// How many are needed.
        needed: usize,
    },
    /// Too far out, or not a number.
    #[error("{value} m is out of bounds")]
    OutOfBounds {
        /// The value, metres.
        value: f64,
    },
    /// A heading that is no angle.
    #[error("a heading of {0} degrees is out of bounds")]
    Heading(f64),
    /// A radius of zero or less, or too large.
    #[error("a radius of {0} m is not possible")]
    Radius(f64),
    /// A tolerance of the plan that is none.
    #[error("snap_m is {0}")]
    Snap(f64),
    /// A share outside 0..1.
    #[error("{field} is {value}")]
    Share {
        /// Which one.
        field: &'static str,
        /// The value.
        value: f64,
    },
    /// The upper height is not above the lower.
    #[error("{upper_name} ({upper} m) is not above {lower_name} ({lower} m)")]
    HeightsReversed {
        /// What the lower one is called.
        lower_name: &'static str,
        /// Metres.
        lower: f64,
        /// What the upper one is called.
        upper_name: &'static str,
        /// Metres.
        upper: f64,
    },
    /// A material of a floor or ceiling that is not there; holds the field of its height.
    #[error("there is none: the scene has no {0}")]
    NoSuchLevel(&'static str),
    /// A named pose where no ranger can stand.
    #[error(transparent)]
    Pose(#[from] PoseError),
}

/// Nothing in a scene lies farther than this from the origin, metres. A ranger sees 10.7 m.
pub(super) const MAX_COORDINATE_M: f64 = 1000.0;

impl SceneProblem {
    /// What would be right.
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

    /// Help that is the same whatever was found.
    const fn fixed_help(&self) -> &'static str {
        match self {
            Self::DuplicateKey(_) => "keep one of the two; only one could count",
            Self::Type(_) => {
                "`sonard scene schema` prints what each field holds; numbers stand without quotes"
            }
            Self::EmptyName => "give it a name of one character or more",
            Self::ControlCharacter(_) => "leave out tabs, line ends and other control characters",
            Self::CommaInName(_) => {
                "leave the comma out: on the command line X,Y,DEG is a pose by its numbers"
            }
            Self::DuplicateId { .. } => {
                "give each wall, cylinder and body a name of its own: records refer to them by it \
                 (segments of a polyline are `id.0`, `id.1`, ...)"
            }
            Self::WallShape(_) => {
                "write \"from\": [x, y] and \"to\": [x, y] for one wall, or \"polyline\": \
                 [[x, y], [x, y], ...] (with \"closed\": true if it returns to its beginning)"
            }
            Self::RobotShape => {
                "write \"circle\": {\"center\": [ahead, left], \"radius_m\": r} or \"outline\": \
                 [[ahead, left], ...]"
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
            Self::Snap(_) => {
                "use metres, from 0 (the plan is taken as drawn) to 0.005; without it 0.002"
            }
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
    format!("add the `{close}` that belongs to it, and look for a missing comma before it")
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
        "check the commas, quotes and brackets at and before this place".to_owned()
    }
}

/// Which of the known names may have been meant, and all of them; `what` says what they are
/// ("poses").
#[must_use]
pub fn suggest(given: &str, known: &[String], what: &str) -> String {
    let near = known
        .iter()
        .map(|name| (strsim::jaro_winkler(&given.to_lowercase(), &name.to_lowercase()), name))
        .filter(|(similarity, _)| *similarity > 0.75)
        .max_by(|a, b| a.0.total_cmp(&b.0));
    let all = known.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
    match near {
        _ if known.is_empty() => format!("there are no {what} yet"),
        Some((_, name)) => format!("did you mean `{name}`? {what}: {all}"),
        None => format!("{what}: {all}"),
    }
}
