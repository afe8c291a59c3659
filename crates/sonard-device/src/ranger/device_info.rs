//! Identity of a device in the form of log records.

use firmware_protocol::{
    host::Serial,
    messages::{Capabilities, Identity},
};
use sonard_records::{Device, Provenance};

/// Provenance of the device's readings, from the capabilities it reports. The kind of port is no
/// evidence.
#[must_use]
pub const fn provenance(identity: &Identity) -> Provenance {
    if identity.capabilities.has(Capabilities::REPLAYED) {
        Provenance::Replay
    } else if identity.capabilities.has(Capabilities::SIMULATED) {
        Provenance::Mock
    } else if identity.capabilities.has(Capabilities::EMULATED) {
        Provenance::Emulator
    } else {
        Provenance::Hardware
    }
}

/// Converts an identity to the device entry of a session record.
#[must_use]
pub fn device_record(identity: &Identity) -> Device {
    let firmware = identity.firmware;
    Device {
        serial: serial_text(identity),
        firmware: format!("{}.{}.{}", firmware.major, firmware.minor, firmware.patch),
        protocol: identity.protocol.version.into(),
        boot: format!("{:04x}", identity.boot),
        tick_hz: identity.tick_hz,
        steps_per_revolution: identity.steps_per_revolution.into(),
    }
}

/// Serial number as text if printable, else in hexadecimal.
#[must_use]
pub fn serial_text(identity: &Identity) -> String {
    Serial(&identity.serial).to_string()
}
