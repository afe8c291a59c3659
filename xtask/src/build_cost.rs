//! Cost of builds: `cargo xtask build-cost`.
//!
//! Each commit is built from nothing in a folder of its own, one after the other. Times depend on
//! the computer; compare lines of one run.

use std::{
    fs,
    io::Write as _,
    path::{Path, PathBuf},
    process::Command,
    time::Instant,
};

use lexopt::{Arg, Parser, ValueExt as _};

use crate::{
    Failure,
    command::{read, run},
    folders,
};

pub(crate) const HELP: &str = "\
Build the program from nothing and print the wall time, processor time and stripped size.

Usage: cargo xtask build-cost [COMMIT[:FEATURE,...]]... [--rebuild]

  COMMIT      commits to compare, each with further features [default: the working tree's HEAD]
  --rebuild   instead: build in the development profile, then print what a build takes after a
              changed line in each of the crates of plots, model, daemon and command line";

/// Crates with a changed line, and the file that is changed.
const CHANGED: [(&str, &str); 4] = [
    ("plot", "crates/sonard-plot/src/lib.rs"),
    ("model", "crates/sonard-model/src/lib.rs"),
    ("daemon", "crates/sonard-daemon/src/lib.rs"),
    ("cli", "src/cli.rs"),
];

/// Requested builds.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct CostOptions {
    builds: Vec<Build>,
    is_rebuild: bool,
}

/// Commit with the features of its build.
#[derive(Debug, PartialEq, Eq)]
struct Build {
    commit: String,
    features: String,
}

impl CostOptions {
    /// Parses the arguments after the task; `None` if help is requested.
    ///
    /// # Errors
    /// An unknown argument.
    pub(crate) fn parse(mut arguments: Parser) -> Result<Option<Self>, Failure> {
        let mut options = Self { builds: Vec::new(), is_rebuild: false };
        while let Some(argument) = arguments.next()? {
            match argument {
                Arg::Value(build) => options.builds.push(Build::from_argument(&build.string()?)),
                Arg::Long("rebuild") => options.is_rebuild = true,
                Arg::Short('h') | Arg::Long("help") => return Ok(None),
                other => return Err(other.unexpected().into()),
            }
        }
        if options.builds.is_empty() {
            options.builds.push(Build::from_argument("HEAD"));
        }
        Ok(Some(options))
    }
}

impl Build {
    fn from_argument(argument: &str) -> Self {
        let (commit, features) = argument.split_once(':').unwrap_or((argument, ""));
        Self { commit: commit.to_owned(), features: features.to_owned() }
    }
}

/// Wall and processor time of a command, seconds.
struct Cost {
    wall_s: f64,
    cpu_s: f64,
}

/// Builds all commits and prints their costs.
///
/// # Errors
/// An unknown commit, or one that does not build.
pub(crate) fn measure(options: &CostOptions) -> Result<(), Failure> {
    let work = folders::target()?.join("build-cost");
    for build in &options.builds {
        let source = work.join("source");
        let target = work.join("target");
        for folder in [&source, &target] {
            if folder.exists() {
                fs::remove_dir_all(folder)?;
            }
        }
        fs::create_dir_all(&source)?;
        extract(&build.commit, &source)?;
        run(cargo(&source, &target).args(["fetch", "--locked", "--quiet"]))?;
        println!(
            "{}{}{}:",
            build.commit,
            if build.features.is_empty() { "" } else { ":" },
            build.features
        );
        if options.is_rebuild {
            rebuild(&source, &target, &build.features)?;
        } else {
            build_release(&source, &target, &build.features)?;
        }
    }
    Ok(fs::remove_dir_all(work)?)
}

/// Writes the files of a commit into a folder.
fn extract(commit: &str, folder: &Path) -> Result<(), Failure> {
    let archive = folder.with_extension("tar");
    let mut git = Command::new("git");
    git.args(["archive", "--output"]).arg(&archive).arg(commit).current_dir(folders::root()?);
    run(&mut git)?;
    Ok(tar::Archive::new(fs::File::open(&archive)?).unpack(folder)?)
}

fn cargo(source: &Path, target: &Path) -> Command {
    let mut cargo = Command::new("cargo");
    cargo.current_dir(source).env("CARGO_TARGET_DIR", target).env("CARGO_INCREMENTAL", "0");
    cargo
}

fn build_release(source: &Path, target: &Path, features: &str) -> Result<(), Failure> {
    let arguments = ["build", "--release", "--locked", "--quiet", "--bin", "sonard", "--features"];
    let cost = timed(cargo(source, target).args(arguments).arg(features))?;
    let program = target.join("sonard");
    run(Command::new("strip").arg("-o").arg(&program).arg(target.join("release/sonard")))?;
    let size_mb = fs::metadata(program)?.len() as f64 / 1e6;
    println!(
        "  {:6.1} s, {:6.1} s of processor time, {size_mb:.1} MB stripped",
        cost.wall_s, cost.cpu_s
    );
    Ok(())
}

/// Builds in the development profile, incrementally, then after each change.
fn rebuild(source: &Path, target: &Path, features: &str) -> Result<(), Failure> {
    let mut build = cargo(source, target);
    build.env_remove("CARGO_INCREMENTAL").args(["build", "--locked", "--quiet", "--features"]);
    run(build.arg(features))?;
    for (name, path) in CHANGED {
        let path: PathBuf = source.join(path);
        let mut file = fs::OpenOptions::new().append(true).open(&path)?;
        writeln!(file, "#[allow(dead_code)]\nconst fn changed() {{}}")?;
        let cost = timed(&mut build)?;
        println!("  {name:8} {:6.1} s, {:6.1} s of processor time", cost.wall_s, cost.cpu_s);
    }
    Ok(())
}

fn timed(command: &mut Command) -> Result<Cost, Failure> {
    let (began, before_s) = (Instant::now(), children_cpu_s()?);
    run(command)?;
    Ok(Cost { wall_s: began.elapsed().as_secs_f64(), cpu_s: children_cpu_s()? - before_s })
}

/// Processor time of all ended child processes, seconds.
fn children_cpu_s() -> Result<f64, Failure> {
    let ticks_per_s: f64 = read(Command::new("getconf").arg("CLK_TCK"))?.parse()?;
    let stat = fs::read_to_string("/proc/self/stat")?;
    Ok(children_ticks(&stat).ok_or("/proc/self/stat: unknown format")? as f64 / ticks_per_s)
}

/// Sum of the fields `cutime` and `cstime` of a line of `/proc/PID/stat` (proc(5)).
fn children_ticks(stat: &str) -> Option<u64> {
    // The name of the program, in parentheses, may contain spaces.
    let (_, fields) = stat.rsplit_once(')')?;
    let ticks = fields.split_whitespace().skip(13).take(2).map(str::parse::<u64>);
    ticks.sum::<Result<u64, _>>().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn builds_from_arguments() {
        let parse = |arguments: &[&str]| {
            CostOptions::parse(Parser::from_args(arguments)).expect("valid").expect("no help")
        };
        let build = |commit: &str, features: &str| Build {
            commit: commit.to_owned(),
            features: features.to_owned(),
        };
        assert_eq!(parse(&[]).builds, [build("HEAD", "")]);
        let options = parse(&["a", "b:mqtt,ros", "--rebuild"]);
        assert_eq!(options.builds, [build("a", ""), build("b", "mqtt,ros")]);
        assert!(options.is_rebuild);
    }

    #[test]
    fn ticks_of_children() {
        let stat = "1 (a) b) S 0 1 1 0 -1 4194560 1 2 3 4 5 6 700 80 20 0 1 0 9";
        assert_eq!(children_ticks(stat), Some(780));
        assert_eq!(children_ticks("1 a S"), None);
    }
}
