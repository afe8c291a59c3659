//! Faults of every kind, one after the other, at a daemon that is never restarted.
//!
//! `SONARD_SOAK_FAULTS=1000 cargo test --release --test cli daemon::soak -- --nocapture` for more.

use std::{
    collections::{BTreeMap, HashSet},
    env,
    time::{Duration, Instant},
};

use rand::{RngExt as _, SeedableRng as _};
use sonard::mock::Pace;

use super::{
    Daemon, clean_log, logs,
    rig::{Rig, limit_files},
};
use crate::common::{Log, wait_until};

#[test]
fn recovers_and_logs_each_beam() {
    let wanted = env::var("SONARD_SOAK_FAULTS").ok().and_then(|n| n.parse().ok()).unwrap_or(60);
    let folder = tempfile::tempdir().expect("a folder");
    let mut rig = Rig::new(folder.path(), Pace::Virtual);
    rig.plug("", 1);
    let mut options = rig.options();
    for setting in [
        "scanning.mode=continuous",
        "plan.to_deg=90",
        "server.write_timeout_s=1",
        "log.rotate_mb=2",
    ] {
        options.extend(["--set".to_owned(), setting.to_owned()]);
    }
    let options: Vec<&str> = options.iter().map(String::as_str).collect();
    let daemon = Daemon::start(folder.path(), &options);
    daemon.wait_for_scans(3);
    let mut random = rand_pcg::Pcg32::seed_from_u64(6500);
    let mut tally: BTreeMap<&str, u64> = BTreeMap::new();
    let began = Instant::now();
    let mut dead_subscribers = Vec::new();
    let mut injected = 0;
    while injected + rig.played() < wanted {
        let kind = random.random_range(0..8);
        let seed = random.random_range(1..1_000_000);
        let hold = Duration::from_millis(random.random_range(20..400));
        let name = inject(&mut rig, &daemon, kind, seed, hold, &mut dead_subscribers);
        *tally.entry(name).or_default() += 1;
        injected += 1;
        let before = daemon.health()["scans"]["completed"].as_u64().expect("a count");
        wait_until("recovery", || daemon.health()["scans"]["completed"].as_u64() > Some(before));
    }
    rig.plug("", 7);
    daemon.wait_for_scans(1);
    dead_subscribers.clear();
    let health = daemon.health();
    println!(
        "{} faults in {:.0} s, all recovered: {tally:?}, {} played by boards; {}",
        injected + rig.played(),
        began.elapsed().as_secs_f64(),
        rig.played(),
        health["scans"],
    );
    assert_eq!(daemon.stop(), Some(0));
    check(&clean_log(folder.path()), health["scans"]["completed"].as_u64().expect("a count"));
    assert!(!logs(folder.path()).is_empty());
}

/// Injects one fault for a while and ends it; returns its name.
fn inject(
    rig: &mut Rig,
    daemon: &Daemon,
    kind: u32,
    seed: u64,
    hold: Duration,
    dead: &mut Vec<std::os::unix::net::UnixStream>,
) -> &'static str {
    let name = match kind {
        0 => {
            rig.unplug();
            std::thread::sleep(hold);
            "unplug"
        }
        1 => {
            let busy = rig.plug_busy();
            std::thread::sleep(hold);
            drop(busy);
            "busy"
        }
        2 => {
            let silent = rig.plug_silent();
            std::thread::sleep(hold * 2);
            drop(silent);
            "hang"
        }
        3 => {
            rig.plug("version=9", seed);
            std::thread::sleep(hold);
            "wrong firmware"
        }
        4 => {
            rig.plug("reset=0.02,hangup=0.002", seed);
            std::thread::sleep(hold);
            return "reset";
        }
        5 => {
            rig.plug("flip=0.001,drop=0.001,double=0.001,stall=0.002,stall_ms=60", seed);
            std::thread::sleep(hold);
            return "noise";
        }
        6 => {
            limit_files(daemon.id(), Some(1));
            std::thread::sleep(hold);
            limit_files(daemon.id(), None);
            return "full disk";
        }
        _ => {
            use std::io::Write as _;
            let mut stream = daemon.connect().expect("it listens");
            let request = b"GET /v1/live/records HTTP/1.1\r\nHost: localhost\r\n\r\n";
            stream.write_all(request).expect("it listens");
            dead.push(stream);
            return "dead subscriber";
        }
    };
    rig.plug("", seed);
    name
}

/// Every beam of every completed scan exactly once.
fn check(log: &Log, completed: u64) {
    let mut scans: BTreeMap<&str, HashSet<u64>> = BTreeMap::new();
    for ping in log.pings() {
        let scan = ping["scan"].as_str().expect("an id");
        let index = ping["index"].as_u64().expect("an index");
        assert!(scans.entry(scan).or_default().insert(index), "{scan} has {index} twice");
    }
    let mut whole = 0;
    for end in log.of_type("scan_end").filter(|end| end["missing"] == 0) {
        let beams = &scans[end["scan"].as_str().expect("an id")];
        assert_eq!(beams.len() as u64, end["beams"].as_u64().expect("a count"));
        assert_eq!(beams.len(), 100);
        whole += 1;
    }
    assert!(whole >= completed, "{whole} whole scans in the log, {completed} completed");
}
