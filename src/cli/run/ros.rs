//! Connection to ROS 2, if the program was built with it.

use crate::{cli::Failure, config::RosKeys, daemon::Handle};

/// ROS 2 node, if enabled.
pub(super) struct Ros {
    #[cfg(feature = "ros")]
    node: Option<crate::ros::Ros>,
}

#[cfg(feature = "ros")]
impl Ros {
    /// Starts the node, before the daemon runs.
    pub(super) fn start(keys: &RosKeys, daemon: &Handle) -> Result<Self, Failure> {
        let begun = keys.enabled.then(|| crate::ros::Ros::start(keys, daemon.clone())).transpose();
        let refuse = |error| Failure::device(format!("cannot start the ROS 2 node: {error}"), "");
        Ok(Self { node: begun.map_err(refuse)? })
    }

    /// Publishes what is pending and stops the node, after the daemon has ended.
    pub(super) async fn stop(self) {
        if let Some(node) = self.node {
            node.stop().await;
        }
    }
}

/// Without the feature, a configuration that enables ROS has been rejected before.
#[cfg(not(feature = "ros"))]
impl Ros {
    #[expect(clippy::unnecessary_wraps, reason = "fallible with the feature")]
    pub(super) const fn start(_: &RosKeys, _: &Handle) -> Result<Self, Failure> {
        Ok(Self {})
    }

    pub(super) async fn stop(self) {}
}
