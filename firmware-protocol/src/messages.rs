//! Message tables of the protocol, one for each direction.
//!
//! Bodies are postcard encodings: the code of the variant, then the fields in order, with `u16`,
//! `u32` as varints and `i16`, `i32` as zigzag varints. `PROTOCOL.md` specifies the details.

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

/// Version of the protocol, incremented with every change after which a host or device of the
/// previous version would reject or misread a frame.
pub const PROTOCOL_VERSION: u8 = 1;

/// Protocol version and schema implemented by this crate.
pub const PROTOCOL: ProtocolId = ProtocolId { version: PROTOCOL_VERSION, schema: SCHEMA_HASH };

/// Hash of all names, codes, fields and types below. Two builds with equal hashes use the same
/// encoding.
pub const SCHEMA_HASH: u32 = schema_hash();

wire_enum! {
    /// Message from the host to the device.
    ///
    /// [`Identify`](Self::Identify), [`Stop`](Self::Stop) and [`Reset`](Self::Reset) keep code and
    /// form in every version.
    pub enum Request {
        /// Requests the [`Identity`]. Always answered, never numbered.
        0 Identify,
        /// Stops motion and firing; the position is kept.
        1 Stop,
        /// Restarts the device; position and settings are lost.
        2 Reset,
        /// Sets motion and ranging parameters; required after each boot.
        3 Configure(Settings),
        /// Searches for the index, or defines the present position as zero.
        4 Home,
        /// Moves to an absolute position.
        5 MoveTo {
            /// Target position, steps from home.
            step: i32,
        },
        /// Fires once in the present direction.
        6 Ping,
        /// Fires at each stop of a plan, without further requests.
        7 Sweep(Sweep),
        /// Requests readings of a sweep again.
        8 Resend {
            /// Number of the sweep.
            sweep: u16,
            /// Lowest index that the host lacks; all lower beams are acknowledged.
            first: u16,
            /// Number of readings, starting with `first`.
            count: u8,
        },
        /// Renews the lease and acknowledges all beams below `next`.
        9 KeepAlive {
            /// Number of the sweep.
            sweep: u16,
            /// Lowest index that the host lacks.
            next: u16,
        },
        /// Requests the device [`Status`].
        10 Status,
    }
}

wire_enum! {
    /// Message from the device to the host: a reply, or an event sent without a request.
    ///
    /// [`Identity`](Self::Identity) keeps its code and starts with the fields of [`ProtocolId`] and
    /// [`FirmwareVersion`] in every version; [`Ack`](Self::Ack) keeps its code.
    pub enum Reply {
        /// Reply to Identify, also sent once after each boot.
        0 Identity(Identity),
        /// Request completed successfully.
        1 Ack,
        /// Request rejected or failed.
        2 Nak {
            /// Reason of the rejection.
            reason: NakReason,
        },
        /// Request accepted and in progress; the final reply follows.
        3 Started,
        /// Final reply to Home.
        4 Homed {
            /// Actual minus expected position of the index, steps; 0 the first time.
            drift_steps: i32,
        },
        /// Result of one firing: reply to Ping, or event of a sweep.
        5 Reading(Reading),
        /// Reply to KeepAlive, and to Resend after the readings.
        6 Alive(Alive),
        /// End of a sweep, after all of its readings were sent.
        7 SweepDone(SweepDone),
        /// Reply to Status.
        8 StatusReport(Status),
        /// Fault that stopped the device; homing is required.
        9 Fault {
            /// Cause of the stop.
            kind: FaultKind,
        },
    }
}

/// Error for a body that is not a message of this protocol version.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Undecodable;

impl core::fmt::Display for Undecodable {
    fn fmt(&self, formatter: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        formatter.write_str("not a message of this protocol version")
    }
}

impl core::error::Error for Undecodable {}

impl Request {
    /// Decodes a request that fills `body` exactly.
    ///
    /// # Errors
    ///
    /// [`Undecodable`] for an unknown code, a field out of its type's range, missing or excess
    /// bytes.
    pub fn decode(body: &[u8]) -> Result<Self, Undecodable> {
        decode_exactly(body)
    }

    /// Returns `true` if code and form are the same in every protocol version.
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
    /// [`Undecodable`] for an unknown code, a field out of its type's range, missing or excess
    /// bytes. [`ProtocolId::peek`] may still decode the version in an Identity of another version.
    pub fn decode(body: &[u8]) -> Result<Self, Undecodable> {
        decode_exactly(body)
    }
}

fn decode_exactly<M: Wire>(body: &[u8]) -> Result<M, Undecodable> {
    let mut message = M::BLANK;
    if message.read_exactly(body) { Ok(message) } else { Err(Undecodable) }
}

impl ProtocolId {
    /// Decodes the frozen first fields of an Identity of any version; `None` if `body` is not one.
    #[must_use]
    pub fn peek(body: &[u8]) -> Option<(Self, FirmwareVersion)> {
        let mut input = Reader::new(body);
        let code = input.byte();
        let mut front = (Self::BLANK, FirmwareVersion::BLANK);
        front.0.read(&mut input);
        front.1.read(&mut input);
        (code == 0 && input.is_valid()).then_some(front)
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
