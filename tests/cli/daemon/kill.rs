//! A daemon that is killed at moments it can't choose goes on with the same log.
//!
//! `SONARD_KILLS=200 cargo test --release --test cli daemon::kill -- --nocapture` for more.

use std::{env, fs, time::Duration};

use rand::{RngExt as _, SeedableRng as _};
use sonard::mock::Pace;

use super::{Daemon, clean_log, logs, rig::Rig};
use crate::common::wait_until;

#[test]
fn synced_records_survive_kill() {
    let kills = env::var("SONARD_KILLS").ok().and_then(|n| n.parse().ok()).unwrap_or(8);
    let folder = tempfile::tempdir().expect("a folder");
    let mut rig = Rig::new(folder.path(), Pace::RealTime);
    rig.plug("", 1);
    let mut options = rig.options();
    for setting in [
        "scanning.mode=continuous",
        "plan.to_deg=18",
        "model.max_range_m=0.6",
        "log.sync_s=0.1",
        "log.daily=false",
    ] {
        options.extend(["--set".to_owned(), setting.to_owned()]);
    }
    let options: Vec<&str> = options.iter().map(String::as_str).collect();
    let mut random = rand_pcg::Pcg32::seed_from_u64(9);
    let mut torn = 0;
    for _ in 0..kills {
        let before = if folder.path().join("log").exists() { records(folder.path()) } else { 0 };
        let daemon = Daemon::start(folder.path(), &options);
        wait_until("records", || daemon.status()["log"]["synced"].as_u64() > Some(3));
        std::thread::sleep(Duration::from_millis(random.random_range(0..300)));
        let synced = daemon.status()["log"]["synced"].as_u64().expect("a count");
        daemon.kill();
        let kept = records(folder.path());
        assert!(kept >= before + synced, "{kept} records, {before} before and {synced} synced");
        // A power cut takes what was not synced, wherever that ends.
        let log = &logs(folder.path())[0];
        let text = fs::read(log).expect("readable");
        if random.random_bool(0.5) {
            fs::write(log, &text[..text.len() - random.random_range(1..3000)]).expect("writable");
            torn += 1;
        }
    }
    let daemon = Daemon::start(folder.path(), &options);
    daemon.wait_for_scans(1);
    assert_eq!(daemon.stop(), Some(0));
    assert_eq!(logs(folder.path()).len(), 1, "the same log goes on");
    let log = clean_log(folder.path());
    let broken = log
        .events()
        .iter()
        .filter(|event| event.contains("ended within the previous scan"))
        .count();
    println!(
        "killed {kills} times, {torn} torn ends, {broken} scans broken off, {} records",
        log.records.len()
    );
    assert!(broken > 0 || kills < 4, "never killed within a scan");
}

/// Whole lines in the logs.
fn records(folder: &std::path::Path) -> u64 {
    let lines =
        |log| fs::read(log).expect("readable").iter().filter(|&&byte| byte == b'\n').count();
    logs(folder).into_iter().map(|log| lines(log) as u64).sum()
}
