//! Messages for TLS errors, with a hint for an unset clock.

use std::io;

use jiff::Timestamp;
use rumqttc::{
    TlsError,
    tokio_rustls::rustls::{CertificateError, Error},
};

/// Release time of this program, seconds since 1970 (2026-01-01): an earlier clock is unset.
const RELEASED_S: i64 = 1_767_225_600;

/// Describes a TLS error at a time of the computer's clock. Repeated attempts give the same text.
pub(super) fn describe(error: &TlsError, now: Timestamp) -> String {
    let today = now.strftime("%Y-%m-%d");
    match certificate_error(error) {
        Some(CertificateError::NotValidYet | CertificateError::NotValidYetContext { .. }) => {
            not_valid_yet(now)
        }
        Some(CertificateError::Expired | CertificateError::ExpiredContext { .. }) => format!(
            "its certificate has expired by this computer's clock ({today}): renew it, or set the clock"
        ),
        _ => format!("TLS: {error}"),
    }
}

fn not_valid_yet(now: Timestamp) -> String {
    let today = now.strftime("%Y-%m-%d");
    if now.as_second() < RELEASED_S {
        return format!(
            "its certificate is not valid yet because this computer's clock is not set ({today}): \
             retrying until the clock is set"
        );
    }
    format!(
        "its certificate is not valid yet by this computer's clock ({today}): compare the clocks"
    )
}

/// Extracts the error of the broker's certificate, if any.
fn certificate_error(error: &TlsError) -> Option<&CertificateError> {
    let error = match error {
        TlsError::TLS(error) => error,
        TlsError::Io(error) => inner_error(error)?,
        _ => return None,
    };
    match error {
        Error::InvalidCertificate(error) => Some(error),
        _ => None,
    }
}

fn inner_error(error: &io::Error) -> Option<&Error> {
    let inner = error.get_ref()?;
    inner.downcast_ref().or_else(|| inner.source()?.downcast_ref())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(second: i64) -> Timestamp {
        Timestamp::from_second(second).expect("a time")
    }

    #[test]
    fn unset_clock_is_named() {
        let not_yet = || Error::InvalidCertificate(CertificateError::NotValidYet);
        let wrapped = TlsError::Io(io::Error::new(io::ErrorKind::InvalidData, not_yet()));
        for error in [TlsError::TLS(not_yet()), wrapped] {
            let unset = describe(&error, at(3600));
            assert!(unset.contains("clock is not set (1970-01-01)"), "{unset}");
            let set = describe(&error, at(RELEASED_S + 3600));
            assert!(set.contains("compare the clocks") && !set.contains("not set"), "{set}");
        }
        let expired = TlsError::TLS(Error::InvalidCertificate(CertificateError::Expired));
        assert!(describe(&expired, at(RELEASED_S)).contains("expired"));
        let other = TlsError::TLS(Error::InvalidCertificate(CertificateError::UnknownIssuer));
        assert!(describe(&other, at(0)).starts_with("TLS: "));
    }
}
