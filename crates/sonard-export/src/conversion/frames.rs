//! Where the robot, its rangers and their faces are, as a tree of frames: `map`, `base_link`, then of a stepper's
//! ranger `sonar_mount`, which stands still, and `sonar`, which turns; of an array `sonar_RANGER` for each.

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

/// The frames of a session's rangers.
#[derive(Debug)]
pub(super) struct Frames {
    /// What a stepper's ranger turns on.
    pub(super) mount: String,
    /// The face of a stepper's ranger.
    sonar: String,
    mounting: Mounting,
    /// The rangers of an array by id.
    rangers: BTreeMap<String, Ranger>,
}

/// How a robot and its ranger stand at a reading.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stance {
    robot: Pose,
    /// Where a stepper has turned its ranger; of an array's, which do not turn, `None`.
    turned_deg: Option<f64>,
}

impl Stance {
    pub(super) fn of(robot: Pose, ping: &Ping) -> Self {
        Self { robot, turned_deg: ping.ranger.is_none().then_some(ping.azimuth_deg) }
    }
}

/// A ranger of an array.
#[derive(Debug)]
struct Ranger {
    /// Its id as a part of the names of topics and frames.
    name: String,
    frame: String,
    translation: [f64; 3],
    rotation: [f64; 4],
}

impl Frames {
    /// Of a session; the frame of a stepper's ranger is called `sonar`, and those of arrays begin so.
    pub(super) fn of(session: &Session, sonar: &str) -> Self {
        let mounting = session.sensor.mounting;
        let mut rangers: BTreeMap<String, Ranger> = BTreeMap::new();
        let array = session.array.as_ref();
        for (ranger, name) in
            array.into_iter().flat_map(|array| array.rangers.iter().zip(names(array)))
        {
            let (bearing_deg, z_m) = (ranger.bearing_deg, ranger.z_m.or(mounting.z_m));
            let [x, y, _] = face(&mounting, bearing_deg);
            let placed = Ranger {
                frame: format!("{sonar}_{name}"),
                translation: [ranger.x_m + x, ranger.y_m + y, z_m.unwrap_or(0.0)],
                rotation: turned(bearing_deg, mounting.tilt_deg),
                name,
            };
            rangers.insert(ranger.id.clone(), placed);
        }
        Self { mount: format!("{sonar}_mount"), sonar: sonar.to_owned(), mounting, rangers }
    }

    /// The frame of the face of a reading's ranger, which looks along x, and of one of an array the name of the
    /// ranger; `None` of a ranger that the session does not have.
    pub(super) fn of_reading(&self, ping: &Ping) -> Option<(&str, Option<&str>)> {
        match &ping.ranger {
            None => Some((&self.sonar, None)),
            Some(id) => self.rangers.get(id).map(|ranger| (&*ranger.frame, Some(&*ranger.name))),
        }
    }

    /// The names of an array's rangers; none of a ranger that turns.
    pub(super) fn rangers(&self) -> Vec<&str> {
        self.rangers.values().map(|ranger| &*ranger.name).collect()
    }

    /// What does not move.
    pub(super) fn fixed(&self, stamp: Stamp) -> Vec<Transform<'_>> {
        if self.rangers.is_empty() {
            let translation = [0.0, 0.0, self.mounting.z_m.unwrap_or(0.0)];
            return vec![Transform {
                header: Header { stamp, frame: BASE },
                child: &self.mount,
                translation,
                rotation: turned(0.0, 0.0),
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

    /// Where the robot is, and where a stepper has turned its ranger.
    pub(super) fn moving(
        &self,
        stamp: Stamp,
        Stance { robot, turned_deg }: Stance,
    ) -> Vec<Transform<'_>> {
        let mut transforms = vec![Transform {
            header: Header { stamp, frame: MAP },
            child: BASE,
            translation: [robot.x_m, robot.y_m, 0.0],
            rotation: turned(robot.heading_deg, 0.0),
        }];
        if let Some(azimuth_deg) = turned_deg {
            transforms.push(Transform {
                header: Header { stamp, frame: &self.mount },
                child: &self.sonar,
                translation: face(&self.mounting, azimuth_deg),
                rotation: turned(azimuth_deg, self.mounting.tilt_deg),
            });
        }
        transforms
    }
}

/// The ids of an array's rangers as parts of the names of topics and frames.
pub(super) fn names(array: &RangerArray) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for ranger in &array.rangers {
        let mut name = plain(&ranger.id);
        while names.contains(&name) {
            name.push('_');
        }
        names.push(name);
    }
    names
}

/// The middle of a face from the axis that it is mounted on, turned by an azimuth.
fn face(mounting: &Mounting, azimuth_deg: f64) -> [f64; 3] {
    let turn = DVec2::from_angle(azimuth_deg.to_radians());
    let [x, y] = turn.rotate(DVec2::new(mounting.ahead_m, mounting.left_m)).to_array();
    [x, y, 0.0]
}

/// The quaternion of a turn to the left and then a tilt up, degrees: about z, then by as much back about y.
fn turned(left_deg: f64, up_deg: f64) -> [f64; 4] {
    let (sin_z, cos_z) = (left_deg.to_radians() / 2.0).sin_cos();
    let (sin_y, cos_y) = (-up_deg.to_radians() / 2.0).sin_cos();
    [-sin_z * sin_y, cos_z * sin_y, sin_z * cos_y, cos_z * cos_y]
}

/// An id as ROS takes it in a name: letters, digits and underscores, a letter first.
fn plain(id: &str) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    let name: String = id.chars().map(plain).collect();
    if name.starts_with(|c: char| c.is_ascii_alphabetic()) { name } else { format!("r{name}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where a quaternion takes the x axis.
    fn ahead([x, y, z, w]: [f64; 4]) -> [f64; 3] {
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)]
    }

    #[test]
    fn a_face_looks_where_its_viewpoint_does() {
        for (left_deg, up_deg) in [(0.0, 0.0), (90.0, 0.0), (30.0, 20.0), (-135.0, -60.0)] {
            let [x, y, z] = ahead(turned(left_deg, up_deg));
            let (left, up) = (f64::to_radians(left_deg), f64::to_radians(up_deg));
            let expected = [left.cos() * up.cos(), left.sin() * up.cos(), up.sin()];
            let off: f64 = [x, y, z].iter().zip(expected).map(|(a, b)| (a - b).abs()).sum();
            assert!(off < 1e-12, "{left_deg} {up_deg}: {x} {y} {z}");
        }
    }

    #[test]
    fn names_of_rangers_are_names_of_ros() {
        let names = ["s0", "front left", "7", "-", "é"].map(plain);
        assert_eq!(names, ["s0", "front_left", "r7", "r_", "r_"]);
    }
}
