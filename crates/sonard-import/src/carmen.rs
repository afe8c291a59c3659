//! Logs of CARMEN: a line a message.
//!
//! `SONAR cone_angle count ranges... [x y theta of each...] time host logger_time`, in metres and radians; older
//! logs lack the cone's angle. `ODOM x y theta ...`, `TRUEPOS x y theta ...`. Messages of other kinds are left
//! out, and so are comments and parameters.

use crate::{
    ImportError, Location,
    rounds::{self, Content, Device, Message, count, number, numbers},
};

/// Words after the ranges and places: when it was sent, by which computer, and when it was logged.
const AFTER: usize = 3;

/// The message of a line, if it is one of ranges or poses.
///
/// # Errors
/// A line of such a kind that holds something else.
pub(crate) fn message(place: Location, line: &str) -> Result<Option<Message>, ImportError> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let content = match words.first() {
        Some(&"ODOM") => pose(place, &words, false)?,
        Some(&"TRUEPOS") => pose(place, &words, true)?,
        Some(&"SONAR") => ranges(place, &words)?,
        _ => return Ok(None),
    };
    Ok(Some(Message { device: Device::default(), content }))
}

fn pose(place: Location, words: &[&str], is_true: bool) -> Result<Content, ImportError> {
    let [x_m, y_m, heading_rad] =
        [(1, "x"), (2, "y"), (3, "theta")].map(|(at, what)| number(place, words, at, what));
    Ok(Content::Pose { pose: rounds::pose(x_m?, y_m?, heading_rad?), is_true })
}

/// The count of words tells how the line is made.
fn ranges(place: Location, words: &[&str]) -> Result<Content, ImportError> {
    let fits = |at: usize| {
        let count: usize = words.get(at)?.parse().ok().filter(|count| *count > 0)?;
        let rest = words.len().checked_sub(at + 1 + count + AFTER)?;
        [0, 3].contains(&(rest / count)).then_some(())?;
        (rest % count == 0).then_some((at + 1, rest > 0))
    };
    let Some((from, has_places)) = fits(2).or_else(|| fits(1)) else {
        let what = "a SONAR message of a form that is not known";
        return Err(ImportError::at(
            place,
            what,
            "it should be: SONAR cone_angle count ranges... [x y theta of each...] time host time",
        ));
    };
    let count = count(place, words, from - 1)?;
    let ranges = rounds::ranges(place, words, from, count)?;
    let places = has_places.then(|| numbers(place, words, from + count, 3 * count, "place"));
    let geometry = places.transpose()?.map(|numbers| {
        numbers.chunks_exact(3).map(|place| [place[0], place[1], place[2]]).collect()
    });
    let seconds = number(place, words, words.len() - AFTER, "time")?;
    Ok(Content::Ranges { seconds: Some(seconds), ranges, geometry })
}
