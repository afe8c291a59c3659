//! Pins: emergency stop, power, reset line, home switch and light, on a board made of switches.

use std::{
    path::Path,
    sync::{
        Arc,
        atomic::{AtomicBool, AtomicU32, Ordering::SeqCst},
    },
    time::Duration,
};

use serde_json::Value;
use sonard::host_gpio::HostGpio;
use sonard_test_support::in_process::Daemon;

use super::clean_log;

#[derive(Default)]
struct Switches {
    pressed: AtomicBool,
    home_open: AtomicBool,
    power: AtomicBool,
    light: AtomicBool,
    resets: AtomicU32,
}

struct Switchboard(Arc<Switches>);

impl HostGpio for Switchboard {
    fn can_reset(&self) -> bool {
        true
    }
    fn reset(&mut self) {
        self.0.resets.fetch_add(1, SeqCst);
    }
    fn set_power(&mut self, on: bool) {
        self.0.power.store(on, SeqCst);
    }
    fn at_home(&self) -> Option<bool> {
        Some(!self.0.home_open.load(SeqCst))
    }
    fn emergency_stop(&self) -> Option<bool> {
        Some(self.0.pressed.load(SeqCst))
    }
    fn set_light(&mut self, on: bool) {
        self.0.light.store(on, SeqCst);
    }
}

const OPTIONS: [&str; 10] = [
    "--set",
    "scanning.mode=continuous",
    "--set",
    "model.max_range_m=2",
    "--set",
    "link.attempts=2",
    "--set",
    "link.retry_min_s=0.05",
    "--set",
    "link.retry_max_s=0.3",
];

/// Starts a daemon whose pins are switches.
fn start(folder: &Path, further: &[&str]) -> (Daemon, Arc<Switches>) {
    let switches = Arc::new(Switches::default());
    let gpio = Box::new(Switchboard(Arc::clone(&switches)));
    (Daemon::start_with_gpio(folder, gpio, &[&OPTIONS, further].concat()), switches)
}

fn wait_for_beams(daemon: &Daemon) {
    daemon.wait_until("beams", || daemon.status()["scan"]["done"].as_u64() >= Some(3));
}

fn beams(daemon: &Daemon) -> Value {
    daemon.health()["scans"]["beams"].clone()
}

#[test]
fn host_pins() {
    let folder = tempfile::tempdir().expect("a folder");
    let (mut daemon, switches) = start(folder.path(), &[]);
    // Each byte is lost: the board never replies.
    daemon.plug("drop=1", 1);
    daemon.wait_until("resets", || switches.resets.load(SeqCst) >= 2);
    switches.home_open.store(true, SeqCst);
    daemon.plug("", 1);
    daemon.wait_for("fault");
    switches.home_open.store(false, SeqCst);
    wait_for_beams(&daemon);
    assert!(switches.power.load(SeqCst) && switches.light.load(SeqCst));

    switches.pressed.store(true, SeqCst);
    daemon.wait_for("emergency_stop");
    daemon.wait_until("no power", || !switches.power.load(SeqCst) && !switches.light.load(SeqCst));
    let before = beams(&daemon);
    daemon.pass(Duration::from_millis(400));
    assert_eq!(daemon.status()["link"]["state"], "emergency_stop");
    assert_eq!(beams(&daemon), before);
    let refused = daemon.send("POST", "/v1/start", "{}");
    assert_eq!(refused.status, 409);
    let error = refused.json()["error"].clone();
    assert!(error.as_str().is_some_and(|error| error.contains("emergency stop")), "{error}");
    // After the release it waits for a start request.
    switches.pressed.store(false, SeqCst);
    daemon.wait_for("awaiting_start");
    let error = daemon.status()["link"]["error"].clone();
    assert!(error.as_str().is_some_and(|error| error.contains("/v1/start")), "{error}");
    daemon.pass(Duration::from_millis(400));
    assert_eq!(daemon.status()["link"]["state"], "awaiting_start");
    assert_eq!(beams(&daemon), before);
    assert!(!switches.power.load(SeqCst));
    assert_eq!(daemon.send("POST", "/v1/start", "{}").status, 202);
    wait_for_beams(&daemon);
    assert!(switches.power.load(SeqCst));

    daemon.stop();
    assert!(!switches.power.load(SeqCst) && !switches.light.load(SeqCst), "off at the end");
    let events = clean_log(folder.path()).events();
    for part in ["emergency stop was pressed", "emergency stop was released", "home switch is open"]
    {
        assert!(events.iter().any(|event| event.contains(part)), "no {part:?} in {events:?}");
    }
}

#[test]
fn automatic_resume_after_stop() {
    let folder = tempfile::tempdir().expect("a folder");
    let resume = ["--set", "safety.resume_after_emergency_stop=true"];
    let (mut daemon, switches) = start(folder.path(), &resume);
    daemon.plug("", 1);
    wait_for_beams(&daemon);
    switches.pressed.store(true, SeqCst);
    daemon.wait_for("emergency_stop");
    switches.pressed.store(false, SeqCst);
    daemon.wait_until("the release", || daemon.status()["link"]["state"] != "emergency_stop");
    wait_for_beams(&daemon);
    daemon.stop();
}
