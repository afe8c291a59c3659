//! The keys of a robot among others.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Most characters of a robot's name.
pub const MAX_ROBOT_NAME: usize = 64;

/// This robot among others.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct FleetKeys {
    /// This robot's name, in the status, the log's sessions and the metrics (restart): letters, digits,
    /// `-`, `_` and `.`, at most 64. The host's name goes before the default.
    #[schemars(extend("x-default-yields" = true))]
    pub robot: String,
    /// Other daemons, at most 32, to be asked every 2 s and shown at /fleet and GET /v1/fleet (restart):
    /// [NAME=]HOST:PORT, or [NAME=] and the path of a socket. One that says another name than NAME is
    /// another robot. None asks nobody.
    pub daemons: Vec<String>,
    /// File with the token that is shown to those by TCP (restart), readable by its owner alone.
    #[schemars(example = "/etc/sonard/fleet-token")]
    pub token_file: Option<String>,
    /// File that lists daemons, each with a token file of its own, to be asked as well (restart); as of
    /// `sonard status --fleet`.
    #[schemars(example = "/etc/sonard/fleet.toml")]
    pub file: Option<String>,
}

impl Default for FleetKeys {
    fn default() -> Self {
        Self { robot: "robot".into(), daemons: Vec::new(), token_file: None, file: None }
    }
}

/// Whether a text can be a robot's name: part of a path, of a topic and of a label without a second
/// meaning there.
#[must_use]
pub fn is_robot_name(text: &str) -> bool {
    let fits = |byte: u8| byte.is_ascii_alphanumeric() || b"-_.".contains(&byte);
    (1..=MAX_ROBOT_NAME).contains(&text.len())
        && text.bytes().all(fits)
        && text.bytes().any(|byte| byte != b'.')
}

/// The robot's name that a host's name makes; `None` if there is no letter or digit in it.
#[must_use]
pub fn robot_name_of_host(host: &str) -> Option<String> {
    let fits = |letter: char| letter.is_ascii_alphanumeric() || "-_.".contains(letter);
    let name: String = host
        .chars()
        .take(MAX_ROBOT_NAME)
        .map(|letter| if fits(letter) { letter } else { '-' })
        .collect();
    name.bytes().any(|byte| byte.is_ascii_alphanumeric()).then_some(name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_name_has_one_meaning_in_paths_topics_and_labels() {
        for good in ["kiwi", "robot-7", "a_b.c", "7", &"x".repeat(64)] {
            assert!(is_robot_name(good), "{good}");
        }
        for bad in ["", ".", "..", "a/b", "a+b", "#", "a b", "\u{e9}", "a\n", &"x".repeat(65)] {
            assert!(!is_robot_name(bad), "{bad:?}");
        }
    }

    #[test]
    fn a_host_name_is_taken_as_it_is_where_it_can_be() {
        assert_eq!(robot_name_of_host("kiwi.lan").as_deref(), Some("kiwi.lan"));
        assert_eq!(robot_name_of_host("my robot/1").as_deref(), Some("my-robot-1"));
        assert_eq!(robot_name_of_host(""), None);
        assert_eq!(robot_name_of_host("(none)").as_deref(), Some("-none-"));
        assert_eq!(robot_name_of_host("\u{3042}\u{3044}"), None);
    }

    proptest! {
        #[test]
        fn every_name_made_of_a_host_is_a_name(host in "\\PC{0,80}") {
            if let Some(name) = robot_name_of_host(&host) {
                prop_assert!(is_robot_name(&name), "{name}");
            }
        }
    }
}
