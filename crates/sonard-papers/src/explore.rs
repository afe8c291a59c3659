//! Exploring a scene with sonar, laser, or laser just in time.
//!
//! After G. Dudek, P. Freedman and I. Rekleitis, "Just-in-time sensing: efficiently combining sonar
//! and laser range data for exploring unknown worlds", ICRA 1996. [`explore`] leads a [`Robot`]
//! round the nearest object at about a metre and on to the next, and makes a map of lines
//! ([`lines`](sonard_interpret::interpret::lines)) of what it senses; it knows nothing else.
//! [`SimulatedRobot`] moves through a scene and hears it by the model.

mod follow;
mod ground;
mod laser;
mod objects;
mod robot;
#[cfg(test)]
mod tests;

pub use follow::{explore, explore_watched};
pub use laser::Laser;
pub use robot::{Drive, Ranger, Robot, RobotSettings, SimulatedRobot};

use serde::Serialize;

use sonard_interpret::interpret::{
    Sweep,
    lines::{FitSettings, LaserScan, LineMapSettings, MapLine, MergeSettings},
};
use sonard_model::geometry::{DVec2, Pose};

/// Sensors of an exploration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Sensing {
    /// Sonar only.
    Sonar,
    /// Laser only: all around at each stop.
    Laser,
    /// Sonar, and at ends of lines one shot of the laser.
    JustInTime,
}

impl Sensing {
    /// All three, in the order in which they are compared.
    pub const ALL: [Self; 3] = [Self::Sonar, Self::Laser, Self::JustInTime];

    /// Its name in records and on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Sonar => "sonar",
            Self::Laser => "laser",
            Self::JustInTime => "just-in-time",
        }
    }
}

/// Settings of an exploration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExploreSettings {
    /// Distance from the object that is followed, metres.
    pub standoff_m: f64,
    /// From stop to stop with sonar, metres at most.
    pub sonar_stride_m: f64,
    /// The same with the laser only, which sees farther, metres.
    pub laser_stride_m: f64,
    /// The robot keeps its centre this far from what it knows, metres.
    pub keep_off_m: f64,
    /// Give up after so many stops.
    pub most_stops: usize,
    /// How the map is made.
    pub map: LineMapSettings,
}

impl Default for ExploreSettings {
    fn default() -> Self {
        Self {
            standoff_m: 1.0,
            sonar_stride_m: 0.45,
            laser_stride_m: 1.0,
            keep_off_m: 0.28,
            most_stops: 400,
            // Between where a wall is followed to and what the laser sees of its corner there is
            // a gap; the robot knows that it is one wall.
            // Where the laser saw a corner, what sonar says of it is too short for a line.
            map: LineMapSettings {
                contradicts_m: 0.03,
                sonar: FitSettings { least_length_m: 0.15, ..FitSettings::default() },
                merge: MergeSettings { gap_m: 0.5, ..MergeSettings::default() },
                ..LineMapSettings::default()
            },
        }
    }
}

/// Task of the robot when it came to a stop.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Task {
    /// Looking round for the first time.
    Begin,
    /// Going to the nearest reading, with nothing on the map yet.
    Approach,
    /// Following a line to its end.
    Follow,
    /// Looking at what is behind the end of a line.
    Round,
}

/// One stop of an exploration.
#[derive(Debug, Clone, PartialEq)]
pub struct Stop {
    /// Where the robot believed to be.
    pub pose: Pose,
    /// What it had come for.
    pub task: Task,
    /// The end of the line in question.
    pub target: Option<DVec2>,
    /// What its sonars read there.
    pub sonar: Option<Sweep>,
    /// What its laser saw there.
    pub laser: Vec<LaserScan>,
    /// The map after that.
    pub lines: Vec<MapLine>,
}

/// An exploration.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Exploration {
    /// Its stops, in order.
    pub stops: Vec<Stop>,
    /// Shots of the laser.
    pub laser_shots: u32,
    /// Readings of the sonars.
    pub sonar_readings: usize,
    /// Way driven, metres, as the robot counts it.
    pub travel_m: f64,
    /// How often the robot ran into something.
    pub bumps: u32,
    /// Whether nothing was left to explore; if not, it ran out of stops.
    pub finished: bool,
}

impl Exploration {
    /// The map at its end.
    #[must_use]
    pub fn lines(&self) -> &[MapLine] {
        self.stops.last().map_or(&[], |stop| &stop.lines)
    }
}
