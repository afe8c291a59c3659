//! Events and errors reported by the host machine.

use core::fmt;

use super::{IdentityFault, ReadingFault, ReplyFault};
use crate::messages::{
    FaultKind, FirmwareVersion, Identity, NakReason, ProtocolId, Reading, Status, SweepState,
};

/// Event of the host machine. Every command ends with exactly one of
/// [`Identified`](Self::Identified), [`Done`](Self::Done), [`SweepDone`](Self::SweepDone) or
/// [`Failed`](Self::Failed). A sweep ended by Stop counts together with that Stop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HostEvent {
    /// Identify succeeded; this is the device.
    Identified(Identity),
    /// Another command succeeded.
    Done(Outcome),
    /// Result of one firing. Each beam of a sweep is reported exactly once, not always in order.
    Reading {
        /// Reading, checked against the plan.
        reading: Reading,
        /// `true` if the reading was lost on the line at first and sent again.
        repaired: bool,
    },
    /// Invalid reading of a sweep. The beam is not requested again, and its reading is not
    /// delivered.
    ReadingRejected {
        /// Reading as received.
        reading: Reading,
        /// Rule that the reading violates.
        fault: ReadingFault,
    },
    /// End of a sweep: every beam was delivered or rejected, or [`super::Command::Stop`] ended it.
    SweepDone {
        /// Number of the sweep.
        sweep: u16,
        /// Number of readings delivered.
        delivered: u16,
        /// Final state: [`SweepState::Complete`] or [`SweepState::Stopped`].
        end: SweepState,
    },
    /// Pair of host and device times, for clock fitting.
    ClockSample {
        /// Time when the request was handed out, us.
        sent_us: u64,
        /// Time when the reply had arrived, us.
        received_us: u64,
        /// Device clock when the request had arrived, ticks (wrapping).
        device_ticks: u32,
        /// `true` if the request was sent more than once, so that the pair may be wrong.
        retried: bool,
    },
    /// The device stopped by itself. A command in progress fails with a separate event.
    Fault(FaultKind),
    /// The device restarted and lost position and settings. Identify, Configure and Home are
    /// required.
    Rebooted {
        /// Last known boot nonce.
        old: u16,
        /// Boot nonce of the restarted device.
        new: u16,
    },
    /// A command failed and has ended.
    Failed(HostError),
}

/// Result of a successful command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// The settings were accepted.
    Configured,
    /// The home position was found.
    Homed {
        /// Actual minus expected position of the index, steps.
        drift_steps: i32,
    },
    /// The target of MoveTo was reached.
    Moved {
        /// Position reached, steps from home.
        step: i32,
    },
    /// The Ping's reading was delivered.
    Pinged,
    /// State of the device.
    Status(Status),
    /// Motion and firing have stopped.
    Stopped,
    /// The device is restarting or has restarted.
    Reset,
}

/// Reason for the failure of a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HostError {
    /// No reply was received.
    NoAnswer {
        /// Number of transmissions since the device last replied Started, or in total.
        attempts: u8,
    },
    /// Bytes were received but no valid frame: another bit rate, or another device.
    NotADevice {
        /// Bytes received since the start of the command.
        bytes: u64,
    },
    /// The protocol version or schema of the device differs.
    WrongVersion {
        /// Protocol of this host.
        ours: ProtocolId,
        /// Protocol of the device.
        theirs: ProtocolId,
        /// Firmware version of the device.
        firmware: FirmwareVersion,
    },
    /// The identity of the device is invalid.
    InvalidIdentity(IdentityFault),
    /// The device rejected the request.
    Rejected(NakReason),
    /// The device restarted during the command.
    Rebooted,
    /// The line was closed.
    Hangup,
    /// The sweep ended because the device received nothing for longer than its lease.
    LeaseExpired,
    /// The emergency stop ended the command.
    EmergencyStop,
    /// The motor did not reach a position.
    MotionFault,
    /// The device reports a stop that this host did not request.
    Stopped,
    /// The device replies but no further reading arrives: it does not continue, or the line loses
    /// every repetition of a beam.
    Stalled {
        /// Number of beams fired so far.
        fired: u16,
    },
    /// The device repeatedly replies Started, for longer than the work can take.
    Overrun {
        /// Time since the request, ms.
        waited_ms: u32,
    },
    /// The device no longer stores the sweep.
    SweepLost,
    /// The reading of a Ping is invalid; it was not delivered.
    InvalidReading(ReadingFault),
    /// A reply is invalid.
    InvalidReply(ReplyFault),
    /// A reading does not match the plan; it was not delivered.
    WrongReading {
        /// Index of the reading.
        index: u16,
        /// Position of the reading, steps.
        step: i32,
        /// The position planned for that index, steps.
        planned: Option<i32>,
    },
}

impl fmt::Display for HostError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoAnswer { attempts } => {
                write!(formatter, "no reply from the device after {attempts} attempts")
            }
            Self::NotADevice { bytes } => write!(
                formatter,
                "received {bytes} bytes but no valid frame: wrong baud rate, or not a sonard device"
            ),
            Self::WrongVersion { ours, theirs, firmware } => write!(
                formatter,
                "wrong version: the device (firmware {}.{}.{}) has protocol {} ({:08x}), this sonard has {} ({:08x})",
                firmware.major,
                firmware.minor,
                firmware.patch,
                theirs.version,
                theirs.schema,
                ours.version,
                ours.schema,
            ),
            Self::InvalidIdentity(fault) => {
                write!(formatter, "the identity of the device is invalid: {fault}")
            }
            Self::Rejected(reason) => {
                write!(formatter, "the device rejected the request: {reason}")
            }
            Self::Rebooted => formatter.write_str("the device restarted"),
            Self::Hangup => formatter.write_str("the line was closed"),
            Self::LeaseExpired => write!(formatter, "{}", FaultKind::LeaseExpired),
            Self::EmergencyStop => write!(formatter, "{}", FaultKind::EmergencyStop),
            Self::MotionFault => write!(formatter, "{}", FaultKind::MotionFault),
            Self::Stopped => formatter.write_str("the operation was stopped"),
            Self::Stalled { fired } => {
                write!(
                    formatter,
                    "the device replies but no further reading arrives; {fired} beams were fired"
                )
            }
            Self::Overrun { waited_ms } => {
                write!(
                    formatter,
                    "the device still reports the request as in progress after {waited_ms} ms"
                )
            }
            Self::InvalidReading(fault) => {
                write!(formatter, "invalid reading: {fault}")
            }
            Self::InvalidReply(fault) => {
                write!(formatter, "invalid reply: {fault}")
            }
            Self::SweepLost => formatter.write_str("the device no longer stores the sweep"),
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
