//! Records that messages carry.

use super::codes::{DeviceState, FaultKind, ReadingStatus, ResetCause, SweepState};
use super::echoes::Echoes;
use super::table::{wire_enum, wire_struct};
use super::wire::{Reader, Wire, Writer};

wire_struct! {
    /// Protocol version of a device. The front of every Identity, frozen.
    pub struct ProtocolId {
        /// Counts up with incompatible changes.
        version: u8,
        /// Hash over the message tables.
        schema: u32,
    }
}

wire_struct! {
    /// Version of the firmware. Frozen.
    pub struct FirmwareVersion {
        /// Incompatible changes.
        major: u8,
        /// Additions.
        minor: u8,
        /// Repairs.
        patch: u8,
    }
}

wire_struct! {
    /// Identity of the device. `protocol` and `firmware` come first in every version.
    pub struct Identity {
        /// Protocol spoken.
        protocol: ProtocolId,
        /// Firmware version.
        firmware: FirmwareVersion,
        /// Serial number: ten bytes that no other board has.
        serial: [u8; 10],
        /// Boot nonce: another one after each restart, never 0.
        boot: u16,
        /// Number of the last request that the device accepted since boot.
        last_seq: Option<u16>,
        /// Device ticks a second.
        tick_hz: u32,
        /// Steps a revolution.
        steps_per_revolution: u16,
        /// What the board can do.
        capabilities: Capabilities,
        /// Bytes kept for unacknowledged readings.
        ring_bytes: u16,
        /// Why it booted.
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
    /// Homes on an index sensor; without it, Home takes the present position for zero.
    pub const INDEX_SENSOR: Self = Self(1);
    /// Can shorten the module's blanking.
    pub const SHORT_BLANKING: Self = Self(1 << 1);
    /// Can tell more than the first echo.
    pub const MULTIPLE_ECHOES: Self = Self(1 << 2);
    /// Has an emergency stop.
    pub const EMERGENCY_STOP: Self = Self(1 << 3);
    /// Can release the motor's coils.
    pub const COIL_RELEASE: Self = Self(1 << 4);
    /// Its clock jumps: good for intervals between firings, not for the time of day.
    pub const VIRTUAL_CLOCK: Self = Self(1 << 13);
    /// The firmware's machine code, but in an emulator.
    pub const EMULATED: Self = Self(1 << 14);
    /// No hardware: the echoes come from a model.
    pub const SIMULATED: Self = Self(1 << 15);

    /// All of them, by name.
    pub const NAMES: [(Self, &str); 8] = [
        (Self::INDEX_SENSOR, "INDEX_SENSOR"),
        (Self::SHORT_BLANKING, "SHORT_BLANKING"),
        (Self::MULTIPLE_ECHOES, "MULTIPLE_ECHOES"),
        (Self::EMERGENCY_STOP, "EMERGENCY_STOP"),
        (Self::COIL_RELEASE, "COIL_RELEASE"),
        (Self::VIRTUAL_CLOCK, "VIRTUAL_CLOCK"),
        (Self::EMULATED, "EMULATED"),
        (Self::SIMULATED, "SIMULATED"),
    ];

    /// Whether all of `wanted` are there.
    #[must_use]
    pub const fn has(self, wanted: Self) -> bool {
        self.0 & wanted.0 == wanted.0
    }

    /// Both together.
    #[must_use]
    pub const fn with(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

wire_struct! {
    /// Settings of motion and listening. See [`super::limits`] for the ranges.
    pub struct Settings {
        /// Listening time after each firing, ticks.
        window_ticks: u32,
        /// Least time from firing to firing, ticks.
        min_interval_ticks: u32,
        /// Rest between the end of a move and firing, ticks.
        settle_ticks: u32,
        /// Echoes to report for each firing.
        max_echoes: u8,
        /// How long the receiver stays deaf after firing.
        blanking: Blanking,
        /// Largest speed, steps/s.
        speed: u16,
        /// Acceleration and deceleration, steps/s^2.
        acceleration: u32,
        /// Idle coils are released after this long without a word from the host, s; 0 for never.
        hold_s: u16,
    }
}

wire_enum! {
    /// How long the receiver is disabled after firing.
    pub enum Blanking {
        /// As long as the module does by itself (2.38 ms).
        0 Internal,
        /// Shortened by the board.
        1 Short {
            /// Ticks after firing.
            ticks: u16,
        },
    }
}

wire_struct! {
    /// A plan of beams that the device carries out alone. Beam `index` is ping
    /// `index % pings_per_stop` at stop `index / pings_per_stop`.
    pub struct Sweep {
        /// Number of the sweep, chosen by the host, not 0.
        sweep: u16,
        /// Position of the first stop, steps.
        first_step: i32,
        /// From stop to stop, steps.
        stride: i16,
        /// Number of stops.
        stops: u16,
        /// Firings at each stop.
        pings_per_stop: u8,
        /// The sweep ends when the host is silent for longer, ms.
        lease_ms: u16,
    }
}

impl Sweep {
    /// Number of beams; `None` if none or more than a sweep may have.
    #[must_use]
    pub fn beams(&self) -> Option<u16> {
        self.stops.checked_mul(u16::from(self.pings_per_stop)).filter(|&beams| beams > 0)
    }

    /// Position of beam `index`, steps; `None` if out of the range of `i32` or without pings.
    #[must_use]
    pub fn step_of(&self, index: u16) -> Option<i32> {
        let stop = index.checked_div(u16::from(self.pings_per_stop))?;
        i32::from(self.stride).checked_mul(i32::from(stop))?.checked_add(self.first_step)
    }
}

wire_struct! {
    /// One firing.
    pub struct Reading {
        /// The sweep it belongs to; 0 for a Ping.
        sweep: u16,
        /// Which beam of the sweep.
        index: u16,
        /// Position, steps.
        step: i32,
        /// Device clock at firing, ticks.
        fired_ticks: u32,
        /// What became of it.
        status: ReadingStatus,
        /// Echo times, ticks after firing.
        echoes: Echoes,
    }
}

wire_struct! {
    /// Progress of the device's latest sweep.
    pub struct Alive {
        /// Device clock when the request came in, ticks.
        ticks: u32,
        /// The latest sweep; 0 if there was none.
        sweep: u16,
        /// Beams fired.
        fired: u16,
        /// Beams reported at least once: what the host lacks below this was lost.
        sent: u16,
        /// How far it is.
        state: SweepState,
    }
}

wire_struct! {
    /// The end of a sweep.
    pub struct SweepDone {
        /// Which sweep.
        sweep: u16,
        /// Beams fired.
        fired: u16,
        /// How it ended.
        end: SweepState,
    }
}

wire_struct! {
    /// Everything about the device that a host may want to see.
    pub struct Status {
        /// Device clock when the request came in, ticks.
        ticks: u32,
        /// What it is doing.
        state: DeviceState,
        /// Whether Configure was done since boot.
        configured: bool,
        /// Whether the position is known.
        homed: bool,
        /// Position, steps from home.
        step: i32,
        /// The latest sweep; 0 if there was none.
        sweep: u16,
        /// Beams of it that were fired.
        fired: u16,
        /// Why the device last stopped by itself, until it is homed again.
        fault: Option<FaultKind>,
        /// Frames dropped since boot: wrong CRC or too short for one.
        dropped_checksum: u16,
        /// Frames dropped since boot: broken stuffing.
        dropped_stuffing: u16,
        /// Frames dropped since boot: too long.
        dropped_too_long: u16,
        /// Frames dropped since boot: the line reported an error.
        dropped_line: u16,
        /// Right frames with an unknown request since boot.
        undecodable: u16,
        /// Old duplicates and requests from before the restart, since boot.
        stale: u16,
    }
}
