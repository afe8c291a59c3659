//! What a host must not believe, each with its name: "What a host must refuse" in PROTOCOL.md.

use core::fmt;

use crate::frame::Header;
use crate::messages::limits::{self, kept_bytes};
use crate::messages::{Capabilities, Identity, Reading, ReadingStatus, Settings};

/// The reason why an Identity is refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum IdentityFault {
    /// It says this host's version, but is not of its form.
    Form,
    /// The boot nonce is 0, which stands for "not known".
    BootZero,
    /// The boot nonce is not that of its own frame.
    BootNotOfFrame {
        /// In the frame's header.
        frame: u16,
        /// In the Identity.
        identity: u16,
    },
    /// The clock does not tick as the protocol says.
    TickRate {
        /// Ticks a second that it claims.
        tick_hz: u32,
    },
    /// A motor without steps.
    NoSteps,
    /// There is no room for the largest reading that the board may be asked for.
    RingTooSmall {
        /// Room that it claims, bytes.
        ring_bytes: u16,
        /// Room that such a reading takes, bytes.
        needed: u16,
    },
}

/// The reason why a reading is refused. Its place in the plan is another matter:
/// [`super::HostError::WrongReading`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ReadingFault {
    /// It says Echo and has none.
    EchoMissing,
    /// It says that nothing was heard, or that the module was not fired, and has echoes.
    EchoUnexpected {
        /// How many.
        echoes: u8,
    },
    /// More echoes than were asked for.
    TooManyEchoes {
        /// How many.
        echoes: u8,
        /// How many were asked for, at most.
        asked: u8,
    },
    /// An echo after the listening window.
    EchoAfterWindow {
        /// Its time, ticks after firing.
        ticks: u32,
        /// The window, ticks.
        window: u32,
    },
    /// Echoes that do not follow one another.
    EchoesOutOfOrder,
    /// Fired before it can have been: before the request, or sooner after another beam than window,
    /// rest and interval allow.
    FiredTooEarly {
        /// By so many ticks.
        ticks: u32,
    },
    /// Fired at a time that has not come yet.
    FiredInFuture {
        /// Ticks ahead of the device's own clock, as it told it.
        ticks: u32,
    },
}

/// The reason why the answer to a command is refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ReplyFault {
    /// Home found the index farther from where it was expected than it can be.
    Drift {
        /// Told, steps.
        drift_steps: i32,
    },
    /// A position that the motor can't have.
    Position {
        /// Told, steps from home.
        step: i32,
    },
    /// More beams sent than fired, or more fired than asked for, or an end before the last beam.
    Progress {
        /// Beams fired, as told.
        fired: u16,
        /// Beams sent, as told.
        sent: u16,
        /// Beams asked for.
        beams: u16,
    },
}

/// Checks what a device says of itself.
pub(super) fn check_identity(header: Header, identity: &Identity) -> Result<(), IdentityFault> {
    let many = identity.capabilities.has(Capabilities::MULTIPLE_ECHOES);
    let needed = kept_bytes(if many { limits::MAX_ECHOES } else { 1 });
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

/// Checks status and echoes against each other and against what was asked for.
pub(super) fn check_echoes(reading: &Reading, settings: &Settings) -> Result<(), ReadingFault> {
    let count = u8::try_from(reading.echoes.len()).unwrap_or(u8::MAX);
    let (asked, window) = (settings.max_echoes, settings.window_ticks);
    match reading.status {
        ReadingStatus::Echo if count == 0 => return Err(ReadingFault::EchoMissing),
        ReadingStatus::NoEcho | ReadingStatus::ModuleFault if count > 0 => {
            return Err(ReadingFault::EchoUnexpected { echoes: count });
        }
        _ => {}
    }
    if count > asked {
        return Err(ReadingFault::TooManyEchoes { echoes: count, asked });
    }
    if !reading.echoes.is_sorted_by(|earlier, later| earlier < later) {
        return Err(ReadingFault::EchoesOutOfOrder);
    }
    match reading.echoes.last() {
        Some(&ticks) if ticks > window => Err(ReadingFault::EchoAfterWindow { ticks, window }),
        _ => Ok(()),
    }
}

/// Checks where Home says that the index was: nearer than any other turn's, and without a sensor
/// just where the motor stands.
pub(super) fn check_drift(drift_steps: i32, identity: &Identity) -> Result<(), ReplyFault> {
    let has_index = identity.capabilities.has(Capabilities::INDEX_SENSOR);
    let most = if has_index { u32::from(identity.steps_per_revolution).div_ceil(2) } else { 0 };
    if drift_steps.unsigned_abs() <= most { Ok(()) } else { Err(ReplyFault::Drift { drift_steps }) }
}

impl fmt::Display for IdentityFault {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Form => formatter.write_str("it has not the form of its version"),
            Self::BootZero => formatter.write_str("its boot nonce is 0"),
            Self::BootNotOfFrame { frame, identity } => {
                write!(formatter, "its boot nonce is {identity:04x} in a frame of {frame:04x}")
            }
            Self::TickRate { tick_hz } => {
                write!(formatter, "its clock has {tick_hz} ticks a second, not {}", limits::TICK_HZ)
            }
            Self::NoSteps => formatter.write_str("its motor has 0 steps a revolution"),
            Self::RingTooSmall { ring_bytes, needed } => write!(
                formatter,
                "it keeps {ring_bytes} bytes of readings, and one reading may take {needed}"
            ),
        }
    }
}

impl fmt::Display for ReadingFault {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::EchoMissing => formatter.write_str("it says that there was an echo, without one"),
            Self::EchoUnexpected { echoes } => {
                write!(formatter, "it says that there was no echo, with {echoes}")
            }
            Self::TooManyEchoes { echoes, asked } => {
                write!(formatter, "{echoes} echoes where {asked} were asked for")
            }
            Self::EchoAfterWindow { ticks, window } => {
                write!(formatter, "an echo after {ticks} ticks in a window of {window}")
            }
            Self::EchoesOutOfOrder => formatter.write_str("echoes out of order"),
            Self::FiredTooEarly { ticks } => {
                write!(formatter, "fired {ticks} ticks before it can have been")
            }
            Self::FiredInFuture { ticks } => {
                write!(formatter, "fired {ticks} ticks from now")
            }
        }
    }
}

impl fmt::Display for ReplyFault {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Drift { drift_steps } => {
                write!(formatter, "home {drift_steps} steps from where it was expected")
            }
            Self::Position { step } => {
                write!(formatter, "a position {step} steps from home")
            }
            Self::Progress { fired, sent, beams } => {
                write!(formatter, "{fired} beams fired and {sent} sent of {beams}")
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
    fn status_and_echoes_must_agree() {
        use ReadingStatus::{Echo, ModuleFault, NoEcho, StepDoubtful};
        let late = ReadingFault::EchoAfterWindow { ticks: 48_001, window: 48_000 };
        for (status, echoes, verdict) in [
            (Echo, &[9_000][..], Ok(())),
            (Echo, &[9_000, 48_000], Ok(())),
            (NoEcho, &[], Ok(())),
            (ModuleFault, &[], Ok(())),
            (StepDoubtful, &[], Ok(())),
            (StepDoubtful, &[9_000], Ok(())),
            (Echo, &[], Err(ReadingFault::EchoMissing)),
            (NoEcho, &[9_000], Err(ReadingFault::EchoUnexpected { echoes: 1 })),
            (ModuleFault, &[9_000], Err(ReadingFault::EchoUnexpected { echoes: 1 })),
            (Echo, &[1, 2, 3], Err(ReadingFault::TooManyEchoes { echoes: 3, asked: 2 })),
            (Echo, &[9_000, 9_000], Err(ReadingFault::EchoesOutOfOrder)),
            (StepDoubtful, &[9_000, 8_000], Err(ReadingFault::EchoesOutOfOrder)),
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
            assert_eq!(check_echoes(&reading, &SETTINGS), verdict, "{reading:?}");
        }
    }
}
