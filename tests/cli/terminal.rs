//! Standard output on terminals of several widths: tables, help and the summary of a simulation.

use std::{
    fs::File,
    io::{self, Read as _},
    process::{Command, Stdio},
};

use rustix::{
    pty::{OpenptFlags, grantpt, ioctl_tiocgptpeer, openpt, unlockpt},
    termios::{Winsize, tcsetwinsize},
};

use crate::common::run;

const SIMPLE_ROOM: [&str; 4] = ["--scene", "simple-room", "--pose", "fig9"];

/// Runs `sonard` with a terminal on standard output, and returns its text and exit code.
fn run_in_terminal(columns: u16, arguments: &[&str]) -> (String, Option<i32>) {
    let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY;
    let master = openpt(flags).expect("a pty");
    grantpt(&master).expect("granted");
    unlockpt(&master).expect("unlocked");
    let slave = ioctl_tiocgptpeer(&master, flags).expect("its other end");
    let size = Winsize { ws_row: 50, ws_col: columns, ws_xpixel: 0, ws_ypixel: 0 };
    tcsetwinsize(&slave, size).expect("a size");
    let mut child = Command::new(env!("CARGO_BIN_EXE_sonard"))
        .args(arguments)
        .env("NO_COLOR", "1")
        .env_remove("COLUMNS")
        .stdin(Stdio::null())
        .stdout(slave.try_clone().expect("a copy"))
        .stderr(slave)
        .spawn()
        .expect("it starts");
    let (mut master, mut bytes) = (File::from(master), Vec::new());
    let mut buffer = [0; 4096];
    // Reading fails once the last copy of the other end is closed.
    while let Ok(count @ 1..) = master.read(&mut buffer) {
        bytes.extend_from_slice(&buffer[..count]);
    }
    let code = child.wait().expect("it ends").code();
    (String::from_utf8(bytes).expect("UTF-8").replace("\r\n", "\n"), code)
}

fn piped(arguments: &[&str]) -> String {
    String::from_utf8(run(arguments).stdout).expect("UTF-8")
}

fn widest(text: &str) -> usize {
    text.lines().map(|line| line.chars().count()).max().unwrap_or_default()
}

#[test]
fn tables_follow_the_width() {
    let folder = tempfile::tempdir().expect("a folder");
    let log = folder.path().join("log.jsonl");
    let log = log.to_str().expect("plain");
    let simulated = run(&[&["simulate", "-o", log][..], &SIMPLE_ROOM].concat());
    assert!(simulated.status.success());
    let trace = [&["trace", "--azimuth-deg", "270", "--until", "3"][..], &SIMPLE_ROOM].concat();
    let paths = [&["paths", "--max-range", "2"][..], &SIMPLE_ROOM].concat();
    let lists = ["scene", "sensor", "array"].map(|kind| [kind, "list"]);
    let [scenes, sensors, arrays] = &lists;
    let tables = [&trace[..], &paths, &["log", "show", log], &["interpret", log]];
    for arguments in tables.into_iter().chain([&scenes[..], sensors, arrays]) {
        for columns in [60, 80, 160] {
            let (text, code) = run_in_terminal(columns, arguments);
            assert_eq!(code, Some(0), "{text}");
            // A sentence is wrapped by the terminal.
            let rows: Vec<_> = text
                .lines()
                .filter(|line| {
                    !["session", "next scan", "echo at", "the signal"]
                        .iter()
                        .any(|start| line.starts_with(start))
                })
                .collect();
            let widest = widest(&rows.join("\n"));
            assert!(widest <= usize::from(columns), "{arguments:?} at {columns}: {text}");
        }
        let text = piped(arguments);
        assert!(text.lines().all(|line| !line.ends_with(' ')), "{text}");
    }
    let narrow = run_in_terminal(60, &["log", "show", log]).0;
    assert!(narrow.contains("beams         400/400\n"), "{narrow}");
}

#[test]
fn rows_end_at_50_without_all() {
    let trace = [&["trace", "--azimuth-deg", "270"][..], &SIMPLE_ROOM].concat();
    let paths = [&["paths", "--max-range", "4"][..], &SIMPLE_ROOM].concat();
    for (arguments, noun) in [(trace, "peaks"), (paths, "paths")] {
        let (text, all) = (piped(&arguments), piped(&[&arguments[..], &["--all"]].concat()));
        let total = all.lines().find(|line| line.ends_with(noun)).expect("a total");
        let count: usize =
            total.split(' ').next().expect("a count").replace(',', "").parse().expect("a number");
        assert!(count > 50, "{total}");
        let rest = text.lines().find(|line| line.contains("; --all prints them")).expect("a rest");
        assert!(rest.starts_with(total), "{rest}");
        // A header and the remarks below the table.
        let remarks = all.lines().count() - count;
        assert_eq!(text.lines().count(), 50 + remarks, "{text}");
    }
}

#[test]
fn summary_of_a_simulation() {
    let simulate = [&["simulate"][..], &SIMPLE_ROOM].concat();
    let (text, code) = run_in_terminal(80, &simulate);
    assert_eq!(code, Some(0), "{text}");
    assert!(
        text.starts_with("1 simulated scan in simple-room, senscomp-6500, model paths\n"),
        "{text}"
    );
    assert!(text.contains(" 0.774,0.085,0     400    393           7         0   "), "{text}");
    let (json, _) = run_in_terminal(80, &[&simulate[..], &["--json"]].concat());
    let lines = |text: &str| text.lines().filter(|line| line.starts_with('{')).count();
    assert_eq!((lines(&json), lines(&piped(&simulate))), (403, 403));
}

/// Commands of the sections `Examples:` of a help text, joined as a shell does.
fn examples(help: &str) -> Vec<String> {
    let joined = help.replace("\\\n", " ");
    let lines = joined.lines().skip_while(|line| *line != "Examples:").skip(1);
    let commands = lines.take_while(|line| line.is_empty() || line.starts_with("  "));
    let words = commands.map(|line| line.split_whitespace().collect::<Vec<_>>().join(" "));
    words.filter(|line| !line.is_empty() && !line.starts_with('#')).collect()
}

#[test]
fn examples_of_help_at_any_width() {
    for verb in ["scan", "run", "simulate", "paths", "import", "generate", "export"] {
        let without_comments = |help: &str| {
            let commands = examples(help).into_iter();
            commands
                .map(|line| line.split(" # ").next().unwrap_or_default().to_owned())
                .collect::<Vec<_>>()
        };
        let wide = without_comments(&run_in_terminal(300, &[verb, "--help"]).0);
        assert!(wide.len() > 1, "{verb}: {wide:?}");
        for columns in [40, 60, 80] {
            let (help, _) = run_in_terminal(columns, &[verb, "--help"]);
            assert_eq!(without_comments(&help), wide, "{verb} at {columns}: {help}");
        }
    }
}

#[test]
fn closed_reader() {
    let mut child = Command::new(env!("CARGO_BIN_EXE_sonard"))
        .args(["paths", "--all", "--max-range", "4"])
        .args(SIMPLE_ROOM)
        .stdout(Stdio::piped())
        .spawn()
        .expect("it starts");
    drop(child.stdout.take());
    let status = child.wait().expect("it ends");
    assert_eq!(status.code(), Some(0), "{:?}", io::Error::last_os_error());
}
