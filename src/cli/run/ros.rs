//! Messages for ROS 2, in a program that was built for it.

use crate::{cli::Failure, config::RosKeys, daemon::Handle};

/// What tells ROS 2, if it is to be told.
pub(super) struct Ros {
    #[cfg(feature = "ros")]
    telling: Option<crate::ros::Ros>,
}

#[cfg(feature = "ros")]
impl Ros {
    /// Begins to tell, before the daemon runs.
    pub(super) fn start(keys: &RosKeys, daemon: &Handle) -> Result<Self, Failure> {
        let begun = keys.enabled.then(|| crate::ros::Ros::start(keys, daemon.clone())).transpose();
        let refuse = |error| Failure::device(format!("cannot tell ROS 2 anything: {error}"), "");
        Ok(Self { telling: begun.map_err(refuse)? })
    }

    /// Tells what is left, once the daemon ended.
    pub(super) async fn stop(self) {
        if let Some(telling) = self.telling {
            telling.stop().await;
        }
    }
}

/// The configuration wants none: that was refused.
#[cfg(not(feature = "ros"))]
impl Ros {
    #[expect(clippy::unnecessary_wraps, reason = "with the feature it can fail")]
    pub(super) const fn start(_: &RosKeys, _: &Handle) -> Result<Self, Failure> {
        Ok(Self {})
    }

    pub(super) async fn stop(self) {}
}
