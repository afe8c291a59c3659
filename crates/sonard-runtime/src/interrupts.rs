//! Signals that request the end of a program.
//!
//! SIGINT, SIGTERM and, with a controlling terminal, SIGHUP request an orderly end. Process
//! wrappers such as `timeout` and `sudo` deliver one request as several signals, so signals within
//! half a second of the first one count as one request. A later signal requests the end within
//! [`FORCED_END`]: motor and log are still closed.
#![warn(clippy::expect_used, clippy::indexing_slicing, clippy::panic)]

use std::{future::poll_fn, task::Poll, time::Duration};

use tokio::{
    sync::watch,
    time::{Instant, sleep},
};

use super::platform::{self, StopSignal};

/// Signals within this time of the first one are part of the same request.
const BURST: Duration = Duration::from_millis(500);
/// Time allowed for the rest of the shutdown once its end is forced.
pub const FORCED_END: Duration = Duration::from_secs(3);

/// Urgency of a requested end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
enum StopRequest {
    #[default]
    None,
    Orderly,
    Forced,
}

/// Effect of SIGHUP on a process.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hangup {
    /// The controlling terminal has closed: an orderly end.
    Stop,
    /// Reload of the configuration: there is no controlling terminal, or the parent process has
    /// arranged for this one to survive it (`nohup`).
    Reload,
}

impl Hangup {
    /// Effect for this process. Must be called before a handler for SIGHUP is installed.
    #[must_use]
    pub fn for_this_process() -> Self {
        if platform::ends_with_terminal() { Self::Stop } else { Self::Reload }
    }
}

/// Requests for the end of this process, from its signals. Clones share them.
#[derive(Debug, Clone)]
pub struct Interrupts(watch::Receiver<StopRequest>);

/// Handlers of the stop signals, installed.
#[derive(Debug)]
pub struct SignalHandlers {
    /// The signals that could be handled.
    streams: Vec<StopSignal>,
    requests: watch::Sender<StopRequest>,
}

impl Interrupts {
    /// Installs handlers for the stop signals, among them SIGHUP, and starts a task that receives
    /// them. Must be called within a tokio runtime.
    #[must_use]
    pub fn listen() -> Self {
        let (interrupts, handlers) = Self::install(Hangup::for_this_process());
        #[allow(
            clippy::disallowed_methods,
            reason = "verbs that end with their work have no supervisor"
        )]
        tokio::spawn(handlers.receive());
        interrupts
    }

    /// Installs handlers for the stop signals; [`SignalHandlers::receive`] is to be spawned. Must
    /// be called within a tokio runtime.
    #[must_use]
    pub fn install(hangup: Hangup) -> (Self, SignalHandlers) {
        let (requests, receiver) = watch::channel(StopRequest::default());
        // A signal without a handler ends the process at once, as the system has it.
        let streams = platform::stop_signals(hangup == Hangup::Stop);
        (Self(receiver), SignalHandlers { streams, requests })
    }

    /// Completes once an end is requested.
    pub async fn wait(self) {
        self.reach(StopRequest::Orderly).await;
    }

    /// Completes once the end is forced: a stop signal has come after the first request.
    pub async fn wait_forced(self) {
        self.reach(StopRequest::Forced).await;
    }

    /// Completes [`FORCED_END`] after the end was forced, when waiting any longer is against the
    /// user's will.
    pub async fn wait_overdue(self) {
        self.wait_forced().await;
        sleep(FORCED_END).await;
    }

    /// Completes once an end is requested, with the reason for a log.
    pub async fn reason(self) -> String {
        self.wait().await;
        "stopped on request".into()
    }

    /// Returns `true` once an end has been requested.
    #[must_use]
    pub fn happened(&self) -> bool {
        *self.0.borrow() >= StopRequest::Orderly
    }

    async fn reach(mut self, request: StopRequest) {
        if self.0.wait_for(|&now| now >= request).await.is_err() {
            std::future::pending::<()>().await;
        }
    }
}

impl SignalHandlers {
    /// Receives signals for the rest of the process's life.
    pub async fn receive(mut self) {
        let mut first: Option<Instant> = None;
        loop {
            next_of(&mut self.streams).await;
            let first = *first.get_or_insert_with(Instant::now);
            let request =
                if first.elapsed() <= BURST { StopRequest::Orderly } else { StopRequest::Forced };
            self.requests.send_if_modified(|now| {
                let is_news = *now < request;
                *now = request.max(*now);
                is_news
            });
        }
    }
}

/// Completes with the next of several signals.
async fn next_of(streams: &mut [StopSignal]) {
    poll_fn(|context| {
        let came = streams.iter_mut().any(|stream| stream.poll_recv(context).is_ready());
        if came { Poll::Ready(()) } else { Poll::Pending }
    })
    .await;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn forced_end_follows_an_orderly_one() {
        let (sender, receiver) = watch::channel(StopRequest::None);
        let interrupts = Interrupts(receiver);
        assert!(!interrupts.happened());
        sender.send_replace(StopRequest::Orderly);
        interrupts.clone().wait().await;
        assert!(interrupts.happened());
        let forced = interrupts.wait_forced();
        tokio::pin!(forced);
        let waiting = poll_fn(|context| Poll::Ready(forced.as_mut().poll(context).is_pending()));
        assert!(waiting.await, "an orderly end is not forced");
        sender.send_replace(StopRequest::Forced);
        forced.await;
    }
}
