//! Tasks and their options as typed.

use std::process::{Command, Output};

fn run(arguments: &[&str]) -> Output {
    let program = env!("CARGO_BIN_EXE_xtask");
    Command::new(program).args(arguments).output().expect("the program starts")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

#[test]
fn help_lists_tasks() {
    for (arguments, part) in [
        (&[][..], "instructions"),
        (&["--help"], "dist"),
        (&["dist", "--help"], "--target"),
        (&["instructions", "--help"], "--record"),
    ] {
        let output = run(arguments);
        assert!(output.status.success() && text(&output.stdout).contains(part), "{arguments:?}");
    }
}

#[test]
fn wrong_arguments() {
    for (arguments, part) in [
        (&["release"][..], "no task"),
        (&["--only"], "--only"),
        (&["dist", "--only", "rpm"], "none of"),
        (&["instructions"], "no program"),
        (&["instructions", "a", "b"], "b"),
    ] {
        let output = run(arguments);
        let printed = text(&output.stderr);
        assert!(!output.status.success() && printed.contains(part), "{arguments:?}: {printed}");
    }
}
