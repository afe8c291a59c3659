//! Invalid replies of the mock: one fault for each validation rule of a host.

use std::fmt::Write as _;

use firmware_protocol::{
    frame::{Frame, FrameDecoder, Received},
    messages::{Capabilities, Echoes, Identity, ProtocolId, Reading, ReadingStatus, Reply, limits},
};

/// Fault of the mock's replies. Faults of the identity after a restart apply from the second boot
/// on, faults of readings to one beam in a hundred.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum InvalidReply {
    /// Boot nonce 0.
    BootZero,
    /// Clock rate 0.
    NoTicks,
    /// Half of the protocol's clock rate.
    SlowTicks,
    /// No motor steps per revolution.
    NoSteps,
    /// Reading buffer smaller than a reading.
    SmallRing,
    /// After a restart: a different serial number.
    OtherSerial,
    /// After a restart: twice the steps per revolution.
    OtherSteps,
    /// After a restart: an emulator. Never hardware, so that no log attributes mock data to it.
    Emulator,
    /// After a restart: no index sensor.
    NoIndex,
    /// Echo after the end of the window.
    LateEcho,
    /// Status "no echo" with an echo time.
    SilentEcho,
    /// Status "echo" without an echo time.
    MissingEcho,
    /// Decreasing echo times.
    FallingEchoes,
    /// More echoes than requested.
    ManyEchoes,
    /// Firing time before the sweep.
    FiredBefore,
    /// Firing time of the previous beam.
    FiredTwice,
    /// Firing time late by an eighth of the clock's period.
    FiredLater,
    /// Step that differs from the plan.
    WrongStep,
    /// Beam index outside of the plan.
    WrongIndex,
    /// Homing that is started and never finished.
    EndlessHome,
    /// Index several revolutions away from the expected position.
    FarHome,
}

/// All reply faults with their names in a fault specification.
pub const INVALID_REPLIES: [(&str, InvalidReply); 21] = [
    ("boot-zero", InvalidReply::BootZero),
    ("no-ticks", InvalidReply::NoTicks),
    ("slow-ticks", InvalidReply::SlowTicks),
    ("no-steps", InvalidReply::NoSteps),
    ("small-ring", InvalidReply::SmallRing),
    ("other-serial", InvalidReply::OtherSerial),
    ("other-steps", InvalidReply::OtherSteps),
    ("emulator", InvalidReply::Emulator),
    ("no-index", InvalidReply::NoIndex),
    ("late-echo", InvalidReply::LateEcho),
    ("silent-echo", InvalidReply::SilentEcho),
    ("missing-echo", InvalidReply::MissingEcho),
    ("falling-echoes", InvalidReply::FallingEchoes),
    ("many-echoes", InvalidReply::ManyEchoes),
    ("fired-before", InvalidReply::FiredBefore),
    ("fired-twice", InvalidReply::FiredTwice),
    ("fired-later", InvalidReply::FiredLater),
    ("wrong-step", InvalidReply::WrongStep),
    ("wrong-index", InvalidReply::WrongIndex),
    ("endless-home", InvalidReply::EndlessHome),
    ("far-home", InvalidReply::FarHome),
];

impl InvalidReply {
    /// Looks up a fault by name.
    ///
    /// # Errors
    /// The list of valid names.
    pub(super) fn from_name(name: &str) -> Result<Self, String> {
        let found = INVALID_REPLIES.iter().find(|(known, _)| *known == name).map(|(_, lie)| *lie);
        found.ok_or_else(|| {
            let mut names = String::from("one of");
            for (known, _) in INVALID_REPLIES {
                let _ = write!(names, " {known}");
            }
            names
        })
    }

    /// Applies the fault to a reply.
    fn corrupt(self, reply: Reply, restarted: bool, fired_before: u32) -> Reply {
        match reply {
            Reply::Identity(identity) => {
                Reply::Identity(self.corrupt_identity(identity, restarted))
            }
            Reply::Reading(reading) if reading.sweep != 0 && reading.index % 100 == 7 => {
                Reply::Reading(self.corrupt_reading(reading, fired_before))
            }
            Reply::Homed { .. } if self == Self::EndlessHome => Reply::Started,
            Reply::Homed { .. } if self == Self::FarHome => Reply::Homed { drift_steps: 10_000 },
            reply => reply,
        }
    }

    fn corrupt_identity(self, identity: Identity, restarted: bool) -> Identity {
        let without = |bits: Capabilities| Capabilities(identity.capabilities.0 & !bits.0);
        match self {
            Self::BootZero => Identity { boot: 0, ..identity },
            Self::NoTicks => Identity { tick_hz: 0, ..identity },
            Self::SlowTicks => Identity { tick_hz: limits::TICK_HZ / 2, ..identity },
            Self::NoSteps => Identity { steps_per_revolution: 0, ..identity },
            Self::SmallRing => Identity { ring_bytes: 4, ..identity },
            _ if !restarted => identity,
            Self::OtherSerial => Identity { serial: *b"OTHER-0002", ..identity },
            Self::OtherSteps => Identity {
                steps_per_revolution: identity.steps_per_revolution.saturating_mul(2),
                ..identity
            },
            Self::Emulator => {
                let capabilities = without(Capabilities::SIMULATED).with(Capabilities::EMULATED);
                Identity { capabilities, ..identity }
            }
            Self::NoIndex => {
                Identity { capabilities: without(Capabilities::INDEX_SENSOR), ..identity }
            }
            _ => identity,
        }
    }

    fn corrupt_reading(self, reading: Reading, fired_before: u32) -> Reading {
        let echoes = |ticks: &[u32]| Echoes::from_ticks(ticks);
        let status = ReadingStatus::Echo;
        match self {
            Self::LateEcho => {
                Reading { status, echoes: echoes(&[limits::WINDOW_TICKS_MAX]), ..reading }
            }
            Self::SilentEcho => {
                Reading { status: ReadingStatus::NoEcho, echoes: echoes(&[9_000]), ..reading }
            }
            Self::MissingEcho => Reading { status, echoes: Echoes::new(), ..reading },
            Self::FallingEchoes => Reading { status, echoes: echoes(&[9_000, 8_000]), ..reading },
            Self::ManyEchoes => {
                let many = [6_000, 6_100, 6_200, 6_300, 6_400, 6_500, 6_600, 6_700];
                Reading { status, echoes: echoes(&many), ..reading }
            }
            Self::FiredBefore => {
                Reading { fired_ticks: reading.fired_ticks.wrapping_sub(1 << 28), ..reading }
            }
            Self::FiredTwice => Reading { fired_ticks: fired_before, ..reading },
            Self::FiredLater => {
                Reading { fired_ticks: reading.fired_ticks.wrapping_add(1 << 29), ..reading }
            }
            Self::WrongStep => Reading { step: reading.step.wrapping_add(1), ..reading },
            Self::WrongIndex => Reading { index: u16::MAX, ..reading },
            _ => reading,
        }
    }
}

/// Applies a reply fault and another protocol version to the replies of a board.
#[derive(Debug, Default)]
pub(super) struct ReplyCorruptor {
    lie: Option<InvalidReply>,
    version: Option<u8>,
    first_boot: Option<u16>,
    /// Firing time of the latest reported beam, ticks.
    fired: u32,
}

impl ReplyCorruptor {
    pub(super) fn new(lie: Option<InvalidReply>, version: Option<u8>) -> Self {
        Self { lie, version, ..Self::default() }
    }

    /// Decodes frames, applies the fault, and encodes them again.
    pub(super) fn corrupt(&mut self, bytes: Vec<u8>) -> Vec<u8> {
        if self.lie.is_none() && self.version.is_none() {
            return bytes;
        }
        let mut decoder = FrameDecoder::new();
        let mut out = Vec::with_capacity(bytes.len());
        for byte in bytes {
            let Received::Frame(frame) = decoder.push(byte) else { continue };
            let Ok(reply) = Reply::decode(frame.body) else { continue };
            let restarted = *self.first_boot.get_or_insert(frame.header.boot) != frame.header.boot;
            let mut sent = reply;
            if let Some(lie) = self.lie {
                sent = lie.corrupt(sent, restarted, self.fired);
            }
            if let (Some(version), Reply::Identity(identity)) = (self.version, &mut sent) {
                identity.protocol = ProtocolId { version, ..identity.protocol };
            }
            if let Reply::Reading(reading) = reply {
                self.fired = reading.fired_ticks;
            }
            if let Ok(frame) = Frame::encode(frame.header, &sent) {
                out.extend_from_slice(&frame);
            }
        }
        out
    }
}
