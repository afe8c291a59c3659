//! Driver settings of a port that interfere with the protocol.

use std::{fs, path::Path};

/// Latency timer of the USB adapter behind a device node, milliseconds; `None` without one.
///
/// FTDI adapters send a short answer to the computer when this timer expires (Application Note
/// AN232B-04).
#[must_use]
pub fn latency_timer_ms(device: &Path) -> Option<u32> {
    read_timer(Path::new("/sys/class/tty"), device)
}

/// Returns `true` if the port is a kernel console, as a Raspberry Pi's UART is by default.
#[must_use]
pub fn is_kernel_console(device: &Path) -> bool {
    let active = fs::read_to_string("/sys/class/tty/console/active").unwrap_or_default();
    names_console(&active, device)
}

fn names_console(active: &str, device: &Path) -> bool {
    let name = device.file_name().and_then(|name| name.to_str());
    name.is_some_and(|name| active.split_whitespace().any(|console| console == name))
}

fn read_timer(terminals: &Path, device: &Path) -> Option<u32> {
    let file = terminals.join(device.file_name()?).join("device/latency_timer");
    fs::read_to_string(file).ok()?.trim().parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn consoles_are_compared_by_name() {
        for (active, is_console) in
            [("tty0 ttyAMA0\n", true), ("ttyAMA0", true), ("ttyAMA01 tty0", false), ("", false)]
        {
            assert_eq!(names_console(active, Path::new("/dev/ttyAMA0")), is_console, "{active}");
        }
    }

    #[test]
    fn timer_of_the_port_is_read() {
        let folder = tempfile::tempdir().expect("a folder");
        let device = folder.path().join("ttyUSB0/device");
        fs::create_dir_all(&device).expect("a folder");
        let read = || read_timer(folder.path(), Path::new("/dev/ttyUSB0"));
        assert_eq!(read(), None);
        for (text, timer) in [("16\n", Some(16)), ("1\n", Some(1)), ("", None), ("fast\n", None)] {
            fs::write(device.join("latency_timer"), text).expect("a file");
            assert_eq!(read(), timer, "{text:?}");
        }
    }
}
