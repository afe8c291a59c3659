//! Test coverage: `cargo xtask coverage`.
//!
//! All tests run on instrumented programs (cargo-llvm-cov), and lines are counted by crate. Tests
//! kill processes; the profiles that these leave incomplete are skipped.

use std::{
    collections::BTreeMap,
    fs,
    path::Path,
    process::{Command, Stdio},
};

use lexopt::{Arg, Parser};
use serde_json::Value;

use crate::{
    Failure,
    command::{read, run},
    folders,
};

pub(crate) const HELP: &str = "\
Run all tests on instrumented programs, and print the share of lines that they execute, by crate.
Takes an hour on two cores, and 10 GB of disk. Build the playground before by web/build.sh: without
it, its tests fail, and the report lacks what they execute.

Usage: cargo xtask coverage [--report-only]

  --report-only   print the table of the last run";

/// Requested run.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct CoverageOptions {
    report_only: bool,
}

impl CoverageOptions {
    /// Parses the arguments after the task; `None` if help is requested.
    ///
    /// # Errors
    /// An unknown argument.
    pub(crate) fn parse(mut arguments: Parser) -> Result<Option<Self>, Failure> {
        let mut options = Self { report_only: false };
        while let Some(argument) = arguments.next()? {
            match argument {
                Arg::Long("report-only") => options.report_only = true,
                Arg::Short('h') | Arg::Long("help") => return Ok(None),
                other => return Err(other.unexpected().into()),
            }
        }
        Ok(Some(options))
    }
}

/// Runs the tests, unless only the report is requested, and prints the table.
///
/// # Errors
/// cargo-llvm-cov is not installed, the tests can't be built, or no profile is left.
pub(crate) fn measure(options: &CoverageOptions) -> Result<(), Failure> {
    const NEEDED: &str = "cargo-llvm-cov is needed: rustup component add llvm-tools && \
                          cargo install cargo-llvm-cov --locked";
    let version =
        Command::new("cargo").args(["llvm-cov", "--version"]).stderr(Stdio::null()).output();
    if !version.is_ok_and(|of| of.status.success()) {
        return Err(NEEDED.into());
    }
    if !options.report_only {
        run_tests()?;
    }
    let path = folders::target()?.join("coverage.json");
    let mut report = Command::new("cargo");
    report.args(["llvm-cov", "report", "--failure-mode", "all", "--json", "--summary-only"]);
    for package in packages()? {
        report.args(["-p", &package]);
    }
    run(report.arg("--output-path").arg(&path).stderr(Stdio::null()))?;
    let found: Value = serde_json::from_str(&fs::read_to_string(&path)?)?;
    print!("{}", table(&by_crate(&found, folders::root()?)?));
    Ok(())
}

/// Runs all tests. What failed tests executed counts as well.
fn run_tests() -> Result<(), Failure> {
    const TESTS_FAILED: i32 = 100;
    let tests = ["llvm-cov", "--no-report", "nextest", "--workspace", "--features", "sonard/full"];
    let status = Command::new("cargo").args(tests).arg("--no-fail-fast").status()?;
    match status.code() {
        Some(0) => Ok(()),
        Some(TESTS_FAILED) => {
            eprintln!("some tests failed: see above");
            Ok(())
        }
        _ => Err(format!("cargo llvm-cov: {status}; it runs the tests by cargo-nextest").into()),
    }
}

/// Names of all packages of the workspace.
fn packages() -> Result<Vec<String>, Failure> {
    let metadata = ["metadata", "--format-version", "1", "--no-deps"];
    let found: Value = serde_json::from_str(&read(Command::new("cargo").args(metadata))?)?;
    let packages = found["packages"].as_array().ok_or("cargo metadata: no packages")?;
    Ok(packages.iter().filter_map(|of| of["name"].as_str()).map(str::to_owned).collect())
}

/// Executed and all lines.
type Lines = [u64; 2];

/// Lines by crate, of a report of cargo-llvm-cov.
fn by_crate(report: &Value, root: &Path) -> Result<BTreeMap<String, Lines>, Failure> {
    let files = report["data"][0]["files"].as_array().ok_or("coverage: no files in the report")?;
    let mut found: BTreeMap<String, Lines> = BTreeMap::new();
    for file in files {
        let name = file["filename"].as_str().unwrap_or_default();
        let path = Path::new(name).strip_prefix(root).unwrap_or_else(|_| Path::new(name));
        let mut parts = path.iter().map(|part| part.to_string_lossy());
        let first = parts.next().unwrap_or_default().into_owned();
        let name =
            if first == "crates" { parts.next().unwrap_or_default().into_owned() } else { first };
        let lines = &file["summary"]["lines"];
        let counts = found.entry(name).or_default();
        for (count, key) in counts.iter_mut().zip(["covered", "count"]) {
            *count += lines[key].as_u64().ok_or("coverage: a file without counts of lines")?;
        }
    }
    Ok(found)
}

fn table(counts: &BTreeMap<String, Lines>) -> String {
    let row = |name: &str, [covered, all]: Lines| {
        let share = 100.0 * covered as f64 / all.max(1) as f64;
        format!("{name:24} {covered:8} {all:8} {share:6.1} %\n")
    };
    let all = counts.values().fold([0; 2], |sum, of| [sum[0] + of[0], sum[1] + of[1]]);
    let head = format!("{:24} {:>8} {:>8} {:>8}\n", "", "executed", "lines", "share");
    let rows = counts.iter().map(|(name, of)| row(name, *of)).chain([row("all", all)]);
    rows.fold(head, |table, row| table + &row)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn lines_are_counted_by_crate() {
        let file = |name: &str, covered: u64, count: u64| {
            json!({"filename": format!("/repository/{name}"),
                   "summary": {"lines": {"covered": covered, "count": count}}})
        };
        let files = [
            file("crates/sonard-plot/src/lib.rs", 3, 4),
            file("crates/sonard-plot/src/map/image.rs", 1, 4),
            file("src/main.rs", 2, 2),
        ];
        let report = json!({"data": [{"files": files}]});
        let found = by_crate(&report, Path::new("/repository")).expect("a report");
        assert_eq!(found["sonard-plot"], [4, 8]);
        assert_eq!(found["src"], [2, 2]);
        let printed = table(&found);
        assert!(
            printed.contains("sonard-plot                     4        8   50.0 %\n"),
            "{printed}"
        );
        assert!(printed.ends_with("6       10   60.0 %\n"), "{printed}");
        let wrong = json!({"data": [{"files": [{"filename": "/repository/src/a.rs"}]}]});
        assert!(by_crate(&wrong, Path::new("/repository")).is_err());
        assert!(by_crate(&json!({}), Path::new("/repository")).is_err());
    }
}
