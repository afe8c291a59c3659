//! Arrays of rangers as a user meets them: `simulate --array` and what reads its logs.

use std::{fs, path::Path};

use serde_json::Value;
use tempfile::TempDir;

use crate::{
    common::{Log, run, stderr},
    map::score_of,
};

/// Runs and returns standard output as a log.
fn simulate(further: &[&str]) -> Log {
    let output = run(&[&["simulate"], further].concat());
    assert!(output.status.success(), "{further:?}: {}", stderr(&output));
    Log::parse(&String::from_utf8(output.stdout).expect("text"))
}

/// Writes a course through the two-surface room, and the readings of an array along it.
fn drive(folder: &Path, array: &str) -> String {
    let way = folder.join("trajectory.jsonl");
    let poses =
        ["0.7,0.8,0", "1.0,0.8,20", "1.3,0.9,60", "1.3,1.3,90", "1.1,1.7,120", "1.0,2.1,180"];
    let line = |pose: &&str| {
        let [x, y, deg] = pose.split(',').collect::<Vec<_>>()[..] else { panic!("a pose") };
        format!("{{\"x_m\":{x},\"y_m\":{y},\"heading_deg\":{deg}}}\n")
    };
    fs::write(&way, poses.iter().map(line).collect::<String>()).expect("writes");
    let log = folder.join(format!("{array}.jsonl"));
    let [way, path] = [&way, &log].map(|path| path.to_str().expect("plain path").to_owned());
    let arguments = ["--scene", "two-surface-room", "--poses", &way, "--array", array];
    let output = run(&[&["simulate", "--max-range", "4", "-o", &path], &arguments[..]].concat());
    assert!(output.status.success(), "{}", stderr(&output));
    path
}

#[test]
fn readings_per_ranger() {
    let log = simulate(&["--scene", "simple-room", "--pose", "0.4,0.37,0", "--array", "pioneer-8"]);
    let session = log.of_type("session").next().expect("a session");
    assert_eq!(session["provenance"], "simulated");
    assert_eq!(session["sensor"]["name"], "pioneer", "the array's own");
    assert_eq!(session["array"]["rangers"].as_array().map(Vec::len), Some(8));
    let pings = log.pings();
    let of = |name: &str| pings.iter().map(|ping| ping[name].clone()).collect::<Vec<_>>();
    assert_eq!(of("ranger"), ["s0", "s1", "s2", "s3", "s4", "s5", "s6", "s7"]);
    assert_eq!(of("azimuth_deg"), [90.0, 50.0, 30.0, 10.0, 350.0, 330.0, 310.0, 270.0]);
    assert!(of("provenance").iter().all(|of| of == "simulated"));
    // s0 looks straight at the north wall, y = 0.742, from y = 0.37 + 0.136.
    let range_m = pings[0]["range_m"].as_f64().expect("a wall");
    assert!((range_m - (0.742 - 0.506)).abs() < 0.003, "{range_m}");
    log.assert_each_beam_once(8);
}

/// The ring of a Pioneer that is polled in 12 ms instead of 40, and one of which two rangers fire at once.
#[test]
fn crosstalk() {
    let folder = TempDir::new().expect("a folder");
    let shipped = fs::read_to_string("arrays/pioneer-8.json").expect("the preset's file");
    let write = |name: &str, text: String| {
        let path = folder.path().join(name);
        fs::write(&path, text).expect("writes");
        path.to_str().expect("plain path").to_owned()
    };
    let hasty = write("hasty.json", shipped.replace("40.0", "12.0"));
    let place = ["--scene", "mcgill-lab", "--pose", "2.4,1.2,20", "--array"];
    let hasty_log = folder.path().join("hasty.jsonl").to_str().expect("plain path").to_owned();
    let output = run(&[&["simulate", "-o", &hasty_log], &place[..], &[&hasty]].concat());
    assert!(output.status.success(), "{}", stderr(&output));
    let log = Log::read(Path::new(&hasty_log));
    let strays: Vec<&Value> =
        log.pings().into_iter().filter(|ping| !ping["crosstalk"].is_null()).collect();
    assert!(!strays.is_empty());
    for ping in strays {
        let before_us = ping["crosstalk"]["before_us"].as_f64().expect("a time");
        assert!(before_us >= 12_000.0 && before_us % 12_000.0 == 0.0, "{before_us}");
        if ping["status"] == "echo" {
            // Its path is longer by what sound runs in that time, give or take the time walk.
            let path_m = ping["path"]["length_m"].as_f64().expect("a length");
            let speed_m_s =
                log.of_type("session").next().expect("a session")["air"]["sound_speed_m_s"]
                    .as_f64();
            let gone_m = before_us * 1e-6 * speed_m_s.expect("a speed");
            let seems_m = 2.0 * ping["range_m"].as_f64().expect("a range");
            assert!((path_m - gone_m - seems_m).abs() < 0.03, "{ping}");
        }
    }
    // Repeated predictions are equal, and without crosstalk no ranger detects another.
    let again = folder.path().join("again.jsonl").to_str().expect("plain path").to_owned();
    let predicted = run(&["predict", &hasty_log, "--scene", "mcgill-lab", "-o", &again]);
    assert!(predicted.status.success(), "{}", stderr(&predicted));
    for ping in Log::read(Path::new(&again)).pings() {
        assert_eq!(ping["sim"]["crosstalk"], ping["crosstalk"], "{ping}");
        assert_eq!(ping["sim"]["range_m"], ping["range_m"], "{ping}");
    }
    let alone = simulate(&[&place[..], &[&hasty, "--without-crosstalk"]].concat());
    assert!(alone.pings().iter().all(|ping| ping["crosstalk"].is_null()));
    let plotted = run(&["plot", &hasty_log, "-o", &format!("{hasty_log}.svg")]);
    assert!(plotted.status.success(), "{}", stderr(&plotted));

    let order = r#""firing_order": [["s3", "s4"], "s0", ["s1", "s7"]], "rangers": ["#;
    let pairs = write("pairs.json", shipped.replace("\"rangers\": [", order));
    let log = simulate(&[&place[..], &[&pairs]].concat());
    let rangers: Vec<_> = log.pings().iter().map(|ping| ping["ranger"].clone()).collect();
    assert_eq!(rangers, ["s3", "s4", "s0", "s1", "s7"]);
    let end = log.of_type("scan_end").next().expect("an end");
    assert_eq!(end["duration_s"], 0.12, "three turns of 40 ms");
    for (wrong, printed) in [
        (r#""firing_order": [[]], "rangers": ["#, "firing_order[0] is an empty list"),
        (
            r#""firing_order": ["s1", ["s2", "s2"]], "rangers": ["#,
            "firing_order[1] has \"s2\" twice",
        ),
        (r#""firing_order": [["s2", "x"]], "rangers": ["#, "firing_order[0] is \"x\""),
        (r#""firing_order": [3], "rangers": ["#, "firing_order[0]: a ranger's id, or a list"),
    ] {
        let file = write("wrong.json", shipped.replace("\"rangers\": [", wrong));
        let output = run(&[&["simulate"], &place[..], &[&file]].concat());
        assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
        assert!(stderr(&output).contains(printed), "{} lacks {printed}", stderr(&output));
    }
}

#[test]
fn rounds_of_a_ring() {
    let folder = TempDir::new().expect("a folder");
    let path = folder.path().join("ring.jsonl").to_str().expect("plain path").to_owned();
    let arguments = ["--scene", "two-surface-room", "--pose", "1.2,1,30", "--array", "ring-12"];
    let further = ["simulate", "--rounds", "15", "--max-range", "4", "-o", &path];
    assert!(run(&[&further, &arguments[..]].concat()).status.success());
    let log = Log::read(Path::new(&path));
    log.assert_each_beam_once(180);
    let headings: Vec<f64> = log
        .pings()
        .iter()
        .map(|ping| ping["pose"]["heading_deg"].as_f64().unwrap_or(30.0))
        .collect();
    assert_eq!((headings[0], headings[12], headings[179]), (30.0, 32.0, 58.0));
    assert_eq!(run(&["log", "verify", &path]).status.code(), Some(0));
    // The model predicts the same again, from where each ranger was.
    let compared = run(&["compare", &path, "--scene", "two-surface-room", "--json"]);
    let compared: Value = serde_json::from_slice(&compared.stdout).expect("one object");
    assert_eq!(
        (&compared["beams"], &compared["verdicts"]["unexplained"]),
        (&180.into(), &0.into())
    );
    assert_eq!(compared["p90_abs_residual_m"], 0.0);
    let shown = run(&["log", "show", &path]);
    assert!(String::from_utf8_lossy(&shown.stdout).contains("ring-12: 12 rangers"));
}

#[test]
fn plot_map_and_lines() {
    let folder = TempDir::new().expect("a folder");
    let (eight, ring) = (drive(folder.path(), "pioneer-8"), drive(folder.path(), "ring-12"));
    let file = |name: &str| folder.path().join(name).to_str().expect("plain path").to_owned();
    let picture = file("fans.svg");
    assert!(run(&["plot", &eight, "-o", &picture]).status.success());
    let svg = fs::read_to_string(&picture).expect("written");
    assert!(svg.contains("class=\"fans\"") && svg.contains("pioneer-8: 8 rangers"), "fans");
    assert!(svg.contains("s3, 10.0\u{b0}"), "a hint names the ranger");

    let out = file("map");
    let map = run(&["map", &eight, &ring, "--out", &out, "--json"]);
    assert!(map.status.success(), "{}", stderr(&map));
    let map: Value = serde_json::from_slice(&map.stdout).expect("one object");
    assert_eq!((&map["scans"], &map["readings"]), (&12.into(), &(6 * 20).into()));
    let score = score_of(&out, "two-surface-room");
    assert!(score.correlation_percent.is_some_and(|percent| percent > 20.0), "{score:?}");

    // Arcs of constant depth need one ranger that turns.
    let refused = run(&["interpret", &eight]);
    assert_eq!(refused.status.code(), Some(2));
    let message = stderr(&refused);
    assert!(message.contains("of an array") && message.contains("sonard lines"), "{message}");
    assert!(run(&["lines", &ring, "--json"]).status.success());
}

/// A wall that a ranger looks at straight on is mapped where it is, which needs the ranger's own
/// place: from the robot's middle it would be 16 cm nearer.
#[test]
fn map_matches_the_scene() {
    let folder = TempDir::new().expect("a folder");
    let path = |name: &str| folder.path().join(name).to_str().expect("plain path").to_owned();
    let (log, out) = (path("ring.jsonl"), path("map"));
    let place = ["--scene", "two-surface-room", "--pose", "1.2,1,0", "--array", "ring-12"];
    assert!(run(&[&["simulate", "-o", &log], &place[..]].concat()).status.success());
    let further = ["--out", &out, "--region", "-0.5,-0.5,4,3", "--resolution", "0.02"];
    assert!(run(&[&["map", &log], &further[..]].concat()).status.success());
    let pgm = fs::read(folder.path().join("map/map.pgm")).expect("written");
    let (width, height) = (225, 175);
    let cells = &pgm[pgm.len() - width * height..];
    let at = |x_m: f64, y_m: f64| {
        let (column, row) = (((x_m + 0.5) / 0.02) as usize, ((y_m + 0.5) / 0.02) as usize);
        cells[(height - 1 - row) * width + column]
    };
    // The west wall is x = 0; the ranger behind sees it.
    assert!(at(0.0, 1.0) < 90, "occupied where the wall is: {}", at(0.0, 1.0));
    assert!(at(0.16, 1.0) > 128 && at(0.6, 1.0) > 150, "free before it: {}", at(0.16, 1.0));
}

#[test]
fn wrong_arrays() {
    let folder = TempDir::new().expect("a folder");
    let file = |name: &str, text: &str| {
        let path = folder.path().join(name);
        fs::write(&path, text).expect("writes");
        path.to_str().expect("plain path").to_owned()
    };
    let good = include_str!("../../arrays/pioneer-8.json");
    let twice = file("twice.json", &good.replace("\"s5\"", "\"s2\""));
    let wrong = file("wrong.json", &good.replace("bearing_deg", "bearing"));
    let nan = file("nan.json", &good.replace("50.0", "NaN"));
    let way = file("trajectory.jsonl", "\n{\"x_m\":9,\"y_m\":0.3}\n");
    let broken = file("broken.jsonl", "\n{\"x_m\":0.4}\n");
    let at = |pose: &'static str, further: &[&str]| -> Vec<String> {
        let place = ["simulate", "--scene", "simple-room", "--pose", pose];
        place.iter().chain(further).map(|&one| one.to_owned()).collect()
    };
    let along = |way: &str| -> Vec<String> {
        ["simulate", "--scene", "simple-room", "--array", "pioneer-8", "--poses", way]
            .map(str::to_owned)
            .into()
    };
    let middle = "0.4,0.37,0";
    for (arguments, parts) in [
        (at(middle, &["--array", "pionier-8"]), &["pionier-8", "did you mean `pioneer-8`"][..]),
        (at(middle, &["--array", &twice]), &["twice.json: rangers[5].id is \"s2\""]),
        (at(middle, &["--array", &wrong]), &["wrong.json:7:", "bearing_deg"]),
        (at(middle, &["--array", &nan]), &["nan.json:8:"]),
        (at(middle, &["--array", "pioneer-8", "--step-deg", "9"]), &["--step-deg"]),
        (at(middle, &["--rounds", "2"]), &["--array"]),
        (at("0.8,0.37,0", &["--array", "pioneer-8"]), &["ranger s2", "outside the room"]),
        (at("0.762,0.37,0", &["--array", "pioneer-8"]), &["ranger s3", "mm from `east`"]),
        (at("5,5,0", &["--array", "pioneer-8"]), &["outside the room"]),
        (along(&way), &["trajectory.jsonl:2: ", "outside"]),
        (along(&broken), &["broken.jsonl:2: ", "y_m"]),
        (along("/nowhere.jsonl"), &["/nowhere.jsonl"]),
        (
            ["scan", "--mock", "--scene", "simple-room", "--pose", "fig9", "--array", "ring-12"]
                .map(str::to_owned)
                .into(),
            &["stepper", "sonard simulate --array", "sonard run --simulate"],
        ),
        (
            ["mock", "--scene", "simple-room", "--pose", "fig9", "--array", "ring-12"]
                .map(str::to_owned)
                .into(),
            &["stepper", "sonard simulate --array"],
        ),
    ] {
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        let output = run(&arguments);
        let printed = stderr(&output).replace(['\n', '\u{2502}'], " ");
        let printed = printed.split_whitespace().collect::<Vec<_>>().join(" ");
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {printed}");
        for part in parts {
            assert!(printed.contains(part), "{arguments:?}: {part:?} is not in: {printed}");
        }
        assert!(!printed.contains("panicked"), "{printed}");
    }
}
