//! Facts about this computer: kernel, user, serial ports, messages.

use std::{
    env,
    fmt::Write as _,
    fs::{self, OpenOptions},
    io::Read as _,
    os::unix::fs::{MetadataExt as _, OpenOptionsExt as _},
    path::Path,
    process::{Command, Stdio},
};

use rustix::{
    fs::OFlags,
    process::{getegid, geteuid, getgroups},
};

use crate::link::{self, SerialPortInfo, latency_timer_ms};

/// Words of kernel messages about serial ports.
const SUBJECTS: [&str; 8] = ["tty", "usb", "cdc_acm", "ch341", "cp210", "ftdi", "pl2303", "sonard"];
/// Maximum number of messages of kernel and units.
const MAX_MESSAGES: usize = 300;

/// Kernel, distribution, memory, uptime, user, and the variables that change the program.
pub(super) fn describe() -> String {
    let uname = rustix::system::uname();
    let text = |part: &std::ffi::CStr| part.to_string_lossy().into_owned();
    let mut described = format!(
        "{} {} {} {}\n",
        text(uname.sysname()),
        text(uname.release()),
        text(uname.version()),
        text(uname.machine())
    );
    for (file, prefixes) in [
        ("/etc/os-release", &["PRETTY_NAME="][..]),
        ("/proc/meminfo", &["MemTotal:", "MemAvailable:"]),
        ("/proc/uptime", &[""]),
        ("/proc/loadavg", &[""]),
        ("/proc/device-tree/model", &[""]),
        ("/proc/self/limits", &["Max open files"]),
    ] {
        let contents = fs::read(file).unwrap_or_default();
        let contents = String::from_utf8_lossy(&contents).replace('\0', "");
        let is_wanted = |line: &&str| prefixes.iter().any(|prefix| line.starts_with(prefix));
        for line in contents.lines().filter(is_wanted) {
            // Writing to a string never fails.
            let _ = writeln!(described, "{file}: {line}");
        }
    }
    let groups: Vec<u32> =
        getgroups().unwrap_or_default().into_iter().map(rustix::process::Gid::as_raw).collect();
    let (user, group) = (geteuid().as_raw(), getegid().as_raw());
    let _ = writeln!(described, "user {user}, group {group}, groups {groups:?}");
    let mut names: Vec<_> = env::vars_os()
        .filter_map(|(name, _)| name.into_string().ok())
        .filter(|name| name.starts_with("SONARD_"))
        .collect();
    names.sort();
    let _ = writeln!(
        described,
        "variables set: {}",
        if names.is_empty() { "none".into() } else { names.join(", ") }
    );
    described
}

/// Serial ports with their rights, their users and the latency of their adapters; none is opened.
pub(super) fn ports() -> String {
    let candidates = match link::list_ports() {
        Ok(candidates) => candidates,
        Err(error) => return format!("{error}\n"),
    };
    if candidates.is_empty() {
        return "no serial port\n".to_owned();
    }
    let mut described = String::new();
    for SerialPortInfo { port, id, usb } in candidates {
        let path = Path::new(&port);
        let _ = writeln!(described, "{port}");
        let _ = writeln!(described, "  stable name: {}", id.as_deref().unwrap_or("none"));
        let _ = writeln!(described, "  USB: {}", usb.as_deref().unwrap_or("no"));
        match fs::metadata(path) {
            Ok(node) => {
                let (mode, owner, group) = (node.mode() & 0o7777, node.uid(), node.gid());
                let _ = writeln!(described, "  rights: {mode:o}, owner {owner}, group {group}");
            }
            Err(error) => {
                let _ = writeln!(described, "  rights: {error}");
            }
        }
        let users = link::find_holders(path).describe("none visible to this user");
        let _ = writeln!(described, "  open in: {users}");
        if let Some(latency_ms) = latency_timer_ms(path) {
            let _ = writeln!(described, "  latency timer: {latency_ms} ms");
        }
    }
    described
}

/// Last kernel messages about USB and serial ports.
pub(super) fn kernel_messages() -> String {
    let nonblocking = OFlags::NONBLOCK.bits().cast_signed();
    let opened = OpenOptions::new().read(true).custom_flags(nonblocking).open("/dev/kmsg");
    let mut log = match opened {
        Ok(log) => log,
        Err(error) => return format!("/dev/kmsg: {error}; `sudo dmesg` prints the messages\n"),
    };
    let (mut messages, mut record) = (Vec::new(), [0; 8192]);
    // Each read returns one record; the last one fails, because further ones would be waited for.
    while let Ok(count @ 1..) = log.read(&mut record) {
        let record = String::from_utf8_lossy(&record[..count]);
        let (head, message) = record.split_once(';').unwrap_or(("", &record));
        let message = message.lines().next().unwrap_or_default();
        let lower = message.to_lowercase();
        if SUBJECTS.iter().any(|subject| lower.contains(subject)) {
            let time_us: f64 = head.split(',').nth(2).and_then(|us| us.parse().ok()).unwrap_or(0.0);
            messages.push(format!("[{:12.6}] {message}\n", time_us / 1e6));
        }
    }
    match messages.len() {
        0 => "no message about USB or serial ports\n".to_owned(),
        count => messages.split_off(count.saturating_sub(MAX_MESSAGES)).concat(),
    }
}

/// Last messages of the daemon's systemd units.
pub(super) fn messages() -> String {
    let output = Command::new("journalctl")
        .args(["--no-pager", "--quiet", "--output=short-iso", "--unit=sonard*"])
        .arg(format!("--lines={MAX_MESSAGES}"))
        .stdin(Stdio::null())
        .output();
    match output {
        Ok(output) if output.status.success() && !output.stdout.is_empty() => {
            String::from_utf8_lossy(&output.stdout).into_owned()
        }
        Ok(output) if output.status.success() => "no messages of a unit sonard*\n".to_owned(),
        Ok(output) => format!("journalctl: {}\n", String::from_utf8_lossy(&output.stderr).trim()),
        Err(error) => format!("journalctl: {error}\n"),
    }
}
