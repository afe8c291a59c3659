//! A `sonard run` process, its API and its logs.

use std::{
    fs,
    io::{BufRead as _, BufReader, Read, Write},
    net::TcpStream,
    os::unix::{fs::PermissionsExt as _, net::UnixStream},
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    sync::{Arc, Mutex},
    thread::JoinHandle,
    time::Duration,
};

use jiff::Timestamp;
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;
use sonard::{
    geometry::Pose,
    scan::{Ping, Record, ScanEnd, ScanPlan, ScanStart, decode_line, encode_line},
};
use uuid::Uuid;

use crate::{Log, run, sonard, stderr, wait_until};

/// Options of a mock in the simple room.
pub(crate) const MOCK: [&str; 5] = ["--mock", "--scene", "simple-room", "--pose", "fig9"];
/// Options of a simulated array of eight rangers in the laboratory.
pub(crate) const ARRAY: [&str; 7] =
    ["--simulate", "--array", "pioneer-8", "--scene", "mcgill-lab", "--pose", "fig4"];

/// A `sonard run` with a folder of its own.
pub struct Daemon {
    pub child: Child,
    pub folder: PathBuf,
    printed: Arc<Mutex<String>>,
    /// Thread that reads standard error.
    reader: Option<JoinHandle<()>>,
}

/// An answer.
pub struct Reply {
    pub status: u16,
    pub head: String,
    pub body: Vec<u8>,
}

impl Reply {
    pub fn json(&self) -> Value {
        serde_json::from_slice(&self.body)
            .unwrap_or_else(|error| panic!("{error}: {}", String::from_utf8_lossy(&self.body)))
    }
}

impl Daemon {
    /// Starts one in `folder` and waits until its API answers.
    pub fn start(folder: &Path, further: &[&str]) -> Self {
        Self::start_as(sonard(&[]), folder, further)
    }

    /// Starts a daemon with a mock in the simple room, in real time.
    pub fn start_mock(folder: &Path, further: &[&str]) -> Self {
        Self::start(folder, &[&MOCK[..], further].concat())
    }

    /// Starts a daemon by a command that ends in the program.
    pub fn start_as(command: Command, folder: &Path, further: &[&str]) -> Self {
        let daemon = Self::spawn(command, folder, further);
        wait_until("the API", || daemon.connect().is_ok());
        daemon
    }

    /// Starts a daemon without waiting for its API.
    pub fn spawn(mut command: Command, folder: &Path, further: &[&str]) -> Self {
        let mut child = command
            .args(["run", "--log"])
            .arg(folder.join("log"))
            .arg("--socket")
            .arg(folder.join("s"))
            .args(further)
            // Nothing on this computer decides what is tested.
            .env_remove("STATE_DIRECTORY")
            .stderr(Stdio::piped())
            .spawn()
            .expect("the program starts");
        let printed = Arc::new(Mutex::new(String::new()));
        let lines = BufReader::new(child.stderr.take().expect("piped"));
        let received = Arc::clone(&printed);
        let reader = std::thread::spawn(move || {
            for line in lines.lines().map_while(Result::ok) {
                *received.lock().expect("no panic") += &(line + "\n");
            }
        });
        Self { child, folder: folder.into(), printed, reader: Some(reader) }
    }

    /// A daemon that was started with `--log` and `--socket` as [`spawn`](Self::spawn) does, and whose standard error
    /// belongs to the test.
    pub fn from_child(child: Child, folder: &Path) -> Self {
        let daemon = Self { child, folder: folder.into(), printed: Arc::default(), reader: None };
        wait_until("the API", || daemon.connect().is_ok());
        daemon
    }

    pub fn id(&self) -> u32 {
        self.child.id()
    }

    pub fn messages(&self) -> String {
        self.printed.lock().expect("no panic").clone()
    }

    pub fn connect(&self) -> std::io::Result<UnixStream> {
        let stream = UnixStream::connect(self.folder.join("s"))?;
        stream.set_read_timeout(Some(Duration::from_secs(20)))?;
        Ok(stream)
    }

    /// Connects by TCP, to the address in the log.
    pub fn connect_tcp(&self) -> TcpStream {
        let stream = TcpStream::connect(self.address()).expect("it listens there");
        stream.set_read_timeout(Some(Duration::from_secs(20))).expect("a socket");
        stream
    }

    /// Address of the daemon's TCP server.
    pub fn address(&self) -> String {
        wait_until("the address", || self.messages().contains("http://"));
        let printed = self.messages();
        let address = printed.split("http://").nth(1).expect("the address");
        address.split_whitespace().next().expect("an address").to_owned()
    }

    pub fn get(&self, path: &str) -> Reply {
        send_request(self.connect().expect("it listens"), "GET", path, &[("Host", "localhost")], "")
    }

    pub fn send(&self, method: &str, path: &str, body: &str) -> Reply {
        let headers = [("Host", "localhost"), ("Content-Type", "application/json")];
        send_request(self.connect().expect("it listens"), method, path, &headers, body)
    }

    /// Sends a request until no computation of another client occupies the daemon.
    pub fn send_when_free(&self, method: &str, path: &str, body: &str) -> Reply {
        let mut reply = self.send(method, path, body);
        wait_until("no other computation", || {
            if reply.status == 503 {
                reply = self.send(method, path, body);
            }
            reply.status != 503
        });
        reply
    }

    pub fn status(&self) -> Value {
        self.get("/v1/status").json()
    }

    pub fn health(&self) -> Value {
        self.get("/v1/health").json()
    }

    /// Waits for a state of the link.
    pub fn wait_for(&self, state: &str) {
        wait_until(state, || self.status()["link"]["state"] == state);
    }

    /// Waits until so many scans are whole, in all.
    pub fn wait_for_scans(&self, scans: u64) {
        wait_until("scans", || self.health()["scans"]["completed"].as_u64() >= Some(scans));
    }

    pub fn signal(&self, signal: Signal) {
        let pid = Pid::from_raw(self.child.id().cast_signed()).expect("a process id");
        kill_process(pid, signal).expect("it runs");
    }

    /// Ends it as systemd does, and returns its exit code.
    pub fn stop(mut self) -> Option<i32> {
        self.signal(Signal::TERM);
        self.wait()
    }

    /// Waits for the end of the process and of its messages; returns its code.
    pub fn wait(&mut self) -> Option<i32> {
        let mut code = None;
        wait_until("the end of the daemon", || {
            code = self.child.try_wait().expect("it is ours");
            code.is_some()
        });
        let code = code.and_then(|code| code.code());
        self.reader.take().into_iter().for_each(|reader| reader.join().expect("no panic"));
        code
    }

    /// Ends it as a power cut does.
    pub fn kill(mut self) {
        self.child.kill().expect("it runs");
        self.child.wait().expect("it ends");
    }
}

impl Drop for Daemon {
    fn drop(&mut self) {
        drop(self.child.kill());
        drop(self.child.wait());
    }
}

/// Starts a mock without noise whose transducer is 0.1 m ahead of the rotation axis, in a room where it can turn.
pub fn start_ahead(folder: &Path, further: &[&str]) -> Daemon {
    let ahead = ahead_options(folder);
    let ahead: Vec<&str> = ahead.iter().map(String::as_str).collect();
    Daemon::start(folder, &[&ahead[..], further].concat())
}

/// Options of a mock without noise whose transducer is 0.1 m ahead of the rotation axis.
pub(crate) fn ahead_options(folder: &Path) -> Vec<String> {
    let shown = run(&["sensor", "show", "senscomp-6500"]);
    let mut sensor: Value = serde_json::from_slice(&shown.stdout).expect("a sensor");
    sensor["mounting"]["ahead_m"] = 0.1.into();
    let file = folder.join("ahead.json");
    fs::write(&file, sensor.to_string()).expect("there is room");
    let sensor = format!("model.sensor={}", file.display());
    let mock = ["--mock", "--scene", "two-surface-room", "--pose", "middle", "--noise-mm", "0"];
    [&mock[..], &["--set", &sensor]].concat().into_iter().map(str::to_owned).collect()
}

/// Starts a stationary simulated array of eight rangers in the laboratory.
pub fn start_array(folder: &Path, further: &[&str]) -> Daemon {
    Daemon::start(folder, &[&ARRAY[..], further].concat())
}

/// A log of so many scans, ten seconds apart, each of so many beams.
pub fn write_scans(folder: &Path, scans: u32, beams: u32) {
    fs::create_dir_all(folder).expect("there is room");
    let few = ["simulate", "--scene", "simple-room", "--pose", "fig9", "--step-deg", "36"];
    let made = run(&[&few[..], &["--max-range", "2"]].concat());
    assert!(made.status.success(), "{}", stderr(&made));
    let record = |line: &[u8]| decode_line(line).expect("a record");
    let records: Vec<Record> =
        made.stdout.trim_ascii_end().split(|b| *b == b'\n').map(record).collect();
    let mut log = Vec::new();
    let mut put = |record: &Record| encode_line(record, &mut log).expect("a line");
    put(&records[0]);
    let step_deg = 360.0 / f64::from(beams);
    let plan = ScanPlan {
        from_deg: 0.0,
        to_deg: step_deg * f64::from(beams),
        step_deg,
        pings_per_stop: 1,
    };
    let pings = records.iter().filter_map(|record| match record {
        Record::Ping(ping) => Some(&**ping),
        _ => None,
    });
    let pings: Vec<&Ping> = pings.collect();
    for number in 0..scans {
        let scan = Uuid::from_u128(u128::from(number) + 1);
        let time = Timestamp::from_second(1_780_000_000 + 10 * i64::from(number)).expect("a time");
        let pose = Pose { x_m: 0.774, y_m: 0.085, heading_deg: 0.0 };
        put(&Record::ScanStart(ScanStart::new(scan, time, pose, plan)));
        for index in 0..beams {
            // As the model reads in the direction nearest to it.
            let like = pings[(u64::from(index) * pings.len() as u64 / u64::from(beams)) as usize];
            let azimuth_deg = step_deg * f64::from(index);
            let ping = Ping { scan, index, step: index.cast_signed(), azimuth_deg, ..like.clone() };
            put(&Record::Ping(Box::new(ping)));
        }
        let Some(Record::ScanEnd(end)) = records.last() else { panic!("a log ends with its scan") };
        put(&Record::ScanEnd(ScanEnd { scan, time, beams, ..end.clone() }));
    }
    fs::write(folder.join("sonard-20260601T000000Z.jsonl"), log).expect("there is room");
}

/// A file with a token, as the daemon wants it.
pub fn write_token(folder: &Path, token: impl AsRef<str>) -> PathBuf {
    let file = folder.join("token");
    fs::write(&file, token.as_ref()).expect("there is room");
    fs::set_permissions(&file, fs::Permissions::from_mode(0o600)).expect("it is ours");
    file
}

/// The logs of a daemon's folder, oldest first.
pub fn logs(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder.join("log")).expect("a folder").flatten();
    let mut logs: Vec<PathBuf> = entries
        .map(|entry| entry.path())
        .filter(|p| p.extension().is_some_and(|e| e == "jsonl"))
        .collect();
    logs.sort();
    logs
}

/// Every record of a daemon's logs; they must be clean.
pub fn clean_log(folder: &Path) -> Log {
    let mut text = String::new();
    for log in logs(folder) {
        let verified = run(&["log", "verify", log.to_str().expect("plain path")]);
        let printed = String::from_utf8_lossy(&verified.stdout).into_owned();
        assert_eq!(verified.status.code(), Some(0), "{printed}");
        text += &fs::read_to_string(&log).expect("readable");
    }
    Log::parse(&text)
}

/// Sends a request on a connection of its own and reads the answer to its end.
pub fn send_request(
    mut stream: impl Read + Write,
    method: &str,
    path: &str,
    headers: &[(&str, &str)],
    body: &str,
) -> Reply {
    let mut request = format!("{method} {path} HTTP/1.1\r\nConnection: close\r\n");
    for (name, value) in headers {
        request += &format!("{name}: {value}\r\n");
    }
    if !body.is_empty() || method != "GET" {
        request += &format!("Content-Length: {}\r\n", body.len());
    }
    request += "\r\n";
    request += body;
    // A server that has refused already may have closed its end.
    drop(stream.write_all(request.as_bytes()));
    read_reply(stream)
}

/// Reads an answer to the end of the connection.
pub fn read_reply(mut stream: impl Read) -> Reply {
    let mut bytes = Vec::new();
    let mut chunk = [0; 4096];
    while let Ok(count @ 1..) = stream.read(&mut chunk) {
        bytes.extend_from_slice(&chunk[..count]);
    }
    let end = bytes.windows(4).position(|window| window == b"\r\n\r\n");
    let end = end.unwrap_or_else(|| panic!("no answer: {:?}", String::from_utf8_lossy(&bytes)));
    let head = String::from_utf8_lossy(&bytes[..end]).to_ascii_lowercase();
    let body = bytes.split_off(end + 4);
    let status = head.split(' ').nth(1).and_then(|s| s.parse().ok()).expect("a status");
    let body = if head.contains("transfer-encoding: chunked") { dechunked(&body) } else { body };
    Reply { status, head, body }
}

fn dechunked(mut rest: &[u8]) -> Vec<u8> {
    let mut body = Vec::new();
    while let Some(end) = rest.windows(2).position(|window| window == b"\r\n") {
        let size = String::from_utf8_lossy(&rest[..end]);
        let size = usize::from_str_radix(size.trim(), 16).expect("a chunk's size");
        let chunk = &rest[end + 2..];
        if size == 0 || chunk.len() < size + 2 {
            break;
        }
        body.extend_from_slice(&chunk[..size]);
        rest = &chunk[size + 2..];
    }
    body
}

/// Resident memory of a process, kilobytes.
pub fn resident_kb(process: u32) -> u64 {
    memory_kb(process, "VmRSS:")
}

/// Resident memory that a process has beside the pages of its program's file, kilobytes: what it costs however
/// large its program is built.
pub fn own_kb(process: u32) -> u64 {
    memory_kb(process, "RssAnon:")
}

/// A figure of a process's memory by its name in `/proc/PID/status`, kilobytes.
pub fn memory_kb(process: u32, figure: &str) -> u64 {
    let status = fs::read_to_string(format!("/proc/{process}/status")).expect("it runs");
    let line = status.lines().find(|line| line.starts_with(figure)).expect("a figure");
    line.split_whitespace().nth(1).and_then(|kb| kb.parse().ok()).expect("a number")
}
