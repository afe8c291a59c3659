//! Where the transducer of a logged reading was, and what stood around it.

use sonard_model::{
    acoustics::{Mounting, Sensor},
    array::MountedRanger,
    geometry::Pose,
    scene::Scene,
    viewpoint::Viewpoint,
};

use crate::{Ping, ScanView, Session};

impl Session {
    /// The ranger of the array that took a reading; `None` if the session has no such ranger.
    fn ranger_of(&self, ping: &Ping) -> Option<&MountedRanger> {
        self.array.as_ref()?.ranger(ping.ranger.as_ref()?)
    }

    /// How the transducer of a reading is mounted: as the sensor's data say, at the height of its ranger.
    fn mounting_of(&self, ping: &Ping) -> Mounting {
        let mounting = self.sensor.mounting;
        let z_m = self.ranger_of(ping).and_then(|ranger| ranger.z_m);
        Mounting { z_m: z_m.or(mounting.z_m), ..mounting }
    }

    /// The sensor that took a reading, at its height.
    #[must_use]
    pub fn sensor_of(&self, ping: &Ping) -> Sensor {
        Sensor { mounting: self.mounting_of(ping), ..self.sensor.clone() }
    }

    /// A scene with the body of the session's robot in it: the array's, or else the scene's own.
    #[must_use]
    pub fn scene_around(&self, scene: &Scene, robot: &Pose) -> Scene {
        match &self.array {
            Some(array) => array.in_scene(scene).with_robot_at(robot),
            None => scene.with_robot_at(robot),
        }
    }
}

impl Ping {
    /// The rotation axis that its transducer is mounted on, turned to where it looked: on a stepper the
    /// robot's pose and the azimuth, in an array the ranger's place and bearing. `robot` is the scan's pose;
    /// a reading with a pose of its own was taken there. `None` if its ranger is none of the session's
    /// array.
    #[must_use]
    pub fn axis(&self, session: Option<&Session>, robot: &Pose) -> Option<Pose> {
        let robot = self.pose.as_ref().unwrap_or(robot);
        if self.ranger.is_some() {
            return Some(session?.ranger_of(self)?.pose_on(robot));
        }
        Some(Pose { heading_deg: robot.heading_deg + self.azimuth_deg, ..*robot })
    }

    /// Where its transducer was when it fired, and where it pointed; `None` as for [`axis`](Self::axis).
    #[must_use]
    pub fn viewpoint(&self, session: Option<&Session>, robot: &Pose) -> Option<Viewpoint> {
        let axis = self.axis(session, robot)?;
        let mounting = session.map(|session| session.mounting_of(self)).unwrap_or_default();
        Some(mounting.viewpoint(&axis))
    }
}

impl ScanView {
    /// Where the transducer of one of its readings was; `None` if the log does not say.
    #[must_use]
    pub fn viewpoint(&self, ping: &Ping) -> Option<Viewpoint> {
        let robot = ping.pose.or_else(|| self.pose())?;
        ping.viewpoint(self.session.as_deref(), &robot)
    }

    /// Whether all its readings are from one place: of a stepper's ranger with its face on the axis, on a
    /// robot that stood still.
    #[must_use]
    pub fn has_one_place(&self) -> bool {
        let on_axis = |session: &Session| {
            let mounting = &session.sensor.mounting;
            session.array.is_none() && mounting.ahead_m == 0.0 && mounting.left_m == 0.0
        };
        self.session.as_deref().is_none_or(on_axis)
            && self.pings.iter().all(|ping| ping.ranger.is_none() && ping.pose.is_none())
    }

    /// Whether it is of an array and not of a stepper's ranger.
    #[must_use]
    pub fn is_of_array(&self) -> bool {
        self.session.as_ref().is_some_and(|session| session.array.is_some())
    }
}
