//! Completions of verbs, options and values, through a shell.

use std::{
    fs,
    path::Path,
    process::{Command, Output, Stdio},
};

use crate::common::{run, stderr};

/// Requests the completions of the last word, as the script of a shell does.
fn complete(words: &[&str]) -> Vec<String> {
    let output = Command::new(env!("CARGO_BIN_EXE_sonard"))
        .arg("--")
        .args(words)
        .env("SONARD_COMPLETE", "fish")
        .output()
        .expect("it starts");
    assert!(output.status.success(), "{}", stderr(&output));
    let text = String::from_utf8(output.stdout).expect("UTF-8");
    text.lines().map(|line| line.split('\t').next().unwrap_or_default().to_owned()).collect()
}

#[test]
fn verbs_options_and_values() {
    for (words, expected) in [
        (&["sonard", "calib"][..], "calibrate"),
        (&["sonard", "log", "ver"], "verify"),
        (&["sonard", "scan", "--max-r"], "--max-range"),
        (&["sonard", "scan", "--scene", "simple-r"], "simple-room"),
        (&["sonard", "mock", "--scene", "simple-room", "--pose", "fig"], "fig9"),
        (&["sonard", "mock", "--scene=simple-room", "--pose", ""], "fig7"),
        (&["sonard", "scene", "draw", "simple-room", "--pose", "fig"], "fig9"),
        (&["sonard", "simulate", "--sensor", "hc-"], "hc-sr04"),
        (&["sonard", "simulate", "--array", "pio"], "pioneer-8"),
        (&["sonard", "sensor", "show", "hc"], "hc-sr04"),
        (&["sonard", "scene", "show", "mcg"], "mcgill-lab"),
    ] {
        let found = complete(words);
        assert!(found.iter().any(|value| value == expected), "{words:?}: {found:?}");
    }
    // A pose of another scene is no completion.
    let poses = complete(&["sonard", "mock", "--scene", "corridor", "--pose", ""]);
    assert!(!poses.is_empty() && !poses.contains(&"fig9".to_owned()), "{poses:?}");
}

#[test]
fn files_next_to_names() {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("simple-attic.json"), "{}").expect("there is room");
    let output = Command::new(env!("CARGO_BIN_EXE_sonard"))
        .args(["--", "sonard", "scan", "--scene", "simple-"])
        .env("SONARD_COMPLETE", "fish")
        .current_dir(folder.path())
        .output()
        .expect("it starts");
    let text = String::from_utf8(output.stdout).expect("UTF-8");
    assert!(text.contains("simple-attic.json") && text.contains("simple-room"), "{text}");
}

/// Lets bash load the script and complete a line.
fn bash(line: &str) -> Output {
    let program = Path::new(env!("CARGO_BIN_EXE_sonard")).parent().expect("a folder").display();
    let words: Vec<_> = line.split(' ').collect();
    let script = format!(
        "PATH={program}:$PATH\nsource <(sonard completions bash)\nCOMP_LINE='{line}'\n\
         COMP_WORDS=({})\nCOMP_CWORD={}\nCOMP_POINT=${{#COMP_LINE}}\nCOMP_TYPE=9\n\
         $(complete -p sonard | sed 's/.* -F \\([^ ]*\\).*/\\1/') sonard\nprintf '%s\\n' \"${{COMPREPLY[@]}}\"",
        words.iter().map(|word| format!("'{word}'")).collect::<Vec<_>>().join(" "),
        words.len() - 1
    );
    Command::new("bash").args(["-c", &script]).stdin(Stdio::null()).output().expect("bash")
}

#[test]
fn script_of_bash() {
    for (line, expected) in
        [("sonard loc", "locate"), ("sonard scan --scene simple-room --pose fig", "fig9")]
    {
        let output = bash(line);
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(text.lines().any(|word| word.trim() == expected), "{text}\n{}", stderr(&output));
    }
}

#[test]
fn scripts_and_wrong_shells() {
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let output = run(&["completions", shell]);
        assert!(output.status.success() && !output.stdout.is_empty(), "{shell}");
    }
    let output = run(&["completions", "tcsh"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("bash"), "{}", stderr(&output));
}
