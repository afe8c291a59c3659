//! Rounds of an array of rangers on a moving robot.

use glam::DVec2;
use sonard_model::geometry::{Pose, wrap_180};
use sonard_records::ScanView;
use uuid::Uuid;

use crate::sweep::{FiringOutcome, FitSweep, FitSweepError, SweepFiring};

/// Readings of the rangers of an array while the robot moves little.
#[derive(Debug, Clone, PartialEq)]
pub struct ArrayRound {
    /// Scan of the readings.
    pub scan: Uuid,
    /// Pose of the robot at the first reading, by odometry.
    pub pose: Pose,
    /// Firings with a valid outcome.
    pub firings: Vec<ArrayFiring>,
}

/// Firing of a ranger of an array.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ArrayFiring {
    /// Position of the transducer in the frame of the round's pose (x ahead, y to the left), metres.
    pub position: DVec2,
    /// Direction of the beam, degrees counter-clockwise from the heading of that pose.
    pub azimuth_deg: f64,
    /// Outcome of the firing.
    pub outcome: FiringOutcome,
}

impl ArrayRound {
    /// Rounds of a logged scan: a round ends where a ranger fires again.
    ///
    /// Within a round, the poses of the readings are taken as exact relative to the first.
    ///
    /// # Errors
    /// Scan without start or session, or of a ranger on a stepper.
    pub fn from_scan(scan: &ScanView) -> Result<Vec<Self>, FitSweepError> {
        let id = scan.scan;
        let (Some(start), Some(session)) = (scan.pose(), &scan.session) else {
            return Err(FitSweepError::Incomplete(id));
        };
        if session.array.is_none() {
            return Err(FitSweepError::NotOfArray(id));
        }
        let tof_us_per_m = 2e6 / session.air.sound_speed_m_s;
        let mut rounds: Vec<Self> = Vec::new();
        let mut fired: Vec<&str> = Vec::new();
        for ping in &scan.pings {
            let (Some(ranger), Some(viewpoint)) = (&ping.ranger, scan.viewpoint(ping)) else {
                continue;
            };
            let pose = ping.pose.unwrap_or(start);
            if rounds.is_empty() || fired.contains(&ranger.as_str()) {
                rounds.push(Self { scan: id, pose, firings: Vec::new() });
                fired.clear();
            }
            fired.push(ranger);
            let Some(outcome) = FiringOutcome::of_ping(ping, tof_us_per_m) else { continue };
            if let Some(round) = rounds.last_mut() {
                round.firings.push(ArrayFiring {
                    position: round.pose.point_in_frame(viewpoint.position()),
                    azimuth_deg: wrap_180(viewpoint.direction_deg - round.pose.heading_deg),
                    outcome,
                });
            }
        }
        rounds.retain(|round| !round.firings.is_empty());
        Ok(rounds)
    }

    /// Readings without the positions of the transducers.
    #[must_use]
    pub fn at_pose(&self) -> FitSweep {
        let beam = |firing: &ArrayFiring| SweepFiring {
            azimuth_deg: firing.azimuth_deg,
            outcome: firing.outcome,
        };
        let beams = self.firings.iter().map(beam).collect();
        FitSweep { scan: self.scan, pose: self.pose, beams }
    }
}
