//! The keys of what is told to ROS 2, and what in them ranges can't say.

use std::net::Ipv4Addr;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_export::{
    Settings,
    dds::{is_name, is_namespace},
};

use super::Fault;

/// Messages and services for ROS 2, by DDS.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RosKeys {
    /// Whether there are any (restart). Without them no port is opened and nothing is sent.
    pub enabled: bool,
    /// ROS_DOMAIN_ID of those who are to hear it (restart).
    #[schemars(range(min = 0, max = 232))]
    pub domain: u16,
    /// Addresses (IPv4) of this computer, or names of its interfaces, that it is told by (restart). DDS has no
    /// passwords: on each of these networks everybody hears it.
    pub networks: Vec<String>,
    /// What the names of node and topics begin with (restart), as /kiwi; empty for none.
    pub namespace: String,
    /// What a Range says of silence (restart): +inf, or what nav2's range layer understands.
    pub profile: RosProfile,
    /// Whose definitions messages follow (restart): jazzy for Iron and later, humble for those before.
    pub distribution: RosDistribution,
    /// The frame of the transducer, which others are named after (restart).
    pub frame: String,
    /// Full angle of what a Range is valid for, degrees (restart), instead of the sensor's beam.
    #[schemars(range(min = 0.1, max = 180), example = 15)]
    pub field_of_view_deg: Option<f64>,
    /// Whether /tf says where base_link is in map (restart). A robot whose own software says so must not be
    /// told twice.
    pub places_robot: bool,
    /// Whether a map of all scans since the start is told after each scan (restart), as `sonard map` makes it. Where others tell
    /// /map, two would contradict each other.
    pub map: bool,
    /// Whether scans may be started and stopped by services and the pose set by /initialpose (restart), by whoever is on
    /// these networks.
    pub commands: bool,
    /// Messages of a topic that subscribers have not acknowledged, all together, kilobytes (restart); what comes
    /// when so much waits is left out, with a count.
    #[schemars(range(min = 16, max = 8192))]
    pub queue_kb: u32,
}

/// What a `Range` says of silence.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RosProfile {
    /// +inf for silence, -inf for what is too near.
    #[default]
    Rep117,
    /// The greatest range for silence, the least for what is too near.
    Nav2,
}

/// Whose definitions messages follow.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RosDistribution {
    /// Up to Humble.
    Humble,
    /// Iron and later.
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
            places_robot: true,
            map: false,
            commands: false,
            queue_kb: 512,
        }
    }
}

impl RosKeys {
    /// How messages are made.
    #[must_use]
    pub fn messages(&self) -> Settings {
        use sonard_export::{Distribution, Profile};

        Settings {
            profile: match self.profile {
                RosProfile::Rep117 => Profile::Rep117,
                RosProfile::Nav2 => Profile::Nav2,
            },
            distribution: match self.distribution {
                RosDistribution::Humble => Distribution::Humble,
                RosDistribution::Jazzy => Distribution::Jazzy,
            },
            places_robot: self.places_robot,
            field_of_view_deg: self.field_of_view_deg,
            frame: self.frame.clone(),
        }
    }

    /// Checks what ranges can't say; `built_in` is whether this program can speak DDS at all. Nothing is wrong where
    /// nothing is to be told.
    ///
    /// # Errors
    /// The first key that is wrong.
    pub fn check(&self, built_in: bool) -> Result<(), Fault> {
        if !self.enabled {
            return Ok(());
        }
        if !built_in {
            let message = "this program was built without the feature ros";
            let help =
                "build it with `cargo build --release --features ros`, or set ros.enabled = false";
            return Err(("enabled", message.into(), help.into()));
        }
        if !is_namespace(&self.namespace) {
            let help = "names of letters, digits and _, each behind a slash: /kiwi, or /lab/kiwi_7";
            return Err((
                "namespace",
                format!("ros.namespace is {:?}", self.namespace),
                help.into(),
            ));
        }
        if !self.frame.split('/').all(is_name) || self.frame.len() > 64 {
            let help = "letters, digits and _, without a slash before them: sonar";
            return Err(("frame", format!("ros.frame is {:?}", self.frame), help.into()));
        }
        if let Some(network) = self.networks.iter().find(|network| !is_network(network)) {
            let help = "an address (IPv4) of this computer or the name of an interface: 192.168.1.7, wlan0";
            return Err(("networks", format!("ros.networks has {network:?}"), help.into()));
        }
        if self.networks.is_empty() {
            let help = "for this computer alone [\"127.0.0.1\"]; for nobody ros.enabled = false";
            return Err(("networks", "ros.networks is empty".into(), help.into()));
        }
        Ok(())
    }
}

/// Whether a text can be an address or the name of an interface.
fn is_network(text: &str) -> bool {
    /// Linux has no longer names.
    const MOST: usize = 15;
    let is_digits_and_dots = text.bytes().all(|byte| byte.is_ascii_digit() || byte == b'.');
    if is_digits_and_dots {
        return text.parse::<Ipv4Addr>().is_ok_and(|address| !address.is_unspecified());
    }
    let fits = |c: char| c.is_ascii_alphanumeric() || "-_.@".contains(c);
    (1..=MOST).contains(&text.len()) && text.chars().all(fits)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_that_ros_could_not_take_are_refused_with_what_would_be_right() {
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
    fn a_program_without_the_feature_says_which_one() {
        assert_eq!(RosKeys::default().check(false), Ok(()));
        let keys = RosKeys { enabled: true, ..RosKeys::default() };
        let (key, message, help) = keys.check(false).expect_err("it can't");
        assert!(key == "enabled" && message.contains("feature ros"), "{message}");
        assert!(help.contains("--features ros"), "{help}");
    }
}
