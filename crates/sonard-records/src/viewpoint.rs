//! Viewpoint of a logged reading, and the scene around it.

use sonard_model::{
    acoustics::{Mounting, Sensor},
    array::MountedRanger,
    geometry::Pose,
    scene::Scene,
    viewpoint::Viewpoint,
};

use crate::{Ping, ScanView, Session};

impl Session {
    /// Ranger of the array that took a reading; `None` if the session has no such ranger.
    fn ranger_of(&self, ping: &Ping) -> Option<&MountedRanger> {
        self.array.as_ref()?.ranger(ping.ranger.as_ref()?)
    }

    /// Mounting of a reading's transducer: the sensor's, at the height of its ranger.
    fn mounting_of(&self, ping: &Ping) -> Mounting {
        let mounting = self.sensor.mounting;
        let z_m = self.ranger_of(ping).and_then(|ranger| ranger.z_m);
        Mounting { z_m: z_m.or(mounting.z_m), ..mounting }
    }

    /// Sensor that took a reading, at the height of its ranger.
    #[must_use]
    pub fn sensor_for(&self, ping: &Ping) -> Sensor {
        Sensor { mounting: self.mounting_of(ping), ..self.sensor.clone() }
    }

    /// Scene with the body of the session's robot: the array's, or else the scene's own.
    #[must_use]
    pub fn scene_with_robot(&self, scene: &Scene, robot: &Pose) -> Scene {
        match &self.array {
            Some(array) => array.scene_with_body(scene).with_robot_at(robot),
            None => scene.with_robot_at(robot),
        }
    }
}

impl Ping {
    /// Pose of the rotation axis of the reading's transducer, with the beam direction as its
    /// heading. On a stepper it follows from the robot's pose and the azimuth, in an array from the
    /// ranger's position and bearing. `robot` is the scan's pose; a pose of the reading takes
    /// precedence. `None` if the session's array has no such ranger.
    #[must_use]
    pub fn axis(&self, session: Option<&Session>, robot: &Pose) -> Option<Pose> {
        let robot = self.pose.as_ref().unwrap_or(robot);
        if self.ranger.is_some() {
            return Some(session?.ranger_of(self)?.world_pose(robot));
        }
        Some(Pose { heading_deg: robot.heading_deg + self.azimuth_deg, ..*robot })
    }

    /// Viewpoint of the reading's transducer at firing; `None` as for [`axis`](Self::axis).
    #[must_use]
    pub fn viewpoint(&self, session: Option<&Session>, robot: &Pose) -> Option<Viewpoint> {
        let axis = self.axis(session, robot)?;
        let mounting = session.map(|session| session.mounting_of(self)).unwrap_or_default();
        Some(mounting.viewpoint(&axis))
    }
}

impl ScanView {
    /// Viewpoint of one of the scan's readings; `None` if the log lacks it.
    #[must_use]
    pub fn viewpoint(&self, ping: &Ping) -> Option<Viewpoint> {
        let robot = ping.pose.or_else(|| self.pose())?;
        ping.viewpoint(self.session.as_deref(), &robot)
    }

    /// Returns `true` if all readings were taken at one position: by a ranger on a stepper with its
    /// face on the axis, on a stationary robot.
    #[must_use]
    pub fn is_from_one_position(&self) -> bool {
        let on_axis = |session: &Session| {
            let mounting = &session.sensor.mounting;
            session.array.is_none() && mounting.ahead_m == 0.0 && mounting.left_m == 0.0
        };
        self.session.as_deref().is_none_or(on_axis)
            && self.pings.iter().all(|ping| ping.ranger.is_none() && ping.pose.is_none())
    }

    /// Returns `true` for an array scan, `false` for a ranger on a stepper.
    #[must_use]
    pub fn is_array_scan(&self) -> bool {
        self.session.as_ref().is_some_and(|session| session.array.is_some())
    }
}
