//! USB adapters that hold received bytes back.

use std::{fs, path::Path};

/// Latency timer of the USB adapter behind a device node, milliseconds; `None` without one.
///
/// FTDI adapters send a short answer to the computer when this timer expires (Application Note
/// AN232B-04).
#[must_use]
pub fn latency_timer_ms(device: &Path) -> Option<u32> {
    read_timer(Path::new("/sys/class/tty"), device)
}

fn read_timer(terminals: &Path, device: &Path) -> Option<u32> {
    let file = terminals.join(device.file_name()?).join("device/latency_timer");
    fs::read_to_string(file).ok()?.trim().parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

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
