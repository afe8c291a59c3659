//! How the broker is reached, and as whom.

use std::{fmt, path::Path};

use rumqttc::{
    LastWill, MqttOptions, QoS, Transport,
    tokio_rustls::rustls::pki_types::{CertificateDer, PrivateKeyDer, pem::PemObject as _},
};
use sonard_api::config::{Broker, MqttKeys};
use sonard_daemon::secret::{Secret, SecretError, read_secret, read_small_file};
use sonard_records::MAX_LINE_BYTES;
use thiserror::Error;

use super::{
    topics::{Kind, Topics},
    window::MOST_UNDER_WAY,
};

/// The largest message from the broker that is read, bytes; commands are far smaller. Some dozens of them wait within the
/// client when a broker sends faster than they are read.
const MOST_RECEIVED_BYTES: usize = 1 << 15;
/// What a message has beside its payload, bytes: its head, its topic.
const BESIDE_BYTES: usize = 1024;
/// Messages that the client takes over at a time: those of the window, the status, answers.
const MOST_TAKEN: usize = MOST_UNDER_WAY + 32;

const PASSWORD: Secret = Secret { what: "password", least: 1, most_bytes: 4096 };
const KEY: Secret = Secret { what: "key", least: 1, most_bytes: MOST_CERTIFICATE_BYTES };
const MOST_CERTIFICATE_BYTES: u64 = 1 << 20;

/// An error in the settings of a broker.
#[derive(Debug, Error)]
#[error("mqtt.{key} {file}: {message}")]
pub struct AccountError {
    key: &'static str,
    file: String,
    message: String,
    /// What a person can do about it.
    pub help: String,
}

/// Address and credentials of a broker.
#[derive(Clone)]
pub struct Account {
    options: MqttOptions,
    broker: Broker,
}

/// Without the password.
impl fmt::Debug for Account {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Account").field("broker", &self.broker).finish_non_exhaustive()
    }
}

impl Account {
    /// The account that the keys name, with what their files hold; `None` if they name no broker.
    ///
    /// # Errors
    /// When a file can't be used.
    pub fn open(keys: &MqttKeys, robot: &str) -> Result<Option<Self>, AccountError> {
        // What is no broker was refused with the configuration.
        let Some(broker) = keys.broker.as_deref().and_then(|url| Broker::parse(url).ok()) else {
            return Ok(None);
        };
        let place = (broker.host.clone(), broker.port);
        let mut options = MqttOptions::new(format!("sonard-{robot}"), place);
        let online = Topics::new(keys, robot).of(Kind::Online);
        options
            .set_keep_alive(keys.keep_alive_s)
            // What was under way is known here, and given out again.
            .set_clean_session(true)
            .set_inflight(MOST_TAKEN as u16)
            .set_request_channel_capacity(MOST_TAKEN)
            .set_max_request_batch(64)
            .set_max_packet_size(MOST_RECEIVED_BYTES, MAX_LINE_BYTES + BESIDE_BYTES)
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

    /// What a client is made of.
    pub(super) fn options(&self) -> MqttOptions {
        self.options.clone()
    }

    /// The name that the broker knows this client by.
    pub(super) fn client_id(&self) -> String {
        self.options.client_id()
    }

    /// The broker's place, as a person says it.
    pub(super) fn broker(&self) -> String {
        let scheme = if self.broker.tls { "mqtts" } else { "mqtt" };
        format!("{scheme}://{}:{}", self.broker.host, self.broker.port)
    }
}

fn tls(keys: &MqttKeys) -> Result<Transport, AccountError> {
    let client = match (&keys.certificate_file, &keys.key_file) {
        (Some(certificate), Some(key)) => {
            let certificate = certificates("certificate_file", certificate)?;
            let text = secret("key_file", key, KEY)?.into_bytes();
            PrivateKeyDer::from_pem_slice(&text).map_err(|error| AccountError {
                key: "key_file",
                file: key.clone(),
                message: format!("no private key can be read from it: {error}"),
                help: "give the key in PEM: -----BEGIN PRIVATE KEY----- and what follows".into(),
            })?;
            Some((certificate, text))
        }
        _ => None,
    };
    if let Some(file) = &keys.ca_file {
        return Ok(Transport::tls(certificates("ca_file", file)?, client, None));
    }
    let trusted = Transport::try_tls_with_default_config().map_err(|error| AccountError {
        key: "broker",
        file: keys.broker.clone().unwrap_or_default(),
        message: format!("this computer's trusted certificates can't be read: {error}"),
        help: "install ca-certificates, or set mqtt.ca_file".into(),
    })?;
    if client.is_some() {
        return Err(AccountError {
            key: "certificate_file",
            file: keys.certificate_file.clone().unwrap_or_default(),
            message: "a certificate of this daemon needs the broker's authority beside it".into(),
            help: "set mqtt.ca_file, for instance to /etc/ssl/certs/ca-certificates.crt".into(),
        });
    }
    Ok(trusted)
}

fn secret(key: &'static str, file: &str, wanted: Secret) -> Result<String, AccountError> {
    read_secret(Path::new(file), wanted).map_err(|error| {
        let other =
            || format!("put the {} in it, readable by the daemon's user alone", wanted.what);
        let help = SecretError::help(&error, Path::new(file)).unwrap_or_else(other);
        AccountError { key, file: file.into(), message: error.to_string(), help }
    })
}

fn certificates(key: &'static str, file: &str) -> Result<Vec<u8>, AccountError> {
    let fail = |message: String| AccountError {
        key,
        file: file.into(),
        message,
        help: "give a file of certificates in PEM: -----BEGIN CERTIFICATE----- and what follows"
            .into(),
    };
    let read = read_small_file(Path::new(file), MOST_CERTIFICATE_BYTES);
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
    fn certificates_are_read_before_they_are_needed() {
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
