//! ROS 2 node: a DDS participant with a writer of serialized messages for each topic.

use std::{
    collections::BTreeMap,
    convert::Infallible,
    net::IpAddr,
    time::{Duration, Instant},
};

use jiff::Timestamp;
use rustdds::{
    DataWriterStatus, DomainParticipant, DomainParticipantBuilder, Publisher, QosPolicies,
    QosPolicyBuilder, RTPSEntity as _, RepresentationIdentifier, StatusEvented as _, TopicKind,
    bytes::Bytes,
    dds::{CreateResult, WriteError},
    no_key::{DataWriter, SerializerAdapter},
    policy::{Durability, History},
};
use sonard_api::{RosReport, config::RosKeys};
use sonard_daemon::{Handle, LiveMessageSink};
use sonard_export::{
    Distribution, LiveMessage, Topic,
    dds::{self, DISCOVERY_TOPIC, Guid, topic_on_wire, type_on_wire},
};
use sonard_records::EventKind;

use super::{
    dropped::DroppedMessages,
    networks::{addresses, interfaces},
    send_limit::SendLimit,
};

/// Name of the node.
const NAME: &str = "sonard";
/// History depth of a volatile topic, and of a static topic that is kept for late subscribers.
const DEPTHS: [i32; 2] = [10, 1];
/// Socket buffer size, bytes; the traffic is small.
const SOCKET_BYTES: usize = 1 << 18;
/// Minimum interval between two logged rejections.
const REFUSAL_LOG_INTERVAL: Duration = Duration::from_secs(5);
/// Time allowed for the acknowledgement of the last messages.
const DRAIN_TIMEOUT: Duration = Duration::from_secs(1);

/// Serialized message without the four bytes of the encapsulation header, which DDS adds.
pub(super) struct RawBytes;

impl SerializerAdapter<Bytes> for RawBytes {
    type Error = Infallible;

    fn output_encoding() -> RepresentationIdentifier {
        RepresentationIdentifier::CDR_LE
    }

    fn to_bytes(bytes: &Bytes) -> Result<Bytes, Infallible> {
        Ok(bytes.clone())
    }
}

pub(super) type Writer = DataWriter<Bytes, RawBytes>;

/// Strips the four bytes of the encapsulation header from a message.
pub(super) fn without_encoding(message: &[u8]) -> Bytes {
    Bytes::copy_from_slice(message.get(4..).unwrap_or_default())
}

/// Policies of a reliable topic; writing never blocks.
pub(super) fn reliable(depth: i32, durability: Durability) -> QosPolicies {
    QosPolicyBuilder::new()
        .reliable(rustdds::Duration::ZERO)
        .durability(durability)
        .history(History::KeepLast { depth })
        .build()
}

/// Node on the network.
pub(super) struct Node {
    offers: BTreeMap<String, Offer>,
    /// Writer of the node's announcement (`ros_discovery_info`).
    announcer: Writer,
    publisher: Publisher,
    /// Dropped last: the entities it created deregister before.
    pub(super) participant: DomainParticipant,
    daemon: Handle,
    /// Readers and writers of the services and of the pose subscription.
    pub(super) services: [Vec<Guid>; 2],
    distribution: Distribution,
    pub(super) namespace: String,
    queue_bytes: usize,
    report: RosReport,
    dropped: DroppedMessages,
    /// Time of the last logged rejection.
    rejection_logged: Option<Instant>,
    /// Failure that ends the node.
    fault: Option<String>,
}

/// Offered topic with its writer.
struct Offer {
    topic: Topic,
    writer: Writer,
    limit: SendLimit,
    subscriptions: i32,
}

impl Node {
    /// Opens the ports of DDS and creates the announcement's writer. Counters continue from
    /// `report`.
    pub(super) fn open(
        keys: &RosKeys,
        daemon: &Handle,
        report: &RosReport,
    ) -> Result<Self, Box<dyn std::error::Error>> {
        let networks = addresses(&keys.networks, &interfaces())?;
        let participant = DomainParticipantBuilder::new(keys.domain)
            .with_only_networks(networks.iter().copied())
            .socket_receive_buffer_size(SOCKET_BYTES)
            .socket_send_buffer_size(SOCKET_BYTES)
            .build()?;
        let publisher = participant.create_publisher(&QosPolicies::qos_none())?;
        let announcer = {
            let policies = reliable(1, Durability::TransientLocal);
            writer(&participant, &publisher, DISCOVERY_TOPIC.0, DISCOVERY_TOPIC.1, &policies)?
        };
        let networks = networks.iter().map(IpAddr::to_string).collect();
        let (up, since) = (true, Timestamp::now());
        Ok(Self {
            daemon: daemon.clone(),
            participant,
            publisher,
            announcer,
            offers: BTreeMap::new(),
            services: [Vec::new(), Vec::new()],
            distribution: keys.message_settings().distribution,
            namespace: keys.namespace.clone(),
            queue_bytes: keys.queue_kb as usize * 1000,
            report: RosReport { networks, up, since, error: None, ..report.clone() },
            dropped: DroppedMessages::default(),
            rejection_logged: None,
            fault: None,
        })
    }

    /// Publishes the node's announcement with its readers and writers.
    pub(super) fn announce_node(&mut self) {
        let offered = self.offers.values().map(|offer| offer.writer.guid().to_bytes());
        let [readers, writers] = self.services.clone();
        let node = dds::NodeInfo {
            namespace: self.namespace.clone(),
            name: NAME.into(),
            readers,
            writers: offered.chain(writers).collect(),
        };
        let participant = self.participant.guid().to_bytes();
        let message = node.announcement(participant, self.distribution);
        let written = self.announcer.write(without_encoding(&message), Some(now()));
        if let Err(error) = written {
            self.fault = Some(format!("the node can't be announced: {error}"));
        }
    }

    /// Creates a writer for a topic and a type, both by their DDS names.
    pub(super) fn writer(
        &self,
        topic: &str,
        type_name: &str,
        policies: &QosPolicies,
    ) -> CreateResult<Writer> {
        writer(&self.participant, &self.publisher, topic, type_name, policies)
    }

    fn offer(&self, topic: &Topic) -> CreateResult<Offer> {
        let (depth, durability) = match topic.is_static() {
            true => (DEPTHS[1], Durability::TransientLocal),
            false => (DEPTHS[0], Durability::Volatile),
        };
        let name = topic_on_wire(&self.namespace, &topic.name);
        let policies = reliable(depth, durability);
        Ok(Offer {
            topic: topic.clone(),
            writer: self.writer(&name, &type_on_wire(topic.type_name()), &policies)?,
            limit: SendLimit::new(self.queue_bytes),
            subscriptions: 0,
        })
    }

    /// Updates the number of subscriptions and reports to the daemon.
    ///
    /// # Errors
    /// Description of a failure that ends the node.
    pub(super) fn update(&mut self) -> Result<(), String> {
        for offer in self.offers.values_mut() {
            while let Some(status) = offer.writer.try_recv_status() {
                if let DataWriterStatus::PublicationMatched { current, .. } = status {
                    offer.subscriptions = current.count();
                }
            }
        }
        let subscriptions = self.offers.values().map(|offer| i64::from(offer.subscriptions));
        self.report.subscriptions = subscriptions.sum::<i64>().unsigned_abs();
        if let Some(text) = self.dropped.take_report(Instant::now()) {
            tracing::warn!("ros: {text}");
            self.daemon.event(EventKind::Gap, format!("ros: {text}"));
        }
        self.daemon.report_ros(self.report.clone());
        self.fault.take().map_or(Ok(()), Err)
    }

    /// Counts a command before the reply is sent. The log of rejections is rate-limited.
    pub(super) fn count_command<T>(&mut self, done: &Result<T, String>) {
        match done {
            Ok(_) => self.report.commands += 1,
            Err(reason) => {
                self.report.rejected += 1;
                self.report.refusal = Some(reason.clone());
                let is_early =
                    self.rejection_logged.is_some_and(|last| last.elapsed() < REFUSAL_LOG_INTERVAL);
                if !is_early {
                    self.rejection_logged = Some(Instant::now());
                    tracing::warn!("ros: {reason}");
                }
            }
        }
        self.daemon.report_ros(self.report.clone());
    }

    /// Waits up to a second for the last acknowledgements and closes the node.
    pub(super) fn leave(self) -> RosReport {
        let deadline = Instant::now() + DRAIN_TIMEOUT;
        for offer in self.offers.values() {
            let left = deadline.saturating_duration_since(Instant::now());
            drop(offer.writer.wait_for_acknowledgments(left));
        }
        self.report
    }
}

impl LiveMessageSink for Node {
    fn set_topics(&mut self, topics: &[Topic]) {
        self.offers.retain(|_, offer| topics.contains(&offer.topic));
        for topic in topics {
            if self.offers.contains_key(&topic.name) {
                continue;
            }
            match self.offer(topic) {
                Ok(offer) => drop(self.offers.insert(topic.name.clone(), offer)),
                Err(error) => {
                    self.fault = Some(format!("{} can't be offered: {error}", topic.name));
                }
            }
        }
        self.report.topics = self.offers.len() as u64;
        self.announce_node();
    }

    fn send(&mut self, message: &LiveMessage<'_>) {
        let Some(offer) = self.offers.get_mut(message.topic) else { return };
        let (writer, bytes) = (&offer.writer, message.bytes.len());
        let all_acknowledged =
            || matches!(writer.wait_for_acknowledgments(Duration::ZERO), Ok(true));
        let written = match offer.limit.has_room(bytes, all_acknowledged) {
            true => writer.write(without_encoding(message.bytes), Some(now())).map_err(Some),
            false => Err(None),
        };
        match written {
            Ok(()) => {
                offer.limit.add(bytes);
                self.report.messages += 1;
            }
            Err(None | Some(WriteError::WouldBlock { .. })) => {
                self.report.dropped += 1;
                self.dropped.add(message.topic);
            }
            Err(Some(error)) => {
                self.fault = Some(format!("{} can't be published: {error}", message.topic));
            }
        }
    }

    fn report_loss(&mut self, words: String) {
        tracing::warn!("ros: {words}");
        self.daemon.event(EventKind::Gap, format!("ros: {words}"));
    }

    fn end_of_record(&mut self) {}
}

fn writer(
    participant: &DomainParticipant,
    publisher: &Publisher,
    topic: &str,
    type_name: &str,
    policies: &QosPolicies,
) -> CreateResult<Writer> {
    let topic = participant.create_topic(
        topic.to_owned(),
        type_name.to_owned(),
        policies,
        TopicKind::NoKey,
    )?;
    publisher.create_datawriter_no_key(&topic, Some(policies.clone()))
}

pub(super) fn now() -> rustdds::Timestamp {
    rustdds::Timestamp::now()
}
