//! Reopening of a port with a check that it is still the same device.

use tokio_serial::SerialStream;

use super::{
    LinkError, holders::real_path, latency_timer_ms, open_path, ports::PortFolders, resolve,
};

/// Reopens a port and tracks the device that a partial name resolved to.
///
/// A partial name that now matches another device is rejected: opening a board resets it, and its
/// readings would be taken with the settings of the previous device.
#[derive(Debug, Default)]
pub struct PortOpener {
    opened: Option<OpenedPart>,
    /// Name of the last opened device.
    device: Option<String>,
    change: Option<String>,
    /// Latency timer of the last opened port's adapter above 1 ms, milliseconds.
    latency_ms: Option<u32>,
}

/// Partial name and the full name of the device that was opened with it.
#[derive(Debug)]
struct OpenedPart {
    part: String,
    id: String,
}

impl OpenedPart {
    /// # Errors
    /// If the partial name now matches another device.
    fn check(&self, now: Option<&str>) -> Result<(), LinkError> {
        match now.filter(|now| *now != self.id) {
            None => Ok(()),
            Some(now) => Err(LinkError::OtherDevice {
                port: self.part.clone(),
                before: self.id.clone(),
                now: now.to_owned(),
            }),
        }
    }
}

impl PortOpener {
    /// Opens a port as [`open`](super::open) does.
    ///
    /// # Errors
    /// As `open`, and [`LinkError::OtherDevice`].
    pub fn open(&mut self, port: &str) -> Result<SerialStream, LinkError> {
        let before = self.opened.as_ref().filter(|opened| opened.part == port);
        let resolved = resolve(port, before.map(|before| before.id.as_str()))?;
        if let Some(before) = before {
            before.check(resolved.matched_id.as_deref())?;
        }
        let line = open_path(&resolved.path)?;
        let latency_ms = latency_timer_ms(&real_path(&resolved.path)).filter(|&ms| ms > 1);
        if let Some(ms) = latency_ms.filter(|_| latency_ms != self.latency_ms) {
            tracing::warn!(
                "the USB adapter of {port} has a latency timer of {ms} ms: times in records are up to \
                 {} ms late; `sonard doctor` suggests a remedy",
                f64::from(ms) / 2.0
            );
        }
        self.latency_ms = latency_ms;
        let opened = resolved.matched_id.map(|id| OpenedPart { part: port.to_owned(), id });
        if let Some(opened) = opened.as_ref().filter(|_| before.is_none()) {
            tracing::info!("{port:?} is {}", opened.id);
        }
        self.opened = opened;
        let device = PortFolders::system().device_name(&resolved.path);
        self.note_device(port, device);
        Ok(line)
    }

    /// Latency timer of the last opened port's USB adapter, milliseconds; `None` without one, or up
    /// to 1 ms.
    #[must_use]
    pub const fn latency_timer_ms(&self) -> Option<u32> {
        self.latency_ms
    }

    /// Takes the description of a change of the device since the previous opening, if any.
    pub fn take_change(&mut self) -> Option<String> {
        self.change.take()
    }

    fn note_device(&mut self, port: &str, now: Option<String>) {
        let Some(now) = now else { return };
        if let Some(before) = self.device.as_ref().filter(|before| **before != now) {
            self.change = Some(format!("{port} is {now} now, and was {before} before"));
        }
        self.device = Some(now);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn partial_name_keeps_its_device() {
        let opened = OpenedPart { part: "Arduino".into(), id: "usb-Arduino_Uno_AAAA-if00".into() };
        assert!(opened.check(Some("usb-Arduino_Uno_AAAA-if00")).is_ok());
        assert!(opened.check(None).is_ok(), "an exact name was given");
        let error = opened.check(Some("usb-Arduino_Uno_BBBB-if00")).expect_err("another device");
        let text = format!("{error}; {}", error.help());
        assert!(
            text.contains("_AAAA-if00, which is gone, and now matches usb-Arduino_Uno_BBBB"),
            "{text}"
        );
        assert!(text.contains("not opened"), "{text}");
    }

    #[test]
    fn device_change_is_reported_once() {
        let mut opener = PortOpener::default();
        for (device, change) in [
            (Some("usb-Uno_AAAA"), None),
            (Some("usb-Uno_AAAA"), None),
            (None, None),
            (
                Some("usb-Uno_BBBB"),
                Some("/dev/ttyACM0 is usb-Uno_BBBB now, and was usb-Uno_AAAA before"),
            ),
            (Some("usb-Uno_BBBB"), None),
        ] {
            opener.note_device("/dev/ttyACM0", device.map(str::to_owned));
            assert_eq!(opener.take_change().as_deref(), change, "{device:?}");
        }
    }

    #[tokio::test]
    async fn path_may_change_its_device() {
        let mut opener = PortOpener::default();
        for _ in 0..2 {
            let pty = crate::link::Pty::open(None).expect("a pty");
            opener.open(pty.path().to_str().expect("plain path")).expect("it opens");
        }
        let error = opener.open("no-such-board").expect_err("there is none");
        assert!(error.to_string().contains("no-such-board"), "{error}");
    }
}
