//! Terminals and serial ports of macOS.

use std::{
    fs::File,
    io,
    os::fd::{OwnedFd, RawFd},
    path::Path,
};

use rustix::{
    io::{FdFlags, fcntl_setfd},
    pty::{OpenptFlags, openpt},
};
use serialport::SerialPortType;

use super::{SystemPort, UsbDevice};

/// Returns `true` for an interactive terminal: the process's own, the console, or the pty
/// multiplexer. Opening one would lock it.
pub(crate) fn is_console(path: &Path, _device: u64) -> bool {
    ["/dev/tty", "/dev/console", "/dev/ptmx"].iter().any(|name| path == Path::new(name))
}

/// Returns `None`: device numbers do not identify pseudo-terminals.
pub(crate) fn pseudo_terminal_index(_device: u64) -> Option<u32> {
    None
}

/// Returns `true` for the path of a pseudo-terminal.
pub(crate) fn is_pseudo_terminal(path: &Path) -> bool {
    path.to_string_lossy().starts_with("/dev/ttys")
}

/// Opens the master of a new pseudo-terminal, which programs started later do not inherit.
pub(crate) fn open_terminal_pair() -> io::Result<OwnedFd> {
    let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY)?;
    fcntl_setfd(&master, FdFlags::CLOEXEC)?;
    Ok(master)
}

/// Duplicates a descriptor of this process, which is given as a number.
pub(crate) fn duplicate_descriptor(number: RawFd) -> io::Result<OwnedFd> {
    File::open(format!("/dev/fd/{number}")).map(OwnedFd::from)
}

/// Lists the USB serial ports that IOKit reports, by their call-out devices, which do not wait for
/// a carrier. The folders are those of Linux and not read.
pub(crate) fn serial_ports(_tty: &Path, _dev: &Path) -> io::Result<Vec<SystemPort>> {
    #[expect(clippy::disallowed_methods, reason = "the other lists are made of this one")]
    let ports = serialport::available_ports()?.into_iter();
    let call_out = ports.filter(|port| port.port_name.starts_with("/dev/cu."));
    let described = call_out.filter_map(|port| match port.port_type {
        SerialPortType::UsbPort(usb) => Some(SystemPort {
            path: port.port_name.into(),
            usb: Some(UsbDevice {
                manufacturer: usb.manufacturer,
                product: usb.product,
                serial: usb.serial_number,
            }),
        }),
        _ => None,
    });
    Ok(described.collect())
}
