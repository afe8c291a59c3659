//! A process that is killed while it writes a log, at moments that it can't choose.
#![cfg(feature = "daemon")]

use std::{
    env, fs,
    io::{self, BufRead, BufReader, Write},
    os::unix::process::ExitStatusExt,
    path::Path,
    process::{Command, Stdio},
    time::Duration,
};

use rand::{RngExt, SeedableRng};
use sonard::{
    scan::{Record, decode_line},
    store::{LogWriter, Recovered, StoreError, load, repair},
};

const LOG: &str = include_str!("fixtures/small.jsonl");
/// Environment variable that turns this test binary into the writing process.
const CHILD: &str = "SONARD_TEST_WRITES_LOG";

/// A reading that carries its number.
fn ping(number: u64) -> Record {
    let line = LOG.lines().nth(2).expect("the third line is a reading");
    let record = decode_line(line.as_bytes()).expect("the fixture is clean");
    let Record::Ping(mut ping) = record else { panic!("the third line is a reading") };
    ping.fired_ticks = Some(number);
    Record::Ping(ping)
}

/// Numbers of the readings in a log, which must be whole.
fn numbers(log: &Path) -> Vec<u64> {
    let loaded = load(log).expect("it can be read");
    assert_eq!(loaded.damaged, []);
    let number = |record| match record {
        Record::Ping(ping) => ping.fired_ticks,
        _ => None,
    };
    loaded.records.into_iter().filter_map(number).collect()
}

/// The writing process: readings without end, and after each sync their number on standard
/// output. Only a test that starts it gives it a log; run by itself it has nothing to do.
#[test]
fn writer() {
    let Some(log) = env::var_os(CHILD) else { return };
    let mut writer = LogWriter::open(Path::new(&log)).expect("the log opens");
    let mut out = io::stdout().lock();
    for number in 0.. {
        match writer.append(&ping(number)) {
            Ok(()) => {}
            Err(error @ StoreError::Write { .. }) => {
                writer.sync().expect("what was appended can be synced");
                writeln!(out, "synced {}", writer.synced()).expect("the parent listens");
                writeln!(out, "failed {error}; {}", error.help()).expect("the parent listens");
                return;
            }
            Err(other) => panic!("{other}"),
        }
        if number % 7 == 0 {
            writer.sync().expect("there is room");
            writeln!(out, "synced {}", writer.synced()).expect("the parent listens");
        }
    }
}

fn child(log: &Path) -> Command {
    let mut command = Command::new(env::current_exe().expect("this test"));
    command.args(["--exact", "writer", "--nocapture"]).env(CHILD, log).stdout(Stdio::piped());
    command
}

/// The last number reported as synced.
fn last_synced<'a>(printed: impl Iterator<Item = &'a str>) -> u64 {
    printed.filter_map(|line| line.strip_prefix("synced ")?.parse().ok()).last().unwrap_or(0)
}

#[test]
fn killed_at_any_moment_every_synced_record_is_there() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut random = rand_pcg::Pcg32::seed_from_u64(6500);
    let mut synced_at_all = 0;
    for round in 0..20 {
        let log = folder.path().join(format!("{round}.jsonl"));
        let mut process = child(&log).spawn().expect("it starts");
        // Not before it writes: its first report.
        let mut printed = BufReader::new(process.stdout.take().expect("piped"));
        let mut lines = Vec::new();
        while !lines.iter().any(|line: &String| line.starts_with("synced")) {
            let mut line = String::new();
            assert!(printed.read_line(&mut line).expect("it reports") > 0, "{lines:?}");
            lines.push(line.trim_end().to_owned());
        }
        std::thread::sleep(Duration::from_micros(random.random_range(0..20_000)));
        process.kill().expect("it still runs");
        assert_eq!(process.wait().expect("it ends").signal(), Some(9));
        lines.extend(printed.lines().map_while(Result::ok));
        let synced = last_synced(lines.iter().map(String::as_str));
        repair(&log).expect("it can be repaired");
        let kept = numbers(&log);
        assert!(kept.len() as u64 >= synced, "{} of {synced} kept", kept.len());
        assert!(kept.iter().copied().eq(0..kept.len() as u64));
        synced_at_all += synced;
    }
    assert!(synced_at_all > 20, "it was killed before it wrote anything");
}

/// Runs the writer under a limit on the file's size, with what that limit's signal does.
fn limited(log: &Path, on_signal: &str) -> std::process::Output {
    let limit = format!("{on_signal} ulimit -f 64; exec \"$0\" \"$@\"");
    let inner = child(log);
    let mut shell = Command::new("sh");
    shell.arg("-c").arg(limit).arg(inner.get_program()).args(inner.get_args()).env(CHILD, log);
    shell.output().expect("there is a shell")
}

#[test]
fn where_the_disk_ends_no_half_record_stays() {
    let folder = tempfile::tempdir().expect("a folder");
    let log = folder.path().join("scan.jsonl");
    let output = limited(&log, "trap '' XFSZ;");
    let printed = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{printed}");
    let failed = printed.lines().find(|line| line.starts_with("failed")).expect("the disk ends");
    assert!(failed.contains("scan.jsonl") && failed.contains("file-size limit"), "{failed}");
    assert!(fs::read(&log).expect("it is there").ends_with(b"\n"));
    let kept = numbers(&log);
    assert!(kept.len() > 20 && kept.len() as u64 == last_synced(printed.lines()), "{printed}");
}

#[test]
fn killed_in_the_middle_of_a_record_only_that_one_is_lost() {
    let folder = tempfile::tempdir().expect("a folder");
    let log = folder.path().join("scan.jsonl");
    // The signal for too large a file kills between the two halves of a record.
    let output = limited(&log, "");
    assert_eq!(output.status.signal(), Some(25), "{output:?}");
    let before = fs::read(&log).expect("it is there");
    assert!(!before.ends_with(b"\n"), "the last record is torn");
    let whole = before.iter().rposition(|&byte| byte == b'\n').expect("many lines") + 1;
    let printed = String::from_utf8_lossy(&output.stdout).into_owned();
    let mut writer = LogWriter::open(&log).expect("it is mended");
    let torn = folder.path().join("scan.jsonl.torn-1");
    assert_eq!(
        writer.recovered(),
        Some(&Recovered::Torn {
            offset: whole as u64,
            bytes: (before.len() - whole) as u64,
            kept: torn.clone(),
        })
    );
    writer.append(&ping(u64::MAX)).expect("there is room");
    drop(writer);
    assert_eq!(fs::read(torn).expect("it is kept"), before[whole..]);
    assert!(fs::read(&log).expect("it is there").starts_with(&before[..whole]));
    let kept = numbers(&log);
    assert!(kept.len() as u64 > last_synced(printed.lines()));
    assert_eq!(kept.last(), Some(&u64::MAX));
}
