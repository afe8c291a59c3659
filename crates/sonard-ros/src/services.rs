//! What whoever is on the network can have done, with the rules of the API: services start and stop scans
//! (`std_srvs/srv/Trigger`), a topic says where the robot is.

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
use sonard_daemon::{Handle, Order, Refusal};
use sonard_export::dds::{Asker, TRIGGER, service_on_wire};
use tokio::time::timeout;

use super::{
    initial_pose::InitialPose,
    node::{AsItIs, Node, Writer, now, reliable, without_encoding},
};

/// How often it is looked whether a service was called.
pub(super) const LOOK: Duration = Duration::from_millis(100);
/// Requests that wait, and that are answered at a look: who sends more gets no answer to some.
pub(super) const MOST_REQUESTS: i32 = 4;
/// How long the daemon may take to answer.
const PATIENCE: Duration = Duration::from_secs(2);

#[derive(Debug, Clone, Copy)]
enum Command {
    Start,
    Stop,
}

impl Command {
    const ALL: [(Self, &'static str); 2] =
        [(Self::Start, "/sonar/start"), (Self::Stop, "/sonar/stop")];

    /// Has it done; what there is to say of it, or why not.
    async fn carry_out(self, daemon: &Handle) -> Result<String, String> {
        in_time(async {
            match self {
                Self::Start => {
                    let begun = daemon.start(ScanRequest::default()).await?;
                    Ok(format!("request {}", begun.request))
                }
                Self::Stop => daemon.order(Order::Stop).await.map(|()| "stopped".to_owned()),
            }
        })
        .await
    }
}

/// What came of something that the daemon does, or why not.
pub(super) async fn in_time<T>(
    done: impl Future<Output = Result<T, Refusal>>,
) -> Result<T, String> {
    let answer = timeout(PATIENCE, done).await.map_err(|_| "the daemon is busy".to_owned())?;
    answer.map_err(|refusal| format!("{}; {}", refusal.message, refusal.help))
}

/// What is offered and listened for.
pub(super) struct Services {
    services: Vec<Service>,
    initial_pose: Option<InitialPose>,
}

struct Service {
    command: Command,
    requests: SimpleDataReader<Bytes, AsItIs>,
    replies: Writer,
}

impl Services {
    /// None of them.
    pub(super) const fn none() -> Self {
        Self { services: Vec::new(), initial_pose: None }
    }

    /// All of them, as the node's.
    pub(super) fn offer(node: &mut Node) -> CreateResult<Self> {
        let policies = reliable(MOST_REQUESTS, Durability::Volatile);
        let subscriber = node.participant.create_subscriber(&policies)?;
        let mut services = Vec::new();
        for (command, name) in Command::ALL {
            let [request, reply] = service_on_wire(&node.namespace, name);
            let requests = reader(node, &subscriber, request, TRIGGER[0], &policies)?;
            let replies = node.writer(&reply, TRIGGER[1], &policies)?;
            node.services[0].push(requests.guid().to_bytes());
            node.services[1].push(replies.guid().to_bytes());
            services.push(Service { command, requests, replies });
        }
        let initial_pose = Some(InitialPose::listen(node, &subscriber)?);
        Ok(Self { services, initial_pose })
    }

    pub(super) const fn are_offered(&self) -> bool {
        !self.services.is_empty()
    }

    /// Does what was asked for since the last time.
    pub(super) async fn answer(&self, daemon: &Handle, node: &mut Node) {
        if let Some(initial_pose) = &self.initial_pose {
            initial_pose.obey(daemon, node).await;
        }
        for service in &self.services {
            service.requests.drain_read_notifications();
            for _ in 0..MOST_REQUESTS {
                // What can't be read asks for nothing.
                let Ok(Some(request)) = service.requests.try_take_one() else { break };
                let done = service.command.carry_out(daemon).await;
                node.count_command(&done);
                service.reply(&request, done);
            }
        }
    }
}

impl Service {
    fn reply(&self, request: &DeserializedCacheChange<Bytes>, done: Result<String, String>) {
        let asker = Asker::of_trigger(&request.sample);
        let success = done.is_ok();
        let message = asker.reply(success, &done.unwrap_or_else(|why| why));
        // Of who says nothing else of itself, the request's own number.
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
            tracing::warn!("ros: a service is not answered: {error}");
        }
    }
}

fn reader(
    node: &Node,
    subscriber: &Subscriber,
    topic: String,
    type_name: &str,
    policies: &QosPolicies,
) -> CreateResult<SimpleDataReader<Bytes, AsItIs>> {
    let kind = TopicKind::NoKey;
    let topic = node.participant.create_topic(topic, type_name.to_owned(), policies, kind)?;
    subscriber.create_simple_datareader_no_key(&topic, Some(policies.clone()))
}

impl DeserializerAdapter<Bytes> for AsItIs {
    type Error = Infallible;
    type Decoded = Bytes;

    fn supported_encodings() -> &'static [RepresentationIdentifier] {
        &[RepresentationIdentifier::CDR_LE]
    }

    fn transform_decoded(decoded: Bytes) -> Bytes {
        decoded
    }
}

impl DefaultDecoder<Bytes> for AsItIs {
    type Decoder = Copying;
    const DECODER: Copying = Copying;
}

/// Takes bytes as they are.
#[derive(Debug, Clone, Copy)]
pub(super) struct Copying;

impl Decode<'_, Bytes> for Copying {
    type Error = Infallible;

    fn decode_bytes(
        self,
        bytes: &[u8],
        _encoding: RepresentationIdentifier,
    ) -> Result<Bytes, Infallible> {
        /// More than that is no request: it has no fields.
        const MOST: usize = 64;
        Ok(Bytes::copy_from_slice(bytes.get(..MOST).unwrap_or(bytes)))
    }
}
