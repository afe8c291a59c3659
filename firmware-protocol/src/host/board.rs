//! Comparison of identities: decides whether a device is still the same board.

use core::fmt;

use crate::messages::{Capabilities, FirmwareVersion, Identity, ProtocolId};

/// Difference between a board and the preceding one. A restart alone is no difference.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BoardChange {
    /// The serial numbers differ.
    Serial {
        /// Serial number in the previous identity.
        old: [u8; 10],
        /// Serial number in the new identity.
        new: [u8; 10],
    },
    /// Other features, or a change between hardware and simulation.
    Capabilities {
        /// Features in the previous identity.
        old: Capabilities,
        /// Features in the new identity.
        new: Capabilities,
    },
    /// Another motor: the same step is another azimuth.
    StepsPerRevolution {
        /// Steps per revolution in the previous identity.
        old: u16,
        /// Steps per revolution in the new identity.
        new: u16,
    },
    /// The clock rates of the devices differ.
    TickRate {
        /// Ticks per second in the previous identity.
        old: u32,
        /// Ticks per second in the new identity.
        new: u32,
    },
    /// The versions of the firmware differ.
    Firmware {
        /// Firmware version in the previous identity.
        old: FirmwareVersion,
        /// Firmware version in the new identity.
        new: FirmwareVersion,
    },
    /// The protocol versions or schemas differ.
    Protocol {
        /// Protocol in the previous identity.
        old: ProtocolId,
        /// Protocol in the new identity.
        new: ProtocolId,
    },
    /// The capacities for unacknowledged readings differ.
    RingBytes {
        /// Capacity in bytes in the previous identity.
        old: u16,
        /// Capacity in bytes in the new identity.
        new: u16,
    },
}

impl BoardChange {
    /// Returns the first relevant difference between two identities; `None` for the same board,
    /// whether or not it restarted in between.
    #[must_use]
    pub fn between(old: &Identity, new: &Identity) -> Option<Self> {
        macro_rules! first_difference {
            ($($field:ident $change:ident),+) => {
                $(if old.$field != new.$field {
                    return Some(Self::$change { old: old.$field, new: new.$field });
                })+
            };
        }
        first_difference!(
            serial Serial,
            capabilities Capabilities,
            steps_per_revolution StepsPerRevolution,
            tick_hz TickRate,
            firmware Firmware,
            protocol Protocol,
            ring_bytes RingBytes
        );
        None
    }
}

impl fmt::Display for BoardChange {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Serial { old, new } => {
                write!(formatter, "its serial number is {}, not {}", Serial(new), Serial(old))
            }
            Self::Capabilities { old, new } => {
                formatter.write_str("its capabilities differ:")?;
                for (bit, name) in Capabilities::NAMES {
                    match (old.has(bit), new.has(bit)) {
                        (false, true) => write!(formatter, " +{name}")?,
                        (true, false) => write!(formatter, " -{name}")?,
                        _ => {}
                    }
                }
                write!(formatter, " ({:04x}, not {:04x})", new.0, old.0)
            }
            Self::StepsPerRevolution { old, new } => {
                write!(formatter, "its motor has {new} steps per revolution, not {old}")
            }
            Self::TickRate { old, new } => {
                write!(formatter, "its clock has {new} ticks per second, not {old}")
            }
            Self::Firmware { old, new } => write!(
                formatter,
                "its firmware is {}.{}.{}, not {}.{}.{}",
                new.major, new.minor, new.patch, old.major, old.minor, old.patch
            ),
            Self::Protocol { old, new } => write!(
                formatter,
                "its protocol is version {} ({:08x}), not {} ({:08x})",
                new.version, new.schema, old.version, old.schema
            ),
            Self::RingBytes { old, new } => {
                write!(formatter, "its reading buffer has {new} bytes, not {old}")
            }
        }
    }
}

/// Formats a serial number: as text if it is printable ASCII, else in hexadecimal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Serial<'a>(pub &'a [u8; 10]);

impl fmt::Display for Serial<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = core::str::from_utf8(self.0).map(|text| text.trim_end_matches('\0'));
        match text {
            Ok(text) if text.chars().all(|c| c.is_ascii_graphic()) => formatter.write_str(text),
            _ => self.0.iter().try_for_each(|byte| write!(formatter, "{byte:02x}")),
        }
    }
}
