//! Logs of Player: a line a message.
//!
//! `time host robot interface index type subtype ...`, metres and radians. Of the interface `sonar`, subtype 1 is
//! `count ranges...` and type or subtype 2 the geometry, `count x y angle of each...`; of `position2d` (`position` in
//! older logs, whose lines may lack type and subtype) subtype 1 begins with `x y angle`. Lines of other interfaces
//! are left out, and so are comments.

use crate::{
    ImportError, Location,
    rounds::{self, Message, count, number, numbers},
};

/// Words of a line before what the interface says, in present and in older logs.
const BEFORE: usize = 7;
const BEFORE_IN_OLD: usize = 5;

/// The message of a line, if it is one of ranges or poses.
///
/// # Errors
/// A line of such a kind that holds something else.
pub(crate) fn message(place: Location, line: &str) -> Result<Option<Message>, ImportError> {
    if line.trim_start().starts_with('#') {
        return Ok(None);
    }
    let words: Vec<&str> = line.split_whitespace().collect();
    let Some(interface) = words.get(3) else { return Ok(None) };
    // Type and subtype are written with three digits, which no count is.
    let has_types = [5, 6].iter().all(|&at| {
        words.get(at).is_some_and(|word| word.len() == 3 && word.parse::<u32>().is_ok())
    });
    let from = if has_types { BEFORE } else { BEFORE_IN_OLD };
    let subtype = words.get(6).filter(|_| has_types).and_then(|word| word.parse::<u32>().ok());
    match *interface {
        "sonar" => sonar(place, &words, from, subtype == Some(2)).map(Some),
        "position2d" | "position" if subtype.is_none_or(|subtype| subtype == 1) => {
            position(place, &words, from).map(Some)
        }
        _ => Ok(None),
    }
}

fn sonar(
    place: Location,
    words: &[&str],
    from: usize,
    is_geometry: bool,
) -> Result<Message, ImportError> {
    let count = count(place, words, from)?;
    if is_geometry {
        // Later versions tell six numbers of each: places and turns in space.
        let each = (words.len() - from - 1) / count;
        let [x, y, turn] = if each >= 6 { [0, 1, 5] } else { [0, 1, 2] };
        let each = if each >= 6 { 6 } else { 3 };
        let all = numbers(place, words, from + 1, each * count, "place")?;
        let places = all.chunks_exact(each).map(|of| [of[x], of[y], of[turn]]).collect();
        return Ok(Message::Geometry(places));
    }
    let ranges_m = numbers(place, words, from + 1, count, "range")?;
    let seconds = number(place, words, 0, "time")?;
    Ok(Message::Ranges { seconds: Some(seconds), ranges_m, geometry: None })
}

fn position(place: Location, words: &[&str], from: usize) -> Result<Message, ImportError> {
    let [x_m, y_m, heading_rad] =
        [(0, "x"), (1, "y"), (2, "angle")].map(|(at, what)| number(place, words, from + at, what));
    Ok(Message::Pose { pose: rounds::pose(x_m?, y_m?, heading_rad?), is_true: false })
}
