//! Address, credentials and TLS settings of the broker.

use std::{fmt, path::Path};

use rumqttc::{
    LastWill, MqttOptions, QoS, Transport,
    tokio_rustls::rustls::pki_types::{CertificateDer, PrivateKeyDer, pem::PemObject as _},
};
use sonard_api::config::{BrokerAddress, MqttKeys};
use sonard_daemon::secret::{SecretError, SecretKind, read_secret, read_small_file};
use sonard_records::MAX_LINE_BYTES;
use thiserror::Error;

use super::{
    in_flight::MAX_IN_FLIGHT,
    topics::{MessageKind, Topics},
};

/// Maximum size of a message from the broker, bytes; commands are far smaller. The client queues
/// some dozens of them when a broker sends faster than they are processed.
const MAX_RECEIVED_BYTES: usize = 1 << 15;
/// Size of a message in addition to its payload, bytes: header and topic.
const OVERHEAD_BYTES: usize = 1024;
/// Capacity of the client's queue: the messages in flight, the status, replies.
const MAX_QUEUED: usize = MAX_IN_FLIGHT + 32;

const PASSWORD: SecretKind = SecretKind { name: "password", min_chars: 1, max_bytes: 4096 };
const KEY: SecretKind = SecretKind { name: "key", min_chars: 1, max_bytes: MAX_CERTIFICATE_BYTES };
const MAX_CERTIFICATE_BYTES: u64 = 1 << 20;

/// Error in the settings of a broker.
#[derive(Debug, Error)]
#[error("mqtt.{key} {file}: {message}")]
pub struct CredentialsError {
    key: &'static str,
    file: String,
    message: String,
    /// Suggested remedy.
    pub help: String,
}

/// Address and credentials of a broker.
#[derive(Clone)]
pub struct Credentials {
    options: MqttOptions,
    broker: BrokerAddress,
}

/// Omits the password.
impl fmt::Debug for Credentials {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Account").field("broker", &self.broker).finish_non_exhaustive()
    }
}

impl Credentials {
    /// Reads the credentials that the configuration names; `None` if it names no broker.
    ///
    /// # Errors
    /// If a file can't be read or has invalid contents.
    pub fn open(keys: &MqttKeys, robot: &str) -> Result<Option<Self>, CredentialsError> {
        // An invalid address was rejected with the configuration.
        let Some(broker) = keys.broker.as_deref().and_then(|url| BrokerAddress::parse(url).ok())
        else {
            return Ok(None);
        };
        let address = (broker.host.clone(), broker.port);
        let mut options = MqttOptions::new(format!("sonard-{robot}"), address);
        let online = Topics::new(keys, robot).topic_for(MessageKind::Online);
        options
            .set_keep_alive(keys.keep_alive_s)
            // Messages in flight are tracked here and sent again after a disconnection.
            .set_clean_session(true)
            .set_inflight(MAX_QUEUED as u16)
            .set_request_channel_capacity(MAX_QUEUED)
            .set_max_request_batch(64)
            .set_max_packet_size(MAX_RECEIVED_BYTES, MAX_LINE_BYTES + OVERHEAD_BYTES)
            .set_last_will(LastWill::new(online, "false", QoS::AtLeastOnce, true));
        match (&keys.user, &keys.password_file) {
            (Some(user), Some(file)) => {
                let password = secret("password_file", file, PASSWORD)?;
                options.set_credentials(user, password);
            }
            (Some(user), None) => {
                options.set_username(user);
            }
            (None, _) => {}
        }
        if broker.tls {
            options.set_transport(tls(keys)?);
        }
        Ok(Some(Self { options, broker }))
    }

    /// Options of the MQTT client.
    pub(super) fn options(&self) -> MqttOptions {
        self.options.clone()
    }

    /// Client id for the broker.
    pub(super) fn client_id(&self) -> String {
        self.options.client_id()
    }

    /// URL of the broker.
    pub(super) fn broker(&self) -> String {
        let scheme = if self.broker.tls { "mqtts" } else { "mqtt" };
        format!("{scheme}://{}:{}", self.broker.host, self.broker.port)
    }
}

fn tls(keys: &MqttKeys) -> Result<Transport, CredentialsError> {
    let client = match (&keys.certificate_file, &keys.key_file) {
        (Some(certificate), Some(key)) => {
            let certificate = certificates("certificate_file", certificate)?;
            let text = secret("key_file", key, KEY)?.into_bytes();
            PrivateKeyDer::from_pem_slice(&text).map_err(|error| CredentialsError {
                key: "key_file",
                file: key.clone(),
                message: format!("no private key can be read from it: {error}"),
                help: "give the key in PEM format (-----BEGIN PRIVATE KEY----- ...)".into(),
            })?;
            Some((certificate, text))
        }
        _ => None,
    };
    if let Some(file) = &keys.ca_file {
        return Ok(Transport::tls(certificates("ca_file", file)?, client, None));
    }
    let trusted = Transport::try_tls_with_default_config().map_err(|error| CredentialsError {
        key: "broker",
        file: keys.broker.clone().unwrap_or_default(),
        message: format!("this computer's trusted certificates can't be read: {error}"),
        help: "install ca-certificates, or set mqtt.ca_file".into(),
    })?;
    if client.is_some() {
        return Err(CredentialsError {
            key: "certificate_file",
            file: keys.certificate_file.clone().unwrap_or_default(),
            message: "a client certificate requires the broker's certificate authority".into(),
            help: "set mqtt.ca_file, for instance to /etc/ssl/certs/ca-certificates.crt".into(),
        });
    }
    Ok(trusted)
}

fn secret(key: &'static str, file: &str, expected: SecretKind) -> Result<String, CredentialsError> {
    read_secret(Path::new(file), expected).map_err(|error| {
        let default =
            || format!("put the {} in it, readable only by the daemon's user", expected.name);
        let help = SecretError::help(&error, Path::new(file)).unwrap_or_else(default);
        CredentialsError { key, file: file.into(), message: error.to_string(), help }
    })
}

fn certificates(key: &'static str, file: &str) -> Result<Vec<u8>, CredentialsError> {
    let fail = |message: String| CredentialsError {
        key,
        file: file.into(),
        message,
        help: "give a file of certificates in PEM format (-----BEGIN CERTIFICATE----- ...)".into(),
    };
    let read = read_small_file(Path::new(file), MAX_CERTIFICATE_BYTES);
    let (text, _) = read.map_err(|error| fail(error.to_string()))?;
    let certificates: Result<Vec<_>, _> = CertificateDer::pem_slice_iter(text.as_bytes()).collect();
    match certificates {
        Ok(certificates) if certificates.is_empty() => Err(fail("no certificate is in it".into())),
        Ok(_) => Ok(text.into_bytes()),
        Err(error) => Err(fail(format!("a certificate in it is damaged: {error}"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn certificates_are_validated() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("ca.pem").display().to_string();
        let read = |text: &str| {
            std::fs::write(&file, text).expect("there is room");
            certificates("ca_file", &file).map_err(|error| error.to_string())
        };
        let pem = |body: &str| {
            format!("-----BEGIN CERTIFICATE-----\n{body}\n-----END CERTIFICATE-----\n")
        };
        assert!(read(&pem("MAA=")).is_ok());
        assert!(read("").is_err_and(|error| error.contains("no certificate")));
        assert!(read(&pem("=not base64=")).is_err_and(|error| error.contains("damaged")));
        assert!(read("-----BEGIN CERTIFICATE-----\nMAA=\n").is_err());
        for path in ["/dev/zero", "/", "/no/such/file"] {
            assert!(certificates("ca_file", path).is_err(), "{path}");
        }
    }
}
