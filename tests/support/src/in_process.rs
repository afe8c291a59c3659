//! A daemon within the test's process: mock board and clients in memory, paused clock, messages in a buffer.
//!
//! Time advances only while a test waits for the daemon, and then as fast as the daemon works: a test with seconds of
//! device time takes milliseconds.

use std::{
    fs,
    io::{self, BufRead as _, BufReader, Read, Write},
    os::unix::net::{UnixListener, UnixStream},
    path::{Path, PathBuf},
    process::{Output, Stdio},
    rc::Rc,
    sync::{Arc, Mutex},
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
    host_gpio::{HostGpio, NoHostGpio},
    messages,
    mock::{MockPort, Pace},
    server::Peer,
};
use tokio::{
    io::{AsyncReadExt as _, AsyncWriteExt as _, DuplexStream},
    runtime::Runtime,
    sync::oneshot,
    task::JoinHandle,
    time::{Instant, sleep, timeout},
};
use tower::ServiceExt as _;
use tracing::{Dispatch, dispatcher};

use crate::{
    daemon::{ARRAY, MOCK, Reply, ahead_options},
    rig, sonard,
};

/// Simulated time that passes before each request.
const STEP: Duration = Duration::from_millis(20);
/// Real time left to the thread that writes the log before each request.
const REAL_STEP: Duration = Duration::from_micros(300);
/// Real time after which a log's thread that does not follow is taken for blocked.
const LOG_LIMIT: Duration = Duration::from_secs(5);
/// Simulated time after which a wait fails.
const LIMIT: Duration = Duration::from_secs(120);

/// An [`EmbeddedDaemon`] with its runtime and a folder of its own.
pub struct Daemon {
    pub folder: PathBuf,
    pub control: EmbeddedDaemon,
    executor: Rc<Executor>,
    messages: MessageBuffer,
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
        Self::start_at_level("info", folder, options)
    }

    /// Starts a daemon that logs messages of a level such as `trace`.
    ///
    /// # Panics
    /// If the options are wrong.
    pub fn start_at_level(level: &str, folder: &Path, options: &[&str]) -> Self {
        Self::start_with(level, folder, Box::new(NoHostGpio), options)
    }

    /// Starts a daemon with pins of the host.
    ///
    /// # Panics
    /// If the options are wrong.
    pub fn start_with_gpio(folder: &Path, gpio: Box<dyn HostGpio>, options: &[&str]) -> Self {
        Self::start_with("info", folder, gpio, options)
    }

    fn start_with(level: &str, folder: &Path, gpio: Box<dyn HostGpio>, options: &[&str]) -> Self {
        let messages = MessageBuffer::default();
        let executor = Rc::new(Executor::new(level, messages.clone()));
        let log = folder.join("log");
        let log = ["--log", log.to_str().expect("plain path")];
        let prepared =
            executor.block_on(async { EmbeddedDaemon::with_gpio(&[&log, options].concat(), gpio) });
        let (control, work) =
            prepared.unwrap_or_else(|failure| panic!("the daemon starts: {failure:?}"));
        let running = executor.runtime.spawn(work);
        Self { folder: folder.into(), control, executor, messages, running, boots: 0, board: None }
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
        let _context = self.executor.runtime.enter();
        let port = MockPort::in_memory(
            rig::board(rig::simple_room(), self.boots, faults, seed, Pace::RealTime),
            self.control.socket.clone(),
        );
        let (stop, stopped) = oneshot::channel::<()>();
        let running =
            self.executor.runtime.spawn(port.run(async move { drop(stopped.await) }, drop));
        self.board = Some((stop, running));
    }

    /// Removes the board; the port no longer exists then.
    pub fn unplug(&mut self) {
        if let Some((stop, running)) = self.board.take() {
            let _ = stop.send(());
            drop(self.executor.block_on(running));
        }
    }

    /// Lets simulated time pass.
    pub fn pass(&self, time: Duration) {
        self.executor.block_on(async { sleep(time).await });
    }

    /// Messages that the daemon has logged, without times.
    ///
    /// # Panics
    /// If a message is no text.
    pub fn messages(&self) -> String {
        let bytes = self.messages.0.lock().expect("no panic").clone();
        String::from_utf8(bytes).expect("messages are text")
    }

    /// Connects a client of the unix socket.
    pub fn connect(&self) -> Connection {
        self.connect_as(Peer::Unix)
    }

    pub fn connect_as(&self, peer: Peer) -> Connection {
        Connection {
            stream: self.control.connect(peer),
            executor: Rc::clone(&self.executor),
            read_timeout: LIMIT,
        }
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
        self.executor.block_on(async {
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

    /// Runs a command of the program that sends GET requests to a daemon, such as `status`.
    ///
    /// # Panics
    /// If the program does not start.
    pub fn run_client(&self, command: &str) -> Output {
        let socket = self.folder.join("s");
        let listener = UnixListener::bind(&socket).expect("the name is free");
        listener.set_nonblocking(true).expect("a socket");
        let mut client = sonard(&[command, "--socket", socket.to_str().expect("plain path")]);
        let client = client.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
        let mut client = client.expect("the program starts");
        while client.try_wait().expect("its state").is_none() {
            match listener.accept() {
                Ok((stream, _)) => self.respond(stream),
                Err(_) => std::thread::sleep(REAL_STEP),
            }
        }
        fs::remove_file(socket).expect("it is there");
        client.wait_with_output().expect("it has ended")
    }

    /// Passes a client's GET request on, and the response back.
    fn respond(&self, mut stream: UnixStream) {
        stream.set_nonblocking(false).expect("a socket");
        let mut head = BufReader::new(&stream).lines().map_while(Result::ok);
        let request = head.next().expect("a request");
        head.take_while(|line| !line.is_empty()).for_each(drop);
        let reply = self.get(request.split(' ').nth(1).expect("a path"));
        let (status, length) = (reply.status, reply.body.len());
        let head = format!(
            "HTTP/1.1 {status} \r\nContent-Type: application/json\r\nConnection: close\r\n\
             Content-Length: {length}\r\n\r\n"
        );
        drop(stream.write_all(&[head.as_bytes(), &reply.body].concat()));
    }

    pub fn status(&self) -> Value {
        self.get("/v1/status").json()
    }

    pub fn health(&self) -> Value {
        self.get("/v1/health").json()
    }

    /// Waits in simulated time, then for the log's thread.
    ///
    /// # Panics
    /// If the condition stays false for two simulated minutes, in which the log's thread had time to follow.
    pub fn wait_until(&self, what: &str, condition: impl Fn() -> bool) {
        let start = self.now();
        while !condition() {
            self.executor.block_on(async { sleep(STEP).await });
            self.wait_for_log();
            assert!(self.now() - start < LIMIT, "waited in vain for {what}: {}", self.status());
        }
        self.wait_for_log();
    }

    /// Waits in real time until the log's thread has written all records, or can't.
    fn wait_for_log(&self) {
        let start = std::time::Instant::now();
        let is_behind = || {
            let log = self.executor.block_on(async { self.control.handle.status().log });
            log.waiting > 0 && log.error.is_none()
        };
        std::thread::sleep(REAL_STEP);
        while is_behind() && start.elapsed() < LOG_LIMIT {
            std::thread::sleep(REAL_STEP);
        }
    }

    fn now(&self) -> Instant {
        self.executor.now()
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
        self.executor.block_on(self.control.reload()).expect("the daemon runs");
    }

    /// Ends the daemon in order.
    ///
    /// # Panics
    /// If a task failed or the log was not closed.
    pub fn stop(self) {
        self.control.stop();
        let outcome = self.executor.block_on(self.running).expect("no panic");
        assert_eq!(outcome, Ok(()));
    }
}

/// Messages as lines of text. Clones share the buffer.
#[derive(Clone, Default)]
struct MessageBuffer(Arc<Mutex<Vec<u8>>>);

impl Write for MessageBuffer {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.lock().expect("no panic").extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Runtime with a paused clock, whose tasks log messages into a buffer.
struct Executor {
    runtime: Runtime,
    messages: Dispatch,
}

impl Executor {
    fn new(level: &str, buffer: MessageBuffer) -> Self {
        let runtime =
            tokio::runtime::Builder::new_current_thread().enable_all().start_paused(true).build();
        let messages =
            Dispatch::new(messages::subscriber(move || buffer.clone(), level, false, false));
        Self { runtime: runtime.expect("a runtime"), messages }
    }

    fn block_on<F: Future>(&self, future: F) -> F::Output {
        dispatcher::with_default(&self.messages, || self.runtime.block_on(future))
    }

    fn now(&self) -> Instant {
        self.block_on(async { Instant::now() })
    }
}

/// Client's end of a connection to a daemon. Simulated time passes while it reads or writes.
pub struct Connection {
    stream: DuplexStream,
    executor: Rc<Executor>,
    read_timeout: Duration,
}

impl Connection {
    /// Sets the simulated time after which a read without data fails.
    pub fn set_read_timeout(&mut self, limit: Duration) {
        self.read_timeout = limit;
    }

    /// Simulated time.
    pub fn now(&self) -> Instant {
        self.executor.now()
    }
}

impl Read for Connection {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let reading = async { timeout(self.read_timeout, self.stream.read(buffer)).await };
        self.executor.block_on(reading).unwrap_or_else(|_| Err(io::ErrorKind::WouldBlock.into()))
    }
}

impl Write for Connection {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let writing = async { timeout(LIMIT, self.stream.write(bytes)).await };
        self.executor.block_on(writing).unwrap_or_else(|_| Err(io::ErrorKind::TimedOut.into()))
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Starts a simulated array of eight rangers in the laboratory.
pub fn start_array(folder: &Path, options: &[&str]) -> Daemon {
    Daemon::start(folder, &[&ARRAY[..], options].concat())
}

/// Starts a mock without noise whose transducer is 0.1 m ahead of the rotation axis, in a room where it can turn.
pub fn start_ahead(folder: &Path, options: &[&str]) -> Daemon {
    let ahead = ahead_options(folder);
    let ahead: Vec<&str> = ahead.iter().map(String::as_str).collect();
    Daemon::start(folder, &[&ahead[..], options].concat())
}
