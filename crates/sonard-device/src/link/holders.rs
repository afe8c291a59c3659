//! Programs that have a port open, from `/proc`.

use std::{
    ffi::OsStr,
    fs, io,
    os::unix::fs::MetadataExt as _,
    path::{Path, PathBuf},
};

use crate::platform::pseudo_terminal_index;

/// Maximum displayed length of a command line, characters.
const MAX_COMMAND_CHARS: usize = 60;

/// Process that has a port open.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Holder {
    /// Process id of the holder.
    pub pid: u32,
    /// Command line, truncated to 60 characters.
    pub command: String,
    /// Name of the program.
    program: String,
}

/// Processes that have a port open, except for this one.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Holders {
    /// Processes visible to this user.
    pub found: Vec<Holder>,
    /// `true` if further processes may exist whose files are not visible to this user.
    pub is_partial: bool,
}

/// Looks up the processes that have the port at `path` open, as far as visible to this user.
///
/// A process that acts as the device at the master of a pseudo-terminal is not listed.
#[must_use]
pub fn find_holders(path: &Path) -> Holders {
    let Some(port) = PortNode::at(path) else { return Holders::default() };
    let Ok(processes) = fs::read_dir("/proc") else {
        return Holders { is_partial: true, ..Holders::default() };
    };
    let own = std::process::id();
    let mut holders = Holders { is_partial: hides_processes(), ..Holders::default() };
    for process in processes.flatten() {
        let Some(pid) = process.file_name().to_str().and_then(|name| name.parse().ok()) else {
            continue;
        };
        if pid == own {
            continue;
        }
        match port.is_held_by(&process.path()) {
            Ok(true) => holders.found.push(Holder::read(pid, &process.path())),
            Ok(false) => {}
            // The process has ended meanwhile.
            Err(error) if error.kind() == io::ErrorKind::NotFound => {}
            Err(_) => holders.is_partial = true,
        }
    }
    holders.found.sort_by_key(|holder| holder.pid);
    holders
}

/// Returns `true` if `/proc` is mounted with `hidepid`, without the processes of other users.
fn hides_processes() -> bool {
    !Path::new("/proc/1/stat").exists()
}

impl Holders {
    /// Lists commands and process ids; returns `unknown` if there are none.
    #[must_use]
    pub fn describe(&self, unknown: &str) -> String {
        if self.found.is_empty() {
            return unknown.to_owned();
        }
        let names =
            self.found.iter().map(|Holder { pid, command, .. }| format!("`{command}` (pid {pid})"));
        names.collect::<Vec<_>>().join(", ")
    }

    /// Suffix of an error message: a colon and the list of holders; empty if there are none.
    pub(super) fn suffix(&self) -> String {
        if self.found.is_empty() { String::new() } else { format!(": {}", self.describe("")) }
    }

    /// Suggests a remedy for each holder; `None` if there are none.
    #[must_use]
    pub fn remedy(&self, port: &Path) -> Option<String> {
        let mut advice: Vec<String> = self.found.iter().map(|holder| holder.advice(port)).collect();
        advice.dedup();
        (!advice.is_empty()).then(|| advice.join("; "))
    }
}

impl Holder {
    fn read(pid: u32, process: &Path) -> Self {
        let read = |name| fs::read(process.join(name)).unwrap_or_default();
        let printable = |bytes: &[u8]| {
            let text = String::from_utf8_lossy(bytes).replace(|c: char| c.is_control(), " ");
            text.trim().to_owned()
        };
        let program = printable(&read("comm"));
        let mut command = printable(&read("cmdline"));
        if command.is_empty() {
            command.clone_from(&program);
        }
        if let Some((end, _)) = command.char_indices().nth(MAX_COMMAND_CHARS) {
            command.truncate(end);
            command.push_str("...");
        }
        Self { pid, command, program }
    }

    fn advice(&self, port: &Path) -> String {
        let name = port.file_name().unwrap_or_default().to_string_lossy();
        match self.program.as_str() {
            "agetty" | "getty" | "login" | "mgetty" => format!(
                "the system offers a login on this port: `sudo systemctl disable --now \
                 serial-getty@{name}.service`"
            ),
            "ModemManager" => "ModemManager looks for modems on serial ports: install \
                               systemd/60-sonard.rules, which excludes the board, or `sudo systemctl \
                               stop ModemManager`"
                .into(),
            "brltty" => "brltty takes CH340 adapters for braille displays: `sudo systemctl disable \
                         --now brltty`"
                .into(),
            "sonard" => format!(
                "a running daemon owns its port: let it take scans (`sonard scan --daemon`), or stop \
                 it (pid {})",
                self.pid
            ),
            _ => format!("stop it (`kill {}`), and let only one program use the port", self.pid),
        }
    }
}

/// Identity of a device node among open files.
struct PortNode {
    device: u64,
    /// File system and number of a pseudo-terminal: every devpts instance numbers its terminals
    /// from 0.
    devpts: Option<(u64, u32)>,
}

impl PortNode {
    fn at(path: &Path) -> Option<Self> {
        let metadata = fs::metadata(path).ok()?;
        let device = metadata.rdev();
        let index = pseudo_terminal_index(device);
        Some(Self { device, devpts: index.map(|index| (metadata.dev(), index)) })
    }

    /// # Errors
    /// If the process has ended, or its files can't be examined.
    fn is_held_by(&self, process: &Path) -> io::Result<bool> {
        let mut is_held = false;
        for file in fs::read_dir(process.join("fd"))?.flatten() {
            // Only device nodes are examined: a stat on an unreachable network share would block.
            let Ok(target) = fs::read_link(file.path()) else { continue };
            if self.is_other_end(process, &file.file_name(), &target)? {
                return Ok(false);
            }
            is_held |= is_device_path(&target)
                && fs::metadata(file.path()).is_ok_and(|metadata| {
                    metadata.rdev() == self.device
                        && self.devpts.is_none_or(|(devpts, _)| devpts == metadata.dev())
                });
        }
        Ok(is_held)
    }

    /// Returns `true` for the master of the pseudo-terminal.
    fn is_other_end(&self, process: &Path, file: &OsStr, target: &Path) -> io::Result<bool> {
        let Some((_, own)) = self.devpts else { return Ok(false) };
        if target.file_name().is_none_or(|name| name != "ptmx") {
            return Ok(false);
        }
        let info = fs::read_to_string(process.join("fdinfo").join(file))?;
        let index = info.lines().find_map(|line| line.strip_prefix("tty-index:"));
        Ok(index.and_then(|index| index.trim().parse().ok()) == Some(own))
    }
}

fn is_device_path(target: &Path) -> bool {
    target.is_absolute() && target.components().any(|part| part.as_os_str() == "dev")
}

/// Canonical path without symbolic links, as used by `/proc` and sysfs.
pub(super) fn real_path(path: &Path) -> PathBuf {
    fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf())
}

#[cfg(test)]
mod tests {
    use std::{
        io::Read as _,
        process::{Child, Command, Stdio},
    };

    use super::*;
    use crate::link::Pty;

    fn wait_for_output(child: &mut Child) {
        let output = child.stdout.as_mut().expect("is piped");
        output.read_exact(&mut [0]).expect("the program writes a byte");
    }

    #[test]
    fn holder_is_named_until_it_ends() {
        let pty = Pty::open(None).expect("a pty");
        assert_eq!(find_holders(pty.path()).found, [], "the device's own end is no holder");
        let file = fs::File::open(pty.path()).expect("opens");
        // `spawn` returns before the kernel has set the new command line; the first byte of the
        // output is written after that.
        let mut child = Command::new("sh")
            .args(["-c", "echo; read line"])
            .stdin(file)
            .stdout(Stdio::piped())
            .spawn()
            .expect("starts");
        wait_for_output(&mut child);
        let holders = find_holders(pty.path());
        child.kill().expect("it runs");
        child.wait().expect("it ends");
        let described = holders.describe("none");
        assert_eq!(described, format!("`sh -c echo; read line` (pid {})", child.id()));
        let advice = holders.remedy(pty.path()).expect("a remedy");
        assert!(advice.contains(&format!("kill {}", child.id())), "{advice}");
        assert_eq!(find_holders(pty.path()).found, []);
    }

    #[test]
    fn process_at_the_master_is_the_device() {
        let pty = Pty::open(None).expect("a pty");
        let path = pty.path().to_path_buf();
        let device = "import os,sys,time; os.open(sys.argv[1], os.O_RDWR); print(flush=True); time.sleep(60)";
        let master = rustix::io::dup(&pty).expect("a descriptor");
        let mut child = Command::new("python3")
            .args(["-c", device, path.to_str().expect("plain path")])
            .stdin(Stdio::from(master))
            .stdout(Stdio::piped())
            .spawn()
            .expect("starts");
        wait_for_output(&mut child);
        let found = find_holders(&path).found;
        child.kill().expect("it runs");
        child.wait().expect("it ends");
        assert_eq!(found, []);
    }

    #[test]
    fn advice_depends_on_the_program() {
        let port = Path::new("/dev/ttyAMA0");
        for (program, remedy) in [
            ("agetty", "serial-getty@ttyAMA0"),
            ("ModemManager", "60-sonard.rules"),
            ("sonard", "--daemon"),
            ("minicom", "kill 7"),
        ] {
            let holder = Holder { pid: 7, command: program.into(), program: program.into() };
            assert!(holder.advice(port).contains(remedy), "{program}");
        }
        assert_eq!(Holders::default().remedy(port), None);
        assert_eq!(Holders::default().describe("another program"), "another program");
    }
}
