//! What a device says of itself, as it stands in records.

use firmware_protocol::{
    host::Serial,
    messages::{Capabilities, Identity},
};
use sonard_records::{Device, Provenance};

/// Where readings of this device come from. The device says itself what it is: how its port was
/// opened proves nothing.
#[must_use]
pub const fn provenance(identity: &Identity) -> Provenance {
    if identity.capabilities.has(Capabilities::SIMULATED) {
        Provenance::Mock
    } else if identity.capabilities.has(Capabilities::EMULATED) {
        Provenance::Emulator
    } else {
        Provenance::Hardware
    }
}

/// The device as it stands in a session's record.
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

/// The serial number as text if it is text, else in hexadecimal.
#[must_use]
pub fn serial_text(identity: &Identity) -> String {
    Serial(&identity.serial).to_string()
}
