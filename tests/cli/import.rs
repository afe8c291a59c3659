//! Readings from elsewhere, through the whole program.

mod answers;
#[cfg(feature = "sqlite")]
#[cfg(feature = "sqlite")]
mod databases;
mod formats;

use std::{fs, path::Path};

use crate::common::{Log, run, sonard, stderr};

/// Runs a verb that should succeed; its standard output.
fn done(arguments: &[&str]) -> String {
    let output = run(arguments);
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", stderr(&output));
    String::from_utf8(output.stdout).expect("text")
}

/// Runs a verb that must reject its input; returns the message.
fn refused(arguments: &[&str]) -> String {
    let output = run(arguments);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}");
    let printed = stderr(&output);
    assert!(!printed.contains("panicked"), "{printed}");
    printed.split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" ")
}

/// The readings of the model at 15 degrees, in a table as people write them: clockwise from the right, in
/// centimetres, silence as 0.
fn write_table(folder: &Path) -> String {
    let log = done(&[
        "simulate",
        "--scene",
        "two-surface-room",
        "--pose",
        "middle",
        "--step-deg",
        "5",
        "--temperature-c",
        "15",
        "--ideal-receiver",
    ]);
    let mut table = "Angle [deg];Distance [cm]\n".to_owned();
    for ping in Log::parse(&log).pings() {
        let azimuth_deg = ping["azimuth_deg"].as_f64().expect("a direction");
        let clockwise_deg = (90.0 - azimuth_deg).rem_euclid(360.0);
        // As a program would that takes sound to go 340 m/s.
        let range_cm =
            ping["range_m"].as_f64().map_or(0.0, |m| 100.0 * m * 340.0 / sound_speed_m_s());
        table.push_str(&format!("{clockwise_deg};{range_cm:.3}\n"));
    }
    let path = folder.join("table.csv").to_str().expect("a plain path").to_owned();
    fs::write(&path, table).expect("writes");
    path
}

fn sound_speed_m_s() -> f64 {
    sonard::acoustics::Air::new(15.0, 50.0, 101.325).expect("air").sound_speed_m_s()
}

#[test]
fn table_to_log() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = |name: &str| folder.path().join(name).to_str().expect("a plain path").to_owned();
    let table = write_table(folder.path());
    let [log, predicted, picture, map, trusted] =
        ["log.jsonl", "predicted.jsonl", "picture.svg", "map", "trusted.jsonl"].map(out);
    let import = |log: &str| {
        let output = run(&[
            "import",
            &table,
            "--clockwise",
            "--zero-deg",
            "90",
            "--no-echo",
            "0",
            "--source-sound-speed",
            "340",
            "--temperature-c",
            "15",
            "--scene",
            "two-surface-room",
            "--pose",
            "middle",
            "-o",
            log,
        ]);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        stderr(&output)
    };
    let printed = import(&log);
    assert!(
        printed.contains("`Angle [deg]` -> azimuth_deg, `Distance [cm]` -> range_cm"),
        "{printed}"
    );
    let records = Log::read(log.as_ref());
    let session = &records.records[0];
    assert_eq!(session["provenance"], "imported");
    assert_eq!(session["imported"]["file"], "table.csv");
    assert_eq!(session["imported"]["mapping"]["columns"]["range_cm"], "Distance [cm]");
    assert_eq!(session["imported"]["sha256"].as_str().map(str::len), Some(64));
    assert_eq!(records.pings().len(), 72);
    assert!(done(&["log", "verify", &log]).contains("clean"));
    // The same file makes the same log.
    let again = out("again.jsonl");
    import(&again);
    assert_eq!(fs::read(&log).expect("reads"), fs::read(&again).expect("reads"));

    let agree = |arguments: &[&str]| {
        let mut all = vec!["compare", "--json"];
        all.extend(arguments);
        let printed: serde_json::Value = serde_json::from_str(&done(&all)).expect("an object");
        (
            printed["agree"].as_u64().expect("a count"),
            printed["both_echo"].as_u64().expect("a count"),
        )
    };
    done(&["predict", &log, "--ideal-receiver", "-o", &predicted]);
    let (agreeing, both) = agree(&[&predicted]);
    assert!(both > 60 && agreeing == both, "{agreeing} of {both}");
    // Another pose explains less, with a message; so does other air.
    assert!(agree(&[&predicted, "--pose", "1.3,1,90"]).0 < both / 2);
    assert!(agree(&[&predicted, "--heading", "80"]).0 < both / 2);
    assert!(agree(&[&log, "--temperature-c", "-5"]).0 < agree(&[&log]).0);
    let predictions = Log::read(predicted.as_ref());
    assert_eq!(predictions.records[0]["model"]["engine"], "paths");
    assert!(predictions.pings().iter().all(|ping| ping["sim"]["status"].is_string()));
    for arguments in [
        vec!["plot", &predicted, "-o", &picture],
        vec!["plot", &predicted, "--kind", "residuals", "-o", &picture],
        vec!["map", &predicted, "--out", &map],
        vec!["log", "show", "--readings", &predicted],
        vec!["log", "annotate", &predicted, "-o", &trusted],
        vec!["interpret", &predicted],
        vec!["lines", &predicted],
    ] {
        done(&arguments);
    }
}

/// A mapping file, options over it, and a file from standard input.
#[test]
fn mapping_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let mapping = folder.path().join("mapping.toml");
    fs::write(
        &mapping,
        "none = [255.0]\nclockwise = true\n[columns]\nbearing_deg = 1\nrange_cm = \"d\"\n",
    )
    .expect("writes");
    let mapping = mapping.to_str().expect("a plain path");
    let refusal = refused(&["import", "/dev/null", "--mapping", mapping]);
    assert!(refusal.contains("has no line"), "{refusal}");
    let mut child =
        sonard(&["import", "-", "--mapping", mapping, "--columns", "bearing_deg=1,range_cm=2"])
            .stdin(std::process::Stdio::piped())
            .stdout(std::process::Stdio::piped())
            .stderr(std::process::Stdio::null())
            .spawn()
            .expect("starts");
    std::io::Write::write_all(&mut child.stdin.take().expect("piped"), b"10 255\n20 120\n")
        .expect("writes");
    let output = child.wait_with_output().expect("ends");
    let log = Log::parse(std::str::from_utf8(&output.stdout).expect("text"));
    let pings = log.pings();
    assert_eq!((&pings[0]["status"], &pings[0]["azimuth_deg"]), (&"no_echo".into(), &350.0.into()));
    assert!((pings[1]["range_m"].as_f64().expect("a range") - 1.2).abs() < 1e-9);
    assert_eq!(log.records[0]["imported"]["poses_known"], false);
    fs::write(mapping, "nome = [255.0]\n").expect("writes");
    let refusal = refused(&["import", "-", "--mapping", mapping]);
    assert!(refusal.contains("unknown field `nome`"), "{refusal}");
}

#[test]
fn wrong_files_and_outputs() {
    let folder = tempfile::tempdir().expect("a folder");
    let table = write_table(folder.path());
    let before = fs::read(&table).expect("reads");
    let over = refused(&["import", &table, "--no-echo", "0", "-o", &table]);
    assert!(over.contains("is read by this command"), "{over}");
    assert_eq!(fs::read(&table).expect("reads"), before);
    let zero = folder.path().join("zero.csv");
    fs::write(&zero, "azimuth_deg,range_cm\n0,100\n10,0\n").expect("writes");
    let silent = refused(&["import", zero.to_str().expect("a plain path")]);
    assert!(silent.contains("a range of 0") && silent.contains("--no-echo=0"), "{silent}");
    let none = refused(&["import", "/nowhere.csv"]);
    assert!(none.contains("No such file"), "{none}");
    let picture = folder.path().join("a.gz");
    fs::write(&picture, [0x1f, 0x8b, 8, 0, 0xff, 0xfe]).expect("writes");
    let packed = refused(&["import", picture.to_str().expect("a plain path")]);
    assert!(packed.contains("compressed"), "{packed}");
    let log = folder.path().join("log.jsonl");
    let log = log.to_str().expect("a plain path");
    done(&["import", &table, "--no-echo", "0", "-o", log]);
    let nothing = refused(&["predict", log]);
    assert!(nothing.contains("no reading to predict") && nothing.contains("--scene"), "{nothing}");
}

/// The page about the format holds a log, and the schema knows its lines.
#[test]
fn minimal_log_of_the_manual() {
    let page = include_str!("../../docs/log.md");
    let (_, rest) = page.split_once("```json\n").expect("a log");
    let (log, _) = rest.split_once("```").expect("its end");
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("least.jsonl");
    fs::write(&path, log).expect("writes");
    let path = path.to_str().expect("a plain path");
    assert!(done(&["log", "verify", path]).contains("clean"));
    done(&["predict", path, "--scene", "two-surface-room"]);
    let schema: serde_json::Value = serde_json::from_str(&done(&["log", "schema"])).expect("JSON");
    assert!(schema["oneOf"].as_array().is_some_and(|kinds| kinds.len() == 5), "{schema}");
}

/// Status, azimuth and range of each reading, and by which ranger.
fn received(log: &str) -> Vec<(String, i64, Option<String>, Option<String>)> {
    let reported = |ping: &&serde_json::Value| {
        let word = |name: &str| ping[name].as_str().map(str::to_owned);
        let azimuth = (ping["azimuth_deg"].as_f64().expect("a direction") * 1e3).round() as i64;
        let range_m = ping["range_m"].as_f64().map(|range_m| (range_m as f32).to_string());
        let status = word("status").expect("a status");
        let range_m = range_m.filter(|_| status == "echo");
        (status, azimuth % 360_000, range_m, word("ranger"))
    };
    Log::parse(log).pings().iter().map(reported).collect()
}

/// Returns the position of the robot at each reading, to a micrometre.
fn places(log: &str) -> Vec<[i64; 3]> {
    let (mut of_scan, mut places) = (serde_json::Value::Null, Vec::new());
    for line in log.lines() {
        let record: serde_json::Value = serde_json::from_str(line).expect("a record");
        match record["type"].as_str() {
            Some("scan_start") => of_scan = record["pose"].clone(),
            Some("ping") => {
                let pose = if record["pose"].is_null() { &of_scan } else { &record["pose"] };
                let part =
                    |name: &str| (pose[name].as_f64().expect("a number") * 1e6).round() as i64;
                places.push(["x_m", "y_m", "heading_deg"].map(part));
            }
            _ => {}
        }
    }
    places
}

/// Recordings of `sonard export` are imported with equal readings and positions.
#[test]
fn recording_round_trip() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).to_str().expect("a plain path").to_owned();
    let course = path("course.csv");
    fs::write(&course, "x_m,y_m,heading_deg\n2,1.5,0\n2.6,1.5,0\n3.2,1.6,30\n").expect("writes");
    let (log, recording) = (path("log.jsonl"), path("log.mcap"));
    for simulate in [
        &["--scene", "simple-room", "--pose", "fig9"][..],
        &["--scene", "mcgill-lab", "--poses", &course, "--max-range", "5"],
        &["--array", "pioneer-8", "--scene", "mcgill-lab", "--poses", &course],
    ] {
        done(&[&["simulate", "-o", &log, "--force"], simulate].concat());
        for profile in ["rep117", "nav2"] {
            done(&["export", &log, "--profile", profile, "-o", &recording]);
            let again = done(&["import", &recording]);
            let was = fs::read_to_string(&log).expect("written");
            assert_eq!(received(&again), received(&was), "{simulate:?} {profile}");
            assert_eq!(places(&again), places(&was), "{simulate:?}");
        }
        // Of a scan that has the form of one, the laser's as well.
        let laser = sonard(&["import", &recording, "--topic", "/sonar/scan"]).output();
        let laser = laser.expect("starts");
        if simulate.contains(&"--array") {
            assert_eq!(laser.status.code(), Some(2), "{}", stderr(&laser));
        } else {
            let text = String::from_utf8(laser.stdout).expect("text");
            assert_eq!(received(&text), received(&fs::read_to_string(&log).expect("written")));
        }
    }
}

#[test]
fn recording_folder() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).to_str().expect("a plain path").to_owned();
    let (log, bag) = (path("log.jsonl"), path("bag"));
    done(&["simulate", "--scene", "simple-room", "--pose", "fig9", "-o", &log]);
    fs::create_dir(&bag).expect("writable");
    assert!(refused(&["import", &bag]).contains("no recording"));
    fs::write(path("bag/bag_0.mcap.zstd"), b"").expect("writable");
    assert!(refused(&["import", &bag]).contains("zstd -d"));
    // The tenth file comes behind the second.
    for name in ["bag/bag_10.mcap", "bag/bag_2.mcap"] {
        done(&["export", &log, "-o", &path(name)]);
    }
    let again = done(&["import", &bag]);
    assert_eq!(Log::parse(&again).pings().len(), 800);
}

#[cfg(not(feature = "sqlite"))]
#[test]
fn database_without_the_feature() {
    let folder = tempfile::tempdir().expect("a folder");
    let bag = folder.path().to_str().expect("a plain path");
    let file = folder.path().join("bag_0.db3");
    fs::write(&file, b"SQLite format 3\0").expect("writable");
    for given in [bag, file.to_str().expect("a plain path")] {
        let reported = refused(&["import", given]);
        assert!(
            reported.contains("ros2 bag convert") && reported.contains("--features sqlite"),
            "{reported}"
        );
    }
}
