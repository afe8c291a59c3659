//! Live messages for ROS 2 over DDS, without an installation of ROS.
//!
//! A thread follows the daemon's records, like a Foxglove viewer, and passes messages to DDS.
//! Records that the thread has not processed are queued in the daemon's broadcast; unacknowledged
//! messages are bounded for each topic (`send_limit`). Publishing never blocks.
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![warn(clippy::expect_used, clippy::indexing_slicing, clippy::panic)]

mod dropped;
mod initial_pose;
mod networks;
mod node;
mod send_limit;
mod services;

use std::{
    io,
    panic::{AssertUnwindSafe, catch_unwind},
    thread::JoinHandle,
    time::Duration,
};

use jiff::Timestamp;
use sonard_api::{RosReport, config::RosKeys};
use sonard_daemon::{Handle, LiveMessageSink as _, MessageConverter};
use sonard_export::{LiveConverter, Topic};
use sonard_runtime::supervisor::Task;
use tokio::{
    runtime::Handle as Runtime,
    time::{MissedTickBehavior, interval, sleep},
};
use tokio_util::sync::CancellationToken;

use node::Node;
use services::Services;

/// Delay between attempts to open the ports of DDS.
const RETRY_DELAY: Duration = Duration::from_secs(5);
/// Poll interval of subscribers.
const POLL_INTERVAL: Duration = Duration::from_secs(1);

/// Handle of the publishing thread.
#[derive(Debug)]
pub struct Ros {
    stop: CancellationToken,
    thread: JoinHandle<Option<()>>,
}

impl Ros {
    /// Starts publishing the daemon's measurements as configured by `keys`. Must be called within a
    /// multi-threaded tokio runtime, before the daemon runs.
    ///
    /// # Errors
    /// If the thread can't be started.
    pub fn start(keys: &RosKeys, daemon: Handle) -> io::Result<Self> {
        let stop = CancellationToken::new();
        let report = RosReport {
            domain: keys.domain,
            networks: keys.networks.clone(),
            up: false,
            since: Timestamp::now(),
            error: None,
            topics: 0,
            subscriptions: 0,
            messages: 0,
            dropped: 0,
            commands: 0,
            rejected: 0,
            refusal: None,
        };
        daemon.report_ros(report.clone());
        let supervisor = daemon.supervisor().clone();
        let publisher = RosThread { keys: keys.clone(), daemon, stop: stop.clone(), report };
        let runtime = Runtime::current();
        let thread = supervisor.spawn_thread(Task::Ros, move || publisher.run(&runtime))?;
        Ok(Self { stop, thread })
    }

    /// Publishes the remaining messages and waits up to a second for their acknowledgement. The
    /// daemon must have ended.
    pub async fn stop(self) {
        self.stop.cancel();
        // The supervisor reports a panic of the thread.
        drop(tokio::task::spawn_blocking(|| self.thread.join()).await);
    }
}

struct RosThread {
    keys: RosKeys,
    daemon: Handle,
    stop: CancellationToken,
    report: RosReport,
}

impl RosThread {
    /// Runs nodes until the daemon ends; a failed node is replaced after a delay.
    fn run(mut self, runtime: &Runtime) {
        loop {
            // A panic of the DDS library must not end the publication.
            let ended = catch_unwind(AssertUnwindSafe(|| runtime.block_on(self.run_node())));
            let trouble = match ended {
                Ok(Ok(())) => return,
                Ok(Err(trouble)) => trouble,
                Err(_) => "internal error of the DDS library".to_owned(),
            };
            if self.report.error.as_ref() != Some(&trouble) {
                tracing::warn!("ros: {trouble}");
            }
            let (up, since, trouble) = (false, Timestamp::now(), Some(trouble));
            (self.report.topics, self.report.subscriptions) = (0, 0);
            self.report = RosReport { up, since, error: trouble, ..self.report.clone() };
            self.daemon.report_ros(self.report.clone());
            let waited = runtime.block_on(async {
                tokio::select! {
                    () = self.stop.cancelled() => false,
                    () = sleep(RETRY_DELAY) => true,
                }
            });
            if !waited {
                return;
            }
        }
    }

    /// Runs a node until the daemon ends.
    ///
    /// # Errors
    /// Description of the failure of the node.
    async fn run_node(&mut self) -> Result<(), String> {
        let opened = Node::open(&self.keys, &self.daemon, &self.report);
        let mut node = opened.map_err(|error| error.to_string())?;
        tracing::info!("ros: domain {} on {}", self.keys.domain, self.keys.networks.join(", "));
        let services = match self.keys.commands {
            true => Services::offer(&mut node).map_err(|error| error.to_string())?,
            false => Services::none(),
        };
        node.set_topics(&self.expected_topics());
        let live = LiveConverter::new(self.keys.message_settings()).with_map(self.keys.map);
        let mut follower = MessageConverter::subscribe(&self.daemon, live, &mut node);
        let ended = self.publish(&mut follower, &mut node, &services).await;
        self.report = node.leave();
        ended
    }

    async fn publish(
        &self,
        follower: &mut MessageConverter,
        node: &mut Node,
        services: &Services,
    ) -> Result<(), String> {
        let mut ticks =
            interval(if services.are_offered() { services::POLL_INTERVAL } else { POLL_INTERVAL });
        ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            tokio::select! {
                more = follower.next(node) => if !more { return node.update() },
                _ = ticks.tick() => {
                    node.update()?;
                    services.process(&self.daemon, node).await;
                }
            }
        }
    }

    /// Topics to offer before the first session record, so that subscribers discover them early.
    fn expected_topics(&self) -> Vec<Topic> {
        let next = self.daemon.next_scan();
        let (is_simulated, has_scene) = (next.array.is_some(), next.scene.is_some());
        let distribution = self.keys.message_settings().distribution;
        let predicts = has_scene && !is_simulated;
        let mut expected =
            Topic::expected(next.array.as_deref(), predicts, has_scene, distribution);
        expected.extend(self.keys.map.then(Topic::map));
        expected
    }
}
