//! A mock that says what is not so: each lie is one that a host must see through.

use std::fmt::Write as _;

use firmware_protocol::{
    frame::{Frame, FrameDecoder, Received},
    messages::{Capabilities, Echoes, Identity, ProtocolId, Reading, ReadingStatus, Reply, limits},
};

/// What a mock says wrongly. Those of an identity after a restart are told from the second boot on;
/// those of readings about one beam in a hundred.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lie {
    /// Its boot nonce is 0.
    BootZero,
    /// Its clock does not tick.
    NoTicks,
    /// Its clock ticks at half the protocol's rate.
    SlowTicks,
    /// Its motor has no steps.
    NoSteps,
    /// It keeps less than a reading.
    SmallRing,
    /// After a restart: another serial number.
    OtherSerial,
    /// After a restart: twice the steps a revolution.
    OtherSteps,
    /// After a restart: an emulator. Never hardware: no log shall take a mock for that.
    Emulator,
    /// After a restart: no index sensor.
    NoIndex,
    /// An echo after the window.
    LateEcho,
    /// No echo, with echoes.
    SilentEcho,
    /// An echo, without one.
    MissingEcho,
    /// Echoes that fall.
    FallingEchoes,
    /// More echoes than asked for.
    ManyEchoes,
    /// Fired before the sweep.
    FiredBefore,
    /// Fired at the same time as the beam before.
    FiredTwice,
    /// Fired an eighth of a turn of its clock later than it was.
    FiredLater,
    /// Another step than the plan's.
    WrongStep,
    /// A beam that the plan has not.
    WrongIndex,
    /// Home is started, and never done.
    EndlessHome,
    /// The index is turns away from where it was expected.
    FarHome,
}

/// All of them, by the names that a fault specification takes.
pub const LIES: [(&str, Lie); 21] = [
    ("boot-zero", Lie::BootZero),
    ("no-ticks", Lie::NoTicks),
    ("slow-ticks", Lie::SlowTicks),
    ("no-steps", Lie::NoSteps),
    ("small-ring", Lie::SmallRing),
    ("other-serial", Lie::OtherSerial),
    ("other-steps", Lie::OtherSteps),
    ("emulator", Lie::Emulator),
    ("no-index", Lie::NoIndex),
    ("late-echo", Lie::LateEcho),
    ("silent-echo", Lie::SilentEcho),
    ("missing-echo", Lie::MissingEcho),
    ("falling-echoes", Lie::FallingEchoes),
    ("many-echoes", Lie::ManyEchoes),
    ("fired-before", Lie::FiredBefore),
    ("fired-twice", Lie::FiredTwice),
    ("fired-later", Lie::FiredLater),
    ("wrong-step", Lie::WrongStep),
    ("wrong-index", Lie::WrongIndex),
    ("endless-home", Lie::EndlessHome),
    ("far-home", Lie::FarHome),
];

impl Lie {
    /// The lie of a name, or the names there are.
    pub(super) fn named(name: &str) -> Result<Self, String> {
        let found = LIES.iter().find(|(known, _)| *known == name).map(|(_, lie)| *lie);
        found.ok_or_else(|| {
            let mut names = String::from("one of");
            for (known, _) in LIES {
                let _ = write!(names, " {known}");
            }
            names
        })
    }

    /// What it makes of a reply.
    fn told(self, reply: Reply, restarted: bool, fired_before: u32) -> Reply {
        match reply {
            Reply::Identity(identity) => Reply::Identity(self.of_identity(identity, restarted)),
            Reply::Reading(reading) if reading.sweep != 0 && reading.index % 100 == 7 => {
                Reply::Reading(self.of_reading(reading, fired_before))
            }
            Reply::Homed { .. } if self == Self::EndlessHome => Reply::Started,
            Reply::Homed { .. } if self == Self::FarHome => Reply::Homed { drift_steps: 10_000 },
            reply => reply,
        }
    }

    fn of_identity(self, identity: Identity, restarted: bool) -> Identity {
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

    fn of_reading(self, reading: Reading, fired_before: u32) -> Reading {
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

/// Tells a lie, and another version of the protocol, in place of what a board says.
#[derive(Debug, Default)]
pub(super) struct Liar {
    lie: Option<Lie>,
    version: Option<u8>,
    first_boot: Option<u16>,
    /// When the latest beam was fired that was told of.
    fired: u32,
}

impl Liar {
    pub(super) fn new(lie: Option<Lie>, version: Option<u8>) -> Self {
        Self { lie, version, ..Self::default() }
    }

    /// The same frames, with whatever is said wrongly.
    pub(super) fn told(&mut self, bytes: Vec<u8>) -> Vec<u8> {
        if self.lie.is_none() && self.version.is_none() {
            return bytes;
        }
        let mut decoder = FrameDecoder::new();
        let mut out = Vec::with_capacity(bytes.len());
        for byte in bytes {
            let Received::Frame(frame) = decoder.push(byte) else { continue };
            let Ok(reply) = Reply::decode(frame.body) else { continue };
            let restarted = *self.first_boot.get_or_insert(frame.header.boot) != frame.header.boot;
            let mut told = reply;
            if let Some(lie) = self.lie {
                told = lie.told(told, restarted, self.fired);
            }
            if let (Some(version), Reply::Identity(identity)) = (self.version, &mut told) {
                identity.protocol = ProtocolId { version, ..identity.protocol };
            }
            if let Reply::Reading(reading) = reply {
                self.fired = reading.fired_ticks;
            }
            if let Ok(frame) = Frame::encode(frame.header, &told) {
                out.extend_from_slice(&frame);
            }
        }
        out
    }
}
