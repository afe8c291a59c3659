//! Configuration keys of the fleet.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Maximum length of a robot's name, characters.
pub const MAX_ROBOT_NAME_CHARS: usize = 64;

/// Name of this robot, and other robots to poll.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct FleetKeys {
    /// Name of this robot in the status, the log's sessions and the metrics (restart): letters,
    /// digits, `-`, `_` and `.`, at most 64 characters. The host name takes precedence over the
    /// default.
    #[schemars(extend("x-default-yields" = true))]
    pub robot: String,
    /// Other daemons, at most 32, polled every 2 s and shown at /fleet and GET /v1/fleet (restart):
    /// [NAME=]HOST:PORT, or [NAME=] and the path of a socket. A daemon that reports a name other
    /// than NAME is shown as another robot.
    pub daemons: Vec<String>,
    /// File with the access token for daemons polled over TCP (restart), readable by its owner
    /// only.
    #[schemars(example = "/etc/sonard/fleet-token")]
    pub token_file: Option<String>,
    /// File with a list of further daemons to poll, each with its own token file (restart); same
    /// format as for `sonard status --fleet`.
    #[schemars(example = "/etc/sonard/fleet.toml")]
    pub file: Option<String>,
}

impl Default for FleetKeys {
    fn default() -> Self {
        Self { robot: "robot".into(), daemons: Vec::new(), token_file: None, file: None }
    }
}

/// Returns `true` if `text` is a valid robot name, which is unambiguous within paths, topics and
/// metric labels.
#[must_use]
pub fn is_robot_name(text: &str) -> bool {
    let fits = |byte: u8| byte.is_ascii_alphanumeric() || b"-_.".contains(&byte);
    (1..=MAX_ROBOT_NAME_CHARS).contains(&text.len())
        && text.bytes().all(fits)
        && text.bytes().any(|byte| byte != b'.')
}

/// Derives a robot's name from a host name; `None` if it has no letter or digit.
#[must_use]
pub fn robot_name_from_host(host: &str) -> Option<String> {
    let fits = |letter: char| letter.is_ascii_alphanumeric() || "-_.".contains(letter);
    let name: String = host
        .chars()
        .take(MAX_ROBOT_NAME_CHARS)
        .map(|letter| if fits(letter) { letter } else { '-' })
        .collect();
    name.bytes().any(|byte| byte.is_ascii_alphanumeric()).then_some(name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn names_are_safe_in_paths() {
        for good in ["kiwi", "robot-7", "a_b.c", "7", &"x".repeat(64)] {
            assert!(is_robot_name(good), "{good}");
        }
        for bad in ["", ".", "..", "a/b", "a+b", "#", "a b", "\u{e9}", "a\n", &"x".repeat(65)] {
            assert!(!is_robot_name(bad), "{bad:?}");
        }
    }

    #[test]
    fn host_name_is_sanitized() {
        assert_eq!(robot_name_from_host("kiwi.lan").as_deref(), Some("kiwi.lan"));
        assert_eq!(robot_name_from_host("my robot/1").as_deref(), Some("my-robot-1"));
        assert_eq!(robot_name_from_host(""), None);
        assert_eq!(robot_name_from_host("(none)").as_deref(), Some("-none-"));
        assert_eq!(robot_name_from_host("\u{3042}\u{3044}"), None);
    }

    proptest! {
        #[test]
        fn derived_names_are_valid(host in "\\PC{0,80}") {
            if let Some(name) = robot_name_from_host(&host) {
                prop_assert!(is_robot_name(&name), "{name}");
            }
        }
    }
}
