//! Interference on the port: other programs, changed settings, an adapter that delays bytes.

use std::{
    os::fd::{AsRawFd, OwnedFd},
    path::PathBuf,
};

use rustix::termios::{ControlModes, InputModes, LocalModes, OutputModes, Termios, tcgetattr};

use super::{
    foreign_sender::{ForeignSender, quote},
    report::{Cause, Check},
};
use crate::link::{self, Holders};

/// Port with the settings that this program applied.
pub(super) struct PortMonitor {
    path: PathBuf,
    /// Open port with its settings after opening; `None` if the kernel does not report them.
    settings: Option<(OwnedFd, Termios)>,
}

impl PortMonitor {
    /// Records the settings of a port opened as `line`.
    pub(super) fn new(port: &str, line: &impl AsRawFd) -> Self {
        let settings = link::duplicate(line).ok().and_then(|line| {
            let settings = tcgetattr(&line).ok()?;
            Some((line, settings))
        });
        Self { path: link::device_path(port).unwrap_or_else(|_| port.into()), settings }
    }

    /// Checks whether another program has the port open.
    pub(super) fn check_port(&self) -> Check {
        let holders = link::find_holders(&self.path);
        if let Some(advice) = holders.remedy(&self.path) {
            return port_shared(&holders, advice);
        }
        if link::is_kernel_console(&self.path) {
            return Check::warning(
                "port",
                Cause::LoginPrompt,
                "opened, but the kernel writes its console to this port: its messages go to the board",
                "take `console=` with this port out of the kernel's command line (on a Raspberry Pi: \
                 raspi-config, Interface Options, Serial Port) and reboot",
            );
        }
        match holders.is_partial {
            true => Check::ok(
                "port",
                "opened; not in use by a visible program, but those of other users are hidden",
            ),
            false => Check::ok("port", "opened exclusively"),
        }
    }

    /// Checks the adapter's latency timer, if it has one.
    pub(super) fn check_adapter(&self) -> Option<Check> {
        let latency_ms = link::latency_timer_ms(&self.path)?;
        Some(check_latency(latency_ms, &self.path.to_string_lossy()))
    }

    /// Checks for settings that have changed since opening.
    pub(super) fn check_settings(&self) -> Option<Check> {
        let (line, before) = self.settings.as_ref()?;
        let changes = describe_changes(before, &tcgetattr(line).ok()?)?;
        let holders = link::find_holders(&self.path);
        let who = holders.describe("another program");
        let help = holders.remedy(&self.path).unwrap_or_else(|| {
            "find what changes them (`stty`, a udev rule, a login service) and stop it".into()
        });
        Some(Check::failed(
            "settings",
            Cause::Settings,
            format!("{who} has changed the line's settings: {changes}"),
            help,
        ))
    }

    /// Explains from received and sent bytes why a board did not reply.
    pub(super) fn explain(&self, received: &[u8], sent: &[u8]) -> Option<Check> {
        let holders = link::find_holders(&self.path);
        if let Some(advice) = holders.remedy(&self.path) {
            return Some(Check { check: "board", ..port_shared(&holders, advice) });
        }
        if let Some(check) = self.check_settings() {
            return Some(Check { check: "board", ..check });
        }
        let sender = ForeignSender::classify(received, sent)?;
        let quoted = quote(received, sender);
        let quoted = quoted.map_or_else(String::new, |line| format!(": {line:?}"));
        let detail = format!("{} ({} bytes){quoted}", sender.name(), received.len());
        Some(Check::failed("board", sender.cause(), detail, sender.help()))
    }

    /// Returns `true` if programs hidden from this user may have the port open.
    pub(super) fn may_hide_programs(&self) -> bool {
        link::find_holders(&self.path).is_partial
    }
}

fn port_shared(holders: &Holders, advice: String) -> Check {
    let who = holders.describe("another program");
    Check::failed(
        "port",
        Cause::Busy,
        format!("{who} has it open, too, and may consume the board's replies"),
        advice,
    )
}

/// Checks a latency timer, milliseconds, of the port at `path`.
fn check_latency(latency_ms: u32, path: &str) -> Check {
    let detail = format!("latency timer {latency_ms} ms");
    if latency_ms <= 1 {
        return Check::ok("adapter", detail);
    }
    let name = path.rsplit('/').next().unwrap_or(path);
    let bias_ms = f64::from(latency_ms) / 2.0;
    Check::warning(
        "adapter",
        Cause::Latency,
        format!(
            "{detail}: the adapter delays received bytes by as much, so times in records are up \
             to {bias_ms} ms late; ranges are not affected, because the board times echoes"
        ),
        format!(
            "`echo 1 | sudo tee /sys/class/tty/{name}/device/latency_timer`, and permanently a udev rule: \
             SUBSYSTEM==\"usb-serial\", DRIVER==\"ftdi_sio\", ATTR{{latency_timer}}=\"1\""
        ),
    )
}

/// Describes the settings that differ; `None` if there are none.
fn describe_changes(before: &Termios, now: &Termios) -> Option<String> {
    let mut changes = Vec::new();
    for (name, then, now) in [
        ("receives at", before.input_speed(), now.input_speed()),
        ("sends at", before.output_speed(), now.output_speed()),
    ] {
        if then != now {
            changes.push(format!("{name} {now} instead of {then} bits/s"));
        }
    }
    let mut flag = |name: &str, then: bool, now: bool| {
        if then != now {
            changes.push(format!("{name} {}", if now { "on" } else { "off" }));
        }
    };
    for (name, mode) in [
        ("echo", LocalModes::ECHO),
        ("line editing", LocalModes::ICANON),
        ("signals", LocalModes::ISIG),
    ] {
        flag(name, before.local_modes.contains(mode), now.local_modes.contains(mode));
    }
    for (name, mode) in [
        ("XON/XOFF", InputModes::IXON),
        ("CR to NL", InputModes::ICRNL),
        ("NL to CR", InputModes::INLCR),
        ("stripping to 7 bits", InputModes::ISTRIP),
    ] {
        flag(name, before.input_modes.contains(mode), now.input_modes.contains(mode));
    }
    let output = OutputModes::OPOST;
    flag(
        "output processing",
        before.output_modes.contains(output),
        now.output_modes.contains(output),
    );
    for (name, mode) in [
        ("parity", ControlModes::PARENB),
        ("second stop bit", ControlModes::CSTOPB),
        ("RTS/CTS", ControlModes::CRTSCTS),
        ("receiver", ControlModes::CREAD),
    ] {
        flag(name, before.control_modes.contains(mode), now.control_modes.contains(mode));
    }
    let size = |settings: &Termios| settings.control_modes & ControlModes::CSIZE;
    if size(before) != size(now) {
        changes.push("different number of data bits".into());
    }
    (!changes.is_empty()).then(|| changes.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::link::Pty;

    #[test]
    fn changed_settings() {
        let pty = Pty::open(None).expect("a pty");
        let line = std::fs::File::open(pty.path()).expect("opens");
        let before = tcgetattr(&line).expect("a terminal");
        assert_eq!(describe_changes(&before, &before), None);
        let mut now = before.clone();
        now.set_speed(9600).expect("a rate");
        now.local_modes |= LocalModes::ECHO | LocalModes::ICANON;
        now.control_modes &= !ControlModes::CREAD;
        let changes = describe_changes(&before, &now).expect("changes");
        for part in ["9600", "echo on", "line editing on", "receiver off"] {
            assert!(changes.contains(part), "{changes}");
        }
    }

    #[test]
    fn latency_timer() {
        assert_eq!(check_latency(1, "/dev/ttyUSB0").cause, None);
        let check = check_latency(16, "/dev/ttyUSB0");
        assert_eq!(check.cause, Some(Cause::Latency));
        assert!(check.detail.contains("16 ms") && check.detail.contains("8 ms late"), "{check:?}");
        assert!(check.help.expect("a remedy").contains("/sys/class/tty/ttyUSB0/"));
    }
}
