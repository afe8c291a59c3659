//! Frame tree of the robot, its rangers and their transducer faces.
//!
//! Below `map` is `base_link`. A ranger on a stepper has the fixed frame `sonar_mount` and below it
//! the rotating frame `sonar`; each ranger of an array has the frame `sonar_RANGER`.

use std::collections::BTreeMap;

use sonard_model::{
    acoustics::Mounting,
    array::RangerArray,
    geometry::{DVec2, Pose},
};
use sonard_records::{Ping, Session};

use crate::ros::message::{Header, Stamp, Transform};

pub(crate) const MAP: &str = "map";
const BASE: &str = "base_link";

/// Frames of a session's rangers.
#[derive(Debug)]
pub(super) struct RangerFrames {
    /// Fixed frame that a ranger on a stepper rotates in.
    pub(super) mount: String,
    /// Frame of the face of a ranger on a stepper.
    sonar: String,
    mounting: Mounting,
    /// Rangers of an array by id.
    rangers: BTreeMap<String, FixedRanger>,
}

/// Pose of the robot, and rotation of its ranger, at a reading.
#[derive(Debug, Clone, Copy)]
pub(super) struct RangerPose {
    robot: Pose,
    /// Rotation by the stepper; `None` for rangers of an array, which are fixed.
    turned_deg: Option<f64>,
}

impl RangerPose {
    pub(super) fn at_reading(robot: Pose, ping: &Ping) -> Self {
        Self { robot, turned_deg: ping.ranger.is_none().then_some(ping.azimuth_deg) }
    }
}

/// Fixed ranger of an array.
#[derive(Debug)]
struct FixedRanger {
    /// Ranger id, as a part of topic and frame names.
    name: String,
    frame: String,
    translation: [f64; 3],
    rotation: [f64; 4],
}

impl RangerFrames {
    /// Creates the frames of a session; `sonar` names the frame of a ranger on a stepper and
    /// prefixes the others.
    pub(super) fn new(session: &Session, sonar: &str) -> Self {
        let mounting = session.sensor.mounting;
        let mut rangers: BTreeMap<String, FixedRanger> = BTreeMap::new();
        let array = session.array.as_ref();
        for (ranger, name) in
            array.into_iter().flat_map(|array| array.rangers.iter().zip(names(array)))
        {
            let (bearing_deg, z_m) = (ranger.bearing_deg, ranger.z_m.or(mounting.z_m));
            let [x, y, _] = face(&mounting, bearing_deg);
            let placed = FixedRanger {
                frame: format!("{sonar}_{name}"),
                translation: [ranger.x_m + x, ranger.y_m + y, z_m.unwrap_or(0.0)],
                rotation: quaternion(bearing_deg, mounting.tilt_deg),
                name,
            };
            rangers.insert(ranger.id.clone(), placed);
        }
        Self { mount: format!("{sonar}_mount"), sonar: sonar.to_owned(), mounting, rangers }
    }

    /// Returns the frame of the face of a reading's ranger, whose x axis is the beam axis, and the
    /// ranger's name if it is part of an array; `None` for a ranger that the session does not
    /// contain.
    pub(super) fn frame_of_reading(&self, ping: &Ping) -> Option<(&str, Option<&str>)> {
        match &ping.ranger {
            None => Some((&self.sonar, None)),
            Some(id) => self.rangers.get(id).map(|ranger| (&*ranger.frame, Some(&*ranger.name))),
        }
    }

    /// Returns the names of an array's rangers; empty for a rotating ranger.
    pub(super) fn rangers(&self) -> Vec<&str> {
        self.rangers.values().map(|ranger| &*ranger.name).collect()
    }

    /// Returns the transforms of fixed frames.
    pub(super) fn fixed(&self, stamp: Stamp) -> Vec<Transform<'_>> {
        if self.rangers.is_empty() {
            let translation = [0.0, 0.0, self.mounting.z_m.unwrap_or(0.0)];
            return vec![Transform {
                header: Header { stamp, frame: BASE },
                child: &self.mount,
                translation,
                rotation: quaternion(0.0, 0.0),
            }];
        }
        let rangers = self.rangers.values();
        let placed = rangers.map(|ranger| Transform {
            header: Header { stamp, frame: BASE },
            child: &ranger.frame,
            translation: ranger.translation,
            rotation: ranger.rotation,
        });
        placed.collect()
    }

    /// Returns the transforms of the robot and of a rotating ranger.
    pub(super) fn moving(
        &self,
        stamp: Stamp,
        RangerPose { robot, turned_deg }: RangerPose,
    ) -> Vec<Transform<'_>> {
        let mut transforms = vec![Transform {
            header: Header { stamp, frame: MAP },
            child: BASE,
            translation: [robot.x_m, robot.y_m, 0.0],
            rotation: quaternion(robot.heading_deg, 0.0),
        }];
        if let Some(azimuth_deg) = turned_deg {
            transforms.push(Transform {
                header: Header { stamp, frame: &self.mount },
                child: &self.sonar,
                translation: face(&self.mounting, azimuth_deg),
                rotation: quaternion(azimuth_deg, self.mounting.tilt_deg),
            });
        }
        transforms
    }
}

/// Returns the ids of an array's rangers as unique parts of topic and frame names.
pub(super) fn names(array: &RangerArray) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for ranger in &array.rangers {
        let mut name = ros_name(&ranger.id);
        while names.contains(&name) {
            name.push('_');
        }
        names.push(name);
    }
    names
}

/// Returns the center of a face relative to the axis of its mount, rotated by an azimuth.
fn face(mounting: &Mounting, azimuth_deg: f64) -> [f64; 3] {
    let turn = DVec2::from_angle(azimuth_deg.to_radians());
    let [x, y] = turn.rotate(DVec2::new(mounting.ahead_m, mounting.left_m)).to_array();
    [x, y, 0.0]
}

/// Returns the quaternion of a rotation about z by `left_deg`, then about y by `-up_deg`.
fn quaternion(left_deg: f64, up_deg: f64) -> [f64; 4] {
    let (sin_z, cos_z) = (left_deg.to_radians() / 2.0).sin_cos();
    let (sin_y, cos_y) = (-up_deg.to_radians() / 2.0).sin_cos();
    [-sin_z * sin_y, cos_z * sin_y, sin_z * cos_y, cos_z * cos_y]
}

/// Converts an id to a valid ROS name: letters, digits and underscores, starting with a letter.
fn ros_name(id: &str) -> String {
    let ascii = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    let name: String = id.chars().map(ascii).collect();
    if name.starts_with(|c: char| c.is_ascii_alphabetic()) { name } else { format!("r{name}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rotates the x axis by a quaternion.
    fn ahead([x, y, z, w]: [f64; 4]) -> [f64; 3] {
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)]
    }

    #[test]
    fn face_matches_viewpoint() {
        for (left_deg, up_deg) in [(0.0, 0.0), (90.0, 0.0), (30.0, 20.0), (-135.0, -60.0)] {
            let [x, y, z] = ahead(quaternion(left_deg, up_deg));
            let (left, up) = (f64::to_radians(left_deg), f64::to_radians(up_deg));
            let expected = [left.cos() * up.cos(), left.sin() * up.cos(), up.sin()];
            let off: f64 = [x, y, z].iter().zip(expected).map(|(a, b)| (a - b).abs()).sum();
            assert!(off < 1e-12, "{left_deg} {up_deg}: {x} {y} {z}");
        }
    }

    #[test]
    fn converts_ids_to_ros_names() {
        let names = ["s0", "front left", "7", "-", "é"].map(ros_name);
        assert_eq!(names, ["s0", "front_left", "r7", "r_", "r_"]);
    }
}
