//! Messages of a long-running program on standard error.
//!
//! Standard error can be closed, full (a pipe without reader, a stopped terminal, a stuck journal)
//! or gone with its terminal. A message must neither fail nor block the task that emits it, so
//! messages pass through a bounded queue to a thread of its own. When the queue is full, messages
//! are dropped and counted.
#![warn(clippy::expect_used, clippy::indexing_slicing, clippy::panic)]

use std::{
    collections::VecDeque,
    io::{self, IsTerminal as _, Write},
    sync::{Arc, Condvar, Mutex, MutexGuard, OnceLock, PoisonError},
    thread,
    time::{Duration, Instant},
};

use tracing::Subscriber;
use tracing_subscriber::{
    Layer as _, Registry,
    filter::Targets,
    fmt::{MakeWriter, layer},
    layer::SubscriberExt as _,
    util::SubscriberInitExt as _,
};

use super::platform::{MAX_ATOMIC_BYTES, Output, stderr, write_before};

/// Upper bound of the queue, bytes.
const MAX_QUEUED_BYTES: usize = 256 * 1024;
/// Time allowed for the queued messages to be written when the program ends.
const DRAIN_TIMEOUT: Duration = Duration::from_millis(500);
/// Time allowed for a message that is written directly.
const DIRECT_TIMEOUT: Duration = Duration::from_secs(1);
/// Targets and levels of messages unless `SONARD_LOG` sets others, such as
/// `info,sonard_device=debug`.
const DEFAULT_FILTER: &str = "info,rustdds=off";

/// Queue of this process's messages, once there is one.
static QUEUE: OnceLock<MessageQueue> = OnceLock::new();

/// Messages of this process that were dropped because standard error was blocked or gone.
#[must_use]
pub fn dropped() -> u64 {
    QUEUE.get().map_or(0, MessageQueue::dropped)
}

/// Queue of messages for standard error. Clones share it.
#[derive(Debug, Clone)]
pub struct MessageQueue(Arc<QueueInner>);

/// Drains the queue when dropped, within half a second.
#[derive(Debug)]
pub struct MessageGuard(MessageQueue);

#[derive(Debug)]
struct QueueInner {
    state: Mutex<QueueState>,
    changed: Condvar,
}

#[derive(Debug, Default)]
struct QueueState {
    messages: VecDeque<Vec<u8>>,
    bytes: usize,
    /// A message taken from the queue is being written.
    is_writing: bool,
    dropped: u64,
    /// Dropped messages that no message has reported yet.
    unreported: u64,
}

/// Sends tracing's messages to standard error through a [`MessageQueue`] that is drained when the
/// guard is dropped. Under systemd the journal adds the time.
#[must_use]
pub fn log_to_stderr() -> MessageGuard {
    let queue = QUEUE.get_or_init(|| MessageQueue::start(stderr())).clone();
    install(queue.clone(), DEFAULT_FILTER, std::env::var_os("JOURNAL_STREAM").is_none());
    // The default hook writes to standard error and would block with it.
    std::panic::set_hook(Box::new(|panic| {
        let place = panic.location().map(ToString::to_string).unwrap_or_default();
        let cause = crate::supervisor::panic_message(panic.payload());
        tracing::error!("internal error at {place}: {cause}; please report it");
    }));
    MessageGuard(queue)
}

/// Sends warnings to standard error, for programs that write their own messages there. `SONARD_LOG`
/// sets another level.
pub fn warn_on_stderr() {
    install(|| DirectWriter, "off,sonard=warn", false);
}

/// Sends messages that pass `SONARD_LOG`, or else `default_filter`, to a writer. A subscriber that
/// the caller has installed before is kept.
fn install<W>(writer: W, default_filter: &str, with_time: bool)
where
    W: for<'a> MakeWriter<'a> + Send + Sync + 'static,
{
    let requested = std::env::var("SONARD_LOG").ok().filter(|text| text.parse::<Targets>().is_ok());
    let filter = requested.as_deref().unwrap_or(default_filter);
    drop(subscriber(writer, filter, with_time, io::stderr().is_terminal()).try_init());
}

/// Returns a tracing subscriber that writes messages as lines of text.
///
/// `filter` lists targets and levels, such as `info,sonard_device=debug`; an invalid list passes no
/// message.
pub fn subscriber<W>(
    writer: W,
    filter: &str,
    with_time: bool,
    with_ansi: bool,
) -> impl Subscriber + Send + Sync
where
    W: for<'a> MakeWriter<'a> + Send + Sync + 'static,
{
    let lines = layer()
        .with_writer(writer)
        .with_ansi(with_ansi)
        .log_internal_errors(false)
        .with_target(false);
    let lines = if with_time { lines.boxed() } else { lines.without_time().boxed() };
    Registry::default().with(lines).with(filter.parse::<Targets>().unwrap_or_default())
}

/// Writes through [`write_stderr`]; never fails.
struct DirectWriter;

impl Write for DirectWriter {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        write_stderr(&String::from_utf8_lossy(bytes));
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Writes a text to standard error for at most a second: a recipient that does not read delays the
/// program no longer, and one that is gone is ignored.
pub fn write_stderr(text: &str) {
    let deadline = Instant::now() + DIRECT_TIMEOUT;
    for piece in text.as_bytes().chunks(MAX_ATOMIC_BYTES) {
        if write_before(stderr(), piece, Some(deadline)).is_err() {
            return;
        }
    }
}

impl MessageQueue {
    /// Starts the thread that writes the messages to `output`.
    fn start(output: Output) -> Self {
        let shared = QueueInner { state: Mutex::default(), changed: Condvar::new() };
        let queue = Self(Arc::new(shared));
        let writer = queue.clone();
        #[allow(clippy::disallowed_methods, reason = "supervised tasks depend on this thread")]
        let started = thread::Builder::new()
            .name("messages".into())
            .spawn(move || writer.write_messages(output));
        // Without a thread, messages are counted as dropped once the queue is full.
        drop(started);
        queue
    }

    /// Messages dropped since the start.
    #[must_use]
    pub fn dropped(&self) -> u64 {
        self.state().dropped
    }

    fn push(&self, message: &[u8]) {
        let mut state = self.state();
        if state.bytes + message.len() > MAX_QUEUED_BYTES {
            state.dropped += 1;
            state.unreported += 1;
            return;
        }
        state.bytes += message.len();
        state.messages.push_back(message.to_vec());
        self.0.changed.notify_all();
    }

    fn write_messages(&self, output: Output) {
        loop {
            let written = write_before(output, &self.next_message(), None);
            let mut state = self.state();
            state.is_writing = false;
            state.dropped += u64::from(written.is_err());
            self.0.changed.notify_all();
        }
    }

    /// Waits for a message. Once the queue is empty, a message about those that were dropped
    /// follows.
    fn next_message(&self) -> Vec<u8> {
        let mut state = self.state();
        loop {
            if let Some(message) = state.messages.pop_front() {
                state.bytes -= message.len();
                state.is_writing = true;
                return message;
            }
            if state.unreported > 0 {
                state.is_writing = true;
                let lost = std::mem::take(&mut state.unreported);
                return format!("{lost} messages were dropped: standard error was blocked\n")
                    .into();
            }
            state = self.0.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Waits until all messages are written, for at most `limit`.
    fn drain(&self, limit: Duration) {
        let deadline = Instant::now() + limit;
        let mut state = self.state();
        while !state.messages.is_empty() || state.is_writing || state.unreported > 0 {
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return;
            }
            let waited = self.0.changed.wait_timeout(state, left);
            state = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    /// Nothing under this lock can panic.
    fn state(&self) -> MutexGuard<'_, QueueState> {
        self.0.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for MessageGuard {
    fn drop(&mut self) {
        self.0.drain(DRAIN_TIMEOUT);
    }
}

/// Queues what is written as one message; never fails.
impl Write for MessageQueue {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.push(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl MakeWriter<'_> for MessageQueue {
    type Writer = Self;

    fn make_writer(&self) -> Self {
        self.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::{io::Read as _, os::fd::OwnedFd};

    /// A queue that writes to a pipe, with the pipe's reading end.
    fn piped() -> (MessageQueue, std::io::PipeReader) {
        let (reader, writer) = io::pipe().expect("a pipe");
        let writer: &'static OwnedFd = Box::leak(Box::new(writer.into()));
        (MessageQueue::start(std::os::fd::AsFd::as_fd(writer)), reader)
    }

    fn read(reader: &mut std::io::PipeReader, bytes: usize) -> String {
        let mut text = vec![0; bytes];
        reader.read_exact(&mut text).expect("text");
        String::from_utf8(text).expect("UTF-8")
    }

    #[test]
    fn messages_keep_their_order() {
        let (mut queue, mut reader) = piped();
        for number in 10..20 {
            queue.write_all(format!("{number}\n").as_bytes()).expect("queued");
        }
        queue.drain(Duration::from_secs(10));
        assert_eq!(read(&mut reader, 30), (10..20).map(|n| format!("{n}\n")).collect::<String>());
        assert_eq!(queue.dropped(), 0);
    }

    #[test]
    fn full_pipe_drops_and_counts() {
        let (mut queue, mut reader) = piped();
        let message = [b'a'; 8192];
        for _ in 0..100 {
            queue.write_all(&message).expect("queued");
        }
        let dropped = queue.dropped();
        // The pipe takes 64 KiB, the queue 256 KiB, and one message is on its way.
        assert!((50..=70).contains(&dropped), "{dropped}");
        let kept = (100 - dropped as usize) * message.len();
        read(&mut reader, kept);
        let note = format!("{dropped} messages were dropped: standard error was blocked\n");
        assert_eq!(read(&mut reader, note.len()), note);
    }

    #[test]
    fn closed_pipe_drops_and_counts() {
        let (mut queue, reader) = piped();
        drop(reader);
        queue.write_all(b"message").expect("queued");
        queue.drain(Duration::from_secs(10));
        assert_eq!(queue.dropped(), 1);
    }
}
