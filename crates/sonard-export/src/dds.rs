//! Conventions of ROS 2 on DDS: names of topics and types on the wire, node discovery, and
//! `std_srvs/Trigger`. Messages are CDR with its four-byte encapsulation header.
//!
//! Sources: "ROS 2: Topic and Service name mapping to DDS" and "Node to Participant mapping"
//! (design.ros2.org); the messages of `rmw_dds_common`.

use crate::{
    Distribution,
    conversion::MAP,
    ros::cdr::{CdrWriter, Encode},
};

/// Discovery topic of nodes, and its message type.
pub const DISCOVERY_TOPIC: (&str, &str) =
    ("ros_discovery_info", "rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_");

/// World frame, in which poses are given.
pub const MAP_FRAME: &str = MAP;

/// Maximum length of a namespace, so topics stay within the 255 characters of DDS.
pub const MAX_NAMESPACE_LENGTH: usize = 100;

/// Identifier of a DDS participant, reader or writer.
pub type Guid = [u8; 16];

/// Returns the DDS name of a topic such as `/sonar/range` in a namespace such as `/kiwi`; the root
/// namespace is empty.
#[must_use]
pub fn topic_on_wire(namespace: &str, topic: &str) -> String {
    format!("rt{namespace}{topic}")
}

/// Returns the DDS names of request and reply of a service such as `/sonar/start`.
#[must_use]
pub fn service_on_wire(namespace: &str, service: &str) -> [String; 2] {
    [format!("rq{namespace}{service}Request"), format!("rr{namespace}{service}Reply")]
}

/// Returns the DDS name of a type such as `sensor_msgs/msg/Range`.
#[must_use]
pub fn type_on_wire(name: &str) -> String {
    match name.rsplit_once('/') {
        Some((package, name)) => format!("{}::dds_::{name}_", package.replace('/', "::")),
        None => name.to_owned(),
    }
}

/// Returns `true` for a valid namespace: empty, or names of letters, digits and `_`, each after a
/// `/`.
#[must_use]
pub fn is_namespace(text: &str) -> bool {
    let Some(names) = text.strip_prefix('/') else { return text.is_empty() };
    text.len() <= MAX_NAMESPACE_LENGTH && names.split('/').all(is_name)
}

/// Returns `true` for a valid ROS name: letters, digits and `_`, without a leading digit or a
/// double `_`.
#[must_use]
pub fn is_name(text: &str) -> bool {
    let fits = |byte: u8| byte.is_ascii_alphanumeric() || byte == b'_';
    text.bytes().all(fits)
        && text.starts_with(|first: char| first.is_ascii_alphabetic() || first == '_')
        && !text.contains("__")
}

/// Node with its DDS endpoints.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NodeInfo {
    /// Namespace, empty or such as `/kiwi`.
    pub namespace: String,
    /// Node name within the namespace.
    pub name: String,
    /// Readers of the node's subscriptions.
    pub readers: Vec<Guid>,
    /// Writers of the node's publications.
    pub writers: Vec<Guid>,
}

impl NodeInfo {
    /// Encodes the discovery message of the participant's only node:
    /// `rmw_dds_common/ParticipantEntitiesInfo`.
    #[must_use]
    pub fn announcement(&self, participant: Guid, distribution: Distribution) -> Vec<u8> {
        // Identifiers have 24 bytes up to Humble.
        let guid_bytes = match distribution {
            Distribution::Humble => 24,
            Distribution::Jazzy => 16,
        };
        encoded(&Announcement { node: self, participant, guid_bytes })
    }
}

struct Announcement<'a> {
    node: &'a NodeInfo,
    participant: Guid,
    guid_bytes: usize,
}

impl Encode for Announcement<'_> {
    fn encode(&self, cdr: &mut CdrWriter) {
        let guid = |guid: &Guid, cdr: &mut CdrWriter| {
            (0..self.guid_bytes).for_each(|at| cdr.u8(guid.get(at).copied().unwrap_or(0)));
        };
        guid(&self.participant, cdr);
        cdr.u32(1);
        cdr.text(if self.node.namespace.is_empty() { "/" } else { &self.node.namespace });
        cdr.text(&self.node.name);
        for guids in [&self.node.readers, &self.node.writers] {
            cdr.u32(guids.len() as u32);
            guids.iter().for_each(|each| guid(each, cdr));
        }
    }
}

/// DDS names of the request and reply types of `std_srvs/srv/Trigger`.
pub const TRIGGER_TYPES: [&str; 2] =
    ["std_srvs::srv::dds_::Trigger_Request_", "std_srvs::srv::dds_::Trigger_Response_"];

/// Identification of a service request, which depends on the client's middleware.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Requester {
    /// Header in the message: client and sequence number (`rmw_cyclonedds`).
    InMessage([u8; Self::BYTES]),
    /// Sample identity outside of the message, as in DDS-RPC (`rmw_fastrtps`).
    OutOfBand,
}

impl Requester {
    const BYTES: usize = 16;

    /// Identifies a `Trigger` request, which has no fields, by its bytes after the encapsulation
    /// header.
    #[must_use]
    pub fn from_trigger(request: &[u8]) -> Self {
        request.first_chunk().map_or(Self::OutOfBand, |header| Self::InMessage(*header))
    }

    /// Encodes the reply with its success flag and message.
    #[must_use]
    pub fn reply(self, success: bool, message: &str) -> Vec<u8> {
        encoded(&TriggerReply { to: self, success, message })
    }
}

struct TriggerReply<'a> {
    to: Requester,
    success: bool,
    message: &'a str,
}

impl Encode for TriggerReply<'_> {
    fn encode(&self, cdr: &mut CdrWriter) {
        if let Requester::InMessage(header) = self.to {
            header.iter().for_each(|byte| cdr.u8(*byte));
        }
        cdr.flag(self.success);
        cdr.text(self.message);
    }
}

fn encoded(message: &impl Encode) -> Vec<u8> {
    let mut buffer = Vec::new();
    CdrWriter::encode(message, &mut buffer);
    buffer
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn converts_names() {
        assert_eq!(topic_on_wire("", "/sonar/range"), "rt/sonar/range");
        assert_eq!(topic_on_wire("/kiwi", "/tf"), "rt/kiwi/tf");
        assert_eq!(type_on_wire("sensor_msgs/msg/Range"), "sensor_msgs::msg::dds_::Range_");
        assert_eq!(
            service_on_wire("/kiwi", "/sonar/start"),
            ["rq/kiwi/sonar/startRequest", "rr/kiwi/sonar/startReply"]
        );
    }

    #[test]
    fn validates_namespaces() {
        for good in ["", "/kiwi", "/lab/_kiwi_7"] {
            assert!(is_namespace(good), "{good}");
        }
        let long = format!("/{}", "a".repeat(MAX_NAMESPACE_LENGTH));
        for bad in ["kiwi", "/", "/kiwi/", "/7", "/a b", "/a__b", "/a//b", "/é", &long] {
            assert!(!is_namespace(bad), "{bad}");
        }
    }

    /// Comparison with an independent CDR encoder.
    #[test]
    fn encodes_discovery_message() {
        let guid = |first: u8| std::array::from_fn::<u8, 16, _>(|at| first + at as u8);
        let node = NodeInfo {
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
        let encoded = node.announcement(guid(0), Distribution::Jazzy);
        assert_eq!((&encoded[..4], &encoded[4..]), (&[0, 1, 0, 0][..], &other[..]));

        // Identifiers padded by eight zeros.
        let wide = |first: u8| (guid(first), [0_u8; 8]);
        let mine: Info<(Guid, [u8; 8])> = (
            wide(0),
            vec![("/kiwi".into(), "sonard".into(), vec![wide(1)], vec![wide(2), wide(3)])],
        );
        let other = cdr_encoding::to_vec::<_, byteorder::LittleEndian>(&mine).expect("encodes");
        assert_eq!(node.announcement(guid(0), Distribution::Humble)[4..], other);
    }

    #[test]
    fn replies_match_requests() {
        // A message without fields is one byte, and padding.
        for request in [&[][..], &[0], &[0, 0, 0, 0]] {
            let asker = Requester::from_trigger(request);
            assert_eq!(asker, Requester::OutOfBand);
            let reply = asker.reply(true, "ok");
            assert_eq!(reply, [0, 1, 0, 0, 1, 0, 0, 0, 3, 0, 0, 0, b'o', b'k', 0]);
        }
        let header: [u8; 16] = std::array::from_fn(|at| at as u8);
        let asker = Requester::from_trigger(&[&header[..], &[0]].concat());
        assert_eq!(asker, Requester::InMessage(header));
        let reply = asker.reply(false, "");
        assert_eq!(reply[4..], [&header[..], &[0, 0, 0, 0, 1, 0, 0, 0, 0]].concat());
    }
}
