//! Terminals and serial ports of Linux.

use std::{
    fs, io,
    os::fd::{OwnedFd, RawFd},
    path::{Path, PathBuf},
};

use rustix::{
    fs::{major, minor},
    process::{PidfdFlags, PidfdGetfdFlags, getpid, pidfd_getfd, pidfd_open},
    pty::{OpenptFlags, openpt},
};

use super::{SystemPort, UsbDevice};

/// Device majors of pseudo-terminals.
const PTS_MAJORS: std::ops::Range<u32> = 136..144;

/// Returns `true` for an interactive terminal: the process's own (`/dev/tty`), the pty multiplexer
/// (`/dev/ptmx`), or a virtual console (`/dev/tty1`). Opening one would lock it.
pub(crate) fn is_console(_path: &Path, device: u64) -> bool {
    matches!((major(device), minor(device)), (5, 0 | 2) | (4, 0..64))
}

/// Number of a pseudo-terminal; `None` for other devices.
pub(crate) fn pseudo_terminal_index(device: u64) -> Option<u32> {
    PTS_MAJORS.contains(&major(device)).then(|| minor(device))
}

/// Returns `true` for the path of a pseudo-terminal.
pub(crate) fn is_pseudo_terminal(path: &Path) -> bool {
    path.starts_with("/dev/pts")
}

/// Opens the master of a new pseudo-terminal, which programs started later do not inherit.
pub(crate) fn open_terminal_pair() -> io::Result<OwnedFd> {
    Ok(openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?)
}

/// Duplicates a descriptor of this process, which is given as a number.
pub(crate) fn duplicate_descriptor(number: RawFd) -> io::Result<OwnedFd> {
    let process = pidfd_open(getpid(), PidfdFlags::empty())?;
    Ok(pidfd_getfd(process, number, PidfdGetfdFlags::empty())?)
}

/// Lists the serial ports in `tty`, a folder of sysfs with one subfolder per terminal, whose
/// device nodes are in `dev`.
pub(crate) fn serial_ports(tty: &Path, dev: &Path) -> io::Result<Vec<SystemPort>> {
    let entries = fs::read_dir(tty)?.map(|entry| Ok(entry?.path()));
    let entries = entries.collect::<io::Result<Vec<PathBuf>>>()?;
    Ok(entries.iter().filter_map(|entry| serial_port(entry, dev)).collect())
}

/// Reads the port of a sysfs folder; `None` for consoles, pseudo-terminals and unpopulated UART
/// slots.
fn serial_port(entry: &Path, dev: &Path) -> Option<SystemPort> {
    let path = dev.join(entry.file_name()?);
    if !path.exists() {
        return None;
    }
    if file_name(entry).starts_with("rfcomm") {
        return Some(SystemPort { path, usb: None });
    }
    let device = fs::canonicalize(entry.join("device")).ok()?;
    let is_unpopulated = attribute(entry, "type").is_some_and(|kind| kind == "0");
    let subsystem = file_name(&fs::canonicalize(device.join("subsystem")).ok()?);
    match subsystem.as_str() {
        _ if is_unpopulated => None,
        "usb" | "usb-serial" => Some(SystemPort { usb: usb_device(&device), path }),
        "amba" | "pci" | "pnp" | "platform" | "serial-base" => Some(SystemPort { path, usb: None }),
        _ => None,
    }
}

/// Reads the USB device of an interface from its parent folders.
fn usb_device(interface: &Path) -> Option<UsbDevice> {
    let device = interface.ancestors().find(|folder| folder.join("idVendor").exists())?;
    Some(UsbDevice {
        manufacturer: attribute(device, "manufacturer"),
        product: attribute(device, "product"),
        serial: attribute(device, "serial"),
    })
}

fn attribute(folder: &Path, name: &str) -> Option<String> {
    let text = fs::read_to_string(folder.join(name)).ok()?;
    Some(text.trim().to_owned()).filter(|text| !text.is_empty())
}

fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}
