//! What the host machine reports.

use core::fmt;

use super::{IdentityFault, ReadingFault, ReplyFault};
use crate::messages::{
    FaultKind, FirmwareVersion, Identity, NakReason, ProtocolId, Reading, Status, SweepState,
};

/// An event of the host machine. Every command ends with exactly one of
/// [`Identified`](Self::Identified), [`Done`](Self::Done), [`SweepDone`](Self::SweepDone) or
/// [`Failed`](Self::Failed); a sweep that Stop ends counts together with that Stop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HostEvent {
    /// Identify succeeded.
    Identified(Identity),
    /// A command succeeded.
    Done(Outcome),
    /// One firing. Each beam of a sweep comes exactly once, not always in order.
    Reading {
        /// The reading, checked against the plan.
        reading: Reading,
        /// Whether it was lost on the line at first and sent again.
        repaired: bool,
    },
    /// A beam of a sweep whose reading makes no sense. It is not asked for again, and not
    /// delivered.
    ReadingRefused {
        /// What was told.
        reading: Reading,
        /// What is wrong with it.
        fault: ReadingFault,
    },
    /// A sweep ended: every beam was delivered or refused, or it was stopped by [`super::Command::Stop`].
    SweepDone {
        /// Its number.
        sweep: u16,
        /// Readings delivered.
        delivered: u16,
        /// [`SweepState::Complete`] or [`SweepState::Stopped`].
        end: SweepState,
    },
    /// A pair of clocks, for a fit.
    ClockSample {
        /// When the request was handed out, us.
        sent_us: u64,
        /// When the reply had come in, us.
        received_us: u64,
        /// Device clock when the request had come in, ticks (wrapping).
        device_ticks: u32,
        /// Whether the request was sent more than once, so that the pair may be wrong.
        retried: bool,
    },
    /// The device stopped by itself. A command under way fails apart from this.
    Fault(FaultKind),
    /// The device restarted: position and settings are gone. Identify, configure, home.
    Rebooted {
        /// The boot nonce known so far.
        old: u16,
        /// The new one.
        new: u16,
    },
    /// A command failed for good.
    Failed(HostError),
}

/// The result of a successful command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// Configure was accepted.
    Configured,
    /// Home was found.
    Homed {
        /// Where the index was found against where it was expected, steps.
        drift_steps: i32,
    },
    /// MoveTo arrived.
    Moved {
        /// Steps from home.
        step: i32,
    },
    /// The Ping's reading was delivered.
    Pinged,
    /// What the device is doing.
    Status(Status),
    /// Everything stands.
    Stopped,
    /// The device restarts, or has restarted.
    Reset,
}

/// The reason why a command failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HostError {
    /// Nothing came back.
    NoAnswer {
        /// How often the request was sent.
        attempts: u8,
    },
    /// Bytes came back, but never a frame: another speed, or another device.
    NotADevice {
        /// Bytes received meanwhile.
        bytes: u64,
    },
    /// The device speaks another version of the protocol.
    WrongVersion {
        /// What this host speaks.
        ours: ProtocolId,
        /// What the device speaks.
        theirs: ProtocolId,
        /// The device's firmware.
        firmware: FirmwareVersion,
    },
    /// What the device says of itself makes no sense.
    WrongIdentity(IdentityFault),
    /// The device refused.
    Refused(NakReason),
    /// The device restarted meanwhile.
    Rebooted,
    /// The line was closed.
    Hangup,
    /// The device heard nothing for longer than the sweep's lease, and ended it.
    LeaseExpired,
    /// The emergency stop ended it.
    EmergencyStop,
    /// The motor did not reach a position.
    MotionFault,
    /// Somebody else stopped it.
    Stopped,
    /// The device answers, but does not get on with its work.
    Stalled {
        /// Beams fired so far.
        fired: u16,
    },
    /// The device says again and again that it is at it, for longer than its work can take.
    Overrun {
        /// How long it was waited for, ms.
        waited_ms: u32,
    },
    /// The device does not know the sweep (any more).
    SweepLost,
    /// The reading of a Ping makes no sense; it was not delivered.
    SenselessReading(ReadingFault),
    /// An answer makes no sense.
    SenselessReply(ReplyFault),
    /// A reading does not fit the plan; it was not delivered.
    WrongReading {
        /// Its index.
        index: u16,
        /// Its position, steps.
        step: i32,
        /// The position planned for that index, steps.
        planned: Option<i32>,
    },
}

impl fmt::Display for HostError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoAnswer { attempts } => {
                write!(formatter, "the device did not answer {attempts} attempts")
            }
            Self::NotADevice { bytes } => write!(
                formatter,
                "{bytes} bytes came back but no frame: wrong baud rate, or not a sonard device"
            ),
            Self::WrongVersion { ours, theirs, firmware } => write!(
                formatter,
                "wrong version: the device (firmware {}.{}.{}) speaks protocol {} ({:08x}), this sonard speaks {} ({:08x})",
                firmware.major,
                firmware.minor,
                firmware.patch,
                theirs.version,
                theirs.schema,
                ours.version,
                ours.schema,
            ),
            Self::WrongIdentity(fault) => {
                write!(formatter, "what the device says of itself makes no sense: {fault}")
            }
            Self::Refused(reason) => write!(formatter, "the device refused: {reason}"),
            Self::Rebooted => formatter.write_str("the device restarted"),
            Self::Hangup => formatter.write_str("the line was closed"),
            Self::LeaseExpired => write!(formatter, "{}", FaultKind::LeaseExpired),
            Self::EmergencyStop => write!(formatter, "{}", FaultKind::EmergencyStop),
            Self::MotionFault => write!(formatter, "{}", FaultKind::MotionFault),
            Self::Stopped => formatter.write_str("it was stopped"),
            Self::Stalled { fired } => {
                write!(formatter, "the device answers but makes no progress after {fired} beams")
            }
            Self::Overrun { waited_ms } => {
                write!(formatter, "the device says after {waited_ms} ms that it is still at it")
            }
            Self::SenselessReading(fault) => {
                write!(formatter, "the device told of a reading that makes no sense: {fault}")
            }
            Self::SenselessReply(fault) => {
                write!(formatter, "the device told what makes no sense: {fault}")
            }
            Self::SweepLost => formatter.write_str("the device does not know the sweep any more"),
            Self::WrongReading { index, step, planned } => match planned {
                Some(planned) => write!(
                    formatter,
                    "reading {index} was taken at step {step} instead of {planned}"
                ),
                None => write!(formatter, "reading {index} is not in the plan"),
            },
        }
    }
}

impl core::error::Error for HostError {}
