//! Live messages for ROS 2, by DDS and without an installation of ROS.
//!
//! One thread follows the daemon's records, as a viewer of Foxglove does, and hands messages to DDS. What waits for that thread
//! waits in the hub; what waits for subscribers is bounded for each topic (`budget`). Nobody is waited for.
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![warn(clippy::expect_used, clippy::indexing_slicing, clippy::panic)]

mod budget;
mod gaps;
mod initial_pose;
mod networks;
mod node;
mod services;

use std::{
    io,
    panic::{AssertUnwindSafe, catch_unwind},
    thread::JoinHandle,
    time::Duration,
};

use jiff::Timestamp;
use sonard_api::{RosReport, config::RosKeys};
use sonard_daemon::{Audience as _, Follower, Handle};
use sonard_export::{Live, Topic};
use sonard_runtime::supervisor::Task;
use tokio::{
    runtime::Handle as Runtime,
    time::{MissedTickBehavior, interval, sleep},
};
use tokio_util::sync::CancellationToken;

use node::Node;
use services::Services;

/// From one try to open the ports of DDS to the next.
const BETWEEN_TRIES: Duration = Duration::from_secs(5);
/// How often it is looked who came and went.
const LOOK: Duration = Duration::from_secs(1);

/// The thread that tells ROS 2, to be stopped at the end.
#[derive(Debug)]
pub struct Ros {
    stop: CancellationToken,
    thread: JoinHandle<Option<()>>,
}

impl Ros {
    /// Begins to tell what the daemon measures, by `keys`. Must be called within a multi-threaded tokio runtime, before
    /// the daemon runs.
    ///
    /// # Errors
    /// When there can't be another thread.
    pub fn start(keys: &RosKeys, daemon: Handle) -> io::Result<Self> {
        let stop = CancellationToken::new();
        let report = RosReport {
            domain: keys.domain,
            networks: keys.networks.clone(),
            up: false,
            since: Timestamp::now(),
            trouble: None,
            topics: 0,
            subscriptions: 0,
            messages: 0,
            left_out: 0,
            commands: 0,
            refused: 0,
            refusal: None,
        };
        daemon.report_ros(report.clone());
        let supervisor = daemon.supervisor().clone();
        let teller = Teller { keys: keys.clone(), daemon, stop: stop.clone(), report };
        let runtime = Runtime::current();
        let thread = supervisor.spawn_thread(Task::Ros, move || teller.run(&runtime))?;
        Ok(Self { stop, thread })
    }

    /// Waits until what was measured is told, as far as that is taken within a second. The daemon must have ended.
    pub async fn stop(self) {
        self.stop.cancel();
        // It ends by itself; the supervisor has its panic.
        drop(tokio::task::spawn_blocking(|| self.thread.join()).await);
    }
}

struct Teller {
    keys: RosKeys,
    daemon: Handle,
    stop: CancellationToken,
    report: RosReport,
}

impl Teller {
    /// Opens a node whenever there is none, until the daemon ends.
    fn run(mut self, runtime: &Runtime) {
        loop {
            // What is wrong within the library must not be the end of what is told.
            let lived = catch_unwind(AssertUnwindSafe(|| runtime.block_on(self.live())));
            let trouble = match lived {
                Ok(Ok(())) => return,
                Ok(Err(trouble)) => trouble,
                Err(_) => "something within DDS went wrong that should not".to_owned(),
            };
            if self.report.trouble.as_ref() != Some(&trouble) {
                tracing::warn!("ros: {trouble}");
            }
            let (up, since, trouble) = (false, Timestamp::now(), Some(trouble));
            (self.report.topics, self.report.subscriptions) = (0, 0);
            self.report = RosReport { up, since, trouble, ..self.report.clone() };
            self.daemon.report_ros(self.report.clone());
            let waited = runtime.block_on(async {
                tokio::select! {
                    () = self.stop.cancelled() => false,
                    () = sleep(BETWEEN_TRIES) => true,
                }
            });
            if !waited {
                return;
            }
        }
    }

    /// A node's life: ends well with the daemon, and else with what is wrong.
    async fn live(&mut self) -> Result<(), String> {
        let opened = Node::open(&self.keys, &self.daemon, &self.report);
        let mut node = opened.map_err(|error| error.to_string())?;
        tracing::info!("ros: domain {} on {}", self.keys.domain, self.keys.networks.join(", "));
        let services = match self.keys.commands {
            true => Services::offer(&mut node).map_err(|error| error.to_string())?,
            false => Services::none(),
        };
        node.set_topics(&self.expected());
        let live = Live::new(self.keys.messages()).with_map(self.keys.map);
        let mut follower = Follower::begin(&self.daemon, live, &mut node);
        let ended = self.tell(&mut follower, &mut node, &services).await;
        self.report = node.leave();
        ended
    }

    async fn tell(
        &self,
        follower: &mut Follower,
        node: &mut Node,
        services: &Services,
    ) -> Result<(), String> {
        let mut looks = interval(if services.are_offered() { services::LOOK } else { LOOK });
        looks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            tokio::select! {
                more = follower.next(node) => if !more { return node.look_after() },
                _ = looks.tick() => {
                    node.look_after()?;
                    services.answer(&self.daemon, node).await;
                }
            }
        }
    }

    /// Topics before the first session says what there is: subscribers find them then.
    fn expected(&self) -> Vec<Topic> {
        let next = self.daemon.next_scan();
        let (is_simulated, has_scene) = (next.array.is_some(), next.scene.is_some());
        let distribution = self.keys.messages().distribution;
        let predicts = has_scene && !is_simulated;
        let mut expected =
            Topic::expected(next.array.as_deref(), predicts, has_scene, distribution);
        expected.extend(self.keys.map.then(Topic::map));
        expected
    }
}
