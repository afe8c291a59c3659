//! What the mock says it is.

use firmware_protocol::{
    device::Board,
    messages::{Capabilities, FirmwareVersion, ResetCause},
};

use super::faults::FaultPlan;

/// Settings of the mock board.
#[derive(Debug, Clone, Copy)]
pub struct BoardSettings {
    /// Boot nonce of the first boot.
    pub boot: u16,
    /// Device clock at the first boot, ticks.
    pub clock: u32,
    /// Steps a revolution.
    pub steps_per_revolution: u16,
    /// What goes wrong.
    pub faults: FaultPlan,
    /// Seed of the faults.
    pub seed: u64,
    /// How its clock passes; a virtual one is announced to the host.
    pub pace: Pace,
}

/// The passage of device time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pace {
    /// As on a wall clock.
    RealTime,
    /// Jumps to whatever happens next; only the host's patience is measured in real time.
    Virtual,
}

/// The board as it introduces itself: never as hardware.
pub(super) fn identity(settings: &BoardSettings, boot: u16, reset_cause: ResetCause) -> Board {
    let clock = match settings.pace {
        Pace::RealTime => Capabilities::default(),
        Pace::Virtual => Capabilities::VIRTUAL_CLOCK,
    };
    Board {
        boot,
        firmware: FirmwareVersion { major: 0, minor: 1, patch: 0 },
        serial: *b"MOCK-00001",
        steps_per_revolution: settings.steps_per_revolution,
        capabilities: Capabilities::INDEX_SENSOR
            .with(Capabilities::SHORT_BLANKING)
            .with(Capabilities::MULTIPLE_ECHOES)
            .with(Capabilities::COIL_RELEASE)
            .with(Capabilities::SIMULATED)
            .with(clock),
        reset_cause,
    }
}
