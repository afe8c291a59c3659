//! Validation of device replies: one error variant for each rule in PROTOCOL.md, "What a host must
//! refuse".

use core::fmt;

use crate::frame::Header;
use crate::messages::limits::{self, kept_bytes};
use crate::messages::{Capabilities, Identity, Reading, ReadingStatus, Settings};

/// Reason for rejecting an Identity.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum IdentityFault {
    /// Version and schema match those of this host, but the fields are invalid.
    Form,
    /// The boot nonce is 0, which means "not known".
    BootZero,
    /// The boot nonce differs from that of the frame's header.
    BootNotOfFrame {
        /// Boot nonce in the header of the frame.
        frame: u16,
        /// Boot nonce in the Identity.
        identity: u16,
    },
    /// The clock rate differs from that of the protocol.
    TickRate {
        /// Reported clock rate, ticks per second.
        tick_hz: u32,
    },
    /// The motor has 0 steps per revolution.
    NoSteps,
    /// The ring is smaller than the largest reading of the board.
    RingTooSmall {
        /// Reported capacity for readings, bytes.
        ring_bytes: u16,
        /// Storage for the largest reading, bytes.
        needed: u16,
    },
}

/// Reason for rejecting the content of a reading. A reading that does not match the plan is a
/// [`super::HostError::WrongReading`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ReadingFault {
    /// Status Echo without an echo.
    EchoMissing,
    /// Status NoEcho or ModuleFault with echoes.
    EchoUnexpected {
        /// Number of echoes reported.
        echoes: u8,
    },
    /// More echoes than requested.
    TooManyEchoes {
        /// Number of echoes reported.
        echoes: u8,
        /// Requested maximum number of echoes.
        requested: u8,
    },
    /// Echo after the listening window.
    EchoAfterWindow {
        /// Time of the echo, ticks after firing.
        ticks: u32,
        /// Length of the window, ticks.
        window: u32,
    },
    /// Echo times that do not increase.
    EchoesOutOfOrder,
    /// Fired too early: before the request, or sooner after another beam than window, settling time
    /// and interval allow.
    FiredTooEarly {
        /// Time by which the firing is too early, ticks.
        ticks: u32,
    },
    /// Fired in the future.
    FiredInFuture {
        /// Time ahead of the last reported device clock, ticks.
        ticks: u32,
    },
}

/// Reason for rejecting the reply to a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ReplyFault {
    /// Homed with a larger drift than possible.
    Drift {
        /// Drift reported by Home, steps.
        drift_steps: i32,
    },
    /// Position outside the range of the motor.
    Position {
        /// Reported position, steps from home.
        step: i32,
    },
    /// More beams sent than fired, more fired than requested, or an end before the last beam.
    Progress {
        /// Reported number of beams fired.
        fired: u16,
        /// Reported number of beams sent.
        sent: u16,
        /// Number of beams requested.
        beams: u16,
    },
}

/// Checks the identity of a device.
pub(super) fn check_identity(header: Header, identity: &Identity) -> Result<(), IdentityFault> {
    let multiple_echoes = identity.capabilities.has(Capabilities::MULTIPLE_ECHOES);
    let needed = kept_bytes(if multiple_echoes { limits::MAX_ECHOES } else { 1 });
    let Identity { boot, tick_hz, steps_per_revolution, ring_bytes, .. } = *identity;
    if boot == Header::BOOT_UNKNOWN {
        Err(IdentityFault::BootZero)
    } else if boot != header.boot {
        Err(IdentityFault::BootNotOfFrame { frame: header.boot, identity: boot })
    } else if tick_hz != limits::TICK_HZ {
        Err(IdentityFault::TickRate { tick_hz })
    } else if steps_per_revolution == 0 {
        Err(IdentityFault::NoSteps)
    } else if ring_bytes < needed {
        Err(IdentityFault::RingTooSmall { ring_bytes, needed })
    } else {
        Ok(())
    }
}

/// Checks status and echoes against each other and against the settings.
pub(super) fn check_echoes(reading: &Reading, settings: &Settings) -> Result<(), ReadingFault> {
    let count = u8::try_from(reading.echoes.len()).unwrap_or(u8::MAX);
    let (requested, window) = (settings.max_echoes, settings.window_ticks);
    match reading.status {
        ReadingStatus::Echo if count == 0 => return Err(ReadingFault::EchoMissing),
        ReadingStatus::NoEcho | ReadingStatus::ModuleFault if count > 0 => {
            return Err(ReadingFault::EchoUnexpected { echoes: count });
        }
        _ => {}
    }
    if count > requested {
        return Err(ReadingFault::TooManyEchoes { echoes: count, requested });
    }
    if !reading.echoes.is_sorted_by(|earlier, later| earlier < later) {
        return Err(ReadingFault::EchoesOutOfOrder);
    }
    match reading.echoes.last() {
        Some(&ticks) if ticks > window => Err(ReadingFault::EchoAfterWindow { ticks, window }),
        _ => Ok(()),
    }
}

/// Checks the drift reported by Home: at most half a revolution, and 0 without an index sensor.
pub(super) fn check_drift(drift_steps: i32, identity: &Identity) -> Result<(), ReplyFault> {
    let has_index = identity.capabilities.has(Capabilities::INDEX_SENSOR);
    let max_drift =
        if has_index { u32::from(identity.steps_per_revolution).div_ceil(2) } else { 0 };
    if drift_steps.unsigned_abs() <= max_drift {
        Ok(())
    } else {
        Err(ReplyFault::Drift { drift_steps })
    }
}

impl fmt::Display for IdentityFault {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Form => formatter.write_str("its fields are invalid for its version"),
            Self::BootZero => formatter.write_str("its boot nonce is 0"),
            Self::BootNotOfFrame { frame, identity } => {
                write!(formatter, "its boot nonce is {identity:04x} in a frame of {frame:04x}")
            }
            Self::TickRate { tick_hz } => {
                write!(
                    formatter,
                    "its clock has {tick_hz} ticks per second, not {}",
                    limits::TICK_HZ
                )
            }
            Self::NoSteps => formatter.write_str("its motor has 0 steps per revolution"),
            Self::RingTooSmall { ring_bytes, needed } => write!(
                formatter,
                "its reading buffer has {ring_bytes} bytes, and one reading may take {needed}"
            ),
        }
    }
}

impl fmt::Display for ReadingFault {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::EchoMissing => formatter.write_str("status is echo, but there are no echoes"),
            Self::EchoUnexpected { echoes } => {
                write!(formatter, "status is no echo, but the echo count is {echoes}")
            }
            Self::TooManyEchoes { echoes, requested } => {
                write!(formatter, "{echoes} echoes, but at most {requested} were requested")
            }
            Self::EchoAfterWindow { ticks, window } => {
                write!(formatter, "echo after {ticks} ticks, beyond the window of {window}")
            }
            Self::EchoesOutOfOrder => formatter.write_str("echo times do not increase"),
            Self::FiredTooEarly { ticks } => {
                write!(formatter, "fired {ticks} ticks too early")
            }
            Self::FiredInFuture { ticks } => {
                write!(formatter, "fired {ticks} ticks in the future")
            }
        }
    }
}

impl fmt::Display for ReplyFault {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Drift { drift_steps } => {
                write!(formatter, "home is {drift_steps} steps from its expected position")
            }
            Self::Position { step } => {
                write!(formatter, "position {step} steps from home, which is out of range")
            }
            Self::Progress { fired, sent, beams } => {
                write!(
                    formatter,
                    "inconsistent progress: {fired} beams fired, {sent} sent, {beams} requested"
                )
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{ReadingFault, check_echoes};
    use crate::messages::{Blanking, Echoes, Reading, ReadingStatus, Settings};

    const SETTINGS: Settings = Settings {
        window_ticks: 48_000,
        min_interval_ticks: 0,
        settle_ticks: 0,
        max_echoes: 2,
        blanking: Blanking::Internal,
        speed: 100,
        acceleration: 1_000,
        hold_s: 0,
    };

    #[test]
    fn status_agrees_with_echoes() {
        use ReadingStatus::{Echo, ModuleFault, NoEcho, StepUncertain};
        let late = ReadingFault::EchoAfterWindow { ticks: 48_001, window: 48_000 };
        for (status, echoes, expected) in [
            (Echo, &[9_000][..], Ok(())),
            (Echo, &[9_000, 48_000], Ok(())),
            (NoEcho, &[], Ok(())),
            (ModuleFault, &[], Ok(())),
            (StepUncertain, &[], Ok(())),
            (StepUncertain, &[9_000], Ok(())),
            (Echo, &[], Err(ReadingFault::EchoMissing)),
            (NoEcho, &[9_000], Err(ReadingFault::EchoUnexpected { echoes: 1 })),
            (ModuleFault, &[9_000], Err(ReadingFault::EchoUnexpected { echoes: 1 })),
            (Echo, &[1, 2, 3], Err(ReadingFault::TooManyEchoes { echoes: 3, requested: 2 })),
            (Echo, &[9_000, 9_000], Err(ReadingFault::EchoesOutOfOrder)),
            (StepUncertain, &[9_000, 8_000], Err(ReadingFault::EchoesOutOfOrder)),
            (Echo, &[48_001], Err(late)),
        ] {
            let reading = Reading {
                sweep: 1,
                index: 0,
                step: 0,
                fired_ticks: 0,
                status,
                echoes: Echoes::from_ticks(echoes),
            };
            assert_eq!(check_echoes(&reading, &SETTINGS), expected, "{reading:?}");
        }
    }
}
