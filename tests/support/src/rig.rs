//! A ranger that can be plugged in, pulled out, and made to misbehave while a daemon uses it.

use std::{
    path::{Path, PathBuf},
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
};

use sonard::{
    acoustics::{Air, Sensor, TofNoise},
    link::{self, Pty},
    mock::{BoardSettings, EchoTable, FaultPlan, MockBoard, MockPort, Note, Pace, World},
    model::{Options, Simulator},
    scene::{Scene, shipped},
};
use tokio::{runtime::Runtime, sync::oneshot, task::JoinHandle};

/// Options of a daemon that tries again soon when its board is away.
pub const OPTIONS: [&str; 14] = [
    "--scene",
    "simple-room",
    "--pose",
    "fig9",
    "--set",
    "model.max_range_m=3",
    "--set",
    "link.attempts=3",
    "--set",
    "link.retry_min_s=0.05",
    "--set",
    "link.retry_max_s=0.4",
    "--set",
    "link.status_interval_s=0.3",
];

/// A stable name, and behind it whatever is plugged in: each time another device.
pub struct Rig {
    link: PathBuf,
    runtime: Runtime,
    soundings: EchoTable,
    pace: Pace,
    boots: u16,
    plugged: Option<(oneshot::Sender<()>, JoinHandle<std::io::Result<()>>)>,
    /// Faults that boards played.
    pub played: Arc<AtomicU64>,
}

impl Rig {
    /// With nothing plugged in. The stable name is `ranger` in `folder`.
    pub fn new(folder: &Path, pace: Pace) -> Self {
        Self {
            link: folder.join("ranger"),
            runtime: Runtime::new().expect("threads"),
            soundings: simple_room(),
            pace,
            boots: 0,
            plugged: None,
            played: Arc::default(),
        }
    }

    /// Options that let a daemon use this and try again soon.
    pub fn options(&self) -> Vec<String> {
        let port = self.link.display().to_string();
        [&["--port", &port][..], &OPTIONS].concat().into_iter().map(str::to_owned).collect()
    }

    /// Plugs a board in, under a device name that was not there before.
    pub fn plug(&mut self, faults: &str, seed: u64) {
        self.unplug();
        self.boots += 1;
        let faults: FaultPlan = faults.parse().expect("faults");
        let board = board(self.soundings.clone(), self.boots, faults, seed, self.pace);
        let _context = self.runtime.enter();
        let port = MockPort::open(board, Some(&self.link));
        let (stop, stopped) = oneshot::channel::<()>();
        let played = Arc::clone(&self.played);
        let note = move |note: Note| {
            if matches!(note, Note::Fault(_)) {
                played.fetch_add(1, Ordering::Relaxed);
            }
        };
        let playing = port.expect("a pty").run(async move { drop(stopped.await) }, note);
        self.plugged = Some((stop, self.runtime.spawn(playing)));
    }

    /// Pulls it out: the line hangs up and the name is gone.
    pub fn unplug(&mut self) {
        if let Some((stop, playing)) = self.plugged.take() {
            let _ = stop.send(());
            drop(self.runtime.block_on(playing));
        }
    }

    /// Connects a port that reads bytes and never replies, as a hanging board, until dropped.
    pub fn plug_silent(&mut self) -> Pty {
        self.unplug();
        Pty::open(Some(&self.link)).expect("a pty")
    }

    /// A port that another program has open; until both are dropped.
    pub fn plug_busy(&mut self) -> (Pty, tokio_serial::SerialStream, Unlink) {
        self.unplug();
        let pty = Pty::open(None).expect("a pty");
        let _context = self.runtime.enter();
        let taken = link::open(pty.path().to_str().expect("plain path")).expect("it is free");
        std::os::unix::fs::symlink(pty.path(), &self.link).expect("the name is free");
        (pty, taken, Unlink(self.link.clone()))
    }

    pub fn played(&self) -> u64 {
        self.played.load(Ordering::Relaxed)
    }
}

/// Echoes of the simple room at its pose `fig9`.
pub fn simple_room() -> EchoTable {
    let text = shipped::text("simple-room").expect("a shipped scene");
    let scene = Scene::from_json(text).expect("a scene");
    let pose = scene.pose("fig9").expect("its pose");
    let sensor = Sensor::preset("senscomp-6500").expect("a preset");
    let simulator = Simulator::new(Arc::new(scene), sensor, Air::default(), Options::default());
    EchoTable::from_model(&simulator.expect("a simulator"), &pose, 400, 0.0).expect("few paths")
}

/// A board without noise and with 400 steps per revolution.
pub fn board(
    soundings: EchoTable,
    boot: u16,
    faults: FaultPlan,
    seed: u64,
    pace: Pace,
) -> MockBoard {
    let settings = BoardSettings {
        boot,
        clock: 0,
        steps_per_revolution: 400,
        faults,
        seed,
        pace,
        is_replay: false,
    };
    MockBoard::new(settings, World::new(soundings, TofNoise::NONE, 0.0, seed))
}

/// Takes a name away when dropped.
pub struct Unlink(PathBuf);

impl Drop for Unlink {
    fn drop(&mut self) {
        drop(std::fs::remove_file(&self.0));
    }
}

/// Limits the size of files a process may write, as a full disk does; `None` lifts the limit.
pub fn limit_files(process: u32, bytes: Option<u64>) {
    use rustix::process::{Pid, Resource, Rlimit, prlimit};
    let pid = Pid::from_raw(process.cast_signed());
    prlimit(pid, Resource::Fsize, Rlimit { current: bytes, maximum: None }).expect("it runs");
}
