//! Commit and features of a program, determined by its build script.
//!
//! A build script calls [`emit`]; the program reads `env!("SONARD_COMMIT")` and
//! `env!("SONARD_FEATURES")`.
// What a build script prints is read by cargo.
#![allow(clippy::print_stdout)]

use std::{env, path::Path, process::Command};

/// Sources of all programs within the repository, whose changes since the commit are stated.
const SOURCES: [&str; 5] = ["src", "crates", "firmware-protocol", "Cargo.toml", "Cargo.lock"];

/// Package within the repository.
#[derive(Debug, Clone, Copy)]
pub struct Package<'a> {
    /// Folder of the package with a slash at its end, such as `emulator/`; empty for the root.
    pub folder: &'a str,
    /// Cargo features that the program states.
    pub features: &'a [&'a str],
}

/// Prints the instructions that set `SONARD_COMMIT` and `SONARD_FEATURES` for the compiler, from
/// the variable `SONARD_COMMIT` or the checkout. The commit is `unknown` outside of a checkout.
pub fn emit(package: Package<'_>) {
    println!("cargo:rerun-if-env-changed=SONARD_COMMIT");
    println!("cargo:rustc-env=SONARD_COMMIT={}", commit(package.folder));
    let is_enabled =
        |name: &&&str| env::var_os(format!("CARGO_FEATURE_{}", name.to_uppercase())).is_some();
    let features: Vec<_> = package.features.iter().filter(is_enabled).copied().collect();
    println!("cargo:rustc-env=SONARD_FEATURES={}", features.join(", "));
}

/// Abbreviated commit: that of the environment, else that of the checkout, else `unknown`.
fn commit(folder: &str) -> String {
    if let Ok(commit) = env::var("SONARD_COMMIT") {
        return commit;
    }
    // A source archive within another checkout has no commit of its own.
    let is_here = git(&["rev-parse", "--show-prefix"]).is_some_and(|prefix| prefix == folder);
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
    let root = "../".repeat(folder.matches('/').count());
    let sources = SOURCES.map(|source| format!("{root}{source}"));
    sources.iter().for_each(|source| println!("cargo:rerun-if-changed={source}"));
    let status = ["status", "--porcelain", "--untracked-files=no", "--"];
    let sources = sources.iter().map(String::as_str);
    match git(&status.into_iter().chain(sources).collect::<Vec<_>>()) {
        Some(changes) if changes.is_empty() => commit,
        _ => format!("{commit}-modified"),
    }
}

fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| text.trim().to_owned())
}
