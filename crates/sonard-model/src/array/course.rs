//! Course of a robot: a sequence of poses, optionally with times.

use serde::Deserialize;
use thiserror::Error;

use crate::geometry::{Pose, wrap_360, wrap_pi};

/// Turn rate for courses without times, degrees per second: an assumed slow turn of an indoor
/// robot.
const TURN_DEG_S: f64 = 60.0;

/// Poses that a robot passes in sequence.
#[derive(Debug, Clone, PartialEq)]
pub struct RobotCourse {
    poses: Vec<Pose>,
    /// Times at the poses, seconds; empty where the file gives no times.
    times_s: Vec<f64>,
}

/// Error in a course.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("line {line}: {message}")]
pub struct CourseError {
    /// Line in the text, from 1.
    pub line: usize,
    /// Description of the error and the correct form.
    pub message: String,
}

/// Line of a course file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Waypoint {
    #[serde(default)]
    time_s: Option<f64>,
    x_m: f64,
    y_m: f64,
    #[serde(default)]
    heading_deg: f64,
}

impl RobotCourse {
    /// Parses lines of JSON, `{"x_m": 1, "y_m": 2, "heading_deg": 90}`, either all with an
    /// increasing `time_s` or all without. Empty lines are ignored.
    ///
    /// # Errors
    /// Names the first invalid line.
    pub fn from_json_lines(text: &str) -> Result<Self, CourseError> {
        let mut course = Self { poses: Vec::new(), times_s: Vec::new() };
        for (number, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
            let reject = |message| CourseError { line: number + 1, message };
            let waypoint: Waypoint = serde_json::from_str(line).map_err(|error| {
                let column = error.column();
                let message = error.to_string();
                let message = message.split(" at line ").next().unwrap_or_default();
                reject(format!(
                    "column {column}: {message}; a line is {{\"x_m\": 1.0, \"y_m\": 2.0, \
                     \"heading_deg\": 90.0}}, with or without \"time_s\""
                ))
            })?;
            course.push(&waypoint).map_err(reject)?;
        }
        if course.poses.is_empty() {
            let message = "no pose: give one JSON object per line".to_owned();
            return Err(CourseError { line: 1, message });
        }
        Ok(course)
    }

    /// Creates a course of poses, with the time of each in seconds or without times.
    ///
    /// # Errors
    /// Names the first invalid pose, counted from 1 as a line.
    pub fn new(poses: &[Pose], times_s: Option<&[f64]>) -> Result<Self, CourseError> {
        let reject = |at: usize, message: String| CourseError { line: at + 1, message };
        if poses.is_empty() {
            return Err(reject(0, "no pose: give at least one".to_owned()));
        }
        if let Some(times_s) = times_s.filter(|times_s| times_s.len() != poses.len()) {
            let (count, times) = (poses.len(), times_s.len());
            let message = format!("{count} poses, but {times} times: give one for each");
            return Err(reject(count.min(times), message));
        }
        let mut course = Self { poses: Vec::new(), times_s: Vec::new() };
        for (at, &Pose { x_m, y_m, heading_deg }) in poses.iter().enumerate() {
            let waypoint =
                Waypoint { time_s: times_s.map(|times_s| times_s[at]), x_m, y_m, heading_deg };
            course.push(&waypoint).map_err(|message| reject(at, message))?;
        }
        Ok(course)
    }

    fn push(&mut self, waypoint: &Waypoint) -> Result<(), String> {
        let Waypoint { time_s, x_m, y_m, heading_deg } = *waypoint;
        if ![time_s.unwrap_or_default(), x_m, y_m, heading_deg]
            .iter()
            .all(|value| value.is_finite())
        {
            return Err("numbers must be finite".into());
        }
        if !self.poses.is_empty() && time_s.is_some() == self.times_s.is_empty() {
            return Err("either every line has a time_s, or none".into());
        }
        if let Some(time_s) = time_s {
            match self.times_s.last() {
                Some(before_s) if time_s <= *before_s => {
                    return Err(format!(
                        "time_s {time_s} is not after the previous one, {before_s}"
                    ));
                }
                _ => {}
            }
            self.times_s.push(time_s);
        }
        self.poses.push(Pose { x_m, y_m, heading_deg });
        Ok(())
    }

    /// Poses in order; at least one.
    #[must_use]
    pub fn poses(&self) -> &[Pose] {
        &self.poses
    }

    /// Times at the poses, seconds; empty where the course has no times.
    #[must_use]
    pub fn times_s(&self) -> &[f64] {
        &self.times_s
    }

    /// Adds times for a robot that drives at this speed, m/s. A course that has times keeps them,
    /// counted from its first pose.
    #[must_use]
    pub fn with_times(mut self, speed_m_s: f64) -> Self {
        if let Some(first_s) = self.times_s.first().copied() {
            self.times_s.iter_mut().for_each(|time_s| *time_s -= first_s);
            return self;
        }
        let mut now_s = 0.0;
        self.times_s.push(now_s);
        for pair in self.poses.windows(2) {
            let distance_m = pair[0].position().distance(pair[1].position());
            let turn_deg = turn_deg(&pair[0], &pair[1]).abs();
            // A repeated pose is left at once.
            now_s += (distance_m / speed_m_s).max(turn_deg / TURN_DEG_S).max(1e-3);
            self.times_s.push(now_s);
        }
        self
    }

    /// Pose at a time in seconds after departure, for a timed course: linear interpolation of
    /// position and of heading through the smaller angle; the last pose after the end.
    #[must_use]
    pub fn pose_at(&self, time_s: f64) -> Pose {
        let next = self.times_s.partition_point(|at_s| *at_s <= time_s);
        let Some(before) = next.checked_sub(1) else { return self.poses[0] };
        let (Some(to), Some(to_s)) = (self.poses.get(next), self.times_s.get(next)) else {
            return self.poses[before.min(self.poses.len() - 1)];
        };
        let (from, from_s) = (self.poses[before], self.times_s[before]);
        let share = (time_s - from_s) / (to_s - from_s);
        let place = from.position().lerp(to.position(), share);
        let heading_deg = wrap_360(from.heading_deg + share * turn_deg(&from, to));
        Pose { x_m: place.x, y_m: place.y, heading_deg }
    }

    /// Duration of a timed course, seconds.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.times_s.last().copied().unwrap_or_default()
    }
}

/// Signed smaller angle from one heading to another, degrees.
fn turn_deg(from: &Pose, to: &Pose) -> f64 {
    wrap_pi((to.heading_deg - from.heading_deg).to_radians()).to_degrees()
}
