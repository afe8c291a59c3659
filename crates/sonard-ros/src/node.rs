//! The node: a participant of DDS with a writer for each topic. It takes bytes as they are.

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
use sonard_daemon::{Audience, Handle};
use sonard_export::{
    Distribution, LiveMessage, Topic,
    dds::{self, Guid, NODES, topic_on_wire, type_on_wire},
};
use sonard_records::EventKind;

use super::{
    budget::Budget,
    gaps::Gaps,
    networks::{addresses, interfaces},
};

/// What nodes are called.
const NAME: &str = "sonard";
/// Messages that are kept of a topic for those who come late, and of one that stands still.
const DEPTHS: [i32; 2] = [10, 1];
/// What the kernel may keep for a socket, bytes: nobody sends much.
const SOCKET_BYTES: usize = 1 << 18;
/// Least time from one refusal that is told to the next.
const BETWEEN_REFUSALS: Duration = Duration::from_secs(5);
/// How long the last messages may take to be acknowledged.
const LAST: Duration = Duration::from_secs(1);

/// Bytes of a message behind the four that say how it is encoded, which DDS adds itself.
pub(super) struct AsItIs;

impl SerializerAdapter<Bytes> for AsItIs {
    type Error = Infallible;

    fn output_encoding() -> RepresentationIdentifier {
        RepresentationIdentifier::CDR_LE
    }

    fn to_bytes(bytes: &Bytes) -> Result<Bytes, Infallible> {
        Ok(bytes.clone())
    }
}

pub(super) type Writer = DataWriter<Bytes, AsItIs>;

/// A message without the four bytes of its encoding.
pub(super) fn without_encoding(message: &[u8]) -> Bytes {
    Bytes::copy_from_slice(message.get(4..).unwrap_or_default())
}

/// Reliable, and never waiting for anybody.
pub(super) fn reliable(depth: i32, durability: Durability) -> QosPolicies {
    QosPolicyBuilder::new()
        .reliable(rustdds::Duration::ZERO)
        .durability(durability)
        .history(History::KeepLast { depth })
        .build()
}

/// The node while it is there.
pub(super) struct Node {
    offers: BTreeMap<String, Offer>,
    /// By which it says who it is.
    announcer: Writer,
    publisher: Publisher,
    /// Goes last: what is made by it leaves with a word to others.
    pub(super) participant: DomainParticipant,
    daemon: Handle,
    /// Readers and writers of services, and what listens for poses.
    pub(super) services: [Vec<Guid>; 2],
    distribution: Distribution,
    pub(super) namespace: String,
    queue_bytes: usize,
    report: RosReport,
    gaps: Gaps,
    /// When a refusal was told last.
    refused: Option<Instant>,
    /// Why it can't go on.
    fault: Option<String>,
}

/// A topic that is offered.
struct Offer {
    topic: Topic,
    writer: Writer,
    budget: Budget,
    subscriptions: i32,
}

impl Node {
    /// Opens the ports of DDS and says who it is; `report` goes on from what it was.
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
            writer(&participant, &publisher, NODES.0, NODES.1, &policies)?
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
            distribution: keys.messages().distribution,
            namespace: keys.namespace.clone(),
            queue_bytes: keys.queue_kb as usize * 1000,
            report: RosReport { networks, up, since, trouble: None, ..report.clone() },
            gaps: Gaps::default(),
            refused: None,
            fault: None,
        })
    }

    /// Says who it is, with what it offers.
    pub(super) fn announce_itself(&mut self) {
        let offered = self.offers.values().map(|offer| offer.writer.guid().to_bytes());
        let [readers, writers] = self.services.clone();
        let node = dds::Node {
            namespace: self.namespace.clone(),
            name: NAME.into(),
            readers,
            writers: offered.chain(writers).collect(),
        };
        let participant = self.participant.guid().to_bytes();
        let message = node.announcement(participant, self.distribution);
        let written = self.announcer.write(without_encoding(&message), Some(now()));
        if let Err(error) = written {
            self.fault = Some(format!("the node can't say who it is: {error}"));
        }
    }

    /// A writer of its own, of a type as it is called on the wire.
    pub(super) fn writer(
        &self,
        topic: &str,
        type_name: &str,
        policies: &QosPolicies,
    ) -> CreateResult<Writer> {
        writer(&self.participant, &self.publisher, topic, type_name, policies)
    }

    fn offer(&self, topic: &Topic) -> CreateResult<Offer> {
        let (depth, durability) = match topic.stands_still() {
            true => (DEPTHS[1], Durability::TransientLocal),
            false => (DEPTHS[0], Durability::Volatile),
        };
        let name = topic_on_wire(&self.namespace, &topic.name);
        let policies = reliable(depth, durability);
        Ok(Offer {
            topic: topic.clone(),
            writer: self.writer(&name, &type_on_wire(topic.type_name()), &policies)?,
            budget: Budget::new(self.queue_bytes),
            subscriptions: 0,
        })
    }

    /// Takes in who came and went, and says how it goes; fails when it can't go on.
    pub(super) fn look_after(&mut self) -> Result<(), String> {
        for offer in self.offers.values_mut() {
            while let Some(status) = offer.writer.try_recv_status() {
                if let DataWriterStatus::PublicationMatched { current, .. } = status {
                    offer.subscriptions = current.count();
                }
            }
        }
        let subscriptions = self.offers.values().map(|offer| i64::from(offer.subscriptions));
        self.report.subscriptions = subscriptions.sum::<i64>().unsigned_abs();
        if let Some(words) = self.gaps.say(Instant::now()) {
            tracing::warn!("ros: {words}");
            self.daemon.event(EventKind::Gap, format!("ros: {words}"));
        }
        self.daemon.report_ros(self.report.clone());
        self.fault.take().map_or(Ok(()), Err)
    }

    /// Counts what was asked for, before that is answered; why it was refused is told, but not as often as somebody can ask.
    pub(super) fn count_command<T>(&mut self, done: &Result<T, String>) {
        match done {
            Ok(_) => self.report.commands += 1,
            Err(why) => {
                self.report.refused += 1;
                self.report.refusal = Some(why.clone());
                let is_early = self.refused.is_some_and(|last| last.elapsed() < BETWEEN_REFUSALS);
                if !is_early {
                    self.refused = Some(Instant::now());
                    tracing::warn!("ros: {why}");
                }
            }
        }
        self.daemon.report_ros(self.report.clone());
    }

    /// Waits until the last messages are acknowledged, if that does not take long, and leaves.
    pub(super) fn leave(self) -> RosReport {
        let last = Instant::now() + LAST;
        for offer in self.offers.values() {
            let left = last.saturating_duration_since(Instant::now());
            drop(offer.writer.wait_for_acknowledgments(left));
        }
        self.report
    }
}

impl Audience for Node {
    fn set_topics(&mut self, topics: &[Topic]) {
        self.offers.retain(|_, offer| topics.contains(&offer.topic));
        for topic in topics {
            if self.offers.contains_key(&topic.name) {
                continue;
            }
            match self.offer(topic) {
                Ok(offer) => drop(self.offers.insert(topic.name.clone(), offer)),
                Err(error) => self.fault = Some(format!("{} is not offered: {error}", topic.name)),
            }
        }
        self.report.topics = self.offers.len() as u64;
        self.announce_itself();
    }

    fn tell(&mut self, message: &LiveMessage<'_>) {
        let Some(offer) = self.offers.get_mut(message.topic) else { return };
        let (writer, bytes) = (&offer.writer, message.bytes.len());
        let all_taken = || matches!(writer.wait_for_acknowledgments(Duration::ZERO), Ok(true));
        let written = match offer.budget.has_room(bytes, all_taken) {
            true => writer.write(without_encoding(message.bytes), Some(now())).map_err(Some),
            false => Err(None),
        };
        match written {
            Ok(()) => {
                offer.budget.put(bytes);
                self.report.messages += 1;
            }
            Err(None | Some(WriteError::WouldBlock { .. })) => {
                self.report.left_out += 1;
                self.gaps.add(message.topic);
            }
            Err(Some(error)) => {
                self.fault = Some(format!("{} can't be told: {error}", message.topic));
            }
        }
    }

    fn announce(&mut self, words: String) {
        tracing::warn!("ros: {words}");
        self.daemon.event(EventKind::Gap, format!("ros: {words}"));
    }

    fn told(&mut self) {}
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
