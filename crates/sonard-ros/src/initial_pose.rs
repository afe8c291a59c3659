//! Subscription to `/initialpose`, the robot's pose as published by RViz's "2D Pose Estimate".

use rustdds::{
    Subscriber, TopicKind, dds::CreateResult, no_key::SimpleDataReader, policy::Durability,
    serialization::CDRDeserializerAdapter,
};
use serde::Deserialize;
use sonard_daemon::{Handle, Order};
use sonard_export::dds::{MAP_FRAME, topic_on_wire, type_on_wire};
use sonard_model::geometry::{Pose, wrap_180};

use super::{
    node::{Node, reliable},
    services::{MAX_REQUESTS, in_time},
};

const TOPIC: &str = "/initialpose";
const TYPE: &str = "geometry_msgs/msg/PoseWithCovarianceStamped";

/// Maximum deviation of a quaternion's length from 1: the effect of rounding to a few digits.
const MAX_LENGTH_ERROR: f64 = 0.01;
/// Maximum inclination of the robot, degrees: the ranger measures in its plane.
const MAX_LEAN_DEG: f64 = 1.0;
/// Maximum length of an unknown frame's name in a message, characters.
const MAX_FRAME_CHARS: usize = 64;

/// Subscription to initial poses.
pub(super) struct InitialPose(SimpleDataReader<Stamped, CDRDeserializerAdapter<Stamped>>);

impl InitialPose {
    /// Subscribes as a part of the node.
    pub(super) fn subscribe(node: &mut Node, subscriber: &Subscriber) -> CreateResult<Self> {
        let policies = reliable(MAX_REQUESTS, Durability::Volatile);
        let name = topic_on_wire(&node.namespace, TOPIC);
        let (type_name, kind) = (type_on_wire(TYPE), TopicKind::NoKey);
        let topic = node.participant.create_topic(name, type_name, &policies, kind)?;
        let reader = subscriber.create_simple_datareader_no_key(&topic, Some(policies))?;
        node.services[0].push(reader.guid().to_bytes());
        Ok(Self(reader))
    }

    /// Applies the latest pose received since the last call, if any, to the next scan.
    pub(super) async fn apply_latest(&self, daemon: &Handle, node: &mut Node) {
        self.0.drain_read_notifications();
        let mut latest = None;
        for _ in 0..MAX_REQUESTS {
            match self.0.try_take_one() {
                Ok(Some(sample)) => latest = Some(sample.into_value().pose()),
                Ok(None) => break,
                Err(error) => latest = Some(Err(format!("it can't be read: {error}"))),
            }
        }
        let done = match latest {
            None => return,
            Some(Ok(pose)) => in_time(daemon.order(Order::Pose(pose))).await,
            Some(Err(reason)) => Err(reason),
        };
        node.count_command(&done.map_err(|reason| format!("{TOPIC} is rejected: {reason}")));
    }
}

/// `geometry_msgs/PoseWithCovarianceStamped` without the covariance, which is not used.
#[derive(Debug, Deserialize)]
struct Stamped {
    _stamp: (i32, u32),
    frame: String,
    position: [f64; 3],
    /// Quaternion x, y, z, w.
    orientation: [f64; 4],
}

impl Stamped {
    /// Converts the message to a planar pose.
    ///
    /// # Errors
    /// The reason for which the pose is invalid.
    fn pose(&self) -> Result<Pose, String> {
        if self.frame != MAP_FRAME {
            let frame: String = self.frame.chars().take(MAX_FRAME_CHARS).collect();
            return Err(format!("its frame is {frame:?}; give a pose in the frame {MAP_FRAME:?}"));
        }
        if !self.position.iter().chain(&self.orientation).all(|number| number.is_finite()) {
            return Err("a number in it is not finite".into());
        }
        let [x, y, z, w] = self.orientation;
        let length = [x, y, z, w].iter().map(|part| part * part).sum::<f64>().sqrt();
        if (length - 1.0).abs() > MAX_LENGTH_ERROR {
            return Err(format!("its orientation is a quaternion of length {length}, not 1"));
        }
        let lean_deg = 2.0 * (x.hypot(y) / length).min(1.0).asin().to_degrees();
        if lean_deg > MAX_LEAN_DEG {
            return Err(format!(
                "it is inclined by {lean_deg:.0} degrees; only the rotation about z may differ from 0"
            ));
        }
        let [x_m, y_m, _] = self.position;
        Ok(Pose { x_m, y_m, heading_deg: wrap_180(2.0 * z.atan2(w).to_degrees()) })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use rustdds::{
        RepresentationIdentifier, no_key::DeserializerAdapter as _,
        serialization::to_writer_with_rep_id,
    };

    use super::*;

    const LITTLE: RepresentationIdentifier = RepresentationIdentifier::CDR_LE;

    fn read(bytes: &[u8]) -> Option<Stamped> {
        CDRDeserializerAdapter::<Stamped>::from_bytes(bytes, LITTLE).ok()
    }

    fn pose_from(frame: &str, position: [f64; 3], orientation: [f64; 4]) -> Result<Pose, String> {
        // The covariance: 36 numbers.
        let message = ((7_i32, 8_u32), frame, position, orientation, [[0.25_f64; 6]; 6]);
        let mut bytes = Vec::new();
        to_writer_with_rep_id(&mut bytes, &message, LITTLE).expect("it encodes");
        read(&bytes).expect("whole").pose()
    }

    fn turned(heading_deg: f64) -> [f64; 4] {
        let half = (heading_deg / 2.0).to_radians();
        [0.0, 0.0, half.sin(), half.cos()]
    }

    #[test]
    fn upright_pose_is_accepted() {
        for heading_deg in [0.0, 90.0, 179.0, -135.0] {
            let pose = pose_from("map", [1.5, -2.25, 0.3], turned(heading_deg)).expect("good");
            assert_eq!([pose.x_m, pose.y_m], [1.5, -2.25]);
            assert!((pose.heading_deg - heading_deg).abs() < 1e-9, "{pose:?}");
            // The negative quaternion is the same rotation.
            let opposite = turned(heading_deg).map(|part| -part);
            let same = pose_from("map", [1.5, -2.25, 0.0], opposite).expect("good");
            assert!((same.heading_deg - heading_deg).abs() < 1e-9, "{same:?}");
        }
    }

    #[test]
    fn invalid_pose_is_rejected() {
        let refused = |frame: &str, position, orientation| {
            pose_from(frame, position, orientation).expect_err("it is invalid")
        };
        let (here, ahead) = ([0.0; 3], turned(0.0));
        for frame in ["", "odom", "/map", &"x".repeat(500)] {
            let why = refused(frame, here, ahead);
            assert!(why.contains("frame \"map\"") && why.len() < 150, "{why}");
        }
        assert!(refused("map", [f64::NAN, 0.0, 0.0], ahead).contains("not finite"));
        assert!(refused("map", here, [0.0, 0.0, f64::INFINITY, 1.0]).contains("not finite"));
        assert!(refused("map", here, [0.0; 4]).contains("length 0"));
        assert!(refused("map", here, [0.0, 0.0, 1e300, 1e300]).contains("length"));
        let half = 0.5_f64.sqrt();
        assert!(refused("map", here, [half, 0.0, 0.0, half]).contains("inclined by 90 degrees"));
        assert!(refused("map", here, [0.0, 1.0, 0.0, 0.0]).contains("inclined by 180 degrees"));
        let slightly = 0.4_f64.to_radians();
        assert!(pose_from("map", here, [slightly.sin(), 0.0, 0.0, slightly.cos()]).is_ok());
    }

    proptest! {
        #[test]
        fn any_bytes_are_handled(
            bytes in proptest::collection::vec(any::<u8>(), 0..400),
        ) {
            if let Some(Ok(pose)) = read(&bytes).map(|stamped| stamped.pose()) {
                prop_assert!(pose.x_m.is_finite() && pose.heading_deg.abs() <= 180.0);
            }
        }
    }
}
