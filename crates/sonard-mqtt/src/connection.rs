//! Connection to the broker: a client with a separate task for its event loop.

use std::{future::Future, io, pin::Pin, time::Duration};

use bytes::Bytes;
use futures_util::{StreamExt as _, stream::FuturesUnordered};
use jiff::Timestamp;
use rumqttc::{
    AsyncClient, ClientError, ConnectReturnCode, ConnectionError, Event, EventLoop, Incoming,
    Publish, PublishOptions, QoS, StateError,
};
use sonard_runtime::wall_clock::ClockEvidence;
use tokio::{
    sync::mpsc,
    task::JoinHandle,
    time::{Instant, timeout},
};

use super::{certificate, credentials::Credentials, diagnosis::SentMessage, topics::MessageKind};

/// Capacity of the event channel.
const EVENT_CAPACITY: usize = 16;
/// Maximum rate of messages from the broker, except acknowledgements.
const MAX_MESSAGES_PER_S: u32 = 100;
/// Time allowed for an orderly disconnection.
const CLOSE_TIMEOUT: Duration = Duration::from_secs(1);

/// Event of a connection.
#[derive(Debug)]
pub(super) enum BrokerEvent {
    /// The broker accepted the connection.
    Connected,
    /// The broker forwarded a message on a subscribed topic.
    Published(Publish),
    /// The broker acknowledged a message.
    Acknowledged(SentMessage),
    /// The broker granted (`true`) or denied the subscription.
    Subscribed(bool),
    /// The connection ended.
    Lost(Disconnection),
}

/// End of a connection.
#[derive(Debug)]
pub(super) struct Disconnection {
    /// Description of the cause, as far as known.
    pub(super) reason: String,
    /// `true` if the broker closed the connection without a reason.
    pub(super) by_broker: bool,
}

impl From<String> for Disconnection {
    fn from(reason: String) -> Self {
        Self { reason, by_broker: false }
    }
}

type Acknowledgement = Pin<Box<dyn Future<Output = Option<BrokerEvent>> + Send>>;

/// Connection from the first attempt to reach the broker to its end.
pub(super) struct Connection {
    client: AsyncClient,
    news: mpsc::Receiver<BrokerEvent>,
    pump: JoinHandle<()>,
    in_flight: FuturesUnordered<Acknowledgement>,
}

impl Connection {
    /// Starts connecting to the broker.
    pub(super) fn open(account: &Credentials) -> Result<Self, String> {
        let options = account.options();
        let capacity = options.request_channel_capacity();
        let built = AsyncClient::builder(options).capacity(capacity).try_build();
        let (client, events) = built.map_err(|error| error.to_string())?;
        let (sender, news) = mpsc::channel(EVENT_CAPACITY);
        #[allow(clippy::disallowed_methods, reason = "its end closes the channel of news")]
        let pump = tokio::spawn(pump(events, sender));
        Ok(Self { client, news, pump, in_flight: FuturesUnordered::new() })
    }

    /// Queues a message for sending, with the retain flag of its kind.
    pub(super) fn send(
        &self,
        topic: String,
        sending: SentMessage,
        payload: Bytes,
    ) -> Result<(), String> {
        let is_retained = sending.kind.is_some_and(MessageKind::is_retained);
        let options = PublishOptions::new(QoS::AtLeastOnce).retain(is_retained);
        let notice = match self.client.try_publish_tracked(topic, payload, options) {
            Ok(notice) => notice,
            // The cause of the disconnection arrives as an event.
            Err(ClientError::RequestChannelDisconnected(_)) => return Ok(()),
            Err(error) => return Err(error.to_string()),
        };
        // Without an acknowledgement an event reports the end of the connection.
        self.in_flight.push(Box::pin(async move {
            notice.wait_async().await.ok().map(|_| BrokerEvent::Acknowledged(sending))
        }));
        Ok(())
    }

    /// Subscribes to a topic filter.
    pub(super) fn subscribe(&self, filter: String) -> Result<(), String> {
        let notice = self.client.try_subscribe_tracked(filter, QoS::AtLeastOnce);
        let notice = notice.map_err(|error| error.to_string())?;
        self.in_flight.push(Box::pin(async move {
            Some(BrokerEvent::Subscribed(notice.wait_completion_async().await.is_ok()))
        }));
        Ok(())
    }

    /// Returns `true` while a message is unacknowledged.
    pub(super) fn is_waiting(&self) -> bool {
        !self.in_flight.is_empty()
    }

    /// Waits for the next event. Cancel-safe.
    pub(super) async fn next(&mut self) -> BrokerEvent {
        loop {
            tokio::select! {
                news = self.news.recv() => {
                    let over = || BrokerEvent::Lost(Disconnection::from("the connection is over".to_owned()));
                    return news.unwrap_or_else(over);
                }
                Some(done) = self.in_flight.next() => {
                    if let Some(news) = done {
                        return news;
                    }
                }
            }
        }
    }

    /// Disconnects in an orderly way, if the broker cooperates in time.
    pub(super) async fn close(mut self) {
        if self.client.try_disconnect().is_ok() {
            let over = async { while !matches!(self.next().await, BrokerEvent::Lost(_)) {} };
            drop(timeout(CLOSE_TIMEOUT, over).await);
        }
    }
}

impl Drop for Connection {
    fn drop(&mut self) {
        self.pump.abort();
    }
}

/// Runs the client's event loop until the connection ends.
async fn pump(mut events: EventLoop, news: mpsc::Sender<BrokerEvent>) {
    let (mut second, mut came) = (Instant::now(), 0);
    loop {
        let event = match events.poll().await {
            Ok(Event::Incoming(Incoming::PubAck(_)) | Event::Outgoing(_)) => continue,
            Ok(Event::Incoming(incoming)) => {
                if second.elapsed() > Duration::from_secs(1) {
                    (second, came) = (Instant::now(), 0);
                }
                came += 1;
                match incoming {
                    _ if came > MAX_MESSAGES_PER_S => BrokerEvent::Lost(Disconnection::from(
                        format!("it sends more than {MAX_MESSAGES_PER_S} messages per second"),
                    )),
                    Incoming::ConnAck(_) => BrokerEvent::Connected,
                    Incoming::Publish(publish) => BrokerEvent::Published(publish),
                    _ => continue,
                }
            }
            Err(error) => BrokerEvent::Lost(Disconnection {
                reason: describe(&error),
                by_broker: is_close(&error),
            }),
        };
        let is_over = matches!(event, BrokerEvent::Lost(_));
        if news.send(event).await.is_err() || is_over {
            return;
        }
    }
}

/// Describes the cause of a disconnection, with a remedy if there is one.
fn describe(error: &ConnectionError) -> String {
    match error {
        ConnectionError::ConnectionRefused(
            ConnectReturnCode::BadUserNamePassword | ConnectReturnCode::NotAuthorized,
        ) => "it refuses user or password: check mqtt.user and mqtt.password_file".into(),
        ConnectionError::ConnectionRefused(code) => format!("it refuses the connection: {code:?}"),
        ConnectionError::Io(error)
        | ConnectionError::MqttState(
            StateError::Io(error) | StateError::Deserialization(rumqttc::Error::Io(error)),
        ) => describe_io(error),
        ConnectionError::NetworkTimeout => "it does not respond".into(),
        ConnectionError::FlushTimeout => "it does not read".into(),
        ConnectionError::MqttState(StateError::ConnectionAborted) => {
            "it closed the connection".into()
        }
        ConnectionError::MqttState(StateError::AwaitPingResp) => {
            "it does not respond to pings".into()
        }
        ConnectionError::MqttState(error) => format!("protocol error: {error}"),
        ConnectionError::Tls(error) => {
            certificate::describe(error, Timestamp::now(), ClockEvidence::collect)
        }
        other => other.to_string(),
    }
}

/// Returns `true` if the broker closed the connection without a reason.
fn is_close(error: &ConnectionError) -> bool {
    match error {
        ConnectionError::Io(error)
        | ConnectionError::MqttState(
            StateError::Io(error) | StateError::Deserialization(rumqttc::Error::Io(error)),
        ) => is_close_of_io(error.kind()),
        ConnectionError::MqttState(error) => matches!(error, StateError::ConnectionAborted),
        _ => false,
    }
}

const fn is_close_of_io(kind: io::ErrorKind) -> bool {
    use io::ErrorKind as Kind;
    matches!(
        kind,
        Kind::UnexpectedEof | Kind::ConnectionReset | Kind::ConnectionAborted | Kind::BrokenPipe
    )
}

fn describe_io(error: &io::Error) -> String {
    match error.kind() {
        io::ErrorKind::ConnectionRefused => "connection refused".into(),
        kind if is_close_of_io(kind) => "it closed the connection".into(),
        _ => error.to_string(),
    }
}
