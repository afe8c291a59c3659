//! Scans of an array: one round of its rangers, or several.

use jiff::Timestamp;
use uuid::Uuid;

use super::{Ping, Provenance, ScanEnd, ScanStart, ScanView, Session};
use crate::{
    geometry::{DVec2, Pose},
    model::{ArrayModel, ArrayStand, Prediction},
};

impl ScanView {
    /// Where a reading's transducer stood, and which way it looked (its heading): in an array at its
    /// ranger's place, on a stepper where the mounting has its face beside the axis; between transmitter
    /// and receiver if they are apart. `None` if the log does not say.
    #[must_use]
    pub fn transducer(&self, ping: &Ping) -> Option<Pose> {
        let robot = ping.pose.or_else(|| self.pose())?;
        let heading_deg = robot.heading_deg + ping.azimuth_deg;
        let Some(id) = &ping.ranger else {
            let at = self.ends(&robot, ping.azimuth_deg);
            let [x_m, y_m] = (0.5 * (at[0] + at[1])).to_array();
            return Some(Pose { x_m, y_m, heading_deg });
        };
        let array = self.session.as_ref()?.array.as_ref()?;
        Some(Pose { heading_deg, ..array.ranger(id)?.pose_on(&robot) })
    }

    /// Where the transmitter and the receiver of a ranger on a stepper are at an azimuth, degrees.
    #[must_use]
    pub fn ends(&self, axis: &Pose, azimuth_deg: f64) -> [DVec2; 2] {
        let mounting = self.session.as_ref().map(|session| session.sensor.mounting);
        mounting.unwrap_or_default().places(axis.position(), axis.direction_rad(azimuth_deg))
    }

    /// Whether it is of an array and not of a stepper's ranger.
    #[must_use]
    pub fn is_of_array(&self) -> bool {
        self.session.as_ref().is_some_and(|session| session.array.is_some())
    }
}

impl Session {
    /// The session of an array that the model plays.
    #[must_use]
    pub fn of_array(model: &ArrayModel, started: Timestamp) -> Self {
        let array = Some(model.array().as_ref().clone());
        Self { array, ..Self::simulated(model.simulator(), started) }
    }
}

impl ScanStart {
    /// So many rounds of an array that the model plays begin.
    #[must_use]
    pub fn of_array(
        model: &ArrayModel,
        scan: Uuid,
        pose: Pose,
        rounds: u32,
        time: Timestamp,
    ) -> Self {
        let plan = model.array().plan(rounds);
        Self {
            scan,
            time,
            pose,
            plan,
            air: None,
            provenance: Some(Provenance::Simulated),
            request: None,
        }
    }
}

impl Ping {
    /// What a ranger of an array reads in the model, in a scan that began at `scan_pose`.
    #[must_use]
    pub fn of_array(
        stand: &ArrayStand<'_>,
        scan: Uuid,
        scan_pose: &Pose,
        index: u32,
        ranger: usize,
        prediction: &Prediction,
    ) -> Self {
        let mounted = &stand.array().rangers[ranger];
        let azimuth_deg = mounted.azimuth_deg();
        let ping = Self::simulated(stand.simulator(ranger), scan, index, azimuth_deg, prediction);
        Self {
            step: 0,
            ranger: Some(mounted.id.clone()),
            pose: Some(*stand.pose()).filter(|pose| pose != scan_pose),
            provenance: Some(Provenance::Simulated),
            ..ping
        }
    }
}

impl ScanEnd {
    /// The end of a round or several, of which so many rangers fired and so many did not.
    #[must_use]
    pub fn of_array(
        model: &ArrayModel,
        scan: Uuid,
        [beams, missing]: [u32; 2],
        time: Timestamp,
    ) -> Self {
        let end = Self::simulated(model.simulator(), scan, beams, time);
        let duration_s = f64::from(beams) * model.array().interval_ms * 1e-3;
        Self { missing, duration_s, provenance: Some(Provenance::Simulated), ..end }
    }
}
