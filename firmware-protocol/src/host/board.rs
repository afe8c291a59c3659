//! Whether a device that answers is the board it was: the one place where that is decided.

use core::fmt;

use crate::messages::{Capabilities, FirmwareVersion, Identity, ProtocolId};

/// In what a board differs from the one before. A restart alone is no difference.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BoardChange {
    /// Another serial number.
    Serial {
        /// Before.
        was: [u8; 10],
        /// Now.
        is: [u8; 10],
    },
    /// It can do other things, or is no longer (or not before) hardware.
    Capabilities {
        /// Before.
        was: Capabilities,
        /// Now.
        is: Capabilities,
    },
    /// Another motor: the same step is another azimuth.
    StepsPerRevolution {
        /// Before.
        was: u16,
        /// Now.
        is: u16,
    },
    /// Another clock.
    TickRate {
        /// Before, ticks a second.
        was: u32,
        /// Now, ticks a second.
        is: u32,
    },
    /// Another firmware.
    Firmware {
        /// Before.
        was: FirmwareVersion,
        /// Now.
        is: FirmwareVersion,
    },
    /// Another protocol.
    Protocol {
        /// Before.
        was: ProtocolId,
        /// Now.
        is: ProtocolId,
    },
    /// It keeps more or fewer readings.
    RingBytes {
        /// Before, bytes.
        was: u16,
        /// Now, bytes.
        is: u16,
    },
}

impl BoardChange {
    /// The first difference that matters between two identities; `None` if the same board told
    /// both, whether it restarted in between or not.
    #[must_use]
    pub fn between(was: &Identity, is: &Identity) -> Option<Self> {
        macro_rules! first_difference {
            ($($field:ident $change:ident),+) => {
                $(if was.$field != is.$field {
                    return Some(Self::$change { was: was.$field, is: is.$field });
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
            Self::Serial { was, is } => {
                write!(formatter, "its serial number is {}, not {}", Serial(is), Serial(was))
            }
            Self::Capabilities { was, is } => {
                formatter.write_str("it can do other things:")?;
                for (bit, name) in Capabilities::NAMES {
                    match (was.has(bit), is.has(bit)) {
                        (false, true) => write!(formatter, " +{name}")?,
                        (true, false) => write!(formatter, " -{name}")?,
                        _ => {}
                    }
                }
                write!(formatter, " ({:04x}, not {:04x})", is.0, was.0)
            }
            Self::StepsPerRevolution { was, is } => {
                write!(formatter, "its motor has {is} steps a revolution, not {was}")
            }
            Self::TickRate { was, is } => {
                write!(formatter, "its clock has {is} ticks a second, not {was}")
            }
            Self::Firmware { was, is } => write!(
                formatter,
                "its firmware is {}.{}.{}, not {}.{}.{}",
                is.major, is.minor, is.patch, was.major, was.minor, was.patch
            ),
            Self::Protocol { was, is } => write!(
                formatter,
                "it speaks protocol {} ({:08x}), not {} ({:08x})",
                is.version, is.schema, was.version, was.schema
            ),
            Self::RingBytes { was, is } => {
                write!(formatter, "it keeps {is} bytes of readings, not {was}")
            }
        }
    }
}

/// A serial number for people: as text if it is text, else in hexadecimal.
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
