//! Foxglove WebSocket server: one follower converts the daemon's records to messages, and each
//! viewer reads them from a shared queue at its own pace.

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
    ExportSettings, LiveConverter, LiveMessage, Topic,
    foxglove::{MAX_TEXT_BYTES, server_info},
};
use sonard_runtime::supervisor::Task;
use tokio::{
    sync::{OwnedSemaphorePermit, Semaphore, watch},
    time::{Instant, sleep_until, timeout},
};
use uuid::Uuid;

use super::Principal;
use crate::{Handle, LiveMessageSink, MessageConverter};
use message_queue::{Delivery, MAX_MESSAGE_BYTES, Outgoing, Viewer, ViewerQueue};

/// Minimum interval between messages read from a viewer.
const READ_INTERVAL: Duration = Duration::from_millis(10);
/// Interval between pings to a viewer.
const PING_INTERVAL: Duration = Duration::from_secs(15);
/// Time without any message after which a viewer is disconnected.
const IDLE_TIMEOUT: Duration = Duration::from_secs(60);
/// Time limit of the closing handshake.
const CLOSE_TIMEOUT: Duration = Duration::from_secs(1);

/// Maximum size of a received message, bytes. Texts longer than `MAX_TEXT_BYTES` are rejected with
/// a reason up to this size.
pub(super) const MAX_RECEIVED_BYTES: usize = 8 * MAX_TEXT_BYTES;
/// Read buffer of a viewer's connection, bytes.
pub(super) const READ_BYTES: usize = 4096;
/// Maximum size of unsent data of a viewer's connection, bytes: a message, and responses to pings.
pub(super) const WRITE_BYTES: usize = MAX_MESSAGE_BYTES + (1 << 16);

/// State shared by all viewers.
#[derive(Debug)]
pub(super) struct Viewers {
    daemon: Handle,
    queue: Mutex<ViewerQueue>,
    /// Notifies viewers of changes of the queue.
    changed: watch::Sender<()>,
    /// Separate slots for guests and for all other viewers.
    slots: [Arc<Semaphore>; 2],
    max_viewers: u32,
    /// Random session id, by which viewers detect a restart.
    session: String,
}

impl Viewers {
    /// Starts the task that follows the daemon until it ends. Must be called within a tokio
    /// runtime.
    pub(super) fn open(daemon: &Handle, keys: &FoxgloveKeys) -> Arc<Self> {
        let viewers = Arc::new(Self {
            daemon: daemon.clone(),
            queue: Mutex::new(ViewerQueue::new(keys.queue_kb as usize * 1000)),
            changed: watch::Sender::new(()),
            slots: [(); 2].map(|()| Arc::new(Semaphore::new(keys.max_clients as usize))),
            max_viewers: keys.max_clients,
            session: Uuid::new_v4().to_string(),
        });
        let mut sink = QueueSink(Arc::clone(&viewers));
        let live = LiveConverter::new(ExportSettings::default()).with_map(keys.map);
        let follower = MessageConverter::subscribe(daemon, live, &mut sink);
        drop(daemon.supervisor().spawn(Task::LiveMessages, follow(follower, sink)));
        viewers
    }

    /// Takes a slot for a viewer, if one is free.
    pub(super) fn take_slot(&self, principal: Principal) -> Option<OwnedSemaphorePermit> {
        let [guests, others] = &self.slots;
        let slots = if principal == Principal::Guest { guests } else { others };
        Arc::clone(slots).try_acquire_owned().ok()
    }

    /// Waits until all viewers have disconnected.
    pub(super) async fn is_empty(&self) {
        for slots in &self.slots {
            drop(slots.acquire_many(self.max_viewers).await);
        }
    }

    /// Serves a viewer until it disconnects or is disconnected.
    pub(super) async fn serve(self: Arc<Self>, mut socket: WebSocket) {
        let _attendance = self.daemon.hub().register_client();
        match self.send_messages(&mut socket).await {
            Ok(frame) => close_socket(&mut socket, frame).await,
            Err(error) if is_write_timeout(&error) => self.daemon.hub().count_cut_off(),
            // The viewer has disconnected.
            Err(_) => {}
        }
    }

    /// Sends a viewer its subscribed messages. Returns the reason of a regular end.
    async fn send_messages(&self, socket: &mut WebSocket) -> Result<CloseFrame, axum::Error> {
        let mut changed = self.changed.subscribe();
        let mut viewer = Viewer::new(&self.queue(), server_info(&self.session));
        let mut last_received = Instant::now();
        let (mut may_read, mut next_ping) = (last_received, last_received + PING_INTERVAL);
        loop {
            // A change after this point makes `changed` ready again.
            changed.mark_unchanged();
            let next = viewer.next(&self.queue());
            let is_idle = next == Delivery::Nothing;
            match next {
                Delivery::Message(Outgoing::Text(text)) => socket.send(text.into()).await?,
                Delivery::Message(Outgoing::Binary(frame)) => socket.send(frame.into()).await?,
                Delivery::Closed => {
                    return Ok(close_frame(close_code::AWAY, "the daemon is stopping"));
                }
                Delivery::Rejected => {
                    return Ok(close_frame(close_code::POLICY, "too many invalid messages"));
                }
                Delivery::Nothing => {}
            }
            let now = Instant::now();
            if now > last_received + IDLE_TIMEOUT {
                return Ok(close_frame(close_code::AWAY, "no response to pings"));
            }
            if now > next_ping {
                next_ping = now + PING_INTERVAL;
                socket.send(Message::Ping(Vec::new().into())).await?;
            }
            tokio::select! {
                biased;
                received = socket.recv(), if now >= may_read => {
                    let Some(received) = received else {
                        return Ok(close_frame(close_code::NORMAL, ""));
                    };
                    last_received = Instant::now();
                    may_read = last_received + READ_INTERVAL;
                    match received {
                        Ok(Message::Text(text)) => viewer.take_text(&text, &self.queue()),
                        Ok(Message::Binary(_)) => viewer.take_binary(&self.queue()),
                        Ok(Message::Ping(_) | Message::Pong(_)) => {}
                        Ok(Message::Close(_)) => return Ok(close_frame(close_code::NORMAL, "")),
                        Err(error) => return receive_error(error),
                    }
                }
                () = std::future::ready(()), if !is_idle => {}
                _ = changed.changed() => {}
                () = sleep_until(may_read), if now < may_read => {}
                () = sleep_until(next_ping) => {}
            }
        }
    }

    /// Locks the queue. Nothing under this lock can panic, so a poisoned lock holds valid data.
    fn queue(&self) -> MutexGuard<'_, ViewerQueue> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Sink of the follower that fills the queue.
struct QueueSink(Arc<Viewers>);

impl LiveMessageSink for QueueSink {
    fn set_topics(&mut self, topics: &[Topic]) {
        self.0.queue().set_topics(topics);
    }

    fn send(&mut self, message: &LiveMessage<'_>) {
        self.0.queue().put(message);
    }

    fn report_loss(&mut self, text: String) {
        self.0.queue().announce(text);
    }

    fn end_of_record(&mut self) {
        self.0.changed.send_replace(());
    }
}

async fn follow(mut follower: MessageConverter, mut sink: QueueSink) {
    while follower.next(&mut sink).await {}
    sink.0.queue().close();
    sink.0.changed.send_replace(());
}

/// Converts a receive error to a close frame; errors of the connection itself are returned.
fn receive_error(error: axum::Error) -> Result<CloseFrame, axum::Error> {
    if is_connection_error(&error) {
        return Err(error);
    }
    let why = format!("{error}; texts have at most {MAX_TEXT_BYTES} bytes");
    // A close reason is limited to 123 bytes.
    let why: String = why.chars().filter(char::is_ascii).take(120).collect();
    Ok(close_frame(close_code::POLICY, &why))
}

fn close_frame(code: u16, reason: &str) -> CloseFrame {
    CloseFrame { code, reason: reason.into() }
}

/// Performs the closing handshake, within a time limit.
async fn close_socket(socket: &mut WebSocket, frame: CloseFrame) {
    let closing = async {
        if socket.send(Message::Close(Some(frame))).await.is_ok() {
            while let Some(Ok(_)) = socket.recv().await {}
        }
    };
    drop(timeout(CLOSE_TIMEOUT, closing).await);
}

/// Returns `true` if a connection ended because the viewer did not read.
fn is_write_timeout(error: &axum::Error) -> bool {
    io_cause(error).is_some_and(|error| error.kind() == io::ErrorKind::TimedOut)
}

fn is_connection_error(error: &axum::Error) -> bool {
    io_cause(error).is_some()
}

/// Returns the I/O error that caused `error`, if any.
fn io_cause(error: &axum::Error) -> Option<&io::Error> {
    let mut source = error.source();
    while let Some(error) = source {
        if let Some(io) = error.downcast_ref::<io::Error>() {
            return Some(io);
        }
        source = error.source();
    }
    None
}
