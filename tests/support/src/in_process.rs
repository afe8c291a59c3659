//! A daemon within the test's process: mock board in memory, paused clock, requests through the router.
//!
//! Time advances only while a test waits for the daemon, and then as fast as the daemon works: a test with seconds of
//! device time takes milliseconds.

use std::{
    io,
    path::{Path, PathBuf},
    time::Duration,
};

use axum::{
    body::Body,
    http::{Request, header},
};
use http_body_util::BodyExt as _;
use serde_json::Value;
use sonard::{
    cli::EmbeddedDaemon,
    mock::{MockPort, Pace},
    server::Peer,
};
use tokio::{runtime::Runtime, sync::oneshot, task::JoinHandle, time::sleep};
use tower::ServiceExt as _;

use crate::{
    daemon::{ARRAY, MOCK, Reply},
    rig,
};

/// Simulated time that passes before each request.
const STEP: Duration = Duration::from_millis(20);
/// Real time left to the thread that writes the log before each request.
const REAL_STEP: Duration = Duration::from_micros(300);
/// Simulated time after which a wait fails.
const LIMIT: Duration = Duration::from_secs(120);

/// An [`EmbeddedDaemon`] with its runtime and a folder of its own.
pub struct Daemon {
    pub folder: PathBuf,
    pub control: EmbeddedDaemon,
    runtime: Runtime,
    running: JoinHandle<Result<(), String>>,
    boots: u16,
    board: Option<(oneshot::Sender<()>, JoinHandle<io::Result<()>>)>,
}

impl Daemon {
    /// Starts a daemon with options of `sonard run`; its logs are in `log` of `folder`.
    ///
    /// # Panics
    /// If the options are wrong.
    pub fn start(folder: &Path, options: &[&str]) -> Self {
        let runtime =
            tokio::runtime::Builder::new_current_thread().enable_all().start_paused(true).build();
        let runtime = runtime.expect("a runtime");
        let log = folder.join("log");
        let log = ["--log", log.to_str().expect("plain path")];
        let context = runtime.enter();
        let prepared = EmbeddedDaemon::from_options(&[&log, options].concat());
        let (control, work) =
            prepared.unwrap_or_else(|failure| panic!("the daemon starts: {failure:?}"));
        let running = runtime.spawn(work);
        drop(context);
        Self { folder: folder.into(), control, runtime, running, boots: 0, board: None }
    }

    /// Starts a daemon with a mock in the simple room.
    pub fn start_mock(folder: &Path, options: &[&str]) -> Self {
        Self::start(folder, &[&MOCK[..], options].concat())
    }

    /// Plugs a board of the simple room into the daemon's port, in place of an earlier one.
    ///
    /// The board keeps pace with the paused clock; one in virtual time would never let the runtime become idle.
    ///
    /// # Panics
    /// If the faults are no specification.
    pub fn plug(&mut self, faults: &str, seed: u64) {
        self.unplug();
        self.boots += 1;
        let faults = faults.parse().expect("faults");
        let _context = self.runtime.enter();
        let port = MockPort::in_memory(
            rig::board(rig::simple_room(), self.boots, faults, seed, Pace::RealTime),
            self.control.socket.clone(),
        );
        let (stop, stopped) = oneshot::channel::<()>();
        let running = self.runtime.spawn(port.run(async move { drop(stopped.await) }, drop));
        self.board = Some((stop, running));
    }

    /// Removes the board; the port no longer exists then.
    pub fn unplug(&mut self) {
        if let Some((stop, running)) = self.board.take() {
            let _ = stop.send(());
            drop(self.runtime.block_on(running));
        }
    }

    /// Lets simulated time pass.
    pub fn pass(&self, time: Duration) {
        self.runtime.block_on(async { sleep(time).await });
    }

    pub fn get(&self, path: &str) -> Reply {
        self.request(Peer::Unix, "GET", path, &[], "")
    }

    pub fn send(&self, method: &str, path: &str, body: &str) -> Reply {
        self.request(Peer::Unix, method, path, &[("content-type", "application/json")], body)
    }

    /// Sends a request as `peer` and reads the whole response.
    ///
    /// # Panics
    /// If the request is not HTTP.
    pub fn request(
        &self,
        peer: Peer,
        method: &str,
        path: &str,
        headers: &[(&str, &str)],
        body: &str,
    ) -> Reply {
        std::thread::sleep(REAL_STEP);
        let mut request = Request::builder().method(method).uri(path).extension(peer);
        if !headers.iter().any(|(name, _)| name.eq_ignore_ascii_case("host")) {
            request = request.header(header::HOST, "localhost");
        }
        for (name, value) in headers {
            request = request.header(*name, *value);
        }
        let request = request.body(Body::from(body.to_owned())).expect("a request");
        let router = self.control.router.clone();
        self.runtime.block_on(async {
            sleep(STEP).await;
            let response = router.oneshot(request).await.unwrap_or_else(|never| match never {});
            let (parts, body) = response.into_parts();
            let mut head = format!("http/1.1 {}\r\n", parts.status);
            for (name, value) in &parts.headers {
                head += &format!("{name}: {}\r\n", String::from_utf8_lossy(value.as_bytes()));
            }
            let body = body.collect().await.expect("a whole body").to_bytes().to_vec();
            Reply { status: parts.status.as_u16(), head: head.to_ascii_lowercase(), body }
        })
    }

    pub fn status(&self) -> Value {
        self.get("/v1/status").json()
    }

    pub fn health(&self) -> Value {
        self.get("/v1/health").json()
    }

    /// Waits in simulated time.
    ///
    /// # Panics
    /// If the condition stays false for two simulated minutes.
    pub fn wait_until(&self, what: &str, condition: impl Fn() -> bool) {
        let start = self.now();
        while !condition() {
            self.runtime.block_on(async { sleep(STEP).await });
            std::thread::sleep(REAL_STEP);
            assert!(self.now() - start < LIMIT, "waited in vain for {what}: {}", self.status());
        }
    }

    fn now(&self) -> tokio::time::Instant {
        self.runtime.block_on(async { tokio::time::Instant::now() })
    }

    /// Waits for a state of the link.
    pub fn wait_for(&self, state: &str) {
        self.wait_until(state, || self.status()["link"]["state"] == state);
    }

    /// Waits until `scans` scans are complete, in total.
    pub fn wait_for_scans(&self, scans: u64) {
        self.wait_until("scans", || self.health()["scans"]["completed"].as_u64() >= Some(scans));
    }

    /// Reads the configuration again, as SIGHUP does.
    pub fn reload(&mut self) {
        self.runtime.block_on(self.control.reload()).expect("the daemon runs");
    }

    /// Ends the daemon in order.
    ///
    /// # Panics
    /// If a task failed or the log was not closed.
    pub fn stop(self) {
        self.control.stop();
        let outcome = self.runtime.block_on(self.running).expect("no panic");
        assert_eq!(outcome, Ok(()));
    }
}

/// Starts a simulated array of eight rangers in the laboratory.
pub fn start_array(folder: &Path, options: &[&str]) -> Daemon {
    Daemon::start(folder, &[&ARRAY[..], options].concat())
}
