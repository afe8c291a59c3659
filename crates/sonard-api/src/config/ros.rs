//! Configuration keys of the ROS 2 output, and checks beyond ranges.

use std::net::Ipv4Addr;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_export::{
    ExportSettings,
    dds::{is_name, is_namespace},
};

use super::Fault;

/// Messages and services for ROS 2 over DDS.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RosKeys {
    /// Enable the ROS 2 output (restart). Otherwise no port is opened and nothing is sent.
    pub enabled: bool,
    /// DDS domain, as ROS_DOMAIN_ID of the subscribers (restart).
    #[schemars(range(min = 0, max = 232))]
    pub domain: u16,
    /// IPv4 addresses of this computer, or names of its interfaces, to publish on (restart). DDS
    /// has no access control: every host on these networks can subscribe.
    pub networks: Vec<String>,
    /// Namespace of node and topics (restart), such as /kiwi; empty for none.
    pub namespace: String,
    /// Encoding of "no echo" in Range messages (restart): +inf (REP 117), or the maximum range as
    /// nav2's range layer expects.
    pub profile: RosProfile,
    /// ROS distribution of the message definitions (restart): jazzy for Iron and later, humble for
    /// earlier ones.
    pub distribution: RosDistribution,
    /// Frame of the transducer, from which other frame names are derived (restart).
    pub frame: String,
    /// Full opening angle of Range messages, degrees (restart); by default the sensor's beam width.
    #[schemars(range(min = 0.1, max = 180), example = 15)]
    pub field_of_view_deg: Option<f64>,
    /// Publish the transform from map to base_link on /tf (restart). Disable it if the robot's own
    /// software publishes that transform.
    pub publish_robot_pose: bool,
    /// Publish a map of all scans since the start after each scan (restart), computed as by `sonard
    /// map`. Disable it if another node publishes /map.
    pub map: bool,
    /// Accept services that start and stop scans, and poses from /initialpose (restart), from every
    /// host on these networks.
    pub commands: bool,
    /// Maximum size of unacknowledged messages per topic, kilobytes (restart); further messages are
    /// dropped and counted.
    #[schemars(range(min = 16, max = 8192))]
    pub queue_kb: u32,
}

/// Encoding of "no echo" in `Range` messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RosProfile {
    /// +inf for no echo, -inf below the minimum range.
    #[default]
    Rep117,
    /// The maximum range for no echo, the minimum range below it.
    Nav2,
}

/// ROS distribution of the message definitions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RosDistribution {
    /// ROS 2 Humble and earlier.
    Humble,
    /// ROS 2 Iron and later.
    #[default]
    Jazzy,
}

impl Default for RosKeys {
    fn default() -> Self {
        Self {
            enabled: false,
            domain: 0,
            networks: vec!["127.0.0.1".into()],
            namespace: String::new(),
            profile: RosProfile::default(),
            distribution: RosDistribution::default(),
            frame: "sonar".into(),
            field_of_view_deg: None,
            publish_robot_pose: true,
            map: false,
            commands: false,
            queue_kb: 512,
        }
    }
}

impl RosKeys {
    /// Returns the settings of the message encoder.
    #[must_use]
    pub fn message_settings(&self) -> ExportSettings {
        use sonard_export::{Distribution, Profile};

        ExportSettings {
            profile: match self.profile {
                RosProfile::Rep117 => Profile::Rep117,
                RosProfile::Nav2 => Profile::Nav2,
            },
            distribution: match self.distribution {
                RosDistribution::Humble => Distribution::Humble,
                RosDistribution::Jazzy => Distribution::Jazzy,
            },
            places_robot: self.publish_robot_pose,
            field_of_view_deg: self.field_of_view_deg,
            frame: self.frame.clone(),
        }
    }

    /// Checks rules beyond ranges; at last, whether the program was built with DDS support
    /// (`built_in`).
    /// If the output is disabled, every setting is valid.
    ///
    /// # Errors
    /// First invalid key.
    pub fn check(&self, built_in: bool) -> Result<(), Fault> {
        if !self.enabled {
            return Ok(());
        }
        if !is_namespace(&self.namespace) {
            let help = "expected names of letters, digits and _, each after a slash: /kiwi, or /lab/kiwi_7";
            return Err((
                "namespace",
                format!("ros.namespace is {:?}", self.namespace),
                help.into(),
            ));
        }
        if !self.frame.split('/').all(is_name) || self.frame.len() > 64 {
            let help = "expected letters, digits and _, without a leading slash: sonar";
            return Err(("frame", format!("ros.frame is {:?}", self.frame), help.into()));
        }
        if let Some(network) = self.networks.iter().find(|network| !is_network(network)) {
            let help = "expected an IPv4 address of this computer or the name of an interface: 192.168.1.7, wlan0";
            return Err(("networks", format!("ros.networks has {network:?}"), help.into()));
        }
        if self.networks.is_empty() {
            let help = "use [\"127.0.0.1\"] for this computer only; to disable the output, set ros.enabled = false";
            return Err(("networks", "ros.networks is empty".into(), help.into()));
        }
        if !built_in {
            let message = "this program was built without the feature ros";
            let help =
                "build it with `cargo build --release --features ros`, or set ros.enabled = false";
            return Err(("enabled", message.into(), help.into()));
        }
        Ok(())
    }
}

/// Returns `true` for an IPv4 address or a valid interface name.
fn is_network(text: &str) -> bool {
    /// Maximum length of an interface name on Linux (IFNAMSIZ - 1).
    const MAX_LENGTH: usize = 15;
    let is_digits_and_dots = text.bytes().all(|byte| byte.is_ascii_digit() || byte == b'.');
    if is_digits_and_dots {
        return text.parse::<Ipv4Addr>().is_ok_and(|address| !address.is_unspecified());
    }
    let fits = |c: char| c.is_ascii_alphanumeric() || "-_.@".contains(c);
    (1..=MAX_LENGTH).contains(&text.len()) && text.chars().all(fits)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invalid_keys_are_named() {
        let good = RosKeys { enabled: true, ..RosKeys::default() };
        assert_eq!(good.check(true), Ok(()));
        let key = |keys: RosKeys| keys.check(true).expect_err("wrong").0;
        for namespace in ["kiwi", "/7", "/a/", "/a b"] {
            assert_eq!(key(RosKeys { namespace: namespace.into(), ..good.clone() }), "namespace");
        }
        for frame in ["", "/sonar", "a b", "sonar/", &"x".repeat(65)] {
            assert_eq!(key(RosKeys { frame: frame.into(), ..good.clone() }), "frame");
        }
        for network in ["", "*", "0.0.0.0", "1.2.3", "::1", "192.168.1.0/24", "a-very-long-name"] {
            let networks = vec!["127.0.0.1".into(), network.into()];
            assert_eq!(key(RosKeys { networks, ..good.clone() }), "networks");
        }
        assert_eq!(key(RosKeys { networks: Vec::new(), ..good.clone() }), "networks");
        let networks = vec!["192.168.1.7".into(), "wlp3s0".into(), "br-lan".into()];
        assert_eq!(RosKeys { networks, ..good }.check(true), Ok(()));
    }

    #[test]
    fn missing_feature_is_named() {
        assert_eq!(RosKeys::default().check(false), Ok(()));
        let keys = RosKeys { enabled: true, ..RosKeys::default() };
        let (key, message, help) = keys.check(false).expect_err("feature missing");
        assert!(key == "enabled" && message.contains("feature ros"), "{message}");
        assert!(help.contains("--features ros"), "{help}");
    }
}
