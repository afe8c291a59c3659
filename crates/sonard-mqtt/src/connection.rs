//! A connection to the broker: a client whose events are driven by a task of their own.

use std::{future::Future, io, pin::Pin, time::Duration};

use bytes::Bytes;
use futures_util::{StreamExt as _, stream::FuturesUnordered};
use jiff::Timestamp;
use rumqttc::{
    AsyncClient, ClientError, ConnectReturnCode, ConnectionError, Event, EventLoop, Incoming,
    Publish, PublishOptions, QoS, StateError,
};
use tokio::{
    sync::mpsc,
    task::JoinHandle,
    time::{Instant, timeout},
};

use super::{account::Account, certificate, diagnosis::Sending, topics::Kind};

/// News that may wait to be taken in.
const NEWS: usize = 16;
/// What else than acknowledgements a broker may send in a second.
const MOST_A_SECOND: u32 = 100;
/// How long the end of a connection may take.
const GOODBYE: Duration = Duration::from_secs(1);

/// What came from the broker.
#[derive(Debug)]
pub(super) enum News {
    /// It knows this client.
    Connected,
    /// A command.
    Published(Publish),
    /// It has what was sent.
    Acknowledged(Sending),
    /// Whether commands will come.
    Subscribed(bool),
    /// The connection is over.
    Lost(Loss),
}

/// The end of a connection.
#[derive(Debug)]
pub(super) struct Loss {
    /// The reason, as far as it is known.
    pub(super) why: String,
    /// Whether the broker has closed it without a word.
    pub(super) by_broker: bool,
}

impl From<String> for Loss {
    fn from(why: String) -> Self {
        Self { why, by_broker: false }
    }
}

type Acknowledgement = Pin<Box<dyn Future<Output = Option<News>> + Send>>;

/// A connection, from the first try to reach the broker to its end.
pub(super) struct Connection {
    client: AsyncClient,
    news: mpsc::Receiver<News>,
    pump: JoinHandle<()>,
    under_way: FuturesUnordered<Acknowledgement>,
}

impl Connection {
    /// Begins to reach the broker.
    pub(super) fn open(account: &Account) -> Result<Self, String> {
        let options = account.options();
        let capacity = options.request_channel_capacity();
        let built = AsyncClient::builder(options).capacity(capacity).try_build();
        let (client, events) = built.map_err(|error| error.to_string())?;
        let (sender, news) = mpsc::channel(NEWS);
        #[allow(clippy::disallowed_methods, reason = "its end closes the channel of news")]
        let pump = tokio::spawn(pump(events, sender));
        Ok(Self { client, news, pump, under_way: FuturesUnordered::new() })
    }

    /// Hands a message over; the broker keeps it if its kind is kept.
    pub(super) fn send(
        &self,
        topic: String,
        sending: Sending,
        payload: Bytes,
    ) -> Result<(), String> {
        let is_retained = sending.kind.is_some_and(Kind::is_retained);
        let options = PublishOptions::new(QoS::AtLeastOnce).retain(is_retained);
        let notice = match self.client.try_publish_tracked(topic, payload, options) {
            Ok(notice) => notice,
            // Why it is over is among the news.
            Err(ClientError::RequestChannelDisconnected(_)) => return Ok(()),
            Err(error) => return Err(error.to_string()),
        };
        // Without an acknowledgement there is news of the connection's end.
        self.under_way.push(Box::pin(async move {
            notice.wait_async().await.ok().map(|_| News::Acknowledged(sending))
        }));
        Ok(())
    }

    /// Asks for commands.
    pub(super) fn subscribe(&self, filter: String) -> Result<(), String> {
        let notice = self.client.try_subscribe_tracked(filter, QoS::AtLeastOnce);
        let notice = notice.map_err(|error| error.to_string())?;
        self.under_way.push(Box::pin(async move {
            Some(News::Subscribed(notice.wait_completion_async().await.is_ok()))
        }));
        Ok(())
    }

    /// Whether something is sent that is not acknowledged.
    pub(super) fn is_waiting(&self) -> bool {
        !self.under_way.is_empty()
    }

    /// What comes next. Cancel-safe.
    pub(super) async fn next(&mut self) -> News {
        loop {
            tokio::select! {
                news = self.news.recv() => {
                    let over = || News::Lost(Loss::from("the connection is over".to_owned()));
                    return news.unwrap_or_else(over);
                }
                Some(done) = self.under_way.next() => {
                    if let Some(news) = done {
                        return news;
                    }
                }
            }
        }
    }

    /// Ends it in order, if the broker does its part.
    pub(super) async fn close(mut self) {
        if self.client.try_disconnect().is_ok() {
            let over = async { while !matches!(self.next().await, News::Lost(_)) {} };
            drop(timeout(GOODBYE, over).await);
        }
    }
}

impl Drop for Connection {
    fn drop(&mut self) {
        self.pump.abort();
    }
}

/// Drives a client until its connection is over.
async fn pump(mut events: EventLoop, news: mpsc::Sender<News>) {
    let (mut second, mut came) = (Instant::now(), 0);
    loop {
        let told = match events.poll().await {
            Ok(Event::Incoming(Incoming::PubAck(_)) | Event::Outgoing(_)) => continue,
            Ok(Event::Incoming(incoming)) => {
                if second.elapsed() > Duration::from_secs(1) {
                    (second, came) = (Instant::now(), 0);
                }
                came += 1;
                match incoming {
                    _ if came > MOST_A_SECOND => News::Lost(Loss::from(format!(
                        "it sends more than {MOST_A_SECOND} messages a second"
                    ))),
                    Incoming::ConnAck(_) => News::Connected,
                    Incoming::Publish(publish) => News::Published(publish),
                    _ => continue,
                }
            }
            Err(error) => News::Lost(Loss { why: words(&error), by_broker: is_close(&error) }),
        };
        let is_over = matches!(told, News::Lost(_));
        if news.send(told).await.is_err() || is_over {
            return;
        }
    }
}

/// Why a connection is over, and what a person can do about it.
fn words(error: &ConnectionError) -> String {
    match error {
        ConnectionError::ConnectionRefused(
            ConnectReturnCode::BadUserNamePassword | ConnectReturnCode::NotAuthorized,
        ) => "it refuses user or password: see mqtt.user and mqtt.password_file".into(),
        ConnectionError::ConnectionRefused(code) => format!("it refuses the connection: {code:?}"),
        ConnectionError::Io(error)
        | ConnectionError::MqttState(
            StateError::Io(error) | StateError::Deserialization(rumqttc::Error::Io(error)),
        ) => words_of_io(error),
        ConnectionError::NetworkTimeout => "it does not answer".into(),
        ConnectionError::FlushTimeout => "it takes nothing".into(),
        ConnectionError::MqttState(StateError::ConnectionAborted) => {
            "it closed the connection".into()
        }
        ConnectionError::MqttState(StateError::AwaitPingResp) => "it shows no sign of life".into(),
        ConnectionError::MqttState(error) => format!("what it sends makes no sense: {error}"),
        ConnectionError::Tls(error) => certificate::words(error, Timestamp::now()),
        other => other.to_string(),
    }
}

/// Whether the broker has closed the connection without a word.
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

fn words_of_io(error: &io::Error) -> String {
    match error.kind() {
        io::ErrorKind::ConnectionRefused => "nobody listens there".into(),
        kind if is_close_of_io(kind) => "it closed the connection".into(),
        _ => error.to_string(),
    }
}
