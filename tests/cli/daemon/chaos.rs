//! Faults of the host, the disk, the line and the clients at random, one or two at a time.
//!
//! `SONARD_CHAOS_S=3600 SONARD_CHAOS_EVERY_S=20 cargo test --test cli daemon::chaos -- --nocapture` runs for an hour.

use std::{
    collections::{BTreeMap, HashSet},
    env, fs,
    io::{self, BufRead as _, BufReader, Write as _},
    os::unix::net::UnixStream,
    path::{Path, PathBuf},
    sync::{
        Arc, Mutex,
        atomic::{AtomicBool, Ordering},
    },
    time::{Duration, Instant},
};

use rand::{RngExt as _, SeedableRng as _, seq::IndexedRandom as _};
use rustix::process::Signal;
use serde_json::Value;
use sonard::{link::Pty, mock::Pace};

use super::{
    Daemon,
    disk::on_faulty_disk,
    logs,
    rig::{Rig, limit_files},
};
use crate::common::{run, sonard, wait_until, without_terminal};

/// A fault that begins and ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Fault {
    Unplugged,
    SilentDevice,
    NoisyLine,
    LogRemoved,
    LogTruncated,
    LogRenamed,
    FolderMoved,
    SyncFails,
    SyncHangs,
    DiskFull,
    Reload,
    ClientFlood,
    Suspended,
}

const FAULTS: [Fault; 13] = [
    Fault::Unplugged,
    Fault::SilentDevice,
    Fault::NoisyLine,
    Fault::LogRemoved,
    Fault::LogTruncated,
    Fault::LogRenamed,
    Fault::FolderMoved,
    Fault::SyncFails,
    Fault::SyncHangs,
    Fault::DiskFull,
    Fault::Reload,
    Fault::ClientFlood,
    Fault::Suspended,
];

/// Readings that a live client received: scan and beam.
type Received = Arc<Mutex<HashSet<(String, u64)>>>;

struct Chaos {
    folder: PathBuf,
    rig: Rig,
    daemon: Daemon,
    /// Renamed logs and moved folders.
    moved: Vec<PathBuf>,
    /// Copies of removed and truncated logs.
    copies: Vec<PathBuf>,
    silent: Option<Pty>,
    clients: Vec<UnixStream>,
    seed: u64,
}

impl Chaos {
    fn begin(&mut self, fault: Fault) {
        let faults = self.folder.join("faults");
        match fault {
            Fault::Unplugged => self.rig.unplug(),
            Fault::SilentDevice => self.silent = Some(self.rig.plug_silent()),
            Fault::NoisyLine => {
                self.rig.plug("flip=0.001,drop=0.001,double=0.001,reset=0.01", self.seed);
            }
            Fault::LogRemoved => self.with_copy(|log| fs::remove_file(log)),
            Fault::LogTruncated => self.with_copy(|log| fs::write(log, "")),
            Fault::LogRenamed => {
                let Some(log) = self.newest_log() else { return };
                self.take(&log, ".jsonl");
            }
            Fault::FolderMoved => self.take(&self.folder.join("log"), ""),
            Fault::SyncFails => fs::write(faults.join("eio"), "").expect("there is room"),
            Fault::SyncHangs => fs::write(faults.join("slow"), "").expect("there is room"),
            Fault::DiskFull => limit_files(self.daemon.id(), Some(1)),
            Fault::Reload => self.daemon.signal(Signal::HUP),
            Fault::ClientFlood => {
                for _ in 0..200 {
                    let Ok(mut client) = self.daemon.connect() else { break };
                    let request = b"GET /v1/live/records HTTP/1.1\r\nHost: localhost\r\n\r\n";
                    drop(client.write_all(request));
                    self.clients.push(client);
                }
            }
            Fault::Suspended => self.daemon.signal(Signal::STOP),
        }
    }

    fn end(&mut self, fault: Fault) {
        let faults = self.folder.join("faults");
        self.seed += 1;
        match fault {
            Fault::Unplugged | Fault::NoisyLine => self.rig.plug("", self.seed),
            Fault::SilentDevice => {
                self.silent = None;
                self.rig.plug("", self.seed);
            }
            Fault::SyncFails => drop(fs::remove_file(faults.join("eio"))),
            Fault::SyncHangs => drop(fs::remove_file(faults.join("slow"))),
            Fault::DiskFull => limit_files(self.daemon.id(), None),
            Fault::ClientFlood => self.clients.clear(),
            Fault::Suspended => self.daemon.signal(Signal::CONT),
            Fault::LogRemoved
            | Fault::LogTruncated
            | Fault::LogRenamed
            | Fault::FolderMoved
            | Fault::Reload => {}
        }
    }

    /// Copies the newest log and acts on it. Nothing is written in between.
    fn with_copy(&mut self, act: impl FnOnce(&Path) -> io::Result<()>) {
        self.daemon.signal(Signal::STOP);
        std::thread::sleep(Duration::from_millis(50));
        if let Some(log) = self.newest_log() {
            let copy = self.folder.join(format!("copy-{}.jsonl", self.copies.len()));
            fs::copy(&log, &copy).expect("there is room");
            act(&log).expect("it is there");
            self.copies.push(copy);
        }
        self.daemon.signal(Signal::CONT);
    }

    fn newest_log(&self) -> Option<PathBuf> {
        // The folder is missing until a log is written after an earlier fault.
        if self.folder.join("log").is_dir() { logs(&self.folder).pop() } else { None }
    }

    /// Renames a log or its folder.
    fn take(&mut self, path: &Path, extension: &str) {
        let moved = self.folder.join(format!("moved-{}{extension}", self.moved.len()));
        if fs::rename(path, &moved).is_ok() {
            self.moved.push(moved);
        }
    }

    /// Logs that the daemon wrote, wherever they are now.
    fn written_logs(&self) -> Vec<PathBuf> {
        let mut all = logs(&self.folder);
        for moved in &self.moved {
            match fs::read_dir(moved) {
                Ok(entries) => all.extend(
                    entries.flatten().map(|entry| entry.path()).filter(|path| is_log(path)),
                ),
                Err(_) => all.push(moved.clone()),
            }
        }
        all
    }
}

fn is_log(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension == "jsonl")
}

fn seconds(variable: &str, default: u64) -> Duration {
    let value = env::var(variable).ok().and_then(|value| value.parse().ok());
    Duration::from_secs(value.unwrap_or(default))
}

/// Faults of one kind of resource exclude each other.
fn conflict(one: Fault, other: Fault) -> bool {
    let kind = |fault| match fault {
        Fault::Unplugged | Fault::SilentDevice | Fault::NoisyLine => 0,
        Fault::LogRemoved
        | Fault::LogTruncated
        | Fault::LogRenamed
        | Fault::FolderMoved
        | Fault::SyncFails
        | Fault::SyncHangs
        | Fault::DiskFull => 1,
        Fault::Reload => 2,
        Fault::ClientFlood => 3,
        // Nothing else can be done to a process that does not run.
        Fault::Suspended => 4,
    };
    kind(one) == kind(other) || one == Fault::Suspended || other == Fault::Suspended
}

/// Follows the live records, reconnecting whenever the connection ends.
fn follow(socket: &Path, received: &Received, is_over: &AtomicBool) {
    while !is_over.load(Ordering::Relaxed) {
        let Ok(mut stream) = UnixStream::connect(socket) else {
            std::thread::sleep(Duration::from_millis(20));
            continue;
        };
        drop(stream.set_read_timeout(Some(Duration::from_secs(5))));
        // Without chunks, each line is a record.
        drop(stream.write_all(b"GET /v1/live/records HTTP/1.0\r\nHost: localhost\r\n\r\n"));
        for line in BufReader::new(stream).lines().map_while(Result::ok) {
            if !line.starts_with("{\"type\":\"ping\"") {
                continue;
            }
            let ping: Value = serde_json::from_str(&line).expect("a record");
            let scan = ping["scan"].as_str().expect("a scan").to_owned();
            let index = ping["index"].as_u64().expect("an index");
            received.lock().expect("no panic").insert((scan, index));
        }
    }
}

#[test]
fn random_faults_lose_no_reading() {
    let (length, every) = (seconds("SONARD_CHAOS_S", 45), seconds("SONARD_CHAOS_EVERY_S", 5));
    let folder = tempfile::tempdir().expect("a folder");
    let mut rig = Rig::new(folder.path(), Pace::RealTime);
    rig.plug("", 1);
    let options = rig.options();
    let mut options: Vec<&str> = options.iter().map(String::as_str).collect();
    for setting in
        ["scanning.mode=continuous", "plan.step_deg=9", "log.sync_s=0.5", "log.rotate_mb=0.2"]
    {
        options.extend(["--set", setting]);
    }
    let command = on_faulty_disk(without_terminal(sonard(&[])), &folder.path().join("faults"));
    let daemon = Daemon::start_as(command, folder.path(), &options);
    daemon.wait_for_scans(1);
    let (received, is_over) = (Received::default(), Arc::new(AtomicBool::new(false)));
    let follower = {
        let (received, is_over) = (Arc::clone(&received), Arc::clone(&is_over));
        let socket = folder.path().join("s");
        std::thread::spawn(move || follow(&socket, &received, &is_over))
    };
    let mut chaos = Chaos {
        folder: folder.path().into(),
        rig,
        daemon,
        moved: Vec::new(),
        copies: Vec::new(),
        silent: None,
        clients: Vec::new(),
        seed: 2,
    };
    let mut random = rand_pcg::Pcg32::seed_from_u64(6500);
    let mut tally: BTreeMap<Fault, u32> = BTreeMap::new();
    let began = Instant::now();
    while began.elapsed() < length {
        let next = Instant::now() + every;
        let first = *FAULTS.choose(&mut random).expect("some");
        let second = FAULTS
            .choose(&mut random)
            .copied()
            .filter(|second| random.random_bool(0.4) && !conflict(first, *second));
        let faults: Vec<Fault> = [Some(first), second].into_iter().flatten().collect();
        println!("{:>5.0} s  {faults:?}", began.elapsed().as_secs_f64());
        for &fault in &faults {
            chaos.begin(fault);
            *tally.entry(fault).or_default() += 1;
        }
        std::thread::sleep(every.mul_f64(random.random_range(0.1..0.6)));
        faults.iter().for_each(|&fault| chaos.end(fault));
        std::thread::sleep(next.saturating_duration_since(Instant::now()));
    }
    let scans = |daemon: &Daemon| daemon.health()["scans"]["completed"].as_u64();
    wait_until("health", || chaos.daemon.status()["log"]["error"].is_null());
    let before = scans(&chaos.daemon);
    wait_until("scans", || scans(&chaos.daemon) > before);
    is_over.store(true, Ordering::Relaxed);
    chaos.daemon.signal(Signal::TERM);
    let code = chaos.daemon.wait();
    assert_eq!(code, Some(0), "{}", chaos.daemon.messages());
    follower.join().expect("no panic");
    let messages = chaos.daemon.messages();
    assert!(!messages.contains("panicked") && !messages.contains("internal error"), "{messages}");
    let (mut logged, mut lines, mut repeated) = (HashSet::new(), HashSet::new(), 0);
    let copies = chaos.copies.iter().map(|copy| (copy.clone(), true));
    let written = chaos.written_logs().into_iter().map(|log| (log, false));
    for (log, is_copy) in copies.chain(written) {
        // While no log can be written, the newest one that a fault truncates was closed before.
        if fs::metadata(&log).is_ok_and(|log| log.len() == 0) {
            continue;
        }
        let verified = run(&["log", "verify", log.to_str().expect("plain path")]);
        let found = String::from_utf8_lossy(&verified.stdout).into_owned();
        assert_eq!(verified.status.code(), Some(0), "{}: {found}", log.display());
        for line in fs::read_to_string(&log).expect("readable").lines() {
            let record: Value = serde_json::from_str(line).expect("a record");
            if record["type"] == "ping" {
                let scan = record["scan"].as_str().expect("a scan").to_owned();
                logged.insert((scan, record["index"].as_u64().expect("an index")));
                repeated += u64::from(!is_copy && !lines.insert(line.to_owned()));
            }
        }
    }
    let received = received.lock().expect("no panic");
    let lost = received.difference(&logged).count();
    println!(
        "{tally:?} in {:.0} s; {} readings received live, {lost} of them not logged, {repeated} logged \
         twice",
        began.elapsed().as_secs_f64(),
        received.len()
    );
    assert!(received.len() > 100, "the follower received nothing");
    assert_eq!((lost, repeated), (0, 0), "{messages}");
}
