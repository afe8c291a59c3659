//! Terminals, serial ports and pins, as far as they differ between Linux and macOS. Both variants
//! have the same functions, so no other module of this crate depends on the system.

#[cfg(feature = "pi")]
#[cfg_attr(target_os = "linux", path = "platform/rppal_gpio.rs")]
#[cfg_attr(not(target_os = "linux"), path = "platform/no_gpio.rs")]
pub(crate) mod gpio;
#[cfg_attr(target_os = "linux", path = "platform/linux.rs")]
#[cfg_attr(not(target_os = "linux"), path = "platform/macos.rs")]
mod system;

use std::path::PathBuf;

pub(crate) use system::{
    duplicate_descriptor, is_console, is_pseudo_terminal, open_terminal_pair,
    pseudo_terminal_index, serial_ports,
};

/// Serial port as described by the system.
#[derive(Debug)]
pub(crate) struct SystemPort {
    pub(crate) path: PathBuf,
    pub(crate) usb: Option<UsbDevice>,
}

/// Descriptor of a USB device.
#[derive(Debug)]
pub(crate) struct UsbDevice {
    pub(crate) manufacturer: Option<String>,
    pub(crate) product: Option<String>,
    pub(crate) serial: Option<String>,
}

impl UsbDevice {
    pub(crate) fn describe(self) -> String {
        let parts = [self.manufacturer, self.product, self.serial];
        parts.into_iter().flatten().collect::<Vec<_>>().join(" ")
    }
}
