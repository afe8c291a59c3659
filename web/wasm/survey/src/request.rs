//! Requests of the page.

use serde::Deserialize;
use sonard_model::geometry::Pose;
use sonard_survey::Survey;

use crate::{room::Room, sweep::Sweep};

/// Request of the page, tagged by `type`.
#[derive(Debug, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub enum Request {
    /// Returns the floor plan of a room and the pose at which a course begins.
    OpenRoom {
        /// Room to open.
        room: Room,
    },
    /// Returns the move that a robot performs instead of the one that its odometry reports.
    Drive {
        /// Pose after the move by odometry, in the frame of the pose before.
        by: Pose,
        /// Seed of the errors of a course.
        seed: u64,
        /// Number of the move in the course.
        number: u64,
    },
    /// Measures a sweep.
    TakeSweep {
        /// Room of the sweep.
        room: Room,
        /// True pose.
        pose: Pose,
        /// Seed of the errors of a course.
        seed: u64,
        /// Number of the sweep in the course.
        number: u64,
    },
    /// Surveys the room of sweeps.
    Survey {
        /// Sweeps in the order of the course.
        sweeps: Vec<Sweep>,
    },
    /// Compares a survey with the true room.
    Compare {
        /// True room.
        room: Room,
        /// True poses of the sweeps.
        course: Vec<Pose>,
        /// Result of the survey.
        survey: Box<Survey>,
    },
}
