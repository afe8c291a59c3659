//! Messages for TLS errors, with a hint for a clock that is not set.

use std::io;

use jiff::Timestamp;
use rumqttc::{
    TlsError,
    tokio_rustls::rustls::{CertificateError, Error},
};
use sonard_runtime::wall_clock::{ClockEvidence, ClockState};

/// Describes a TLS error at a time of the computer's clock. Repeated attempts give the same text.
pub(super) fn describe(
    error: &TlsError,
    now: Timestamp,
    evidence: impl FnOnce() -> ClockEvidence,
) -> String {
    match certificate_error(error) {
        Some(CertificateError::NotValidYet | CertificateError::NotValidYetContext { .. }) => {
            not_valid_yet(now, evidence().state(now.into()))
        }
        Some(CertificateError::Expired | CertificateError::ExpiredContext { .. }) => {
            expired(now, evidence().state(now.into()))
        }
        _ => format!("TLS: {error}"),
    }
}

fn not_valid_yet(now: Timestamp, clock: ClockState) -> String {
    let today = now.strftime("%Y-%m-%d");
    match clock {
        ClockState::Behind => format!(
            "its certificate is not valid yet because this computer's clock is not set ({today}): \
             retrying until the clock is set"
        ),
        ClockState::Unsynchronized => format!(
            "its certificate is not valid yet by this computer's clock ({today}), which no time source \
             has set: retrying; `timedatectl` shows why the clock is not synchronised"
        ),
        ClockState::Synchronized => format!(
            "its certificate is not valid yet by this computer's clock ({today}), which a time source \
             has set: check the certificate"
        ),
        ClockState::Unknown => format!(
            "its certificate is not valid yet by this computer's clock ({today}): compare the clocks"
        ),
    }
}

fn expired(now: Timestamp, clock: ClockState) -> String {
    let today = now.strftime("%Y-%m-%d");
    match clock {
        // A clock that is behind makes certificates valid for longer.
        ClockState::Synchronized | ClockState::Behind => {
            format!("its certificate has expired by this computer's clock ({today}): renew it")
        }
        ClockState::Unsynchronized | ClockState::Unknown => format!(
            "its certificate has expired by this computer's clock ({today}): renew it, or set the clock"
        ),
    }
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
        let passed = Some(at(1_700_000_000).into());
        for error in [TlsError::TLS(not_yet()), wrapped] {
            for (is_synchronized, second, text) in [
                (Some(false), 3600, "clock is not set (1970-01-01)"),
                (None, 1_699_999_999, "clock is not set (2023-11-14)"),
                // A board that starts at the build date of its system.
                (Some(false), 1_700_000_001, "which no time source has set: retrying"),
                (Some(true), 1_700_000_001, "check the certificate"),
                (None, 1_700_000_001, "compare the clocks"),
            ] {
                let evidence = ClockEvidence { is_synchronized, passed };
                let described = describe(&error, at(second), || evidence);
                assert!(described.contains(text), "{described}");
            }
        }
    }

    #[test]
    fn other_certificate_errors() {
        let described = |error, is_synchronized| {
            let evidence = ClockEvidence { is_synchronized, passed: None };
            let error = TlsError::TLS(Error::InvalidCertificate(error));
            describe(&error, at(1_700_000_000), || evidence)
        };
        let expired = |is_synchronized| described(CertificateError::Expired, is_synchronized);
        assert!(expired(Some(false)).ends_with("renew it, or set the clock"));
        assert!(expired(Some(true)).ends_with("(2023-11-14): renew it"));
        assert!(described(CertificateError::UnknownIssuer, None).starts_with("TLS: "));
    }
}
