//! Plans: complete, wrong and changed; predicted and actual durations.

use super::{Case, joined_stderr};
use crate::common::{run, stderr};

#[test]
fn report_and_manifest() {
    let case = Case::new(
        "[collection]\nname = \"shelf\"\nrepeats = 2\norder = \"random\"\nseed = 5\n\
         [poses]\nlist = [\"fig9\", \"0.5,0.3,45\", \"fig7\"]\n\
         [conditions]\nroom = \"laboratory\"\ncarpet = false\n",
    );
    case.collect_all(&[]);
    case.assert_each_scan_once(3, 2, 25);
    let log = case.scan("p002-r01.jsonl");
    let of = &log.of_type("session").next().expect("a session")["collection"];
    assert_eq!((&of["name"], &of["conditions"]["carpet"]), (&"shelf".into(), &false.into()));
    // In the order of the seed, which is not that of the poses.
    let order: Vec<_> = case
        .entries("attempt")
        .iter()
        .map(|take| (take["pose"].clone(), take["repeat"].clone()))
        .collect();
    let mut sorted = order.clone();
    sorted.sort_by_key(|(pose, repeat)| (pose.as_u64(), repeat.as_u64()));
    assert_eq!(order.len(), 6);
    assert_ne!(order, sorted);
    let report = case.text("out/report.md");
    for part in ["# shelf", "6 of 6 scans", "| 1 fig9 |", "carpet false", "report/pose-003.svg"] {
        assert!(report.contains(part), "{part} is not in\n{report}");
    }
    for picture in ["overview", "drift", "repeatability", "pose-001", "pose-002", "pose-003"] {
        let svg = case.text(&format!("out/report/{picture}.svg"));
        assert!(svg.contains("<svg"), "{picture}");
        assert_eq!(svg.contains("MOCK, not hardware"), picture != "overview", "{picture}");
    }
    assert!(case.text("out/inputs/plan.toml").contains("seed = 5"));
    // Started again it finds nothing to do, and does not even need the ranger.
    let again = case.collect(&["--port", "/nowhere"]);
    assert_eq!(again.status.code(), Some(0), "{}", stderr(&again));
    assert_eq!(case.verify().0, Some(0));

    // Report and manifest can be written again and differ in their time only.
    let out = case.path("out");
    let rewrite = |path: &str| run(&["collect", "--report", path]).status.code();
    assert_eq!(rewrite(out.to_str().expect("plain path")), Some(0));
    assert_eq!((case.text("out/report.md"), case.verify().0), (report, Some(0)));
    assert_eq!(rewrite("/nowhere"), Some(2));

    for (change, printed) in [
        ("scans/p001-r01.jsonl", "p001-r01.jsonl: changed"),
        ("journal.jsonl", "journal.jsonl: changed"),
        ("report/drift.svg", "drift.svg: changed"),
    ] {
        let name = format!("out/{change}");
        let before = case.text(&name);
        case.write(&name, &before.replacen('0', "1", 1));
        let (code, text) = case.verify();
        assert!(code == Some(1) && text.contains(printed), "{change}: {text}");
        case.write(&name, &before);
    }
    case.write("out/scans/p009-r01.jsonl", "");
    let (code, text) = case.verify();
    assert!(code == Some(1) && text.contains("p009-r01.jsonl: not in the manifest"), "{text}");
    std::fs::remove_file(case.path("out/scans/p009-r01.jsonl")).expect("it is there");
    std::fs::remove_file(case.path("out/scans/p003-r02.jsonl")).expect("it is there");
    let (code, text) = case.verify();
    assert!(code == Some(1) && text.contains("p003-r02.jsonl: cannot read"), "{text}");
}

#[test]
fn wrong_plans() {
    for (plan, place, help) in [
        ("", "plan.toml: poses.list: no poses", "exactly one of"),
        ("[poses]\nlist = [\"fig99\"]\n", "plan.toml:9:8: poses.list", "fig9"),
        ("[poses]\nlist = [\"9,9,0\"]\n", "plan.toml:9:8", ""),
        ("[poses]\nlist = [\"fig9\"]\nprompt = true\n", "more than one source", "exactly one of"),
        ("[poses]\nfile = \"nowhere.csv\"\n", "cannot read the poses nowhere.csv", "CSV"),
        ("[poses]\nlist = [\"fig9\"]\n[collection]\nrepeat = 2\n", "plan.toml:11:1", "`repeats`"),
        (
            "[poses]\nlist = [\"fig9\"]\n[checks]\non_home_drift = \"retry\"\n",
            "plan.toml:11:17",
            "retake",
        ),
        ("[poses]\nprompt = true\n[collection]\norder = \"rounds\"\n", "plan.toml:11:9", "by-pose"),
        ("[poses]\nlist = [\"fig9\"]\n[motion]\nspeed = 0\n", "plan.toml:11:9", "1 to 10000"),
        ("[poses]\nlist = [\"fig9\"]\n[air]\nfile = \"/nowhere/t\"\n", "/nowhere/t", "air.file"),
    ] {
        let case = Case::new(plan);
        let output = case.collect(&[]);
        let plain = joined_stderr(&output);
        let wanted = if plan.contains("/nowhere") { Some(3) } else { Some(2) };
        assert_eq!(output.status.code(), wanted, "{plan}: {plain}");
        assert!(plain.contains(place) && plain.contains(help), "{plan}: {plain}");
        assert!(!case.path("out/journal.jsonl").exists(), "{plan}");
    }
    let case = Case::new("[poses]\nlist = [\"fig9\"]\n");
    let output = run(&["collect", case.path("plan.toml").to_str().expect("plain path")]);
    assert!(output.status.code() == Some(2) && joined_stderr(&output).contains("no device"));
}

#[test]
fn changed_plan() {
    let plan =
        |more: &str| format!("{}[poses]\nlist = [\"fig9\"{more}]\n[collection]\n", super::SHORT);
    let case = Case::new("");
    case.write("plan.toml", &plan(""));
    case.collect_all(&[]);
    // A comment changes nothing.
    case.write("plan.toml", &format!("# day two\n{}", plan("")));
    case.collect_all(&[]);
    case.write("plan.toml", &(plan(", \"fig7\"") + "repeats = 2\n"));
    let refused = case.collect(&[]);
    let text = joined_stderr(&refused);
    assert_eq!(refused.status.code(), Some(2), "{text}");
    assert!(text.contains("collection.repeats changed from 1 to 2"), "{text}");
    let before = case.text("out/scans/p001-r01.jsonl");
    case.collect_all(&["--accept-changed-plan"]);
    case.assert_each_scan_once(2, 2, 25);
    assert_eq!(case.text("out/scans/p001-r01.jsonl"), before, "what was there stays");
    assert_eq!(case.entries("plan").len(), 2);
}

#[test]
fn estimate_matches_the_duration() {
    let case = Case::new(
        "[poses]\nlist = [\"fig9\"]\n[collection]\nrepeats = 3\npause_s = 0.2\n[motion]\nsettle_ms = 20\n",
    );
    let turn = ["--set", "plan.to_deg=360"];
    let output = case.collect(&[&turn[..], &["--plan-only", "--json"]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let printed: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let (scan, total) = (&printed["scan"], &printed["total"]);
    let figure = |value: &serde_json::Value| value.as_f64().expect("a figure");
    // 100 windows of 3 m there and back at 343.99 m/s, no less than 20 ms apart.
    let acoustics_s = figure(&scan["acoustics_s"]);
    assert!((acoustics_s - 100.0 * 2.0 * 1.5 / 343.99).abs() < 1e-4, "{scan}");
    let parts = ["acoustics_s", "motor_s", "link_s"].map(|part| figure(&scan[part]));
    assert!((parts.iter().sum::<f64>() - figure(&scan["total_s"])).abs() < 1e-9);
    assert!((figure(&total["total_s"]) - 3.0 * figure(&scan["total_s"]) - 0.4).abs() < 1e-9);
    assert!(!case.path("out").exists(), "a dry run writes nothing");

    case.collect_all(&[&turn[..], &["--realtime"]].concat());
    let takes = case.entries("attempt");
    let mut measured: Vec<f64> = takes.iter().map(|take| figure(&take["wall_s"])).collect();
    measured.sort_by(f64::total_cmp);
    let estimated_s = figure(&scan["total_s"]);
    println!("estimated {estimated_s:.4} s a scan, measured {measured:.4?}");
    // A busy computer keeps one scan or another waiting, so the middle one counts.
    let median_s = measured[1];
    assert!((median_s / estimated_s - 1.0).abs() < 0.03, "{median_s} s, {estimated_s} s estimated");
    // The files have about the predicted size.
    let bytes: u64 = case.manifest()["files"]
        .as_array()
        .expect("files")
        .iter()
        .filter(|file| file["scan"].is_object())
        .map(|file| file["bytes"].as_u64().expect("a size"))
        .sum();
    let printed = figure(&total["disk_bytes"]);
    assert!((bytes as f64 / printed - 1.0).abs() < 0.3, "{bytes} bytes, {printed} estimated");
}
