//! Workloads of the instruction counts.

use std::process::{Command, Output};

fn run(argument: &str) -> Output {
    let program = env!("CARGO_BIN_EXE_instructions");
    Command::new(program).arg(argument).output().expect("the program starts")
}

fn printed(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

#[test]
fn workloads_compute() {
    let names = printed(&run("--list"));
    assert!(names.lines().count() >= 6, "{names}");
    for name in names.lines() {
        let output = run(name);
        assert!(output.status.success(), "{name}: {}", String::from_utf8_lossy(&output.stderr));
        let digest: f64 = printed(&output).trim().parse().expect("a number");
        assert!(digest.is_finite() && digest != 0.0, "{name}: {digest}");
    }
    let frames = printed(&run("frames"));
    assert_eq!(frames.trim(), "1000", "all readings are decoded");
}

#[test]
fn unknown_workload() {
    let output = run("scan");
    assert!(!output.status.success());
    assert!(String::from_utf8_lossy(&output.stderr).contains("--list"));
}
