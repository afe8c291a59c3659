//! Live messages for viewers that speak Foxglove's protocol: one follower makes them of the daemon's records, and each
//! viewer takes them from the queue at its own pace.

mod message_queue;

use std::{
    error::Error as _,
    io,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::Duration,
};

use axum::extract::ws::{CloseFrame, Message, WebSocket, close_code};
use sonard_api::config::FoxgloveKeys;
use sonard_export::{
    Live, LiveMessage, Settings, Topic,
    foxglove::{MOST_TEXT_BYTES, server_info},
};
use sonard_runtime::supervisor::Task;
use tokio::{
    sync::{OwnedSemaphorePermit, Semaphore, watch},
    time::{Instant, sleep_until, timeout},
};
use uuid::Uuid;

use super::Standing;
use crate::{Audience, Follower, Handle};
use message_queue::{Found, MOST_MESSAGE_BYTES, MessageQueue, Outgoing, Viewer};

/// Least time from one thing that a viewer sends to the next that is read.
const BETWEEN_READS: Duration = Duration::from_millis(10);
/// How often a viewer is asked whether it is there.
const SIGN_OF_LIFE: Duration = Duration::from_secs(15);
/// One that shows no sign of life for so long is gone.
const GIVEN_UP: Duration = Duration::from_secs(60);
/// How long a viewer may take to say goodbye.
const GOODBYE: Duration = Duration::from_secs(1);

/// The longest that a viewer may send at once, bytes: what is longer than a text may be is refused in words up to here.
pub(super) const MOST_RECEIVED_BYTES: usize = 8 * MOST_TEXT_BYTES;
/// What is kept of a viewer's connection beside its messages, bytes.
pub(super) const READ_BYTES: usize = 4096;
/// The longest that waits to be taken by a viewer's connection: a message, and what answers its pings.
pub(super) const WRITE_BYTES: usize = MOST_MESSAGE_BYTES + (1 << 16);

/// Where viewers come together.
#[derive(Debug)]
pub(super) struct Viewers {
    daemon: Handle,
    queue: Mutex<MessageQueue>,
    /// Changes with whatever viewers have to look at.
    changed: watch::Sender<()>,
    /// Slots of guests, and of all others: nobody takes them from those.
    places: [Arc<Semaphore>; 2],
    most_viewers: u32,
    /// Another one after a restart, so that viewers know.
    session: String,
}

impl Viewers {
    /// Begins to follow the daemon, until that ends. Must be called within a runtime.
    pub(super) fn open(daemon: &Handle, keys: &FoxgloveKeys) -> Arc<Self> {
        let viewers = Arc::new(Self {
            daemon: daemon.clone(),
            queue: Mutex::new(MessageQueue::new(keys.queue_kb as usize * 1000)),
            changed: watch::Sender::new(()),
            places: [(); 2].map(|()| Arc::new(Semaphore::new(keys.max_clients as usize))),
            most_viewers: keys.max_clients,
            session: Uuid::new_v4().to_string(),
        });
        let mut told = Told(Arc::clone(&viewers));
        let live = Live::new(Settings::default()).with_map(keys.map);
        let follower = Follower::begin(daemon, live, &mut told);
        drop(daemon.supervisor().spawn(Task::LiveMessages, follow(follower, told)));
        viewers
    }

    /// A place for a viewer, if one is free.
    pub(super) fn take_place(&self, standing: Standing) -> Option<OwnedSemaphorePermit> {
        let [guests, others] = &self.places;
        let places = if standing == Standing::Guest { guests } else { others };
        Arc::clone(places).try_acquire_owned().ok()
    }

    /// Waits until every viewer has left.
    pub(super) async fn is_empty(&self) {
        for places in &self.places {
            drop(places.acquire_many(self.most_viewers).await);
        }
    }

    /// Tells a viewer, until it leaves or is shown out.
    pub(super) async fn attend(self: Arc<Self>, mut socket: WebSocket) {
        let _attendance = self.daemon.hub().attend();
        match self.tell(&mut socket).await {
            Ok(goodbye) => say_goodbye(&mut socket, goodbye).await,
            Err(error) if took_nothing(&error) => self.daemon.hub().count_cut_off(),
            // It is gone.
            Err(_) => {}
        }
    }

    /// Tells a viewer what it asks for; why that ended in order.
    async fn tell(&self, socket: &mut WebSocket) -> Result<CloseFrame, axum::Error> {
        let mut changed = self.changed.subscribe();
        let mut viewer = Viewer::new(&self.queue(), server_info(&self.session));
        let mut heard = Instant::now();
        let (mut may_read, mut next_ping) = (heard, heard + SIGN_OF_LIFE);
        loop {
            // What comes after this look makes it ready again.
            changed.mark_unchanged();
            let found = viewer.look(&self.queue());
            let is_idle = found == Found::Nothing;
            match found {
                Found::Something(Outgoing::Text(text)) => socket.send(text.into()).await?,
                Found::Something(Outgoing::Binary(frame)) => socket.send(frame.into()).await?,
                Found::Over => return Ok(goodbye(close_code::AWAY, "nothing more is told here")),
                Found::ShownOut => {
                    return Ok(goodbye(close_code::POLICY, "too much makes no sense"));
                }
                Found::Nothing => {}
            }
            let now = Instant::now();
            if now > heard + GIVEN_UP {
                return Ok(goodbye(close_code::AWAY, "there is no sign of life"));
            }
            if now > next_ping {
                next_ping = now + SIGN_OF_LIFE;
                socket.send(Message::Ping(Vec::new().into())).await?;
            }
            tokio::select! {
                biased;
                came = socket.recv(), if now >= may_read => {
                    let Some(came) = came else { return Ok(goodbye(close_code::NORMAL, "")) };
                    heard = Instant::now();
                    may_read = heard + BETWEEN_READS;
                    match came {
                        Ok(Message::Text(text)) => viewer.take_text(&text, &self.queue()),
                        Ok(Message::Binary(_)) => viewer.take_binary(&self.queue()),
                        Ok(Message::Ping(_) | Message::Pong(_)) => {}
                        Ok(Message::Close(_)) => return Ok(goodbye(close_code::NORMAL, "")),
                        Err(error) => return refused(error),
                    }
                }
                () = std::future::ready(()), if !is_idle => {}
                _ = changed.changed() => {}
                () = sleep_until(may_read), if now < may_read => {}
                () = sleep_until(next_ping) => {}
            }
        }
    }

    /// Nothing under this lock can panic, so a poisoned one holds what it should.
    fn queue(&self) -> MutexGuard<'_, MessageQueue> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The viewers as the follower tells it.
struct Told(Arc<Viewers>);

impl Audience for Told {
    fn set_topics(&mut self, topics: &[Topic]) {
        self.0.queue().set_topics(topics);
    }

    fn tell(&mut self, message: &LiveMessage<'_>) {
        self.0.queue().put(message);
    }

    fn announce(&mut self, words: String) {
        self.0.queue().announce(words);
    }

    fn told(&mut self) {
        self.0.changed.send_replace(());
    }
}

async fn follow(mut follower: Follower, mut told: Told) {
    while follower.next(&mut told).await {}
    told.0.queue().close();
    told.0.changed.send_replace(());
}

/// Why a viewer is shown out whose connection brought what can't be read.
fn refused(error: axum::Error) -> Result<CloseFrame, axum::Error> {
    if is_of_connection(&error) {
        return Err(error);
    }
    let why = format!("{error}; texts have at most {MOST_TEXT_BYTES} bytes");
    // A reason has at most 123 bytes.
    let why: String = why.chars().filter(char::is_ascii).take(120).collect();
    Ok(goodbye(close_code::POLICY, &why))
}

fn goodbye(code: u16, reason: &str) -> CloseFrame {
    CloseFrame { code, reason: reason.into() }
}

/// Closes a connection in order, if the other end does its part.
async fn say_goodbye(socket: &mut WebSocket, goodbye: CloseFrame) {
    let closing = async {
        if socket.send(Message::Close(Some(goodbye))).await.is_ok() {
            while let Some(Ok(_)) = socket.recv().await {}
        }
    };
    drop(timeout(GOODBYE, closing).await);
}

/// Whether a connection ended because the viewer did not read.
fn took_nothing(error: &axum::Error) -> bool {
    cause(error).is_some_and(|error| error.kind() == io::ErrorKind::TimedOut)
}

fn is_of_connection(error: &axum::Error) -> bool {
    cause(error).is_some()
}

/// The fault of the connection that is behind an error, if one is.
fn cause(error: &axum::Error) -> Option<&io::Error> {
    let mut source = error.source();
    while let Some(error) = source {
        if let Some(io) = error.downcast_ref::<io::Error>() {
            return Some(io);
        }
        source = error.source();
    }
    None
}
