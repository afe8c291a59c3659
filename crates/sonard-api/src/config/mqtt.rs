//! The keys of what an MQTT broker is sent, and what in them ranges can't say.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Fault;

/// The port of MQTT, and that of MQTT by TLS.
const PORTS: [u16; 2] = [1883, 8883];
/// Longest prefix of topics and name of a robot, bytes: a topic has at most 65,535.
const MOST_NAME_BYTES: usize = 200;

/// Records to an MQTT broker.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MqttKeys {
    /// The broker (restart): mqtt://HOST:PORT, or mqtts://HOST:PORT for TLS. Without one nothing is sent.
    #[schemars(example = "mqtt://broker.local:1883")]
    pub broker: Option<String>,
    /// What topics begin with, before the robot's name (restart).
    pub topic: String,
    /// Name of the user at the broker (restart).
    #[schemars(example = "robot-1")]
    pub user: Option<String>,
    /// File with that user's password, readable by its owner alone (restart).
    #[schemars(example = "/etc/sonard/mqtt-password")]
    pub password_file: Option<String>,
    /// File of certificates (PEM) by one of which the broker's has to be signed (restart), in place of those that
    /// this computer trusts.
    #[schemars(example = "/etc/sonard/mqtt-ca.pem")]
    pub ca_file: Option<String>,
    /// File of the certificate (PEM) that the broker knows this daemon by (restart).
    #[schemars(example = "/etc/sonard/mqtt-client.pem")]
    pub certificate_file: Option<String>,
    /// File of its key (PEM), readable by its owner alone (restart).
    #[schemars(example = "/etc/sonard/mqtt-client.key")]
    pub key_file: Option<String>,
    /// Whether scans may be started and stopped through the broker (restart), by whoever may publish there.
    pub commands: bool,
    /// Whether the first time all that is in the log is sent (restart), and not only what comes from then on.
    pub history: bool,
    /// How often a silent line is tried, seconds (restart).
    #[schemars(range(min = 5, max = 600))]
    pub keep_alive_s: u16,
    /// How often the status is sent, seconds (restart); a change of the link or of scanning is told at once.
    #[schemars(range(min = 1, max = 3600))]
    pub status_s: u32,
    /// Records under way that the broker has not acknowledged, all together, kilobytes (restart).
    #[schemars(range(min = 16, max = 32_768))]
    pub queue_kb: u32,
}

impl Default for MqttKeys {
    fn default() -> Self {
        Self {
            broker: None,
            topic: "sonard".into(),
            user: None,
            password_file: None,
            ca_file: None,
            certificate_file: None,
            key_file: None,
            commands: false,
            history: false,
            keep_alive_s: 30,
            status_s: 10,
            queue_kb: 256,
        }
    }
}

/// The address of a broker.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Broker {
    /// Name or address of its computer; an address of IPv6 in brackets.
    pub host: String,
    /// Its port.
    pub port: u16,
    /// Whether it is spoken to by TLS.
    pub tls: bool,
}

impl Broker {
    /// Reads `mqtt://HOST:PORT` or `mqtts://HOST:PORT`; the port may be left out.
    ///
    /// # Errors
    /// What would be right.
    pub fn parse(url: &str) -> Result<Self, String> {
        let wanted = || "mqtt://HOST:PORT, or mqtts://HOST:PORT for TLS".to_owned();
        let (scheme, place) = url.split_once("://").ok_or_else(wanted)?;
        let tls = match scheme {
            "mqtt" => false,
            "mqtts" => true,
            _ => return Err(wanted()),
        };
        let place = place.strip_suffix('/').unwrap_or(place);
        if place.contains('@') {
            return Err("user and password have keys of their own: user, password_file".into());
        }
        let (host, port) = match place.rsplit_once(':') {
            Some((host, port)) if !port.ends_with(']') => {
                (host, port.parse().map_err(|_| wanted())?)
            }
            _ => (place, PORTS[usize::from(tls)]),
        };
        let in_brackets = host.strip_prefix('[').and_then(|rest| rest.strip_suffix(']'));
        let is_host = match in_brackets {
            Some(address) => address.parse::<std::net::Ipv6Addr>().is_ok(),
            None => !host.is_empty() && host.bytes().all(is_of_name),
        };
        match (is_host, in_brackets, tls) {
            (true, Some(_), true) => {
                Err("TLS needs the name of a host, or an address of IPv4".into())
            }
            (true, ..) if port != 0 => Ok(Self { host: host.into(), port, tls }),
            _ => Err(wanted()),
        }
    }
}

const fn is_of_name(byte: u8) -> bool {
    byte.is_ascii_alphanumeric() || matches!(byte, b'-' | b'.' | b'_')
}

impl MqttKeys {
    /// Checks what ranges can't say; `built_in` is whether this program can speak to a broker at all. Nothing is wrong where no broker is named.
    ///
    /// # Errors
    /// The first key that is wrong.
    pub fn check(&self, built_in: bool) -> Result<(), Fault> {
        let Some(url) = &self.broker else { return Ok(()) };
        if !built_in {
            let help =
                "build it with `cargo build --release --features mqtt`, or leave mqtt.broker out";
            return Err((
                "broker",
                "this program was built without the feature mqtt".into(),
                help.into(),
            ));
        }
        let broker =
            Broker::parse(url).map_err(|help| ("broker", format!("mqtt.broker is {url}"), help))?;
        if !is_prefix(&self.topic) {
            let help = "names separated by /, without +, # and spaces: sonard, or plant/sonard";
            return Err(("topic", format!("mqtt.topic is {:?}", self.topic), help.into()));
        }
        self.check_secrets(&broker)
    }

    fn check_secrets(&self, broker: &Broker) -> Result<(), Fault> {
        if self.password_file.is_some() && self.user.is_none() {
            let help = "set mqtt.user to the name that the password is of";
            return Err(("password_file", "a password without a user".into(), help.into()));
        }
        if self.certificate_file.is_some() != self.key_file.is_some() {
            let help = "give both, or neither";
            let message = "a certificate needs its key, and a key its certificate";
            return Err(("certificate_file", message.into(), help.into()));
        }
        if !broker.tls && (self.ca_file.is_some() || self.certificate_file.is_some()) {
            let help = "for TLS, mqtt.broker is mqtts://HOST:PORT";
            return Err(("broker", "certificates are of no use without TLS".into(), help.into()));
        }
        Ok(())
    }
}

/// Whether topics can begin so.
fn is_prefix(topic: &str) -> bool {
    topic.len() <= MOST_NAME_BYTES && !topic.starts_with('$') && topic.split('/').all(is_level)
}

/// Whether a level of a topic can be called so.
fn is_level(name: &str) -> bool {
    let is_wrong = |c: char| matches!(c, '/' | '+' | '#') || c.is_control() || c.is_whitespace();
    !name.is_empty() && name.len() <= MOST_NAME_BYTES && !name.contains(is_wrong)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn brokers_are_read_and_what_is_none_is_told() {
        let read = |url| Broker::parse(url).map(|b| (b.host, b.port, b.tls));
        assert_eq!(read("mqtt://broker.local:1884"), Ok(("broker.local".into(), 1884, false)));
        assert_eq!(read("mqtts://10.0.0.7/"), Ok(("10.0.0.7".into(), 8883, true)));
        assert_eq!(read("mqtt://[::1]:1883"), Ok(("[::1]".into(), 1883, false)));
        assert_eq!(read("mqtt://[::1]"), Ok(("[::1]".into(), 1883, false)));
        for (url, help) in [
            ("broker:1883", "mqtt://HOST"),
            ("tcp://broker:1883", "mqtt://HOST"),
            ("mqtt://", "mqtt://HOST"),
            ("mqtt://:1883", "mqtt://HOST"),
            ("mqtt://broker:65536", "mqtt://HOST"),
            ("mqtt://broker:0", "mqtt://HOST"),
            ("mqtt://a b", "mqtt://HOST"),
            ("mqtt://a/b", "mqtt://HOST"),
            ("mqtt://[::g]:1883", "mqtt://HOST"),
            ("mqtt://me:secret@broker", "password_file"),
            ("mqtts://[::1]:8883", "IPv4"),
        ] {
            assert!(read(url).is_err_and(|told| told.contains(help)), "{url}: {:?}", read(url));
        }
    }

    #[test]
    fn keys_that_do_not_go_together_are_refused_with_what_would_be_right() {
        let good = MqttKeys { broker: Some("mqtts://b".into()), ..MqttKeys::default() };
        let some = |text: &str| Some(text.to_owned());
        assert_eq!(good.check(true), Ok(()));
        assert_eq!(MqttKeys::default().check(false), Ok(()));
        let wrong = |keys: MqttKeys| keys.check(true).expect_err("wrong");
        for topic in
            ["", "/sonard", "sonard/", "a//b", "a/+/b", "#", "$SYS", "a b", &"x".repeat(201)]
        {
            assert_eq!(wrong(MqttKeys { topic: topic.into(), ..good.clone() }).0, "topic");
        }
        let (key, ..) = wrong(MqttKeys { password_file: some("p"), ..good.clone() });
        assert_eq!(key, "password_file");
        let (key, ..) = wrong(MqttKeys { key_file: some("k"), ..good.clone() });
        assert_eq!(key, "certificate_file");
        let plain = MqttKeys { broker: some("mqtt://b"), ca_file: some("c"), ..good.clone() };
        assert!(wrong(plain).2.contains("mqtts://"));
    }

    #[test]
    fn a_program_without_the_feature_says_which_one() {
        let keys = MqttKeys { broker: Some("mqtt://b".into()), ..MqttKeys::default() };
        let (key, message, help) = keys.check(false).expect_err("it can't");
        assert!(key == "broker" && message.contains("feature mqtt"), "{message}");
        assert!(help.contains("--features mqtt"), "{help}");
    }
}
