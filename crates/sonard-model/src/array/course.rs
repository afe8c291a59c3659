//! The course that a robot takes: poses, one after the other, perhaps with times.

use serde::Deserialize;
use thiserror::Error;

use crate::geometry::{Pose, wrap_360, wrap_pi};

/// Turning in place where a course has no times, degrees a second: an assumption, a leisurely
/// turn of an indoor robot.
const TURN_DEG_S: f64 = 60.0;

/// Poses that a robot takes one after the other.
#[derive(Debug, Clone, PartialEq)]
pub struct Course {
    poses: Vec<Pose>,
    /// When it is at each of them, seconds; empty where the file gives no times.
    times_s: Vec<f64>,
}

/// An error in a course.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("line {line}: {message}")]
pub struct CourseError {
    /// Line in the text, from 1.
    pub line: usize,
    /// What is wrong and what would be right.
    pub message: String,
}

/// One line of a course.
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

impl Course {
    /// Reads lines of JSON, `{"x_m": 1, "y_m": 2, "heading_deg": 90}`, all of them with a `time_s`
    /// that grows, or none. Empty lines are passed over.
    ///
    /// # Errors
    /// Names the first line that is wrong.
    pub fn from_json_lines(text: &str) -> Result<Self, CourseError> {
        let mut course = Self { poses: Vec::new(), times_s: Vec::new() };
        for (number, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
            let refuse = |message| CourseError { line: number + 1, message };
            let waypoint: Waypoint = serde_json::from_str(line).map_err(|error| {
                let column = error.column();
                let message = error.to_string();
                let message = message.split(" at line ").next().unwrap_or_default();
                refuse(format!(
                    "column {column}: {message}; a line is {{\"x_m\": 1.0, \"y_m\": 2.0, \
                     \"heading_deg\": 90.0}}, with or without \"time_s\""
                ))
            })?;
            course.push(&waypoint).map_err(refuse)?;
        }
        if course.poses.is_empty() {
            let message = "there is no pose in it: give one JSON object a line".to_owned();
            return Err(CourseError { line: 1, message });
        }
        Ok(course)
    }

    /// A course of poses, with the seconds at which the robot is at each of them or with none.
    ///
    /// # Errors
    /// Names the first pose that is wrong, counted from 1 as a line.
    pub fn new(poses: &[Pose], times_s: Option<&[f64]>) -> Result<Self, CourseError> {
        let refuse = |at: usize, message: String| CourseError { line: at + 1, message };
        if poses.is_empty() {
            return Err(refuse(0, "there is no pose: give one".to_owned()));
        }
        if let Some(times_s) = times_s.filter(|times_s| times_s.len() != poses.len()) {
            let (count, times) = (poses.len(), times_s.len());
            let message = format!("{count} poses, but {times} times: give one for each");
            return Err(refuse(count.min(times), message));
        }
        let mut course = Self { poses: Vec::new(), times_s: Vec::new() };
        for (at, &Pose { x_m, y_m, heading_deg }) in poses.iter().enumerate() {
            let waypoint =
                Waypoint { time_s: times_s.map(|times_s| times_s[at]), x_m, y_m, heading_deg };
            course.push(&waypoint).map_err(|message| refuse(at, message))?;
        }
        Ok(course)
    }

    fn push(&mut self, waypoint: &Waypoint) -> Result<(), String> {
        let Waypoint { time_s, x_m, y_m, heading_deg } = *waypoint;
        if ![time_s.unwrap_or_default(), x_m, y_m, heading_deg].iter().all(|one| one.is_finite()) {
            return Err("its numbers must be finite".into());
        }
        if !self.poses.is_empty() && time_s.is_some() == self.times_s.is_empty() {
            return Err("either every line has a time_s, or none".into());
        }
        if let Some(time_s) = time_s {
            match self.times_s.last() {
                Some(before_s) if time_s <= *before_s => {
                    return Err(format!("time_s {time_s} is not after {before_s}, the one before"));
                }
                _ => {}
            }
            self.times_s.push(time_s);
        }
        self.poses.push(Pose { x_m, y_m, heading_deg });
        Ok(())
    }

    /// The poses in order; at least one.
    #[must_use]
    pub fn poses(&self) -> &[Pose] {
        &self.poses
    }

    /// When the robot is at each of them, seconds; empty where the course has no times.
    #[must_use]
    pub fn times_s(&self) -> &[f64] {
        &self.times_s
    }

    /// With times for a robot that drives at this speed, metres a second; a course that has times
    /// keeps them, counted from its first pose.
    #[must_use]
    pub fn timed(mut self, speed_m_s: f64) -> Self {
        if let Some(first_s) = self.times_s.first().copied() {
            self.times_s.iter_mut().for_each(|time_s| *time_s -= first_s);
            return self;
        }
        let mut now_s = 0.0;
        self.times_s.push(now_s);
        for pair in self.poses.windows(2) {
            let way_m = pair[0].position().distance(pair[1].position());
            let turn_deg = turn_deg(&pair[0], &pair[1]).abs();
            // A pose that is there twice is left at once.
            now_s += (way_m / speed_m_s).max(turn_deg / TURN_DEG_S).max(1e-3);
            self.times_s.push(now_s);
        }
        self
    }

    /// Where the robot is so many seconds after it left the first pose of a timed course: on the
    /// straight line between two poses, turning evenly the shorter way; at the last pose in the end.
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

    /// How long a timed course takes, seconds.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.times_s.last().copied().unwrap_or_default()
    }
}

/// From one heading to another the shorter way, degrees.
fn turn_deg(from: &Pose, to: &Pose) -> f64 {
    wrap_pi((to.heading_deg - from.heading_deg).to_radians()).to_degrees()
}
