//! Pins: emergency stop, power, reset line, home switch and light, on a board made of switches.

use std::{
    path::Path,
    sync::{
        Arc,
        atomic::{AtomicBool, AtomicU32, Ordering::SeqCst},
    },
    time::Duration,
};

use sonard::{
    acoustics::Sensor,
    api::{LinkState, Trouble},
    config::{Keys, Mode},
    daemon::{Handle, Journal, OptionalOutputs, Order, QueuedScans, Resources, Settings, prepare},
    host_gpio::HostGpio,
    link,
    mock::Pace,
    scene::parse_pose,
    supervisor::Supervisor,
};
use tokio::runtime::Runtime;
use tokio_util::sync::CancellationToken;

use super::{clean_log, rig::Rig};
use crate::common::wait_until;

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

fn settings(port: String) -> Settings {
    let mut keys = Keys::default();
    keys.device.port = Some(port);
    keys.scanning.mode = Mode::Continuous;
    keys.model.options.max_range_m = Some(2.0);
    keys.link.attempts = 2;
    (keys.link.retry_min_s, keys.link.retry_max_s) = (0.05, 0.3);
    let sensor = Sensor::preset("senscomp-6500").expect("a preset");
    let pose = parse_pose("0,0,0").expect("a pose");
    let outputs = OptionalOutputs { mqtt: false, ros: false };
    Settings {
        keys,
        scene: None,
        sensor,
        pose,
        simulated: None,
        outputs,
        files: Default::default(),
    }
}

/// Runs a daemon with pins made of switches while `act` goes on. Returns the switches as the daemon left them.
fn run(
    settings: Settings,
    folder: &Path,
    act: impl FnOnce(&Runtime, &Handle, &Switches),
) -> Arc<Switches> {
    let switches = Arc::new(Switches::default());
    let runtime = Runtime::new().expect("threads");
    let supervisor = Supervisor::default();
    let context = runtime.enter();
    let opened = Journal::open(&folder.join("log"), settings.rotation(), &supervisor);
    let (journal, thread) = opened.expect("a log");
    let gpio = Box::new(Switchboard(Arc::clone(&switches)));
    let resources = Resources {
        open_port: Box::new(|port| Ok(Box::new(link::open(port)?))),
        relocate: None,
        gpio,
        journal,
        supervisor,
    };
    let stop = CancellationToken::new();
    let (daemon, handle) = prepare(resources, settings);
    drop(context);
    let running = runtime.spawn(daemon.run(stop.clone().cancelled_owned()));
    act(&runtime, &handle, &switches);
    stop.cancel();
    runtime.block_on(running).expect("it ends").expect("no task failed");
    assert_eq!(thread.close().error, None);
    switches
}

#[test]
fn host_pins() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut rig = Rig::new(folder.path(), Pace::RealTime);
    let settings = settings(folder.path().join("ranger").display().to_string());
    let switches = run(settings, folder.path(), |runtime, handle, switches| {
        play(&mut rig, runtime, handle, switches);
    });
    assert!(!switches.power.load(SeqCst) && !switches.light.load(SeqCst), "off at the end");
    let events = clean_log(folder.path()).events();
    for part in ["emergency stop was pressed", "emergency stop was released", "home switch is open"]
    {
        assert!(events.iter().any(|event| event.contains(part)), "no {part:?} in {events:?}");
    }
}

fn play(rig: &mut Rig, runtime: &Runtime, daemon: &Handle, switches: &Switches) {
    let state = || daemon.status().link.state;
    let scans = |beams| {
        wait_until("beams", || daemon.status().scan.is_some_and(|scan| scan.done >= beams));
    };
    let silent = rig.plug_silent();
    wait_until("resets", || switches.resets.load(SeqCst) >= 2);
    drop(silent);
    switches.home_open.store(true, SeqCst);
    rig.plug("", 1);
    wait_until("the fault", || state() == LinkState::Down(Trouble::Fault));
    switches.home_open.store(false, SeqCst);
    scans(3);
    assert!(switches.power.load(SeqCst) && switches.light.load(SeqCst));

    switches.pressed.store(true, SeqCst);
    wait_until("the stop", || state() == LinkState::EmergencyStop);
    wait_until("no power", || !switches.power.load(SeqCst) && !switches.light.load(SeqCst));
    let beams = daemon.health().scans.beams;
    std::thread::sleep(Duration::from_millis(400));
    assert_eq!((state(), daemon.health().scans.beams), (LinkState::EmergencyStop, beams));
    let refused = runtime.block_on(daemon.order(start()));
    assert!(refused.is_err_and(|refusal| refusal.message.contains("emergency stop")));
    // After the release it waits for a start request.
    switches.pressed.store(false, SeqCst);
    wait_until("the release", || state() == LinkState::AwaitingStart);
    let trouble = daemon.status().link.error;
    assert!(trouble.is_some_and(|trouble| trouble.contains("/v1/start")));
    std::thread::sleep(Duration::from_millis(400));
    assert_eq!((state(), daemon.health().scans.beams), (LinkState::AwaitingStart, beams));
    assert!(!switches.power.load(SeqCst));
    runtime.block_on(daemon.order(start())).expect("it begins");
    scans(3);
    assert!(switches.power.load(SeqCst));
}

fn start() -> Order {
    let request = uuid::Uuid::new_v4();
    Order::Start(QueuedScans { request, scans: None, plan: None, pose: None })
}

#[test]
fn automatic_resume_after_stop() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut rig = Rig::new(folder.path(), Pace::RealTime);
    rig.plug("", 1);
    let mut settings = settings(folder.path().join("ranger").display().to_string());
    settings.keys.safety.resume_after_emergency_stop = true;
    run(settings, folder.path(), |_, handle, switches| {
        let scans = || {
            wait_until("beams", || handle.status().scan.is_some_and(|scan| scan.done >= 3));
        };
        scans();
        switches.pressed.store(true, SeqCst);
        wait_until("the stop", || handle.status().link.state == LinkState::EmergencyStop);
        switches.pressed.store(false, SeqCst);
        scans();
    });
}
