//! Poses that come one by one: from people, programs and files.

use std::{io::Write as _, process::Stdio};

use super::{Case, joined_stderr};
use crate::common::{sonard, stderr};

/// Collects with these lines on standard input.
fn answered(case: &Case, lines: &str, further: &[&str]) -> std::process::Output {
    let arguments = case.arguments(further);
    let mut child = sonard(&arguments.iter().map(String::as_str).collect::<Vec<_>>())
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    let mut stdin = child.stdin.take().expect("piped");
    stdin.write_all(lines.as_bytes()).expect("it listens");
    drop(stdin);
    child.wait_with_output().expect("it ends")
}

#[test]
fn prompted_poses_and_conditions() {
    let case = Case::new(
        "[poses]\nprompt = true\nconfirm = true\n[collection]\nrepeats = 2\n\
         [ask]\nat_start = [\"operator\"]\nat_pose = [\"door\"]\n",
    );
    // First pose, operator, consent, door; a pose in the wall prompts again; then the second.
    let lines = "fig9\nAda\n\nopen\n5,5,0\n0.5,0.3,90\n\nshut\n\n";
    let output = answered(&case, lines, &[]);
    let text = joined_stderr(&output);
    assert_eq!(output.status.code(), Some(0), "{text}");
    assert!(text.contains("pose 3 (X,Y,DEG") && text.contains("put the ranger at fig9"), "{text}");
    case.assert_each_scan_once(2, 2, 25);
    let conditions = |name: &str| {
        let log = case.scan(name);
        log.of_type("session").next().expect("a session")["collection"]["conditions"].clone()
    };
    let expected = serde_json::json!({"operator": "Ada", "door": "open"});
    assert_eq!(conditions("p001-r02.jsonl"), expected);
    assert_eq!(conditions("p002-r01.jsonl")["door"], "shut");
    assert_eq!(case.manifest()["starts"][0]["conditions"]["operator"], "Ada");
}

#[test]
fn prompt_about_a_failed_check() {
    let plan = "[poses]\nlist = [\"fig9\"]\n[checks]\non_home_drift = \"ask\"\n";
    let case = Case::new(plan);
    let output = answered(&case, "what?\nr\nk\n", &["--missed-steps", "1"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert_eq!(case.files("rejected"), ["p001-r01-attempt1.jsonl"]);
    case.assert_each_scan_once(1, 1, 25);
    // Without a terminal it stops, and nothing is lost.
    let case = Case::new(plan);
    let output = answered(&case, "", &["--missed-steps", "1"]);
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    assert_eq!((case.files("scans").len(), case.files("rejected").len()), (0, 1));
}

#[test]
fn poses_from_programs() {
    let one = "[poses]\nprogram = '''case $SONARD_POSE in 1) echo fig9;; \
               2) echo '{\"x_m\":0.5,\"y_m\":0.3,\"heading_deg\":10,\"tilt\":2}';; esac'''\n";
    let case = Case::new(one);
    case.collect_all(&[]);
    case.assert_each_scan_once(2, 1, 25);
    assert_eq!(case.manifest()["poses"]["2"]["conditions"]["tilt"], 2);

    let stream = "[poses]\nstream = '''for y in 0.2 0.3 0.4 0.5; do echo 0.5,$y,0; done; sleep 60'''\ncount = 3\n";
    let case = Case::new(stream);
    case.collect_all(&[]);
    case.assert_each_scan_once(3, 1, 25);

    for (command, part) in
        [("false", "failed: exit status: 1"), ("echo nonsense", "printed no valid pose")]
    {
        let case = Case::new(&format!("[poses]\nprogram = \"{command}\"\n"));
        let output = case.collect(&[]);
        assert!(
            output.status.code() == Some(2) && joined_stderr(&output).contains(part),
            "{}",
            stderr(&output)
        );
    }
}

#[test]
fn poses_from_a_file() {
    let case = Case::new("");
    let file = case.path("poses.csv");
    case.write("poses.csv", "name,x_m,y_m,heading_deg,door\na,0.5,0.3,0,open\nb,0.6,0.2,45,\n");
    let plan = format!("{}[poses]\nfile = \"{}\"\n", super::SHORT, file.display());
    case.write("plan.toml", &plan);
    case.collect_all(&[]);
    case.assert_each_scan_once(2, 1, 25);
    assert_eq!(case.manifest()["poses"]["1"]["conditions"]["door"], "open");
    case.write("poses.csv", "name,x_m,y_m,heading_deg\na,0.5,0.3,0\nb,0.6,0.25,45\n");
    let output = case.collect(&[]);
    assert!(
        output.status.code() == Some(2) && joined_stderr(&output).contains("poses in the file")
    );
    case.write("poses.csv", "name,x_m,y_m,heading_deg\na,0.5,0.3,0\nb,zero,0.25,45\n");
    let output = case.collect(&[]);
    assert!(joined_stderr(&output).contains("poses.csv:3:"), "{}", stderr(&output));
}
