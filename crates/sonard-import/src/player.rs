//! Logs of Player: a line a message.
//!
//! `time host robot interface index type subtype ...`, metres and radians, with types 1 for data and 4 for the reply to a
//! request (Player 2.0 to 3.0, "Data logging"). Of `sonar`, 1:1 is `count ranges...`, 1:2 and 4:1 are the places of the
//! rangers, `count x y angle of each...`; of `ranger`, 1:1 and 1:2 begin with `count ranges...`, 1:5 and 4:1 are the
//! places; of `position2d`, 1:1 begins with `x y angle`, and 1:2 and 4:1 are offset and size of the base, no pose.
//!
//! Lines of Player 1 have no type and subtype, and the time of the data behind the index; their `sonar` has `count`, the
//! places, `count`, the ranges, or the ranges alone. Lines of other interfaces are left out, and so are comments.

use crate::{
    ImportError, Location,
    rounds::{self, Content, Device, Message, count, number, numbers, ranges},
};

/// The interfaces by which a log is known.
pub(crate) const INTERFACES: [&str; 4] = ["sonar", "ranger", "position2d", "position"];

/// Words of a line before what the interface says, with type and subtype, and without.
const BEFORE: usize = 7;
const BEFORE_IN_OLD: usize = 5;

/// Type and subtype of a message; `None` in logs of Player 1.
type Kind = Option<(u32, u32)>;

/// The message of a line, if it is one of ranges or poses.
///
/// # Errors
/// A line of such a kind that holds something else.
pub(crate) fn message(place: Location, line: &str) -> Result<Option<Message>, ImportError> {
    if line.trim_start().starts_with('#') {
        return Ok(None);
    }
    let words: Vec<&str> = line.split_whitespace().collect();
    let [_, host, robot, interface, index, ..] = words[..] else { return Ok(None) };
    // Type and subtype are written with three digits, which no count is.
    let digits = |at: usize| words.get(at).filter(|word| word.len() == 3)?.parse::<u32>().ok();
    let kind: Kind = digits(5).zip(digits(6));
    let from = if kind.is_some() { BEFORE } else { old_start(&words) };
    let content = match interface {
        "sonar" => sonar(place, &words, from, kind)?,
        "ranger" => ranger(place, &words, from, kind)?,
        "position2d" | "position" if matches!(kind, None | Some((1, 1))) => {
            Some(position(place, &words, from)?)
        }
        _ => None,
    };
    let device = || Device {
        robot: format!("{host}:{robot}"),
        interface: interface.to_owned(),
        index: index.to_owned(),
    };
    Ok(content.map(|content| Message { device: device(), content }))
}

/// First word of the data in a line of Player 1: behind a second time, if there is one. Times have no sign and places have
/// one, and no place is a million metres away.
fn old_start(words: &[&str]) -> usize {
    let number = |at: usize| words.get(at).and_then(|word| word.parse::<f64>().ok());
    let is_signed = |at: usize| words.get(at).is_some_and(|word| word.starts_with(['+', '-']));
    let is_time = number(BEFORE_IN_OLD).is_some_and(|time| {
        time >= 1e6 || (!is_signed(BEFORE_IN_OLD) && is_signed(BEFORE_IN_OLD + 1))
    });
    // A count has no point.
    let has_point = words.get(BEFORE_IN_OLD).is_some_and(|word| word.contains('.'));
    let is_time = if words.get(3) == Some(&"sonar") { has_point } else { is_time };
    BEFORE_IN_OLD + usize::from(is_time)
}

fn sonar(
    place: Location,
    words: &[&str],
    from: usize,
    kind: Kind,
) -> Result<Option<Content>, ImportError> {
    match kind {
        Some((1, 1)) => {
            let count = count(place, words, from)?;
            read(place, words, from + 1, count, None).map(Some)
        }
        Some((1, 2) | (4, 1)) => {
            let count = count(place, words, from)?;
            // Later versions have six numbers of each: places and turns in space.
            let each = if (words.len() - from - 1) / count >= 6 { 6 } else { 3 };
            places(place, words, from + 1, count, each)
                .map(|places| Some(Content::Geometry(places)))
        }
        Some(_) => Ok(None),
        None => {
            let count = count(place, words, from)?;
            let after = from + 1 + 3 * count;
            let has_places = words.len() == after + 1 + count
                && words.get(after).and_then(|word| word.parse::<usize>().ok()) == Some(count);
            match has_places {
                true => {
                    let places = places(place, words, from + 1, count, 3)?;
                    read(place, words, after + 1, count, Some(places)).map(Some)
                }
                false => read(place, words, from + 1, count, None).map(Some),
            }
        }
    }
}

fn ranger(
    place: Location,
    words: &[&str],
    from: usize,
    kind: Kind,
) -> Result<Option<Content>, ImportError> {
    match kind {
        Some((1, 1 | 2)) => {
            let count = count(place, words, from)?;
            read(place, words, from + 1, count, None).map(Some)
        }
        Some((1, 5) | (4, 1)) => {
            // Pose and size of the device, then count and pose of each ranger, then their sizes.
            let at = from + 6 + 3;
            let elements = words.get(at).and_then(|word| word.parse::<usize>().ok()).unwrap_or(0);
            let fits = (1..=rounds::MAX_RANGERS).contains(&elements)
                && words.len() >= at + 1 + 6 * elements;
            match fits {
                true => places(place, words, at + 1, elements, 6)
                    .map(|places| Some(Content::Geometry(places))),
                false => Ok(None),
            }
        }
        _ => Ok(None),
    }
}

/// Places of rangers, of so many numbers each: x, y and the turn about the upright axis.
fn places(
    place: Location,
    words: &[&str],
    from: usize,
    count: usize,
    each: usize,
) -> Result<Vec<[f64; 3]>, ImportError> {
    let all = numbers(place, words, from, each * count, "place")?;
    Ok(all.chunks_exact(each).map(|of| [of[0], of[1], of[each - 1]]).collect())
}

fn read(
    place: Location,
    words: &[&str],
    from: usize,
    count: usize,
    geometry: Option<Vec<[f64; 3]>>,
) -> Result<Content, ImportError> {
    let ranges = ranges(place, words, from, count)?;
    let seconds = number(place, words, 0, "time")?;
    Ok(Content::Ranges { seconds: Some(seconds), ranges, geometry })
}

fn position(place: Location, words: &[&str], from: usize) -> Result<Content, ImportError> {
    let [x_m, y_m, heading_rad] =
        [(0, "x"), (1, "y"), (2, "angle")].map(|(at, what)| number(place, words, from + at, what));
    Ok(Content::Pose { pose: rounds::pose(x_m?, y_m?, heading_rad?), is_true: false })
}
