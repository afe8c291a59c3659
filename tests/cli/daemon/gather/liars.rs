//! Daemons whose logs are not what they say.

use std::{
    io::{BufRead as _, BufReader, Write as _},
    net::{TcpListener, TcpStream},
    sync::Arc,
    thread,
};

use super::{
    Daemon, Stdio, Value, assert_same, fs, gather, gathered, json, logs, memory_kb, run, said,
    sonard, start, stderr, take_scans, text_of,
};

const LOG: &str = "sonard-20260101T000000Z.jsonl";

/// What a liar answers to the question for its log.
type Answer = Arc<dyn Fn(&mut TcpStream) + Send + Sync>;

/// A daemon that says it is `robot` and well, and has a log of so many bytes. Its address.
fn liar(of: &Daemon, robot: &str, bytes: u64, answer: Answer) -> String {
    let mut status = of.status();
    status["robot"] = robot.into();
    let (status, health) = (status.to_string(), of.health().to_string());
    let list = json!([{"name": LOG, "bytes": bytes, "current": true}]).to_string();
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("its address").to_string();
    thread::spawn(move || {
        for mut stream in listener.incoming().flatten() {
            let (status, health, list) = (status.clone(), health.clone(), list.clone());
            let answer = Arc::clone(&answer);
            thread::spawn(move || {
                let asked = BufReader::new(&stream).lines().map_while(Result::ok).next();
                let path =
                    asked.as_deref().and_then(|line| line.split(' ').nth(1)).unwrap_or_default();
                let body = match path {
                    "/v1/status" => &status,
                    "/v1/health" => &health,
                    "/v1/logs" => &list,
                    _ => return answer(&mut stream),
                };
                drop(stream.write_all(head(body.len()).as_bytes()));
                drop(stream.write_all(body.as_bytes()));
            });
        }
    });
    address
}

fn head(length: usize) -> String {
    format!("HTTP/1.1 200 OK\r\nconnection: close\r\ncontent-length: {length}\r\n\r\n")
}

/// Answers with a text that has its true length.
fn honest_length(text: String) -> (u64, Answer) {
    let bytes = text.len() as u64;
    let answer = move |stream: &mut TcpStream| {
        drop(stream.write_all(head(text.len()).as_bytes()));
        drop(stream.write_all(text.as_bytes()));
    };
    (bytes, Arc::new(answer))
}

/// Answers with a piece for ever.
fn endless(piece: Vec<u8>) -> Answer {
    Arc::new(move |stream: &mut TcpStream| {
        drop(stream.write_all(b"HTTP/1.1 200 OK\r\n\r\n"));
        while stream.write_all(&piece).is_ok() {}
    })
}

#[test]
fn records_that_lie_are_refused_with_robot_scan_and_reason_and_the_rest_is_taken() {
    let folder = tempfile::tempdir().expect("a folder");
    let (own, out) = (folder.path().join("kiwi"), folder.path().join("history"));
    let kiwi = start(&own, "kiwi", &["--set", "server.listen=127.0.0.1:0"]);
    take_scans(&kiwi, 2);
    let log = text_of(&logs(&own));
    let lines: Vec<&str> = log.lines().collect();
    let at = lines.iter().position(|line| line.contains("\"type\":\"ping\"")).expect("a reading");
    let scan: Value = serde_json::from_str(lines[at]).expect("JSON");
    let scan = scan["scan"].as_str().expect("a scan").to_owned();
    let elsewhere = "11111111-2222-4333-8444-555555555555";
    let lies = [
        "\u{1b}[2Jno JSON".to_owned(),
        lines[at].replace(&scan, elsewhere),
        format!("{{\"type\":\"event\",\"detail\":\"{}\"}}", "x".repeat(3 << 20)),
        lines[at].replacen("\"index\":0", "\"index\":77", 1),
    ];
    let mut told = lines.clone();
    for lie in &lies {
        told.insert(at + 1, lie);
    }
    let (bytes, answer) = honest_length(told.join("\n") + "\n");
    let lime = liar(&kiwi, "lime", bytes, answer);
    let addresses = [kiwi.address(), lime];
    let arguments = [
        "gather",
        "--address",
        &addresses[0],
        "--address",
        &addresses[1],
        "--out",
        out.to_str().expect("plain path"),
    ];
    let output = run(&[&arguments[..], &["--json"]].concat());
    let warned = stderr(&output);
    assert_eq!(output.status.code(), Some(1), "{warned}");
    assert_same(&out, "kiwi", &own);
    assert_eq!(text_of(&gathered(&out, "lime")), log, "all but the lies");
    let row: Value =
        serde_json::from_str(said(&output).lines().nth(1).expect("two")).expect("JSON");
    assert_eq!(row["refused"], 4, "{row}");
    for part in [
        &format!("lime: {LOG}, byte "),
        &format!("scan {elsewhere}: refused: a reading of a scan that is not under way"),
        &format!("scan {scan}: refused: beam 77"),
        "3145",
    ] {
        assert!(warned.contains(part), "{part}: {warned}");
    }
    assert!(!warned.contains('\u{1b}'), "{warned:?}");
    // Again: what was refused is behind.
    let output = run(&arguments);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert_eq!(text_of(&gathered(&out, "lime")), log);
}

#[test]
fn what_has_no_end_costs_neither_memory_nor_disk_nor_the_others() {
    let folder = tempfile::tempdir().expect("a folder");
    let (own, out) = (folder.path().join("kiwi"), folder.path().join("history"));
    let kiwi = start(&own, "kiwi", &["--set", "server.listen=127.0.0.1:0"]);
    take_scans(&kiwi, 2);
    let line = liar(&kiwi, "line", 1 << 50, endless(vec![b'x'; 1 << 16]));
    let garbage = liar(&kiwi, "garbage", 1 << 50, endless(b"no record\n".repeat(1 << 12)));
    let (_, short) = honest_length("{}".into());
    let short = liar(&kiwi, "short", 1 << 50, short);
    let addresses = [kiwi.address(), line, garbage, short];
    let mut command = sonard(&["gather", "--json", "--out", out.to_str().expect("plain path")]);
    for address in &addresses {
        command.args(["--address", address]);
    }
    let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("it starts");
    let id = child.id();
    let watching = thread::spawn(move || {
        let mut most_kb = 0;
        while fs::read_to_string(format!("/proc/{id}/status"))
            .is_ok_and(|text| text.contains("RssAnon:"))
        {
            most_kb = most_kb.max(memory_kb(id, "RssAnon:"));
            thread::sleep(std::time::Duration::from_millis(5));
        }
        most_kb
    });
    let output = child.wait_with_output().expect("it ends");
    let most_kb = watching.join().expect("no panic");
    println!("{most_kb} kB; {}", stderr(&output));
    assert_eq!(output.status.code(), Some(3), "{}", stderr(&output));
    assert!(most_kb < 24 << 10, "{most_kb} kB");
    assert_same(&out, "kiwi", &own);
    let rows: Vec<Value> =
        said(&output).lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    for (row, why) in rows[1..].iter().zip(["are no records", "are no records", "in part"]) {
        assert!(row["wrong"].as_str().expect("why").contains(why), "{row}");
        let robot = row["robot"].as_str().expect("a robot");
        assert_eq!(text_of(&gathered(&out, robot)), "", "{robot}");
    }
    // They say nothing new, and the honest one is not asked to wait for that.
    take_scans(&kiwi, 1);
    assert_eq!(gather(&[&own], &out, &[]).status.code(), Some(0));
    assert_same(&out, "kiwi", &own);
}
