//! CARMEN logs: one message per line.
//!
//! `SONAR cone_angle count ranges... [x y theta of each...] time host logger_time`, in metres and
//! radians; older logs lack the cone angle. `ODOM x y theta ...`, `TRUEPOS x y theta ...`. Other
//! messages, comments and parameters are skipped. The host distinguishes the robots of a log.

use crate::{
    FileLocation, ImportError,
    array_rounds::{
        self, CARMEN_SONAR, LogDevice, LogMessage, MessageContent, count, number, numbers,
    },
};

/// Number of words after ranges and positions: send time, host and log time.
const TRAILING_WORDS: usize = 3;
/// Place of the sending host, counted from the end of a line.
const HOST_FROM_END: usize = 2;

/// Parses a line; `None` for lines without ranges or a pose.
///
/// # Errors
/// Returns an error for a malformed message.
pub(crate) fn message(place: FileLocation, line: &str) -> Result<Option<LogMessage>, ImportError> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let content = match words.first() {
        Some(&"ODOM") => pose(place, &words, false)?,
        Some(&"TRUEPOS") => pose(place, &words, true)?,
        Some(&"SONAR") => ranges(place, &words)?,
        _ => return Ok(None),
    };
    let host = words.len().checked_sub(HOST_FROM_END).and_then(|at| words.get(at));
    let host = host.filter(|host| host.parse::<f64>().is_err()).copied().unwrap_or_default();
    let interface = match content {
        MessageContent::Pose { .. } => "position",
        _ => CARMEN_SONAR,
    };
    let device =
        LogDevice { robot: host.to_owned(), interface: interface.to_owned(), index: String::new() };
    Ok(Some(LogMessage { device, content }))
}

fn pose(place: FileLocation, words: &[&str], is_true: bool) -> Result<MessageContent, ImportError> {
    let [x_m, y_m, heading_rad] =
        [(1, "x"), (2, "y"), (3, "theta")].map(|(at, what)| number(place, words, at, what));
    Ok(MessageContent::Pose { pose: array_rounds::pose(x_m?, y_m?, heading_rad?), is_true })
}

/// Parses a SONAR line; its layout follows from the number of words.
fn ranges(place: FileLocation, words: &[&str]) -> Result<MessageContent, ImportError> {
    let fits = |at: usize| {
        let count: usize = words.get(at)?.parse().ok().filter(|count| *count > 0)?;
        let rest = words.len().checked_sub(at + 1 + count + TRAILING_WORDS)?;
        [0, 3].contains(&(rest / count)).then_some(())?;
        (rest % count == 0).then_some((at + 1, rest > 0))
    };
    let Some((from, has_places)) = fits(2).or_else(|| fits(1)) else {
        let what = "SONAR message with an unexpected number of words";
        return Err(ImportError::at(
            place,
            what,
            "expected: SONAR cone_angle count ranges... [x y theta of each...] time host time",
        ));
    };
    let count = count(place, words, from - 1)?;
    let ranges = array_rounds::ranges(place, words, from, count)?;
    let places = has_places.then(|| numbers(place, words, from + count, 3 * count, "position"));
    let geometry = places.transpose()?.map(|numbers| {
        numbers.chunks_exact(3).map(|place| [place[0], place[1], place[2]]).collect()
    });
    let seconds = number(place, words, words.len() - TRAILING_WORDS, "time")?;
    Ok(MessageContent::Ranges { seconds: Some(seconds), ranges, geometry })
}
