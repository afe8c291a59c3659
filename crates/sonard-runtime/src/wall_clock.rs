//! Evidence for the correctness of the wall clock.
//!
//! A computer without a battery-backed clock starts at 1970, at the build date of its system, or at
//! the time of its last shutdown, and is set once a time source is reachable. The date alone does
//! not reveal that, so the state follows from the kernel, from systemd-timesyncd, and from files
//! that were written earlier.

use std::{
    fs,
    path::{Path, PathBuf},
    time::SystemTime,
};

use super::platform;

/// Present while systemd-timesyncd has set the clock since the start of the computer.
const SYNCHRONIZED_FILE: &str = "run/systemd/timesync/synchronized";
/// Folder of systemd-timesyncd, present while it runs.
const TIMESYNCD_FOLDER: &str = "run/systemd/timesync";
/// Files whose modification times have passed on every computer: the build date of the system, and
/// the times that systemd-timesyncd and fake-hwclock kept at the last shutdown.
const EARLIER_FILES: [&str; 4] = [
    "usr/lib/clock-epoch",
    "var/lib/systemd/timesync/clock",
    "etc/fake-hwclock.data",
    "proc/self/exe",
];

/// State of the wall clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ClockState {
    /// Synchronised by a time source.
    Synchronized,
    /// Not synchronised since the start of the computer; right if a battery-backed clock is.
    Unsynchronized,
    /// Earlier than a time at which this computer was running or its system was built.
    Behind,
    /// Not determinable: a sandbox hides the kernel's state, and systemd-timesyncd is not in use.
    Unknown,
}

/// Observations from which the [`ClockState`] follows.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ClockEvidence {
    /// Synchronisation as reported by kernel or systemd; `None` if neither is accessible.
    pub is_synchronized: Option<bool>,
    /// Latest time that has certainly passed.
    pub passed: Option<SystemTime>,
}

impl ClockEvidence {
    /// Collects the evidence of this computer.
    #[must_use]
    pub fn collect() -> Self {
        Self::collect_from(Path::new("/"), platform::is_clock_synchronized())
    }

    /// Collects the evidence from the files below `root`. `kernel` is the kernel's report, if
    /// accessible.
    #[must_use]
    pub fn collect_from(root: &Path, kernel: Option<bool>) -> Self {
        let has = |path: &str| root.join(path).exists();
        let is_synchronized = if has(SYNCHRONIZED_FILE) {
            Some(true)
        } else {
            kernel.or_else(|| has(TIMESYNCD_FOLDER).then_some(false))
        };
        let modified = |path: PathBuf| fs::metadata(path).and_then(|file| file.modified()).ok();
        let passed = EARLIER_FILES.iter().filter_map(|path| modified(root.join(path))).max();
        Self { is_synchronized, passed }
    }

    /// State of a wall clock that shows `now`.
    #[must_use]
    pub fn state(&self, now: SystemTime) -> ClockState {
        match self.is_synchronized {
            Some(true) => ClockState::Synchronized,
            _ if self.passed.is_some_and(|passed| now < passed) => ClockState::Behind,
            Some(false) => ClockState::Unsynchronized,
            None => ClockState::Unknown,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::{fs::File, time::Duration};

    use super::*;

    const DAY: Duration = Duration::from_secs(24 * 3600);

    /// Files of a computer, each with its modification time in days since 1970.
    fn computer(files: &[(&str, u32)]) -> tempfile::TempDir {
        let root = tempfile::tempdir().expect("a folder");
        for (path, days) in files {
            let path = root.path().join(path);
            fs::create_dir_all(path.parent().expect("a folder")).expect("created");
            let file = File::create(path).expect("created");
            file.set_modified(SystemTime::UNIX_EPOCH + *days * DAY).expect("set");
        }
        root
    }

    fn state(files: &[(&str, u32)], kernel: Option<bool>, days: u32) -> ClockState {
        let root = computer(files);
        let evidence = ClockEvidence::collect_from(root.path(), kernel);
        evidence.state(SystemTime::UNIX_EPOCH + days * DAY)
    }

    #[test]
    fn clock_without_battery() {
        let built = ("usr/lib/clock-epoch", 20_000);
        // At 1970 before anything restores the time, and at the build date of the system.
        assert_eq!(state(&[built], Some(false), 0), ClockState::Behind);
        assert_eq!(state(&[built], Some(false), 20_000), ClockState::Unsynchronized);
        // The last shutdown is later than the build.
        for kept in ["var/lib/systemd/timesync/clock", "etc/fake-hwclock.data"] {
            let files = [built, (kept, 20_400)];
            assert_eq!(state(&files, Some(false), 20_100), ClockState::Behind, "{kept}");
            assert_eq!(state(&files, Some(false), 20_400), ClockState::Unsynchronized, "{kept}");
            assert_eq!(state(&files, None, 20_100), ClockState::Behind, "{kept}");
        }
    }

    #[test]
    fn synchronised_clock() {
        let synchronized = ("run/systemd/timesync/synchronized", 0);
        for kernel in [None, Some(false), Some(true)] {
            assert_eq!(state(&[synchronized], kernel, 20_000), ClockState::Synchronized);
        }
        // Another time service than systemd's; a file that was modified in the future.
        let future = ("usr/lib/clock-epoch", 30_000);
        assert_eq!(state(&[future], Some(true), 20_000), ClockState::Synchronized);
    }

    #[test]
    fn sandbox_hides_the_kernel() {
        assert_eq!(state(&[], None, 20_000), ClockState::Unknown);
        // systemd-timesyncd runs and has not reached a server.
        let running = ("run/systemd/timesync/other", 0);
        assert_eq!(state(&[running], None, 20_000), ClockState::Unsynchronized);
    }

    #[test]
    fn evidence_of_this_computer() {
        let evidence = ClockEvidence::collect();
        assert!(evidence.passed.is_some(), "the program is a file");
        assert_eq!(
            ClockEvidence { is_synchronized: None, ..evidence }.state(SystemTime::UNIX_EPOCH),
            ClockState::Behind
        );
    }
}
