//! Every message of the protocol, in one table each way.
//!
//! Bodies are postcard encodings: the code of the variant, then the fields in order, with
//! `u16`, `u32` as varints and `i16`, `i32` as zigzag varints. `PROTOCOL.md` spells it out.

mod codes;
mod echoes;
pub mod limits;
mod records;
pub(crate) mod table;
mod wire;

pub use codes::{DeviceState, FaultKind, NakReason, ReadingStatus, ResetCause, SweepState};
pub use echoes::Echoes;
pub use records::{
    Alive, Blanking, Capabilities, FirmwareVersion, Identity, ProtocolId, Reading, Settings,
    Status, Sweep, SweepDone,
};
pub use table::{Field, Variant};
pub use wire::{Reader, Wire, Writer};

use table::wire_enum;

/// Version of the protocol: counts up with every change that is not only an addition.
pub const PROTOCOL_VERSION: u8 = 1;

/// The protocol this crate speaks.
pub const PROTOCOL: ProtocolId = ProtocolId { version: PROTOCOL_VERSION, schema: SCHEMA_HASH };

/// Hash of all names, codes, fields and types below: two builds with the same hash encode alike.
pub const SCHEMA_HASH: u32 = schema_hash();

wire_enum! {
    /// Host to device.
    ///
    /// [`Identify`](Self::Identify), [`Stop`](Self::Stop) and [`Reset`](Self::Reset) keep code
    /// and form for ever, whatever the version.
    pub enum Request {
        /// Who are you? Always answered, never numbered.
        0 Identify,
        /// Stop motion and firing; the position is kept.
        1 Stop,
        /// Restart the device.
        2 Reset,
        /// Settings for motion and ranging; needed after each boot.
        3 Configure(Settings),
        /// Find the index, or take the present position for zero.
        4 Home,
        /// Turn to an absolute position.
        5 MoveTo {
            /// Steps from home.
            step: i32,
        },
        /// Fire once where the ranger points now.
        6 Ping,
        /// Fire at each stop of a plan, without the host.
        7 Sweep(Sweep),
        /// Send readings of a sweep again.
        8 Resend {
            /// Which sweep.
            sweep: u16,
            /// Lowest index the host lacks; everything below is acknowledged.
            first: u16,
            /// How many, from `first` on.
            count: u8,
        },
        /// I am here, and I have everything below `next`.
        9 KeepAlive {
            /// Which sweep.
            sweep: u16,
            /// Lowest index the host lacks.
            next: u16,
        },
        /// What are you doing?
        10 Status,
    }
}

wire_enum! {
    /// Device to host: replies, and events that nobody asked for.
    ///
    /// [`Identity`](Self::Identity) keeps its code and the fields of [`ProtocolId`] and
    /// [`FirmwareVersion`] at its front for ever; [`Ack`](Self::Ack) keeps its code.
    pub enum Reply {
        /// Answer to Identify, and announced once after each boot.
        0 Identity(Identity),
        /// Done.
        1 Ack,
        /// Not done.
        2 Nak {
            /// Why not.
            reason: NakReason,
        },
        /// Accepted and under way; the final reply follows.
        3 Started,
        /// Final reply to Home.
        4 Homed {
            /// Where the index was found against where it was expected, steps; 0 the first time.
            drift_steps: i32,
        },
        /// One firing: reply to Ping, or an event of a sweep.
        5 Reading(Reading),
        /// Reply to KeepAlive, and to Resend after the readings.
        6 Alive(Alive),
        /// A sweep ended and all its readings were sent.
        7 SweepDone(SweepDone),
        /// Reply to Status.
        8 StatusReport(Status),
        /// The device stopped by itself; home again.
        9 Fault {
            /// Why.
            kind: FaultKind,
        },
    }
}

/// A body that is no message of this version.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Undecodable;

impl core::fmt::Display for Undecodable {
    fn fmt(&self, formatter: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        formatter.write_str("no message of this protocol version")
    }
}

impl core::error::Error for Undecodable {}

impl Request {
    /// Decodes a request that fills `body` exactly.
    ///
    /// # Errors
    ///
    /// [`Undecodable`] for an unknown code, a field out of its type's range, missing or further bytes.
    pub fn decode(body: &[u8]) -> Result<Self, Undecodable> {
        decode_exactly(body)
    }

    /// Whether code and form are the same in every version.
    #[must_use]
    pub const fn is_frozen(&self) -> bool {
        matches!(self, Self::Identify | Self::Stop | Self::Reset)
    }
}

impl Reply {
    /// Decodes a reply that fills `body` exactly.
    ///
    /// # Errors
    ///
    /// [`Undecodable`] for an unknown code, a field out of its type's range, missing or further
    /// bytes. An Identity of another version may still tell its version: [`ProtocolId::peek`].
    pub fn decode(body: &[u8]) -> Result<Self, Undecodable> {
        decode_exactly(body)
    }
}

fn decode_exactly<M: Wire>(body: &[u8]) -> Result<M, Undecodable> {
    let mut message = M::BLANK;
    if message.read_exactly(body) { Ok(message) } else { Err(Undecodable) }
}

impl ProtocolId {
    /// Reads the frozen front of an Identity of any version; `None` if `body` is none.
    #[must_use]
    pub fn peek(body: &[u8]) -> Option<(Self, FirmwareVersion)> {
        let mut input = Reader::new(body);
        let code = input.byte();
        let mut front = (Self::BLANK, FirmwareVersion::BLANK);
        front.0.read(&mut input);
        front.1.read(&mut input);
        (code == 0 && input.is_right()).then_some(front)
    }
}

const fn schema_hash() -> u32 {
    let mut hash = table::HASH_START;
    hash = table::hash_enum(hash, "Request", Request::VARIANTS);
    hash = table::hash_enum(hash, "Reply", Reply::VARIANTS);
    hash = table::hash_enum(hash, "NakReason", NakReason::VARIANTS);
    hash = table::hash_enum(hash, "FaultKind", FaultKind::VARIANTS);
    hash = table::hash_enum(hash, "SweepState", SweepState::VARIANTS);
    hash = table::hash_enum(hash, "DeviceState", DeviceState::VARIANTS);
    hash = table::hash_enum(hash, "ReadingStatus", ReadingStatus::VARIANTS);
    hash = table::hash_enum(hash, "ResetCause", ResetCause::VARIANTS);
    hash = table::hash_enum(hash, "Blanking", Blanking::VARIANTS);
    hash = table::hash_struct(hash, "ProtocolId", ProtocolId::FIELDS);
    hash = table::hash_struct(hash, "FirmwareVersion", FirmwareVersion::FIELDS);
    hash = table::hash_struct(hash, "Identity", Identity::FIELDS);
    hash = table::hash_struct(hash, "Settings", Settings::FIELDS);
    hash = table::hash_struct(hash, "Sweep", Sweep::FIELDS);
    hash = table::hash_struct(hash, "Reading", Reading::FIELDS);
    hash = table::hash_struct(hash, "Alive", Alive::FIELDS);
    hash = table::hash_struct(hash, "SweepDone", SweepDone::FIELDS);
    table::hash_struct(hash, "Status", Status::FIELDS)
}
