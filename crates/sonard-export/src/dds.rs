//! How ROS 2 uses DDS: what topics and types are called on the wire, how a node makes itself known, and what
//! `std_srvs/Trigger` looks like. Bytes are CDR with the four bytes that say so.
//!
//! Sources: "ROS 2: Topic and Service name mapping to DDS" and "Node to Participant mapping" (design.ros2.org);
//! the messages of `rmw_dds_common`.

use crate::{
    Distribution,
    conversion::MAP,
    ros::cdr::{Cdr, Encode},
};

/// The topic by which nodes make themselves known, and the type of its messages.
pub const NODES: (&str, &str) =
    ("ros_discovery_info", "rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_");

/// The frame of the world, in which poses are.
pub const MAP_FRAME: &str = MAP;

/// Most characters of a namespace, so that topics stay within the 255 that DDS has.
pub const MOST_NAMESPACE: usize = 100;

/// Number of a participant, reader or writer of DDS.
pub type Guid = [u8; 16];

/// What a topic as `/sonar/range` is called on the wire, under a namespace as `/kiwi`; the outermost one is empty.
#[must_use]
pub fn topic_on_wire(namespace: &str, topic: &str) -> String {
    format!("rt{namespace}{topic}")
}

/// What request and reply of a service as `/sonar/start` are called on the wire.
#[must_use]
pub fn service_on_wire(namespace: &str, service: &str) -> [String; 2] {
    [format!("rq{namespace}{service}Request"), format!("rr{namespace}{service}Reply")]
}

/// What a type as `sensor_msgs/msg/Range` is called on the wire.
#[must_use]
pub fn type_on_wire(name: &str) -> String {
    match name.rsplit_once('/') {
        Some((package, name)) => format!("{}::dds_::{name}_", package.replace('/', "::")),
        None => name.to_owned(),
    }
}

/// Whether a text can be a namespace: empty, or names of letters, digits and `_`, each behind a `/`.
#[must_use]
pub fn is_namespace(text: &str) -> bool {
    let Some(names) = text.strip_prefix('/') else { return text.is_empty() };
    text.len() <= MOST_NAMESPACE && names.split('/').all(is_name)
}

/// Whether a text can be a name of ROS: letters, digits and `_`, no digit first and no two `_` together.
#[must_use]
pub fn is_name(text: &str) -> bool {
    let fits = |byte: u8| byte.is_ascii_alphanumeric() || byte == b'_';
    text.bytes().all(fits)
        && text.starts_with(|first: char| first.is_ascii_alphabetic() || first == '_')
        && !text.contains("__")
}

/// A node, and what of DDS belongs to it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Node {
    /// Empty, or as `/kiwi`.
    pub namespace: String,
    /// Its name in there.
    pub name: String,
    /// What it listens by.
    pub readers: Vec<Guid>,
    /// What it tells by.
    pub writers: Vec<Guid>,
}

impl Node {
    /// What the only node of a participant says of itself: `rmw_dds_common/ParticipantEntitiesInfo`.
    #[must_use]
    pub fn announcement(&self, participant: Guid, distribution: Distribution) -> Vec<u8> {
        // Up to Humble numbers have room for those of other middleware.
        let room = match distribution {
            Distribution::Humble => 24,
            Distribution::Jazzy => 16,
        };
        encoded(&Announcement { node: self, participant, room })
    }
}

struct Announcement<'a> {
    node: &'a Node,
    participant: Guid,
    room: usize,
}

impl Encode for Announcement<'_> {
    fn encode(&self, cdr: &mut Cdr) {
        let guid = |guid: &Guid, cdr: &mut Cdr| {
            (0..self.room).for_each(|at| cdr.u8(guid.get(at).copied().unwrap_or(0)));
        };
        guid(&self.participant, cdr);
        cdr.u32(1);
        cdr.text(if self.node.namespace.is_empty() { "/" } else { &self.node.namespace });
        cdr.text(&self.node.name);
        for guids in [&self.node.readers, &self.node.writers] {
            cdr.u32(guids.len() as u32);
            guids.iter().for_each(|one| guid(one, cdr));
        }
    }
}

/// The types of request and reply of `std_srvs/srv/Trigger`, as they are called on the wire.
pub const TRIGGER: [&str; 2] =
    ["std_srvs::srv::dds_::Trigger_Request_", "std_srvs::srv::dds_::Trigger_Response_"];

/// Who asked for what, as the middleware of the asker says it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Asker {
    /// In the message itself: number of the asker and of its request (`rmw_cyclonedds`).
    Within([u8; Self::BYTES]),
    /// Beside the message, as DDS-RPC has it (`rmw_fastrtps`).
    Beside,
}

impl Asker {
    const BYTES: usize = 16;

    /// Who sent a request of `Trigger`, which has no fields of its own, by its bytes behind the four of the encoding.
    #[must_use]
    pub fn of_trigger(request: &[u8]) -> Self {
        request.first_chunk().map_or(Self::Beside, |header| Self::Within(*header))
    }

    /// The reply to it: whether that was done, and what there is to say.
    #[must_use]
    pub fn reply(self, success: bool, message: &str) -> Vec<u8> {
        encoded(&Reply { to: self, success, message })
    }
}

struct Reply<'a> {
    to: Asker,
    success: bool,
    message: &'a str,
}

impl Encode for Reply<'_> {
    fn encode(&self, cdr: &mut Cdr) {
        if let Asker::Within(header) = self.to {
            header.iter().for_each(|byte| cdr.u8(*byte));
        }
        cdr.flag(self.success);
        cdr.text(self.message);
    }
}

fn encoded(message: &impl Encode) -> Vec<u8> {
    let mut buffer = Vec::new();
    Cdr::of(message, &mut buffer);
    buffer
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_on_the_wire_are_those_of_ros() {
        assert_eq!(topic_on_wire("", "/sonar/range"), "rt/sonar/range");
        assert_eq!(topic_on_wire("/kiwi", "/tf"), "rt/kiwi/tf");
        assert_eq!(type_on_wire("sensor_msgs/msg/Range"), "sensor_msgs::msg::dds_::Range_");
        assert_eq!(
            service_on_wire("/kiwi", "/sonar/start"),
            ["rq/kiwi/sonar/startRequest", "rr/kiwi/sonar/startReply"]
        );
    }

    #[test]
    fn namespaces_are_names_behind_slashes() {
        for good in ["", "/kiwi", "/lab/_kiwi_7"] {
            assert!(is_namespace(good), "{good}");
        }
        let long = format!("/{}", "a".repeat(MOST_NAMESPACE));
        for bad in ["kiwi", "/", "/kiwi/", "/7", "/a b", "/a__b", "/a//b", "/é", &long] {
            assert!(!is_namespace(bad), "{bad}");
        }
    }

    /// The bytes as another encoder of CDR has them.
    #[test]
    fn a_node_says_who_it_is_as_rmw_dds_common_has_it() {
        let guid = |first: u8| std::array::from_fn::<u8, 16, _>(|at| first + at as u8);
        let node = Node {
            namespace: "/kiwi".into(),
            name: "sonard".into(),
            readers: vec![guid(1)],
            writers: vec![guid(2), guid(3)],
        };
        type Info<G> = (G, Vec<(String, String, Vec<G>, Vec<G>)>);
        let mine: Info<Guid> = (
            guid(0),
            vec![("/kiwi".into(), "sonard".into(), vec![guid(1)], vec![guid(2), guid(3)])],
        );
        let other = cdr_encoding::to_vec::<_, byteorder::LittleEndian>(&mine).expect("encodes");
        let told = node.announcement(guid(0), Distribution::Jazzy);
        assert_eq!((&told[..4], &told[4..]), (&[0, 1, 0, 0][..], &other[..]));

        // Eight zeros behind each number.
        let wide = |first: u8| (guid(first), [0_u8; 8]);
        let mine: Info<(Guid, [u8; 8])> = (
            wide(0),
            vec![("/kiwi".into(), "sonard".into(), vec![wide(1)], vec![wide(2), wide(3)])],
        );
        let other = cdr_encoding::to_vec::<_, byteorder::LittleEndian>(&mine).expect("encodes");
        assert_eq!(node.announcement(guid(0), Distribution::Humble)[4..], other);
    }

    #[test]
    fn a_reply_goes_back_the_way_that_its_request_came() {
        // No fields are one byte, and padding.
        for request in [&[][..], &[0], &[0, 0, 0, 0]] {
            let asker = Asker::of_trigger(request);
            assert_eq!(asker, Asker::Beside);
            let told = asker.reply(true, "ok");
            assert_eq!(told, [0, 1, 0, 0, 1, 0, 0, 0, 3, 0, 0, 0, b'o', b'k', 0]);
        }
        let header: [u8; 16] = std::array::from_fn(|at| at as u8);
        let asker = Asker::of_trigger(&[&header[..], &[0]].concat());
        assert_eq!(asker, Asker::Within(header));
        let told = asker.reply(false, "");
        assert_eq!(told[4..], [&header[..], &[0, 0, 0, 0, 1, 0, 0, 0, 0]].concat());
    }
}
