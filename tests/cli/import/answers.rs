//! Questions of `sonard import`: each option that a message offers exists, and following it gives right readings.

use std::{fs, path::PathBuf};

use super::{done, refused};
use crate::common::Log;

/// The words of a command as a shell splits them.
fn split(text: &str) -> Vec<String> {
    let (mut words, mut word, mut quote) = (Vec::new(), String::new(), None);
    for c in text.chars() {
        match (quote, c) {
            // An apostrophe within a word is none.
            (None, '\'') if word.is_empty() => quote = Some(c),
            (Some(_), '\'') => quote = None,
            (None, ' ') => {
                words.extend(Some(std::mem::take(&mut word)).filter(|word| !word.is_empty()));
            }
            _ => word.push(c),
        }
    }
    words.extend(Some(word).filter(|word| !word.is_empty()));
    words
}

/// Options with a value behind them.
const WITH_VALUE: [&str; 6] =
    ["--columns", "--decimal", "--range-unit", "--time-format", "--azimuth-deg", "--utc-offset"];

/// The answers that a message offers, the words of each.
fn offered(printed: &str) -> Vec<Vec<String>> {
    let mut answers: Vec<Vec<String>> = Vec::new();
    let mut words = split(printed).into_iter().peekable();
    let mut is_going_on = false;
    while let Some(word) = words.next() {
        let option = word.trim_end_matches([';', ',']).to_owned();
        if !option.starts_with("--") || option == "--no-unit-check" {
            is_going_on = false;
            continue;
        }
        if !std::mem::replace(&mut is_going_on, true) {
            answers.push(Vec::new());
        }
        let ends = word.ends_with(';');
        let answer = answers.last_mut().expect("begun");
        let takes_value = WITH_VALUE.contains(&option.as_str());
        answer.push(option);
        if takes_value {
            let value = words.next().expect("a value");
            answer.push(value.trim_end_matches([';', ',']).replace("DEG", "90"));
            is_going_on = !value.ends_with(';');
        }
        is_going_on &= !ends;
    }
    answers
}

/// Azimuth in whole degrees and range in centimetres of each reading.
fn readings(log: &str) -> Vec<(i64, Option<i64>)> {
    let cm =
        |ping: &serde_json::Value| ping["range_m"].as_f64().map(|m| (100.0 * m).round() as i64);
    let deg = |ping: &serde_json::Value| {
        ping["azimuth_deg"].as_f64().expect("a direction").round() as i64
    };
    Log::parse(log).pings().iter().map(|ping| (deg(ping), cm(ping))).collect()
}

/// A row each ten degrees.
fn rows(header: &str, row: impl Fn(i32) -> String) -> String {
    let rows: String = (0..36).map(|at| format!("{}\n", row(at))).collect();
    format!("{header}\n{rows}")
}

const fn cm(at: i32) -> i32 {
    120 + at * 7 % 11
}

#[test]
fn offered_options_work() {
    let folder = tempfile::tempdir().expect("a folder");
    let expected: Vec<_> =
        (0..36).map(|at| (10 * i64::from(at), Some(i64::from(cm(at))))).collect();
    let third: Vec<_> =
        expected.iter().map(|&(deg, cm)| (deg, cm.filter(|_| deg / 10 % 3 != 0))).collect();
    let fixed: Vec<_> = expected.iter().map(|&(_, cm)| (90, cm)).collect();
    let with = |constant: &'static str| {
        move |at: i32| match at % 3 {
            0 => format!("{},{constant}", 10 * at),
            _ => format!("{},{}", 10 * at, cm(at)),
        }
    };
    let names = "angle_deg,distance_cm";
    for (name, text, right) in [
        ("longest", rows(names, with("400")), &third),
        ("beyond", rows(names, with("65535")), &third),
        ("zero", rows(names, with("0")), &third),
        ("minus one", rows(names, with("-1")), &third),
        (
            "metres",
            rows(names, |at| format!("{},{}", 10 * at, f64::from(cm(at)) / 100.0)),
            &expected,
        ),
        ("millimetres", rows(names, |at| format!("{},{}", 10 * at, 10 * cm(at))), &expected),
        (
            "radians",
            rows(names, |at| format!("{:.4},{}", f64::from(10 * at).to_radians(), cm(at))),
            &expected,
        ),
        (
            "no unit",
            rows("angle_deg,min_range,range", |at| format!("{},2,{}", 10 * at, cm(at))),
            &expected,
        ),
        (
            "blanks in names",
            rows("Lage [deg],Mess wert [cm]", |at| format!("{},{}", 10 * at, cm(at))),
            &expected,
        ),
        (
            "two ranges",
            rows("angle_deg,raw range_cm,range_cm", |at| format!("{},1,{}", 10 * at, cm(at))),
            &expected,
        ),
        ("fixed", rows("n,distance_cm", |at| format!("{at},{}", cm(at))), &fixed),
        (
            "the echo's place",
            rows("angle_deg,distance_cm,x_cm,y_cm", |at| {
                let (sin, cos) = f64::from(10 * at).to_radians().sin_cos();
                format!(
                    "{},{},{:.1},{:.1}",
                    10 * at,
                    cm(at),
                    f64::from(cm(at)) * cos,
                    f64::from(cm(at)) * sin
                )
            }),
            &expected,
        ),
        (
            "dates",
            rows("time,angle_deg,distance_cm", |at| {
                format!("01/02/2026 12:00:{at:02},{},{}", 10 * at, cm(at))
            }),
            &expected,
        ),
        (
            "commas",
            rows("angle_deg;distance_mm", |at| format!("{};1,{:03}", 10 * at, 10 * cm(at) - 1000)),
            &expected,
        ),
    ] {
        let path = folder.path().join("table.csv");
        fs::write(&path, text).expect("writes");
        let path = path.to_str().expect("a plain path");
        let given = ["import", path, "--sensor", "hc-sr04"];
        let message = refused(&given);
        let answers = offered(&message);
        assert!(!answers.is_empty(), "{name}: {message}");
        let read: Vec<_> = answers
            .iter()
            .filter_map(|answer| {
                let arguments = given.iter().copied().chain(answer.iter().map(String::as_str));
                let output = crate::common::run(&arguments.collect::<Vec<_>>());
                let text = crate::common::stderr(&output);
                assert!(
                    !text.contains("unexpected argument") && !text.contains("invalid value"),
                    "{name}: {answer:?}: {text}"
                );
                output.status.success().then(|| String::from_utf8(output.stdout).expect("text"))
            })
            .collect();
        assert!(read.iter().any(|log| readings(log) == **right), "{name}: {answers:?}");
    }
}

#[test]
fn dry_run_writes_no_log() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).to_str().expect("a plain path").to_owned();
    fs::write(
        path("a.csv"),
        rows("angle_deg,distance_cm,n", |at| format!("{},{},7", 10 * at, cm(at))),
    )
    .expect("writes");
    let output = crate::common::run(&[
        "import",
        &path("a.csv"),
        "--dry-run",
        "--picture",
        &path("a.svg"),
        "--scene",
        "simple-room",
    ]);
    let printed = crate::common::stderr(&output);
    assert!(output.status.success() && output.stdout.is_empty(), "{printed}");
    for part in ["columns: ", "columns not used: `n`", "counter-clockwise", "1 scan, 36 readings"] {
        assert!(printed.contains(part), "{part}: {printed}");
    }
    assert!(fs::read_to_string(path("a.svg")).expect("drawn").starts_with("<svg"));
    refused(&["import", &path("a.csv"), "--dry-run", "-o", &path("a.jsonl")]);
    done(&["import", &path("a.csv"), "-o", &path("a.jsonl"), "--picture", &path("a.png")]);
    assert!(fs::read(path("a.png")).expect("drawn").starts_with(b"\x89PNG"));
}

/// Options of other programs and verbs that messages recommend.
const OF_OTHERS: [&str; 6] =
    ["--src", "--dst", "--dst-storage", "--full-length", "--width-m", "--compression"];

/// Every option that a message of the importer names is one of the command.
#[test]
fn named_options_exist() {
    let help = done(&["import", "--help"]);
    let mut folders = vec![PathBuf::from("crates/sonard-import/src")];
    let mut count = 0;
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).expect("sources") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
                continue;
            }
            let text = fs::read_to_string(&path).expect("text");
            let code = text.lines().filter(|line| !line.trim_start().starts_with("//"));
            for word in code.flat_map(|line| line.split("--").skip(1)) {
                let end = word.find(|c: char| !c.is_ascii_lowercase() && c != '-' && c != '_');
                let option =
                    format!("--{}", word[..end.unwrap_or(word.len())].trim_end_matches('-'));
                if option.len() < 4 || OF_OTHERS.contains(&option.as_str()) {
                    continue;
                }
                count += 1;
                assert!(help.contains(&option), "{}: {option}", path.display());
            }
        }
    }
    assert!(count > 50, "{count}");
}
