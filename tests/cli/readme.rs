//! The README's commands, run as they stand there, in an empty folder.

use std::{
    env, fs,
    path::Path,
    process::{Command, Stdio},
};

const README: &str = include_str!("../../README.md");

/// What can't run in a test: it builds, installs, or needs hardware or the rights of root.
const EXCEPTIONS: [&str; 5] = ["cargo ", "./test.sh", "pip ", "sudo ", "sudoedit "];

/// The shell commands of the README, block by block.
fn blocks() -> Vec<String> {
    let blocks = README.split("```sh\n").skip(1);
    blocks.map(|rest| rest.split("```").next().unwrap_or_default().to_owned()).collect()
}

/// A block without the commands that can't run here.
fn runnable(block: &str) -> String {
    let exception = |line: &&str| !EXCEPTIONS.iter().any(|start| line.starts_with(start));
    block.lines().filter(exception).map(|line| format!("{line}\n")).collect()
}

#[test]
fn every_command_of_the_readme_runs_as_pasted() {
    let folder = tempfile::tempdir().expect("a folder");
    let program = Path::new(env!("CARGO_BIN_EXE_sonard")).parent().expect("a folder");
    let path = format!("{}:{}", program.display(), env::var("PATH").unwrap_or_default());
    let curl = Command::new("curl").arg("--version").stdout(Stdio::null()).status();
    assert!(curl.is_ok(), "curl is missing: sudo apt-get install curl");
    let (mut commands, mut verbs) = (0, Vec::new());
    for block in blocks() {
        let block = runnable(&block);
        let of_sonard = block.lines().filter(|line| line.starts_with("sonard "));
        verbs.extend(of_sonard.filter_map(|line| line.split(' ').nth(1).map(str::to_owned)));
        commands += block.lines().filter(|line| !line.trim().is_empty()).count();
        // What goes on in the background ends with the block, however that ends.
        let script = format!("set -e\ntrap 'kill $(jobs -p) 2>/dev/null || true' EXIT\n{block}");
        let output = Command::new("bash")
            .args(["-c", &script])
            .current_dir(folder.path())
            .env("PATH", &path)
            .env("NO_COLOR", "1")
            .output()
            .expect("bash starts");
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{block}\n{said}");
        assert!(!said.contains("panicked"), "{block}\n{said}");
    }
    verbs.sort();
    verbs.dedup();
    assert!(commands > 40 && verbs.len() > 17, "{commands} lines of {verbs:?}");
    for file in ["out/fig7/scan.png", "path.png", "plan.png", "map/map.yaml", "array.png"] {
        assert!(fs::metadata(folder.path().join(file)).is_ok_and(|file| file.len() > 0), "{file}");
    }
}

#[test]
fn what_curl_is_asked_to_do_works_in_old_ones() {
    // --json came with 7.82; Debian 11 has 7.74.
    for (name, text) in [("README.md", README), ("run.rs", include_str!("../../src/cli/run.rs"))] {
        let newer = text.lines().find(|line| line.contains("curl") && line.contains("--json"));
        assert_eq!(newer, None, "{name}");
    }
}
