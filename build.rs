//! Commit of the source, for `sonard --version` and for the sessions of logs.

use std::{env, path::Path, process::Command};

/// Sources of the program, whose changes since the commit are stated.
const SOURCES: [&str; 5] = ["src", "crates", "firmware-protocol", "Cargo.toml", "Cargo.lock"];

/// Features that `sonard --version` states.
const FEATURES: [&str; 6] = ["daemon", "pi", "lz4", "mqtt", "ros", "sqlite"];

fn main() {
    println!("cargo:rerun-if-env-changed=SONARD_COMMIT");
    println!("cargo:rustc-env=SONARD_COMMIT={}", commit());
    let is_enabled =
        |name: &&&str| env::var_os(format!("CARGO_FEATURE_{}", name.to_uppercase())).is_some();
    let features: Vec<_> = FEATURES.iter().filter(is_enabled).copied().collect();
    println!("cargo:rustc-env=SONARD_FEATURES={}", features.join(", "));
}

/// Abbreviated commit: that of the environment, else that of the checkout, else `unknown`.
fn commit() -> String {
    if let Ok(commit) = env::var("SONARD_COMMIT") {
        return commit;
    }
    // A source archive within another checkout has no commit of its own.
    let is_here = git(&["rev-parse", "--show-prefix"]).is_some_and(|prefix| prefix.is_empty());
    let commit = git(&["rev-parse", "--short=12", "HEAD"]).filter(|_| is_here);
    let Some(commit) = commit else { return "unknown".to_owned() };
    let reference = git(&["symbolic-ref", "-q", "HEAD"]);
    for name in ["HEAD", "packed-refs"].into_iter().chain(reference.as_deref()) {
        if let Some(path) = git(&["rev-parse", "--git-path", name])
            && Path::new(&path).exists()
        {
            println!("cargo:rerun-if-changed={path}");
        }
    }
    SOURCES.iter().for_each(|source| println!("cargo:rerun-if-changed={source}"));
    let status = ["status", "--porcelain", "--untracked-files=no", "--"];
    match git(&[&status[..], &SOURCES].concat()) {
        Some(changes) if changes.is_empty() => commit,
        _ => format!("{commit}-modified"),
    }
}

fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| text.trim().to_owned())
}
