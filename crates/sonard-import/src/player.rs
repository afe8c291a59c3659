//! Player logs: one message per line.
//!
//! `time host robot interface index type subtype ...`, in metres and radians; type 1 is data, type
//! 4 the reply to a request (Player 2.0 to 3.0, "Data logging").
//!
//! - `sonar`: 1:1 is `count ranges...`; 1:2 and 4:1 are the ranger positions, `count` and then
//!   `x y angle` of each.
//! - `ranger`: 1:1 and 1:2 begin with `count ranges...`; 1:5 and 4:1 are the ranger positions.
//! - `position2d`: 1:1 begins with `x y angle`; 1:2 and 4:1 are offset and size of the base, not a
//!   pose.
//!
//! Lines of Player 1 have neither type nor subtype, and the time of the data after the index. Their
//! `sonar` has `count`, the positions, `count` and the ranges, or only the ranges. Lines of other
//! interfaces and comments are skipped.

use crate::{
    FileLocation, ImportError,
    array_rounds::{self, LogDevice, LogMessage, MessageContent, count, number, numbers, ranges},
};

/// Interfaces by which a Player log is detected.
pub(crate) const INTERFACES: [&str; 4] = ["sonar", "ranger", "position2d", "position"];

/// Number of words before the data of the interface, with type and subtype; without them in Player
/// 1.
const HEAD_WORDS: usize = 7;
const HEAD_WORDS_PLAYER_1: usize = 5;

/// Type and subtype of a message; `None` in Player 1 logs.
type MessageType = Option<(u32, u32)>;

/// Parses a line; `None` for lines without ranges or a pose.
///
/// # Errors
/// Returns an error for a malformed message.
pub(crate) fn message(place: FileLocation, line: &str) -> Result<Option<LogMessage>, ImportError> {
    if line.trim_start().starts_with('#') {
        return Ok(None);
    }
    let words: Vec<&str> = line.split_whitespace().collect();
    let [_, host, robot, interface, index, ..] = words[..] else { return Ok(None) };
    // Type and subtype have three digits, unlike counts.
    let digits = |at: usize| words.get(at).filter(|word| word.len() == 3)?.parse::<u32>().ok();
    let kind: MessageType = digits(5).zip(digits(6));
    let from = if kind.is_some() { HEAD_WORDS } else { old_start(&words) };
    let content = match interface {
        "sonar" => sonar(place, &words, from, kind)?,
        "ranger" => ranger(place, &words, from, kind)?,
        "position2d" | "position" if matches!(kind, None | Some((1, 1))) => {
            Some(position(place, &words, from)?)
        }
        _ => None,
    };
    let device = || LogDevice {
        robot: format!("{host}:{robot}"),
        interface: interface.to_owned(),
        index: index.to_owned(),
    };
    Ok(content.map(|content| LogMessage { device: device(), content }))
}

/// Returns the index of the first data word in a Player 1 line, after an optional second time.
/// Times are unsigned and positions signed; positions are below a million metres.
fn old_start(words: &[&str]) -> usize {
    let number = |at: usize| words.get(at).and_then(|word| word.parse::<f64>().ok());
    let is_signed = |at: usize| words.get(at).is_some_and(|word| word.starts_with(['+', '-']));
    let is_time = number(HEAD_WORDS_PLAYER_1).is_some_and(|time| {
        time >= 1e6 || (!is_signed(HEAD_WORDS_PLAYER_1) && is_signed(HEAD_WORDS_PLAYER_1 + 1))
    });
    // A count has no decimal point.
    let has_point = words.get(HEAD_WORDS_PLAYER_1).is_some_and(|word| word.contains('.'));
    let is_time = if words.get(3) == Some(&"sonar") { has_point } else { is_time };
    HEAD_WORDS_PLAYER_1 + usize::from(is_time)
}

fn sonar(
    place: FileLocation,
    words: &[&str],
    from: usize,
    kind: MessageType,
) -> Result<Option<MessageContent>, ImportError> {
    match kind {
        Some((1, 1)) => {
            let count = count(place, words, from)?;
            parse_ranges(place, words, from + 1, count, None).map(Some)
        }
        Some((1, 2) | (4, 1)) => {
            let count = count(place, words, from)?;
            // Later versions have six numbers per ranger: position and rotation in space.
            let each = if (words.len() - from - 1) / count >= 6 { 6 } else { 3 };
            positions(place, words, from + 1, count, each)
                .map(|positions| Some(MessageContent::Geometry(positions)))
        }
        Some(_) => Ok(None),
        None => {
            let count = count(place, words, from)?;
            let after = from + 1 + 3 * count;
            let has_positions = words.len() == after + 1 + count
                && words.get(after).and_then(|word| word.parse::<usize>().ok()) == Some(count);
            match has_positions {
                true => {
                    let positions = positions(place, words, from + 1, count, 3)?;
                    parse_ranges(place, words, after + 1, count, Some(positions)).map(Some)
                }
                false => parse_ranges(place, words, from + 1, count, None).map(Some),
            }
        }
    }
}

fn ranger(
    place: FileLocation,
    words: &[&str],
    from: usize,
    kind: MessageType,
) -> Result<Option<MessageContent>, ImportError> {
    match kind {
        Some((1, 1 | 2)) => {
            let count = count(place, words, from)?;
            parse_ranges(place, words, from + 1, count, None).map(Some)
        }
        Some((1, 5) | (4, 1)) => {
            // Pose and size of the device, then count and pose of each ranger, then their sizes.
            let at = from + 6 + 3;
            let elements = words.get(at).and_then(|word| word.parse::<usize>().ok()).unwrap_or(0);
            let fits = (1..=array_rounds::MAX_RANGERS).contains(&elements)
                && words.len() >= at + 1 + 6 * elements;
            match fits {
                true => positions(place, words, at + 1, elements, 6)
                    .map(|positions| Some(MessageContent::Geometry(positions))),
                false => Ok(None),
            }
        }
        _ => Ok(None),
    }
}

/// Parses ranger positions of `each` numbers: x, y and finally the yaw.
fn positions(
    place: FileLocation,
    words: &[&str],
    from: usize,
    count: usize,
    each: usize,
) -> Result<Vec<[f64; 3]>, ImportError> {
    let all = numbers(place, words, from, each * count, "position")?;
    Ok(all
        .chunks_exact(each)
        .map(|numbers_of_ranger| {
            [numbers_of_ranger[0], numbers_of_ranger[1], numbers_of_ranger[each - 1]]
        })
        .collect())
}

fn parse_ranges(
    place: FileLocation,
    words: &[&str],
    from: usize,
    count: usize,
    geometry: Option<Vec<[f64; 3]>>,
) -> Result<MessageContent, ImportError> {
    let ranges = ranges(place, words, from, count)?;
    let seconds = number(place, words, 0, "time")?;
    Ok(MessageContent::Ranges { seconds: Some(seconds), ranges, geometry })
}

fn position(
    place: FileLocation,
    words: &[&str],
    from: usize,
) -> Result<MessageContent, ImportError> {
    let [x_m, y_m, heading_rad] =
        [(0, "x"), (1, "y"), (2, "angle")].map(|(at, what)| number(place, words, from + at, what));
    Ok(MessageContent::Pose { pose: array_rounds::pose(x_m?, y_m?, heading_rad?), is_true: false })
}
