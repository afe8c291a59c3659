//! Supervision of the daemon's long-lived tasks and threads.
//!
//! Each long-lived task is spawned through a [`Supervisor`] under a [`Task`]. A panic, or an end
//! before the daemon is stopping, is a [`TaskFailure`]; the first one is returned by
//! [`Supervisor::failure`], upon which the daemon shuts down and exits with a non-zero code, so
//! that the service manager restarts it. `clippy.toml` forbids the plain spawning functions, so
//! that no task is left out.
#![warn(clippy::expect_used, clippy::indexing_slicing, clippy::panic)]

use std::{
    any::Any,
    fmt, io,
    panic::{AssertUnwindSafe, catch_unwind},
    thread,
};

use futures_util::FutureExt as _;
use thiserror::Error;
use tokio::{sync::watch, task::JoinHandle};
use tokio_util::sync::CancellationToken;

/// Defines [`Task`] from one table, so that [`Task::ALL`] contains every task.
macro_rules! tasks {
    ($($(#[$doc:meta])+ $task:ident = $name:literal,)+) => {
        /// Name of a long-lived task.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum Task {
            $($(#[$doc])+ $task,)+
        }

        impl Task {
            /// All tasks.
            pub const ALL: [Self; [$($name),+].len()] = [$(Self::$task),+];

            /// Name in messages.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$task => $name,)+
                }
            }
        }
    };
}

tasks! {
    /// Owner of the serial port, or of the simulated array.
    Device = "device",
    /// Writer of the log folder (a thread).
    Log = "log",
    /// Watch on the time that the log's writes and syncs take.
    LogWatch = "log-watch",
    /// Notifications to systemd.
    Notifications = "notifications",
    /// Periodic reading of the thermometer.
    Thermometer = "thermometer",
    /// Accept loop of a listening socket.
    Server = "server",
    /// Restoration of listening sockets.
    Listeners = "listeners",
    /// Conversion of records to viewers' messages.
    LiveMessages = "live-messages",
    /// Polling of the fleet's other daemons.
    Fleet = "fleet",
    /// Publication of records to an MQTT broker.
    Mqtt = "mqtt",
    /// Publication of messages to ROS 2 (a thread).
    Ros = "ros",
    /// Reloads of the configuration.
    Reload = "reload",
    /// Reception of stop signals.
    Signals = "signals",
    /// Mock device of `sonard run --mock`.
    Mock = "mock",
}

impl fmt::Display for Task {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Unexpected end of a long-lived task.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("the task \"{task}\" ended unexpectedly: {cause}")]
pub struct TaskFailure {
    /// The task that ended.
    pub task: Task,
    /// Message of its panic, or that it returned.
    pub cause: String,
}

/// Spawns long-lived tasks and reports the first one that fails. Clones share their state.
#[derive(Debug, Clone)]
pub struct Supervisor {
    stopping: CancellationToken,
    failure: watch::Sender<Option<TaskFailure>>,
}

impl Default for Supervisor {
    fn default() -> Self {
        Self { stopping: CancellationToken::new(), failure: watch::Sender::new(None) }
    }
}

impl Supervisor {
    /// Token that is cancelled when the daemon begins to stop; from then on tasks may end.
    #[must_use]
    pub const fn stopping(&self) -> &CancellationToken {
        &self.stopping
    }

    /// Spawns a task that runs until the daemon stops: a panic and an early end are failures.
    /// `None` is its output after a panic. Must be called within a tokio runtime.
    pub fn spawn<F>(&self, task: Task, future: F) -> JoinHandle<Option<F::Output>>
    where
        F: Future<Output: Send> + Send + 'static,
    {
        self.spawn_supervised(task, future, true)
    }

    /// Spawns a task that may end when its work is done: only a panic is a failure. Must be called
    /// within a tokio runtime.
    pub fn spawn_finite<F>(&self, task: Task, future: F) -> JoinHandle<Option<F::Output>>
    where
        F: Future<Output: Send> + Send + 'static,
    {
        self.spawn_supervised(task, future, false)
    }

    /// Starts a thread that runs until the daemon stops. `None` is its output after a panic.
    ///
    /// # Errors
    /// If the system cannot create another thread.
    pub fn spawn_thread<T: Send + 'static>(
        &self,
        task: Task,
        run: impl FnOnce() -> T + Send + 'static,
    ) -> io::Result<thread::JoinHandle<Option<T>>> {
        let supervisor = self.clone();
        #[allow(clippy::disallowed_methods, reason = "this is the supervised spawn")]
        thread::Builder::new().name(task.name().into()).spawn(move || {
            let run = || {
                fault::panic_now(task);
                run()
            };
            supervisor.end(task, catch_unwind(AssertUnwindSafe(run)), true)
        })
    }

    /// Completes with the first failure of a task.
    pub async fn failure(&self) -> TaskFailure {
        let mut failure = self.failure.subscribe();
        loop {
            if let Some(failure) = failure.borrow_and_update().clone() {
                return failure;
            }
            // The sender lives in `self`.
            if failure.changed().await.is_err() {
                return std::future::pending().await;
            }
        }
    }

    /// First failure of a task so far.
    #[must_use]
    pub fn first_failure(&self) -> Option<TaskFailure> {
        self.failure.borrow().clone()
    }

    fn spawn_supervised<F>(
        &self,
        task: Task,
        future: F,
        must_run: bool,
    ) -> JoinHandle<Option<F::Output>>
    where
        F: Future<Output: Send> + Send + 'static,
    {
        let supervisor = self.clone();
        #[allow(clippy::disallowed_methods, reason = "this is the supervised spawn")]
        tokio::spawn(async move {
            let outcome = AssertUnwindSafe(fault::with_panic(task, future)).catch_unwind().await;
            supervisor.end(task, outcome, must_run)
        })
    }

    /// Reports the end of a task where it is a failure, and returns its output.
    fn end<T>(&self, task: Task, outcome: thread::Result<T>, must_run: bool) -> Option<T> {
        let (output, cause) = match outcome {
            Ok(output) if !must_run || self.stopping.is_cancelled() => return Some(output),
            Ok(output) => (Some(output), "it returned".to_owned()),
            Err(panic) => (None, panic_message(&*panic)),
        };
        let failure = TaskFailure { task, cause };
        tracing::error!("{failure}");
        self.failure.send_if_modified(|first| {
            let is_first = first.is_none();
            first.get_or_insert(failure);
            is_first
        });
        output
    }
}

/// Message of a panic.
pub(crate) fn panic_message(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().copied();
    let text = text.or_else(|| panic.downcast_ref::<String>().map(String::as_str));
    text.unwrap_or("no message").to_owned()
}

/// Panics on request, for the test that ends each task in turn: in builds with debug assertions,
/// the environment variable `SONARD_TEST_PANIC` names a task that panics a second after its start.
mod fault {
    use super::Task;

    #[cfg(debug_assertions)]
    fn is_named(task: Task) -> bool {
        std::env::var_os("SONARD_TEST_PANIC").is_some_and(|name| name == task.name())
    }

    #[cfg(debug_assertions)]
    const DELAY: std::time::Duration = std::time::Duration::from_secs(1);

    #[cfg(debug_assertions)]
    #[expect(clippy::panic, reason = "the fault that a test requests")]
    pub(super) async fn with_panic<F: Future>(task: Task, future: F) -> F::Output {
        if !is_named(task) {
            return future.await;
        }
        match tokio::time::timeout(DELAY, future).await {
            Ok(output) => output,
            Err(_) => panic!("requested by SONARD_TEST_PANIC"),
        }
    }

    #[cfg(debug_assertions)]
    #[expect(clippy::panic, reason = "the fault that a test requests")]
    pub(super) fn panic_now(task: Task) {
        if is_named(task) {
            std::thread::sleep(DELAY);
            panic!("requested by SONARD_TEST_PANIC");
        }
    }

    #[cfg(not(debug_assertions))]
    pub(super) async fn with_panic<F: Future>(_: Task, future: F) -> F::Output {
        future.await
    }

    #[cfg(not(debug_assertions))]
    pub(super) const fn panic_now(_: Task) {}
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn panic_is_a_failure() {
        let supervisor = Supervisor::default();
        let task = supervisor.spawn_finite(Task::Fleet, async { panic!("index 3") });
        assert_eq!(task.await.expect("joins"), None::<()>);
        let failure = supervisor.failure().await;
        assert_eq!(failure, TaskFailure { task: Task::Fleet, cause: "index 3".into() });
    }

    #[tokio::test]
    async fn early_end_is_a_failure_unless_finite() {
        let supervisor = Supervisor::default();
        supervisor.spawn_finite(Task::Fleet, async {}).await.expect("joins");
        assert_eq!(supervisor.first_failure(), None);
        supervisor.spawn(Task::Server, async {}).await.expect("joins");
        assert_eq!(supervisor.failure().await.task, Task::Server);
    }

    #[tokio::test]
    async fn end_while_stopping_is_expected() {
        let supervisor = Supervisor::default();
        supervisor.stopping().cancel();
        let output = supervisor.spawn(Task::Server, async { 7 }).await.expect("joins");
        assert_eq!((output, supervisor.first_failure()), (Some(7), None));
    }

    #[test]
    fn first_failure_is_kept() {
        let supervisor = Supervisor::default();
        for (task, cause) in [(Task::Log, "first"), (Task::Ros, "second")] {
            let run = move || -> () { panic!("{cause}") };
            let thread = supervisor.spawn_thread(task, run).expect("starts");
            assert_eq!(thread.join().expect("caught"), None);
        }
        assert_eq!(supervisor.first_failure().map(|failure| failure.task), Some(Task::Log));
    }

    #[test]
    fn names_are_distinct() {
        let mut names: Vec<_> = Task::ALL.iter().map(|task| task.name()).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), Task::ALL.len());
    }
}
