//! Exploration of a scene with sonar, laser, or just-in-time sensing.
//!
//! After G. Dudek, P. Freedman and I. Rekleitis, "Just-in-time sensing: efficiently combining sonar
//! and laser range data for exploring unknown worlds", ICRA 1996. [`explore`] leads a [`Robot`]
//! round the nearest object at about a metre and then to the next. Its measurements are the only
//! input of the line map ([`lines`](sonard_interpret::interpret::lines)). [`SimulatedRobot`] moves
//! through a scene and measures it by the model.
//!
//! [`explore_views`] is another strategy: the robot drives to the next view of the survey of its
//! sweeps.

mod follow;
mod ground;
mod laser;
mod objects;
mod robot;
#[cfg(test)]
mod tests;
mod views;

pub use follow::{explore, explore_observed};
pub use laser::Laser;
pub use robot::{DriveOutcome, Robot, RobotSettings, SimulatedRobot, SonarLayout};
pub use views::explore_views;

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
    /// Sonar readings without the laser.
    Sonar,
    /// Laser only: a full turn at each stop.
    Laser,
    /// Sonar, and one laser shot at each line end.
    JustInTime,
}

impl Sensing {
    /// All variants in the order of comparison tables.
    pub const ALL: [Self; 3] = [Self::Sonar, Self::Laser, Self::JustInTime];

    /// Name in records and on the command line.
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
    /// Distance from the followed object, metres.
    pub standoff_m: f64,
    /// Maximum distance between stops with sonar, metres.
    pub sonar_stride_m: f64,
    /// Maximum distance between stops with the laser only, which has a longer range, metres.
    pub laser_stride_m: f64,
    /// Minimum distance of the robot's centre from known obstacles, metres.
    pub min_clearance_m: f64,
    /// Maximum number of stops.
    pub max_stops: usize,
    /// Settings of the line map.
    pub map: LineMapSettings,
}

impl Default for ExploreSettings {
    fn default() -> Self {
        Self {
            standoff_m: 1.0,
            sonar_stride_m: 0.45,
            laser_stride_m: 1.0,
            min_clearance_m: 0.28,
            max_stops: 400,
            // `gap_m`: sonar follows a wall only up to a gap before the corner that the laser
            // measures, and both parts are one wall. `least_length_m`: sonar lines at a corner that
            // the laser measured are too short for walls.
            map: LineMapSettings {
                contradicts_m: 0.03,
                sonar: FitSettings { min_length_m: 0.15, ..FitSettings::default() },
                merge: MergeSettings { gap_m: 0.5, ..MergeSettings::default() },
                ..LineMapSettings::default()
            },
        }
    }
}

/// Purpose of a stop.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Task {
    /// First measurement at the start pose.
    Begin,
    /// Drive towards the nearest reading while the map is empty.
    Approach,
    /// Drive along a line to its end.
    Follow,
    /// Drive round the end of a line to observe its other side.
    Round,
}

/// Stop of an exploration with its measurements.
#[derive(Debug, Clone, PartialEq)]
pub struct Stop {
    /// Pose by the robot's odometry.
    pub pose: Pose,
    /// Purpose of the stop.
    pub task: Task,
    /// Line end that the stop was planned for.
    pub target: Option<DVec2>,
    /// Sonar readings; `None` with the laser only.
    pub sonar: Option<Sweep>,
    /// Laser scans taken at the stop.
    pub laser: Vec<LaserScan>,
    /// Map after these measurements.
    pub lines: Vec<MapLine>,
}

/// Complete record of an exploration.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Exploration {
    /// Stops in order of time.
    pub stops: Vec<Stop>,
    /// Number of laser shots.
    pub laser_shots: u32,
    /// Number of sonar readings.
    pub sonar_readings: usize,
    /// Distance driven by odometry, metres.
    pub travel_m: f64,
    /// Number of collisions with obstacles.
    pub collisions: u32,
    /// Whether everything was explored before the maximum number of stops.
    pub finished: bool,
}

impl Exploration {
    /// Final map, empty before the first stop.
    #[must_use]
    pub fn lines(&self) -> &[MapLine] {
        self.stops.last().map_or(&[], |stop| &stop.lines)
    }
}
