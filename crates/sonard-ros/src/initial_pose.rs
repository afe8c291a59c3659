//! The robot's pose as somebody on the network tells it: `/initialpose`, which RViz's "2D Pose Estimate" publishes.

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
    services::{MOST_REQUESTS, in_time},
};

const TOPIC: &str = "/initialpose";
const TYPE: &str = "geometry_msgs/msg/PoseWithCovarianceStamped";

/// How far the length of a quaternion may be from 1: what rounding to a few digits leaves.
const MOST_OFF_LENGTH: f64 = 0.01;
/// How far the robot may lean, degrees: the ranger measures in its plane.
const MOST_LEAN_DEG: f64 = 1.0;
/// Characters that are told of a frame that is not known.
const MOST_TOLD: usize = 64;

/// What listens for poses.
pub(super) struct InitialPose(SimpleDataReader<Stamped, CDRDeserializerAdapter<Stamped>>);

impl InitialPose {
    /// Begins to listen, as a part of the node.
    pub(super) fn listen(node: &mut Node, subscriber: &Subscriber) -> CreateResult<Self> {
        let policies = reliable(MOST_REQUESTS, Durability::Volatile);
        let name = topic_on_wire(&node.namespace, TOPIC);
        let (type_name, kind) = (type_on_wire(TYPE), TopicKind::NoKey);
        let topic = node.participant.create_topic(name, type_name, &policies, kind)?;
        let reader = subscriber.create_simple_datareader_no_key(&topic, Some(policies))?;
        node.services[0].push(reader.guid().to_bytes());
        Ok(Self(reader))
    }

    /// Has the next scan taken where the last one that came says, if any came since the last time.
    pub(super) async fn obey(&self, daemon: &Handle, node: &mut Node) {
        self.0.drain_read_notifications();
        let mut last = None;
        for _ in 0..MOST_REQUESTS {
            match self.0.try_take_one() {
                Ok(Some(one)) => last = Some(one.into_value().pose()),
                Ok(None) => break,
                Err(error) => last = Some(Err(format!("it can't be read: {error}"))),
            }
        }
        let done = match last {
            None => return,
            Some(Ok(pose)) => in_time(daemon.order(Order::Pose(pose))).await,
            Some(Err(why)) => Err(why),
        };
        node.count_command(&done.map_err(|why| format!("{TOPIC} is not followed: {why}")));
    }
}

/// `geometry_msgs/PoseWithCovarianceStamped` up to the covariance: nobody here would make use of that.
#[derive(Debug, Deserialize)]
struct Stamped {
    _stamp: (i32, u32),
    frame: String,
    position: [f64; 3],
    /// Quaternion x, y, z, w.
    orientation: [f64; 4],
}

impl Stamped {
    /// Where the robot stands and looks, or why it can't stand so.
    fn pose(&self) -> Result<Pose, String> {
        if self.frame != MAP_FRAME {
            let told: String = self.frame.chars().take(MOST_TOLD).collect();
            return Err(format!("its frame is {told:?}; give a pose in the frame {MAP_FRAME:?}"));
        }
        if !self.position.iter().chain(&self.orientation).all(|figure| figure.is_finite()) {
            return Err("a figure of it is not finite".into());
        }
        let [x, y, z, w] = self.orientation;
        let length = [x, y, z, w].iter().map(|part| part * part).sum::<f64>().sqrt();
        if (length - 1.0).abs() > MOST_OFF_LENGTH {
            return Err(format!("its orientation is a quaternion of length {length}; 1 is one"));
        }
        let lean_deg = 2.0 * (x.hypot(y) / length).min(1.0).asin().to_degrees();
        if lean_deg > MOST_LEAN_DEG {
            return Err(format!(
                "it leans by {lean_deg:.0} degrees; only the turn about z may differ from 0"
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

    fn told(frame: &str, position: [f64; 3], orientation: [f64; 4]) -> Result<Pose, String> {
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
    fn an_upright_pose_in_the_map_is_taken() {
        for heading_deg in [0.0, 90.0, 179.0, -135.0] {
            let pose = told("map", [1.5, -2.25, 0.3], turned(heading_deg)).expect("good");
            assert_eq!([pose.x_m, pose.y_m], [1.5, -2.25]);
            assert!((pose.heading_deg - heading_deg).abs() < 1e-9, "{pose:?}");
            // The same turn.
            let opposite = turned(heading_deg).map(|part| -part);
            let same = told("map", [1.5, -2.25, 0.0], opposite).expect("good");
            assert!((same.heading_deg - heading_deg).abs() < 1e-9, "{same:?}");
        }
    }

    #[test]
    fn what_no_robot_can_do_here_is_refused_with_the_reason() {
        let refused = |frame: &str, position, orientation| {
            told(frame, position, orientation).expect_err("it is wrong")
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
        assert!(refused("map", here, [half, 0.0, 0.0, half]).contains("leans by 90 degrees"));
        assert!(refused("map", here, [0.0, 1.0, 0.0, 0.0]).contains("leans by 180 degrees"));
        let slightly = 0.4_f64.to_radians();
        assert!(told("map", here, [slightly.sin(), 0.0, 0.0, slightly.cos()]).is_ok());
    }

    proptest! {
        #[test]
        fn whatever_bytes_come_make_a_finite_pose_or_none(
            bytes in proptest::collection::vec(any::<u8>(), 0..400),
        ) {
            if let Some(Ok(pose)) = read(&bytes).map(|stamped| stamped.pose()) {
                prop_assert!(pose.x_m.is_finite() && pose.heading_deg.abs() <= 180.0);
            }
        }
    }
}
