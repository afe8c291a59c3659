//! Status and watch of many daemons, and a daemon that polls others.

use std::{
    fs,
    io::{BufRead as _, BufReader, Read as _, Write as _},
    net::{TcpListener, TcpStream},
    process::{Output, Stdio},
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
    thread,
    time::Duration,
};

use serde_json::Value;
use sonard_test_support::{
    fleet::{Fleet, SCANNING, until_it_listens},
    in_process::Daemon as InProcess,
};

use super::{Daemon, send_request, write_token};
use crate::common::{run, sonard, stderr, wait_until};

fn printed(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

#[test]
fn status_of_three_robots() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut fleet = Fleet::start(folder.path());
    wait_until("three that are well", || fleet.states() == ["healthy", "healthy", "healthy"]);
    wait_until("pictures", || {
        let has = |one: &Value| one["report"]["last_scan"]["picture"]["points_m"].is_array();
        fleet.reports().iter().all(has)
    });
    let picture = &fleet.reports()[1]["report"]["last_scan"]["picture"];
    assert!(picture["points_m"].as_array().expect("points").len() > 50, "{picture}");
    assert!(picture["walls_m"].as_array().expect("walls").len() >= 4, "{picture}");
    let output = fleet.status();
    assert_eq!(output.status.code(), Some(0), "{}{}", printed(&output), stderr(&output));

    fleet.rig.unplug();
    wait_until("the unplugged one", || fleet.states() == ["unhealthy", "healthy", "healthy"]);
    let output = fleet.status();
    assert_eq!(output.status.code(), Some(1), "{}", printed(&output));
    assert!(fleet.reports()[0]["problems"][0].as_str().expect("why").contains("the link is"));

    fleet.robots[1].take().expect("it runs").kill();
    wait_until("the killed one", || fleet.states() == ["unhealthy", "no_response", "healthy"]);
    let output = fleet.status();
    assert_eq!(output.status.code(), Some(3), "{}", printed(&output));
    let table = printed(&output);
    let row =
        |name: &str| table.lines().find(|line| line.contains(name)).expect("a row").to_owned();
    assert!(row("mango").contains("OFFLINE") && row("lime").contains('%'), "{table}");
    assert!(row("kiwi").contains("the link is"), "{table}");
    // What it was last is still there, and since when it is silent.
    let mango = &fleet.reports()[1];
    assert!(
        mango["last_report"].is_string() && mango["report"]["last_scan"].is_object(),
        "{mango}"
    );
    // Another robot at its place is not taken for it.
    let listen = format!("server.listen={}", mango["address"].as_str().expect("an address"));
    let elsewhere = folder.path().join("papaya");
    fs::create_dir(&elsewhere).expect("it is new");
    let named = ["--set", &listen, "--set", "fleet.robot=papaya"];
    let papaya = Daemon::start_mock(&elsewhere, &named);
    wait_until("another", || fleet.states() == ["unhealthy", "other_robot", "healthy"]);
    assert_eq!(fleet.reports()[1]["problems"][0], "papaya responds in place of mango");
    assert_eq!(fleet.status().status.code(), Some(3));
    papaya.kill();
    wait_until("silence", || fleet.states() == ["unhealthy", "no_response", "healthy"]);

    fleet.rig.plug("", 2);
    wait_until("the one that is back", || fleet.states() == ["healthy", "no_response", "healthy"]);
}

#[test]
fn without_a_fleet() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = InProcess::start_mock(folder.path(), &[]);
    assert_eq!(daemon.get("/v1/fleet").status, 404);
    assert_eq!(daemon.get("/fleet").status, 404);
    let page = String::from_utf8(daemon.get("/").body).expect("text");
    assert!(page.contains("href=\"/fleet\" hidden"), "{page}");
    for (setting, part) in [
        ("fleet.daemons=kiwi", "is not a daemon's address"),
        ("fleet.daemons=a=h:1,a=h:2", "two daemons of robot a"),
        ("fleet.file=/no/such.toml", "/no/such.toml"),
    ] {
        let output = run(&["run", "--check", "--port", "x", "--set", setting]);
        assert_eq!(output.status.code(), Some(2), "{setting}");
        assert!(stderr(&output).contains(part), "{setting}: {}", stderr(&output));
    }
}

/// Answers each request as a faulty daemon; returns the number of bytes that were read of its answers.
fn serve(
    answer: impl Fn(TcpStream, &AtomicU64) + Send + Sync + 'static,
) -> (String, Arc<AtomicU64>) {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("its address").to_string();
    let taken = Arc::new(AtomicU64::new(0));
    let (counted, answer) = (Arc::clone(&taken), Arc::new(answer));
    thread::spawn(move || {
        for mut stream in listener.incoming().flatten() {
            let (counted, answer) = (Arc::clone(&counted), Arc::clone(&answer));
            thread::spawn(move || {
                drop(stream.set_read_timeout(Some(Duration::from_secs(10))));
                let mut request = [0; 4096];
                let _ = stream.read(&mut request);
                answer(stream, &counted);
            });
        }
    });
    (address, taken)
}

fn answer_with(mut stream: &TcpStream, media: &str, body: &str) {
    let length = body.len();
    let head =
        format!("HTTP/1.1 200 OK\r\ncontent-type: {media}\r\ncontent-length: {length}\r\n\r\n");
    drop(stream.write_all((head + body).as_bytes()));
}

/// Writes for ever, as fast as it is taken.
fn pour(mut stream: TcpStream, taken: &AtomicU64) {
    let head = b"HTTP/1.1 200 OK\r\ncontent-type: application/json\r\n\r\n[";
    if stream.write_all(head).is_err() {
        return;
    }
    let piece = [b'1'; 16 * 1024];
    while let Ok(bytes) = stream.write(&piece) {
        taken.fetch_add(bytes as u64, Ordering::Relaxed);
    }
}

#[test]
fn unreachable_and_foreign_daemons() {
    let folder = tempfile::tempdir().expect("a folder");
    let name = ["--set", "fleet.robot=kiwi", "--set", "server.listen=127.0.0.1:0"];
    let robot = Daemon::start_mock(folder.path(), &name);
    until_it_listens(&robot);
    let mut lie = robot.status();
    lie["robot"] = "\u{1b}[2Jowned".into();
    let lie = lie.to_string();
    let (silent, _) = serve(|stream, _| {
        thread::sleep(Duration::from_secs(60));
        drop(stream);
    });
    let (page, _) = serve(|stream, _| answer_with(&stream, "text/html", "<html>\u{1b}[2J</html>"));
    let (endless, taken) = serve(pour);
    let (liar, _) = serve(move |stream, _| answer_with(&stream, "application/json", &lie));
    let (babble, _) = serve(|mut stream, _| drop(stream.write_all(b"SSH-2.0-x\r\n")));
    let absent = {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        listener.local_addr().expect("its address").to_string()
    };
    let kiwi = robot.address();
    let others = [&silent, &page, &endless, &liar, &babble, &absent];
    let daemons: Vec<String> = others.iter().map(|one| (*one).clone()).collect();
    let daemons = [vec![format!("mango={kiwi}")], daemons].concat();
    let mut arguments = vec!["status"];
    for daemon in &daemons {
        arguments.extend(["--address", daemon]);
    }
    let output = run(&[&arguments[..], &["--json"]].concat());
    assert_eq!(output.status.code(), Some(3));
    let printed = printed(&output);
    assert!(!printed.contains('\u{1b}'), "{printed:?}");
    let rows: Vec<Value> =
        printed.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    let states: Vec<&str> = rows.iter().map(|row| row["state"].as_str().expect("text")).collect();
    assert_eq!(
        states,
        [
            "other_robot",
            "no_response",
            "invalid_response",
            "invalid_response",
            "invalid_response",
            "invalid_response",
            "no_response"
        ],
        "{printed}"
    );
    assert_eq!(rows[0]["problems"][0], "kiwi responds in place of mango");
    assert!(rows[3]["problems"][0].as_str().expect("why").contains("longer than"), "{printed}");
    // What the system's buffers hold, and no more, was taken of what has no end: two questions.
    let taken = taken.load(Ordering::Relaxed);
    assert!(taken < 24 << 20, "{taken} bytes");
    println!("seven daemons, six of them none: {taken} bytes taken");

    let list = format!("fleet.daemons={}", [vec![kiwi], daemons[1..].to_vec()].concat().join(","));
    let folder = tempfile::tempdir().expect("a folder");
    let asking = Daemon::start_mock(folder.path(), &["--set", &list]);
    let states = || {
        let fleet = asking.get("/v1/fleet").json();
        let robots = fleet["robots"].as_array().expect("robots").clone();
        robots.iter().map(|one| one["state"].as_str().expect("text").to_owned()).collect::<Vec<_>>()
    };
    let wanted = [
        "healthy",
        "no_response",
        "invalid_response",
        "invalid_response",
        "invalid_response",
        "invalid_response",
        "no_response",
    ];
    wait_until("each as it is", || states() == wanted);
    assert!(!asking.get("/v1/fleet").body.contains(&0x1b));
}

#[test]
fn api_hides_tokens() {
    const TOKEN: &str = "0123456789abcdef0123456789abcdef";
    let (seen, tokens) = std::sync::mpsc::channel();
    let seen = std::sync::Mutex::new(seen);
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("its address").to_string();
    thread::spawn(move || {
        for stream in listener.incoming().flatten() {
            let mut lines = BufReader::new(&stream).lines().map_while(Result::ok);
            let shown = lines.find(|line| line.to_lowercase().starts_with("authorization"));
            drop(seen.lock().expect("no panic").send(shown.unwrap_or_default()));
            let mut stream = &stream;
            drop(stream.write_all(b"HTTP/1.1 401 Unauthorized\r\ncontent-length: 0\r\n\r\n"));
        }
    });
    let folder = tempfile::tempdir().expect("a folder");
    let file = write_token(folder.path(), TOKEN);
    let list = folder.path().join("fleet.toml");
    let entry = "[[daemon]]\nrobot = \"kiwi\"\ntoken_file = \"token\"\n";
    fs::write(&list, format!("{entry}address = {address:?}\n")).expect("room");
    let settings = [
        format!("fleet.file={}", list.display()),
        format!("server.token_file={}", file.display()),
        "server.listen=127.0.0.1:0".to_owned(),
    ];
    let settings: Vec<&str> = settings.iter().flat_map(|one| ["--set", one.as_str()]).collect();
    let asking = Daemon::start_mock(folder.path(), &settings);
    let shown = tokens.recv_timeout(Duration::from_secs(10)).expect("a request");
    assert!(shown.ends_with(TOKEN), "{shown}");
    until_it_listens(&asking);
    wait_until("the refusal", || {
        asking.get("/v1/fleet").json()["robots"][0]["state"] == "rejected"
    });
    let body = String::from_utf8(asking.get("/v1/fleet").body).expect("text");
    assert!(!body.contains(TOKEN) && !body.contains("token_file"), "{body}");
    assert!(!asking.messages().contains(TOKEN), "{}", asking.messages());
    for (host, origin, status) in [
        ("localhost", None, 200),
        ("evil.example", None, 403),
        ("localhost", Some("http://evil.example"), 403),
    ] {
        for path in ["/v1/fleet", "/fleet"] {
            let headers: Vec<_> =
                [("Host", host)].into_iter().chain(origin.map(|one| ("Origin", one))).collect();
            let reply = send_request(asking.connect_tcp(), "GET", path, &headers, "");
            assert_eq!(reply.status, status, "{path} {host} {origin:?}");
        }
    }
}

#[test]
fn watch_of_all_robots() {
    let folders = [(); 2].map(|()| tempfile::tempdir().expect("a folder"));
    let start = |number: usize, name: &str| {
        let named = format!("fleet.robot={name}");
        let options = [&SCANNING[..], &["--set", &named]].concat();
        Daemon::start_mock(folders[number].path(), &options)
    };
    let kiwi = start(0, "kiwi");
    let mango = start(1, "mango");
    let sockets: Vec<String> =
        folders.iter().map(|folder| folder.path().join("s").display().to_string()).collect();
    let mut watching =
        sonard(&["watch", "--socket", &sockets[0], "--socket", &sockets[1], "--json"])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("the program starts");
    let mut lines = BufReader::new(watching.stdout.take().expect("piped")).lines();
    let mut until_both = || {
        let mut received = [false; 2];
        while received != [true; 2] {
            let line = lines.next().expect("it goes on").expect("text");
            let line: Value = serde_json::from_str(&line).expect("JSON");
            let is_reading = line["record"]["type"] == "ping";
            let number = ["kiwi", "mango"].iter().position(|name| line["robot"] == *name);
            received[number.expect("a robot")] |= is_reading;
        }
    };
    until_both();
    kiwi.kill();
    let kiwi = start(0, "kiwi");
    // Of what it sent before it was killed some may wait still.
    for _ in 0..100 {
        until_both();
    }
    drop(watching.kill());
    drop(watching.wait());
    assert_eq!((kiwi.stop(), mango.stop()), (Some(0), Some(0)));
}
