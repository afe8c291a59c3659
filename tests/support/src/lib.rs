//! Processes, logs and simulated rangers for tests of the program `sonard`.
//!
//! Tests of other packages (`tests/browser`, `tests/terminal`) use it too. The program must have been built:
//! `cargo test` builds it for the tests of its own package only.

pub mod collection;
pub mod daemon;
pub mod fleet;
pub mod in_process;
pub mod rig;

use std::{
    env, fs,
    path::{Path, PathBuf},
    process::{Child, Command, Output, Stdio},
    sync::atomic::{AtomicBool, Ordering},
    time::{Duration, Instant},
};

use serde_json::Value;

/// Path of a program of the workspace, in the same target folder as the running test.
///
/// # Panics
/// If the program has not been built.
#[must_use]
pub fn program(name: &str) -> PathBuf {
    let test = env::current_exe().expect("path of the test");
    // target/debug/deps/test-hash, and target/debug/name.
    let program = test.parent().and_then(Path::parent).expect("a target folder").join(name);
    assert!(program.exists(), "{} is missing: cargo build --workspace", program.display());
    program
}

/// The program under test.
pub fn sonard(arguments: &[&str]) -> Command {
    let mut command = Command::new(program("sonard"));
    command.args(arguments).env("NO_COLOR", "1");
    command
}

/// A command that runs in a session of its own, without a controlling terminal.
pub fn without_terminal(mut command: Command) -> Command {
    use std::os::unix::process::CommandExt as _;
    #[allow(unsafe_code, reason = "between fork and exec, only a system call is made")]
    // SAFETY: setsid(2) is async-signal-safe.
    unsafe {
        command.pre_exec(|| rustix::process::setsid().map(drop).map_err(Into::into));
    }
    command
}

/// Runs it to its end.
pub fn run(arguments: &[&str]) -> Output {
    sonard(arguments).output().expect("the program starts")
}

/// Standard error as text.
pub fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// A scan on the mock of `simple-room` at `pose` into `out`, with further options.
pub fn mock_scan(pose: &str, out: &Path, further: &[&str]) -> Output {
    let out = out.to_str().expect("plain path");
    let mut arguments =
        vec!["scan", "--mock", "--scene", "simple-room", "--pose", pose, "--out", out];
    arguments.extend(further);
    run(&arguments)
}

/// The ids of what a path's record meets, in order.
pub fn met(path: &Value) -> Vec<&str> {
    let interactions = path["interactions"].as_array().expect("interactions");
    interactions.iter().map(|met| met["id"].as_str().expect("an id")).collect()
}

/// The records of a log, by type.
pub struct Log {
    pub records: Vec<Value>,
}

impl Log {
    pub fn read(path: &Path) -> Self {
        Self::parse(&fs::read_to_string(path).expect("the log is there"))
    }

    pub fn parse(text: &str) -> Self {
        let parse = |line| serde_json::from_str(line).expect("every line is a record");
        Self { records: text.lines().map(parse).collect() }
    }

    pub fn of_type<'a>(&'a self, wanted: &'a str) -> impl Iterator<Item = &'a Value> {
        self.records.iter().filter(move |record| record["type"] == wanted)
    }

    pub fn pings(&self) -> Vec<&Value> {
        self.of_type("ping").collect()
    }

    pub fn end(&self) -> &Value {
        self.of_type("scan_end").last().expect("the scan has an end")
    }

    pub fn events(&self) -> Vec<String> {
        self.of_type("event")
            .map(|event| format!("{} {}", event["kind"], event["detail"]))
            .collect()
    }

    /// Fails unless every beam of a plan with so many beams has exactly one reading.
    pub fn assert_each_beam_once(&self, beams: u64) {
        let mut indices: Vec<u64> =
            self.pings().iter().map(|ping| ping["index"].as_u64().expect("an index")).collect();
        indices.sort_unstable();
        assert_eq!(indices, (0..beams).collect::<Vec<_>>());
    }
}

/// A `sonard mock` that is stopped when dropped.
pub struct MockProcess {
    child: Child,
    pub link: PathBuf,
}

impl MockProcess {
    /// Starts one at `fig9` behind a link in `folder`, and waits until the link is there.
    pub fn start(folder: &Path, further: &[&str]) -> Self {
        Self::spawn(folder, &[&["--scene", "simple-room", "--pose", "fig9"][..], further].concat())
    }

    /// Starts one that replays a log.
    pub fn replay(folder: &Path, log: &Path) -> Self {
        Self::spawn(folder, &["--replay", log.to_str().expect("plain path")])
    }

    fn spawn(folder: &Path, further: &[&str]) -> Self {
        let link = folder.join("ranger");
        let mut arguments = vec!["mock", "--link", link.to_str().expect("plain path")];
        arguments.extend(further);
        let child = sonard(&arguments).stdout(Stdio::piped()).spawn().expect("the program starts");
        wait_until("the mock's link", || link.exists());
        Self { child, link }
    }

    pub fn id(&self) -> u32 {
        self.child.id()
    }

    pub fn port(&self) -> &str {
        self.link.to_str().expect("plain path")
    }

    /// Interrupts it and returns what it printed.
    pub fn stop(mut self) -> (Option<i32>, String) {
        interrupt(self.child.id());
        let mut text = String::new();
        let mut stdout = self.child.stdout.take().expect("piped");
        std::io::Read::read_to_string(&mut stdout, &mut text).expect("text");
        (self.child.wait().expect("it ends").code(), text)
    }
}

impl Drop for MockProcess {
    fn drop(&mut self) {
        drop(self.child.kill());
        drop(self.child.wait());
    }
}

/// Sends SIGINT.
pub fn interrupt(process: u32) {
    use rustix::process::{Pid, Signal, kill_process};
    let pid = Pid::from_raw(process.cast_signed()).expect("a process id");
    kill_process(pid, Signal::INT).expect("it runs");
}

/// Sets a flag when it is dropped, by a panic too: threads of a scope that test the flag end.
pub struct SetOnDrop<'a>(pub &'a AtomicBool);

impl Drop for SetOnDrop<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// Waits up to a minute for a condition: a busy machine takes long.
pub fn wait_until(what: &str, mut condition: impl FnMut() -> bool) {
    let since = Instant::now();
    while !condition() {
        assert!(since.elapsed() < Duration::from_secs(60), "waited in vain for {what}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// CPU time that a process has used, seconds.
pub fn cpu_s(process: u32) -> f64 {
    let stat = fs::read_to_string(format!("/proc/{process}/stat")).expect("it runs");
    let fields: Vec<&str> = stat.rsplit(')').next().expect("fields").split_whitespace().collect();
    let ticks: f64 = [11, 12].iter().map(|&i| fields[i].parse::<f64>().expect("a number")).sum();
    ticks / rustix::param::clock_ticks_per_second() as f64
}
