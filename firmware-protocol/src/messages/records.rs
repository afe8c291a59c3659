//! Records carried by messages.

use super::codes::{DeviceState, FaultKind, ReadingStatus, ResetCause, SweepState};
use super::echoes::Echoes;
use super::table::{wire_enum, wire_struct};
use super::wire::{Reader, Wire, Writer};

wire_struct! {
    /// Protocol version of a device: the first field of every Identity, frozen.
    pub struct ProtocolId {
        /// Incremented with incompatible changes.
        version: u8,
        /// Hash of the message tables.
        schema: u32,
    }
}

wire_struct! {
    /// Version of the firmware. Frozen.
    pub struct FirmwareVersion {
        /// Incremented with incompatible changes.
        major: u8,
        /// Incremented with additions.
        minor: u8,
        /// Incremented with corrections.
        patch: u8,
    }
}

wire_struct! {
    /// Identity of the device. `protocol` and `firmware` come first in every version.
    pub struct Identity {
        /// Protocol version and schema of the device.
        protocol: ProtocolId,
        /// Version of the firmware.
        firmware: FirmwareVersion,
        /// Serial number: ten bytes, unique to the board.
        serial: [u8; 10],
        /// Boot nonce: differs after each restart, never 0.
        boot: u16,
        /// Number of the last request that the device accepted since boot.
        last_seq: Option<u16>,
        /// Device ticks per second.
        tick_hz: u32,
        /// Steps per revolution, including microstepping and gears.
        steps_per_revolution: u16,
        /// Features of the board.
        capabilities: Capabilities,
        /// Capacity for unacknowledged readings, bytes.
        ring_bytes: u16,
        /// Cause of the last reset.
        reset_cause: ResetCause,
    }
}

/// Features of a board, as bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
pub struct Capabilities(pub u16);

impl Wire for Capabilities {
    const BLANK: Self = Self(0);

    fn put(&self, out: &mut Writer<'_>) {
        self.0.put(out);
    }

    fn read(&mut self, input: &mut Reader<'_>) {
        self.0.read(input);
    }
}

impl Capabilities {
    /// Homes on an index sensor. Without the sensor, Home defines the present position as zero.
    pub const INDEX_SENSOR: Self = Self(1);
    /// Can shorten the module's blanking.
    pub const SHORT_BLANKING: Self = Self(1 << 1);
    /// Can report more than the first echo.
    pub const MULTIPLE_ECHOES: Self = Self(1 << 2);
    /// Has an emergency stop.
    pub const EMERGENCY_STOP: Self = Self(1 << 3);
    /// Can release the motor's coils.
    pub const COIL_RELEASE: Self = Self(1 << 4);
    /// Reports the readings of a log, in addition to [`Self::SIMULATED`].
    pub const REPLAYED: Self = Self(1 << 12);
    /// Has a clock that jumps: valid for intervals between firings, not for the time of day.
    pub const VIRTUAL_CLOCK: Self = Self(1 << 13);
    /// Runs the firmware's machine code in an emulator.
    pub const EMULATED: Self = Self(1 << 14);
    /// Simulates all echoes with a model; there is no hardware.
    pub const SIMULATED: Self = Self(1 << 15);

    /// All capability bits with their names.
    pub const NAMES: [(Self, &str); 9] = [
        (Self::INDEX_SENSOR, "INDEX_SENSOR"),
        (Self::SHORT_BLANKING, "SHORT_BLANKING"),
        (Self::MULTIPLE_ECHOES, "MULTIPLE_ECHOES"),
        (Self::EMERGENCY_STOP, "EMERGENCY_STOP"),
        (Self::COIL_RELEASE, "COIL_RELEASE"),
        (Self::REPLAYED, "REPLAYED"),
        (Self::VIRTUAL_CLOCK, "VIRTUAL_CLOCK"),
        (Self::EMULATED, "EMULATED"),
        (Self::SIMULATED, "SIMULATED"),
    ];

    /// Returns `true` if all bits of `required` are set.
    #[must_use]
    pub const fn has(self, required: Self) -> bool {
        self.0 & required.0 == required.0
    }

    /// Returns the union of both sets of features.
    #[must_use]
    pub const fn with(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

wire_struct! {
    /// Motion and ranging parameters. See [`super::limits`] for the ranges.
    pub struct Settings {
        /// Listening time after each firing, ticks.
        window_ticks: u32,
        /// Minimum time between firings, ticks.
        min_interval_ticks: u32,
        /// Settling time between the end of a move and firing, ticks.
        settle_ticks: u32,
        /// Maximum number of echoes reported for each firing.
        max_echoes: u8,
        /// Receiver blanking after firing.
        blanking: Blanking,
        /// Maximum speed of moves, steps/s.
        speed: u16,
        /// Acceleration and deceleration, steps/s^2.
        acceleration: u32,
        /// Time without a request after which idle coils are released, s; 0 for never.
        hold_s: u16,
    }
}

wire_enum! {
    /// Time during which the receiver is blanked after firing.
    pub enum Blanking {
        /// Internal blanking of the module (2.38 ms).
        0 Internal,
        /// Blanking shortened by the board.
        1 Short {
            /// End of the blanking, ticks after firing.
            ticks: u16,
        },
    }
}

wire_struct! {
    /// Plan of beams that the device executes on its own. Beam `index` is ping
    /// `index % pings_per_stop` at stop `index / pings_per_stop`.
    pub struct Sweep {
        /// Number of the sweep, chosen by the host, not 0.
        sweep: u16,
        /// Position of the first stop, steps.
        first_step: i32,
        /// Steps from stop to stop.
        stride: i16,
        /// Number of stops in the sweep.
        stops: u16,
        /// Firings at each stop.
        pings_per_stop: u8,
        /// Time without a request after which the sweep ends, ms.
        lease_ms: u16,
    }
}

impl Sweep {
    /// Number of beams; `None` if 0 or above [`super::limits::BEAMS_MAX`].
    #[must_use]
    pub fn beams(&self) -> Option<u16> {
        self.stops.checked_mul(u16::from(self.pings_per_stop)).filter(|&beams| beams > 0)
    }

    /// Position of beam `index`, steps; `None` if it overflows `i32` or there are no pings.
    #[must_use]
    pub fn step_of(&self, index: u16) -> Option<i32> {
        let stop = index.checked_div(u16::from(self.pings_per_stop))?;
        i32::from(self.stride).checked_mul(i32::from(stop))?.checked_add(self.first_step)
    }
}

wire_struct! {
    /// Result of one firing.
    pub struct Reading {
        /// Number of the sweep; 0 for a Ping.
        sweep: u16,
        /// Index of the beam in the sweep.
        index: u16,
        /// Position, steps from home.
        step: i32,
        /// Device clock at firing, ticks.
        fired_ticks: u32,
        /// Outcome of the firing.
        status: ReadingStatus,
        /// Echo times, ticks after firing.
        echoes: Echoes,
    }
}

wire_struct! {
    /// Progress of the device's latest sweep.
    pub struct Alive {
        /// Device clock when the request arrived, ticks.
        ticks: u32,
        /// Number of the latest sweep; 0 without one.
        sweep: u16,
        /// Beams fired.
        fired: u16,
        /// Number of beams reported at least once: any lower beam that the host lacks was lost.
        sent: u16,
        /// State of the sweep.
        state: SweepState,
    }
}

wire_struct! {
    /// Message that ends a sweep.
    pub struct SweepDone {
        /// Number of the sweep.
        sweep: u16,
        /// Number of beams fired.
        fired: u16,
        /// State in which the sweep ended.
        end: SweepState,
    }
}

wire_struct! {
    /// State of the device and its error counters.
    pub struct Status {
        /// Device clock when the request arrived, ticks.
        ticks: u32,
        /// Current activity of the device.
        state: DeviceState,
        /// `true` if Configure was received since boot.
        configured: bool,
        /// `true` if the position is known.
        homed: bool,
        /// Position, steps from home.
        step: i32,
        /// Number of the latest sweep; 0 without one.
        sweep: u16,
        /// Number of beams fired in the latest sweep.
        fired: u16,
        /// Reason for the last stop by the device itself; cleared by homing.
        fault: Option<FaultKind>,
        /// Frames dropped since boot: wrong CRC or too short for one.
        dropped_checksum: u16,
        /// Frames dropped since boot: broken stuffing.
        dropped_stuffing: u16,
        /// Frames dropped since boot: too long.
        dropped_too_long: u16,
        /// Frames dropped since boot: the line reported an error.
        dropped_line: u16,
        /// Valid frames with an unknown request since boot.
        undecodable: u16,
        /// Old duplicates and requests from before the restart, since boot.
        stale: u16,
    }
}
