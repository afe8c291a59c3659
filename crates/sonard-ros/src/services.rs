//! Commands from the ROS network, with the rules of the API: services start and stop scans
//! (`std_srvs/srv/Trigger`), a topic sets the robot's pose.

use std::{convert::Infallible, time::Duration};

use rustdds::{
    QosPolicies, RTPSEntity as _, RepresentationIdentifier, SampleIdentity, SequenceNumber,
    Subscriber, TopicKind, WriteOptionsBuilder,
    bytes::Bytes,
    dds::CreateResult,
    no_key::{
        Decode, DefaultDecoder, DeserializedCacheChange, DeserializerAdapter, SimpleDataReader,
    },
    policy::Durability,
};
use sonard_api::ScanRequest;
use sonard_daemon::{Handle, Order, OrderError};
use sonard_export::dds::{Requester, TRIGGER_TYPES, service_on_wire};
use tokio::time::timeout;

use super::{
    initial_pose::InitialPose,
    node::{Node, RawBytes, Writer, now, reliable, without_encoding},
};

/// Poll interval of service calls.
pub(super) const POLL_INTERVAL: Duration = Duration::from_millis(100);
/// Maximum number of queued requests, all processed at one poll; further requests get no reply.
pub(super) const MAX_REQUESTS: i32 = 4;
/// Time allowed for the daemon's reply.
const REPLY_TIMEOUT: Duration = Duration::from_secs(2);

#[derive(Debug, Clone, Copy)]
enum Command {
    Start,
    Stop,
}

impl Command {
    const ALL: [(Self, &'static str); 2] =
        [(Self::Start, "/sonar/start"), (Self::Stop, "/sonar/stop")];

    /// Executes the command. Returns the text of the reply, or the reason of the rejection.
    async fn execute(self, daemon: &Handle) -> Result<String, String> {
        in_time(async {
            match self {
                Self::Start => {
                    let started = daemon.start(ScanRequest::default()).await?;
                    Ok(format!("request {}", started.request))
                }
                Self::Stop => daemon.order(Order::Stop).await.map(|()| "stopped".to_owned()),
            }
        })
        .await
    }
}

/// Waits for the daemon with a timeout; converts a rejection to text.
pub(super) async fn in_time<T>(
    done: impl Future<Output = Result<T, OrderError>>,
) -> Result<T, String> {
    let answer = timeout(REPLY_TIMEOUT, done).await.map_err(|_| "the daemon is busy".to_owned())?;
    answer.map_err(|refusal| format!("{}; {}", refusal.message, refusal.help))
}

/// Offered services and subscriptions.
pub(super) struct Services {
    services: Vec<Service>,
    initial_pose: Option<InitialPose>,
}

struct Service {
    command: Command,
    requests: SimpleDataReader<Bytes, RawBytes>,
    replies: Writer,
}

impl Services {
    /// Creates an empty set, for a node without commands.
    pub(super) const fn none() -> Self {
        Self { services: Vec::new(), initial_pose: None }
    }

    /// Creates all services and subscriptions on a node.
    pub(super) fn offer(node: &mut Node) -> CreateResult<Self> {
        let policies = reliable(MAX_REQUESTS, Durability::Volatile);
        let subscriber = node.participant.create_subscriber(&policies)?;
        let mut services = Vec::new();
        for (command, name) in Command::ALL {
            let [request, reply] = service_on_wire(&node.namespace, name);
            let requests = reader(node, &subscriber, request, TRIGGER_TYPES[0], &policies)?;
            let replies = node.writer(&reply, TRIGGER_TYPES[1], &policies)?;
            node.services[0].push(requests.guid().to_bytes());
            node.services[1].push(replies.guid().to_bytes());
            services.push(Service { command, requests, replies });
        }
        let initial_pose = Some(InitialPose::subscribe(node, &subscriber)?);
        Ok(Self { services, initial_pose })
    }

    pub(super) const fn are_offered(&self) -> bool {
        !self.services.is_empty()
    }

    /// Executes the commands received since the last call.
    pub(super) async fn process(&self, daemon: &Handle, node: &mut Node) {
        if let Some(initial_pose) = &self.initial_pose {
            initial_pose.apply_latest(daemon, node).await;
        }
        for service in &self.services {
            service.requests.drain_read_notifications();
            for _ in 0..MAX_REQUESTS {
                // Unreadable requests are ignored.
                let Ok(Some(request)) = service.requests.try_take_one() else { break };
                let done = service.command.execute(daemon).await;
                node.count_command(&done);
                service.reply(&request, done);
            }
        }
    }
}

impl Service {
    fn reply(&self, request: &DeserializedCacheChange<Bytes>, done: Result<String, String>) {
        let asker = Requester::from_trigger(&request.sample);
        let success = done.is_ok();
        let message = asker.reply(success, &done.unwrap_or_else(|reason| reason));
        // Without a related identity, the sequence number of the request itself applies.
        let own = request.sequence_number;
        let mut to = request
            .related_sample_identity()
            .unwrap_or(SampleIdentity { writer_guid: request.writer_guid, sequence_number: own });
        if to.sequence_number == SequenceNumber::UNKNOWN {
            to.sequence_number = own;
        }
        let options =
            WriteOptionsBuilder::new().source_timestamp(now()).related_sample_identity(to).build();
        if let Err(error) = self.replies.write_with_options(without_encoding(&message), options) {
            tracing::warn!("ros: a service reply could not be sent: {error}");
        }
    }
}

fn reader(
    node: &Node,
    subscriber: &Subscriber,
    topic: String,
    type_name: &str,
    policies: &QosPolicies,
) -> CreateResult<SimpleDataReader<Bytes, RawBytes>> {
    let kind = TopicKind::NoKey;
    let topic = node.participant.create_topic(topic, type_name.to_owned(), policies, kind)?;
    subscriber.create_simple_datareader_no_key(&topic, Some(policies.clone()))
}

impl DeserializerAdapter<Bytes> for RawBytes {
    type Error = Infallible;
    type Decoded = Bytes;

    fn supported_encodings() -> &'static [RepresentationIdentifier] {
        &[RepresentationIdentifier::CDR_LE]
    }

    fn transform_decoded(decoded: Bytes) -> Bytes {
        decoded
    }
}

impl DefaultDecoder<Bytes> for RawBytes {
    type Decoder = CopyBytes;
    const DECODER: CopyBytes = CopyBytes;
}

/// Decoder that copies the bytes.
#[derive(Debug, Clone, Copy)]
pub(super) struct CopyBytes;

impl Decode<'_, Bytes> for CopyBytes {
    type Error = Infallible;

    fn decode_bytes(
        self,
        bytes: &[u8],
        _encoding: RepresentationIdentifier,
    ) -> Result<Bytes, Infallible> {
        /// Maximum length of a request, which has no fields.
        const MAX_BYTES: usize = 64;
        Ok(Bytes::copy_from_slice(bytes.get(..MAX_BYTES).unwrap_or(bytes)))
    }
}
