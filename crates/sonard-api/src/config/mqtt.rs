//! Configuration keys of the MQTT output, and checks beyond ranges.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Fault;

/// Default TCP port without TLS.
const PORT: u16 = 1883;
/// Default TCP port over TLS.
const TLS_PORT: u16 = 8883;
/// Maximum length of a topic prefix and of a robot's name, bytes. A topic is limited to 65,535
/// bytes.
const MAX_NAME_BYTES: usize = 200;

/// Publication of log records to an MQTT broker.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MqttKeys {
    /// URL of the broker (restart): mqtt://HOST:PORT, or mqtts://HOST:PORT for TLS. Without one
    /// nothing is sent.
    #[schemars(example = "mqtt://broker.local:1883")]
    pub broker: Option<String>,
    /// Prefix of topics, before the robot's name (restart).
    pub topic: String,
    /// User name at the broker (restart).
    #[schemars(example = "robot-1")]
    pub user: Option<String>,
    /// File with the user's password, readable by its owner only (restart).
    #[schemars(example = "/etc/sonard/mqtt-password")]
    pub password_file: Option<String>,
    /// File with certificates (PEM) of accepted certificate authorities (restart), in place of
    /// those that this computer trusts.
    #[schemars(example = "/etc/sonard/mqtt-ca.pem")]
    pub ca_file: Option<String>,
    /// File with the client certificate (PEM) of this daemon (restart).
    #[schemars(example = "/etc/sonard/mqtt-client.pem")]
    pub certificate_file: Option<String>,
    /// File with the key (PEM) of the client certificate, readable by its owner only (restart).
    #[schemars(example = "/etc/sonard/mqtt-client.key")]
    pub key_file: Option<String>,
    /// Accept commands that start and stop scans (restart), from every client with publish
    /// permission at the broker.
    pub commands: bool,
    /// On the first connection, publish the whole log and not only records from then on (restart).
    pub history: bool,
    /// Keep-alive interval of an idle connection, seconds (restart).
    #[schemars(range(min = 5, max = 600))]
    pub keep_alive_s: u16,
    /// Interval between status messages, seconds (restart); changes of the link or of scanning are
    /// published at once.
    #[schemars(range(min = 1, max = 3600))]
    pub status_s: u32,
    /// Maximum size of sent but unacknowledged records, kilobytes (restart).
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

/// Address of an MQTT broker.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BrokerAddress {
    /// Host name or address; an IPv6 address in brackets.
    pub host: String,
    /// TCP port.
    pub port: u16,
    /// `true` for a connection over TLS.
    pub tls: bool,
}

impl BrokerAddress {
    /// Parses `mqtt://HOST:PORT` or `mqtts://HOST:PORT`; the port is optional.
    ///
    /// # Errors
    /// Description of the expected format.
    pub fn parse(url: &str) -> Result<Self, String> {
        let expected = || "mqtt://HOST:PORT, or mqtts://HOST:PORT for TLS".to_owned();
        let (scheme, place) = url.split_once("://").ok_or_else(expected)?;
        let tls = match scheme {
            "mqtt" => false,
            "mqtts" => true,
            _ => return Err(expected()),
        };
        let place = place.strip_suffix('/').unwrap_or(place);
        if place.contains('@') {
            return Err("set user and password by the keys user and password_file".into());
        }
        let (host, port) = match place.rsplit_once(':') {
            Some((host, port)) if !port.ends_with(']') => {
                (host, port.parse().map_err(|_| expected())?)
            }
            _ => (place, if tls { TLS_PORT } else { PORT }),
        };
        let in_brackets = host.strip_prefix('[').and_then(|rest| rest.strip_suffix(']'));
        let is_host = match in_brackets {
            Some(address) => address.parse::<std::net::Ipv6Addr>().is_ok(),
            None => !host.is_empty() && host.bytes().all(is_name_byte),
        };
        match (is_host, in_brackets, tls) {
            (true, Some(_), true) => Err("TLS needs a host name or an IPv4 address".into()),
            (true, ..) if port != 0 => Ok(Self { host: host.into(), port, tls }),
            _ => Err(expected()),
        }
    }
}

const fn is_name_byte(byte: u8) -> bool {
    byte.is_ascii_alphanumeric() || matches!(byte, b'-' | b'.' | b'_')
}

impl MqttKeys {
    /// Checks rules beyond ranges; at last, whether the program was built with MQTT support
    /// (`built_in`).
    /// Without a broker every setting is valid.
    ///
    /// # Errors
    /// First invalid key.
    pub fn check(&self, built_in: bool) -> Result<(), Fault> {
        let Some(url) = &self.broker else { return Ok(()) };
        let broker = BrokerAddress::parse(url)
            .map_err(|help| ("broker", format!("mqtt.broker is {url}"), help))?;
        if !is_prefix(&self.topic) {
            let help = "names separated by /, without +, # and spaces: sonard, or plant/sonard";
            return Err(("topic", format!("mqtt.topic is {:?}", self.topic), help.into()));
        }
        self.check_secrets(&broker)?;
        if !built_in {
            let help =
                "build it with `cargo build --release --features mqtt`, or remove mqtt.broker";
            return Err((
                "broker",
                "this program was built without the feature mqtt".into(),
                help.into(),
            ));
        }
        Ok(())
    }

    fn check_secrets(&self, broker: &BrokerAddress) -> Result<(), Fault> {
        if self.password_file.is_some() && self.user.is_none() {
            let help = "set mqtt.user";
            return Err(("password_file", "a password without a user".into(), help.into()));
        }
        if self.certificate_file.is_some() != self.key_file.is_some() {
            let help = "give both, or neither";
            let message = "a certificate needs its key, and a key its certificate";
            return Err(("certificate_file", message.into(), help.into()));
        }
        if !broker.tls && (self.ca_file.is_some() || self.certificate_file.is_some()) {
            let help = "set mqtt.broker to mqtts://HOST:PORT";
            return Err(("broker", "certificates need TLS".into(), help.into()));
        }
        Ok(())
    }
}

/// Returns `true` for a valid topic prefix.
fn is_prefix(topic: &str) -> bool {
    topic.len() <= MAX_NAME_BYTES && !topic.starts_with('$') && topic.split('/').all(is_level)
}

/// Returns `true` for a valid level of a topic.
fn is_level(name: &str) -> bool {
    let is_wrong = |c: char| matches!(c, '/' | '+' | '#') || c.is_control() || c.is_whitespace();
    !name.is_empty() && name.len() <= MAX_NAME_BYTES && !name.contains(is_wrong)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn broker_urls() {
        let read = |url| BrokerAddress::parse(url).map(|b| (b.host, b.port, b.tls));
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
            assert!(read(url).is_err_and(|error| error.contains(help)), "{url}: {:?}", read(url));
        }
    }

    #[test]
    fn inconsistent_keys() {
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
    fn missing_feature_is_named() {
        let keys = MqttKeys { broker: Some("mqtt://b".into()), ..MqttKeys::default() };
        let (key, message, help) = keys.check(false).expect_err("feature missing");
        assert!(key == "broker" && message.contains("feature mqtt"), "{message}");
        assert!(help.contains("--features mqtt"), "{help}");
    }
}
